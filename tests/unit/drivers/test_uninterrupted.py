"""Signals wait until a block is done; an error of the block matters more than an interruption."""

import signal
import threading

import pytest

from armload_drivers.uninterrupted import uninterrupted


@pytest.fixture
def handled(monkeypatch):
    """Signals that were handled, in order."""
    handled, numbers = [], (signal.SIGINT, signal.SIGUSR1, signal.SIGTERM)
    before = {number: signal.signal(number, lambda n, frame: handled.append(n)) for number in numbers}
    yield handled
    for number, handler in before.items():
        signal.signal(number, handler)


def test_signals_are_handled_after_the_block_in_their_order(handled):
    with uninterrupted():
        for number in (signal.SIGUSR1, signal.SIGINT, signal.SIGTERM):
            signal.raise_signal(number)
        assert handled == []
    assert handled == [signal.SIGUSR1, signal.SIGINT, signal.SIGTERM]
    signal.raise_signal(signal.SIGINT)
    assert handled[3:] == [signal.SIGINT], "handled at once again"


def run_block(number, error=None):
    """A block in which a signal arrives, and that may then fail."""
    with uninterrupted():
        signal.raise_signal(number)
        if error is not None:
            raise error


def test_an_interruption_leaves_after_the_block(interruptible):
    before = signal.getsignal(signal.SIGINT)
    with pytest.raises(KeyboardInterrupt):
        run_block(signal.SIGINT)
    assert signal.getsignal(signal.SIGINT) is before


def test_an_error_of_the_block_leaves_with_the_interruption_as_a_note(interruptible):
    before = signal.getsignal(signal.SIGINT)
    with pytest.raises(ValueError, match="the drive") as raised:
        run_block(signal.SIGINT, ValueError("the drive"))
    assert raised.value.__notes__ == ["Interrupted: KeyboardInterrupt"]
    assert signal.getsignal(signal.SIGINT) is before


def test_the_end_of_the_program_waits_but_does_not_hide_an_error():
    """SIGTERM without a handler would end the program; an error tells what to do about the arm."""
    before = signal.signal(signal.SIGTERM, signal.SIG_DFL)
    try:
        with pytest.raises(ValueError, match="the drive"):
            run_block(signal.SIGTERM, ValueError("the drive"))
        assert signal.getsignal(signal.SIGTERM) is signal.SIG_DFL
    finally:
        signal.signal(signal.SIGTERM, before)


def test_what_was_ignored_stays_ignored():
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with uninterrupted():
            assert signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
            signal.raise_signal(signal.SIGHUP)
    finally:
        signal.signal(signal.SIGHUP, before)


def test_another_thread_changes_no_handlers():
    before, found = signal.getsignal(signal.SIGINT), []

    def run():
        with uninterrupted():
            found.append(signal.getsignal(signal.SIGINT))

    thread = threading.Thread(target=run)
    thread.start()
    thread.join()
    assert found == [before]
