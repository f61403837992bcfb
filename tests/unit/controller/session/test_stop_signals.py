"""Signals as stops: those handled, those that stay ignored, and the handlers restored afterwards."""

import os
import signal

import pytest

from armload_controller.motion.motion_control import MotionControl, OperatorStop, TerminationStop
from armload_controller.session.stop_signals import StopSignals

TAKEN = {
    signal.SIGINT: OperatorStop,
    signal.SIGTSTP: OperatorStop,
    signal.SIGHUP: TerminationStop,
    signal.SIGTERM: TerminationStop,
    signal.SIGUSR1: TerminationStop,
    signal.SIGALRM: TerminationStop,
    signal.SIGXCPU: TerminationStop,
}


@pytest.fixture(params=[signal.SIG_DFL, signal.SIG_IGN], ids=["default", "ignored"])
def inherited(request):
    """Every signal in a state that a program may inherit."""
    before = {number: signal.signal(number, request.param) for number in TAKEN}
    yield request.param
    now = {number: signal.getsignal(number) for number in TAKEN}
    for number, handler in before.items():
        signal.signal(number, handler)
    assert set(now.values()) == {request.param}


@pytest.mark.parametrize("number", TAKEN)
def test_a_signal_stops_unless_it_was_ignored_before_and_sigterm_does_so_always(inherited, number):
    control = MotionControl()
    with StopSignals(control):
        os.kill(os.getpid(), number)
        if inherited is signal.SIG_IGN and number != signal.SIGTERM:
            assert control.goal.stop is None
            os.kill(os.getpid(), signal.SIGTERM)
            assert isinstance(control.goal.stop, TerminationStop)
        else:
            assert isinstance(control.goal.stop, TAKEN[number])


def test_the_second_signal_interrupts_at_once(inherited):
    control = MotionControl()
    with StopSignals(control):
        os.kill(os.getpid(), signal.SIGTERM)
        with pytest.raises(KeyboardInterrupt):
            os.kill(os.getpid(), signal.SIGTERM)
        for _ in range(3):
            os.kill(os.getpid(), signal.SIGTERM)  # nothing may interrupt the removal of torque


def test_once_a_motion_has_ended_with_an_error_no_signal_interrupts(inherited):
    control = MotionControl()
    with StopSignals(control):
        control.ended = True
        for _ in range(3):
            os.kill(os.getpid(), signal.SIGTERM)
    assert isinstance(control.goal.stop, TerminationStop)


def test_signals_are_ignored_after_an_error_until_its_message_is_printed():
    with pytest.raises(OperatorStop), StopSignals(MotionControl()):
        raise OperatorStop("Ctrl-C")
    for number in (signal.SIGINT, signal.SIGTSTP, signal.SIGHUP, signal.SIGTERM):
        os.kill(os.getpid(), number)


def test_a_generator_that_is_closed_restores_the_handlers(inherited):
    def moments():
        with StopSignals(MotionControl()):
            yield

    some = moments()
    next(some)
    some.close()


def test_a_signal_with_a_handler_of_its_own_keeps_it():
    seen = []
    before = signal.signal(signal.SIGUSR1, lambda number, frame: seen.append(number))
    try:
        with StopSignals(control := MotionControl()):
            os.kill(os.getpid(), signal.SIGUSR1)
    finally:
        signal.signal(signal.SIGUSR1, before)
    assert seen == [signal.SIGUSR1]
    assert control.goal.stop is None


def test_a_question_is_ended_by_a_signal_and_by_nothing_afterwards(inherited):
    control = MotionControl()
    with StopSignals(control) as signals:
        assert signals.ask("Go on?", lambda question: question == "Go on?")

        def answer(question):
            os.kill(os.getpid(), signal.SIGTERM)
            raise AssertionError("the question went on")

        with pytest.raises(TerminationStop, match="SIGTERM"):
            signals.ask("Go on?", answer)
        assert isinstance(control.goal.stop, TerminationStop)


def test_nothing_is_asked_after_a_stop_was_requested(inherited):
    """A signal while the drives are being connected only requests the stop: the next thing would be the question."""
    control, asked = MotionControl(), []
    with StopSignals(control) as signals:
        os.kill(os.getpid(), signal.SIGTERM)
        with pytest.raises(TerminationStop, match="SIGTERM"):
            signals.ask("Is the workspace clear?", asked.append)
    assert asked == []
