r"""Signals as stops: the effect of Ctrl-C, a lost terminal and `kill` on a motion.

    SIGINT   Ctrl-C           the operator requests a stop
    SIGTSTP  Ctrl-Z           the same: a suspended program would leave the arm to its drives
    SIGHUP   terminal lost    the system requests the program to end
    SIGTERM  kill             the same
    SIGQUIT  Ctrl-\           the same: an immediate end would leave the arm in motion and the terminal without echo

Other signals that end a program by default are taken as SIGTERM: SIGUSR1, SIGALRM, SIGXCPU and so on.

Rules. The first signal stops along the path, a second one immediately; further ones are ignored, and so are all once a
motion has ended with an error, until the program ends, because nothing must interrupt the removal of torque, or the
message about it. While a question is open the drives are off, and a signal ends the program; after a signal nothing is
asked. A signal that is ignored when the program starts stays ignored: SIGINT and SIGTSTP in a background job of a shell
script, SIGHUP under nohup. SIGTERM is the exception: it always stops the arm.
"""

from __future__ import annotations

import signal
from collections.abc import Callable
from types import FrameType
from typing import Any, Self

from armload_controller.motion.motion_control import MotionControl, OperatorStop, StopRequested, TerminationStop

_OTHER_ENDING_SIGNALS = [
    signal.Signals[f"SIG{name}"] for name in ("USR1", "USR2", "ALRM", "VTALRM", "PROF", "XCPU", "IO", "PWR")
]


class StopSignals:
    """Turns signals into stops within a `with` block, and restores the previous handlers afterwards.

    After a block that ended with an error the signals are ignored, so that its message is printed.

    Args:
        control: Receives the stops.
    """

    def __init__(self, control: MotionControl) -> None:
        self._control = control
        self._asking = self._interrupted = False
        self._previous_handlers: dict[int, Any] = {}

    def __enter__(self) -> Self:
        reasons: dict[int, StopRequested] = {
            signal.SIGINT: OperatorStop("Ctrl-C"),
            signal.SIGTSTP: OperatorStop("Ctrl-Z"),
            signal.SIGHUP: TerminationStop("SIGHUP, the terminal is gone", signal.SIGHUP),
            signal.SIGTERM: TerminationStop("SIGTERM"),
            signal.SIGQUIT: TerminationStop("SIGQUIT", signal.SIGQUIT),
        }

        for other in _OTHER_ENDING_SIGNALS:
            if signal.getsignal(other) is signal.SIG_DFL:
                reasons[other] = TerminationStop(other.name, other)

        def on_signal(number: int, frame: FrameType | None) -> None:
            if self._control.goal.stop is not None:
                if self._interrupted or self._control.ended:
                    return
                self._interrupted = True
                raise KeyboardInterrupt
            self._control.stop(reasons[number])
            if self._asking:
                raise reasons[number]

        for number in reasons:
            if number == signal.SIGTERM or signal.getsignal(number) is not signal.SIG_IGN:
                self._previous_handlers[number] = signal.signal(number, on_signal)
        return self

    def __exit__(self, kind: type[BaseException] | None, *_error: object) -> None:
        failed = kind is not None and kind is not GeneratorExit
        for number, handler in self._previous_handlers.items():
            signal.signal(number, signal.SIG_IGN if failed else handler)

    def ask(self, question: str, put: Callable[[str], bool]) -> bool:
        """Ask a question; a signal ends it, and after one nothing is asked.

        Args:
            put: Asks it; True means yes.

        Raises:
            StopRequested: a signal was received.
        """
        self._asking = True
        try:
            self._control.require_no_stop()
            return put(question)
        finally:
            self._asking = False
