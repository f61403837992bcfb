r"""Signals as stops: what Ctrl-C, a lost terminal and `kill` do to a motion.

    SIGINT   Ctrl-C           the operator asked for a stop
    SIGTSTP  Ctrl-Z           likewise: a halted program would leave the arm to its drives
    SIGHUP   terminal lost    the system asked the program to end
    SIGTERM  kill             likewise
    SIGQUIT  Ctrl-\           likewise: ended at once, it would leave the arm in motion and the terminal without echo

Rules. The first signal stops along the path, a second one at once. While a question waits for its answer the drives are
off, and a signal ends the program there. A signal that is ignored when the program starts stays ignored: SIGINT and
SIGTSTP in a background job of a shell script, SIGHUP under nohup. SIGTERM is the exception: it always stops the arm.
"""

from __future__ import annotations

import signal
from collections.abc import Callable
from types import FrameType, TracebackType
from typing import Any, Self

from armload_controller.motion.motion_control import MotionControl, OperatorStop, StopRequested, TerminationStop


class StopSignals:
    """Signals stop a motion while the block lasts; afterwards they do what they did before.

    Args:
        control: Of the motion.
    """

    def __init__(self, control: MotionControl) -> None:
        self._control = control
        self._asking = False
        self._before: dict[int, Any] = {}

    def __enter__(self) -> Self:
        reasons: dict[int, StopRequested] = {
            signal.SIGINT: OperatorStop("Ctrl-C"),
            signal.SIGTSTP: OperatorStop("Ctrl-Z"),
            signal.SIGHUP: TerminationStop("SIGHUP, the terminal is gone", signal.SIGHUP),
            signal.SIGTERM: TerminationStop("SIGTERM"),
            signal.SIGQUIT: TerminationStop("SIGQUIT", signal.SIGQUIT),
        }

        def on_signal(number: int, frame: FrameType | None) -> None:
            if self._control.goal.stop is not None:
                raise KeyboardInterrupt
            self._control.stop(reasons[number])
            if self._asking:
                raise reasons[number]

        for number in reasons:
            if number == signal.SIGTERM or signal.getsignal(number) is not signal.SIG_IGN:
                self._before[number] = signal.signal(number, on_signal)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)

    def ask(self, question: str, put: Callable[[str], bool]) -> bool:
        """Put a question; a signal ends it.

        Args:
            question: The question.
            put: Puts it; True is yes.

        Raises:
            StopRequested: a signal came.
        """
        self._asking = True
        try:
            return put(question)
        finally:
            self._asking = False
