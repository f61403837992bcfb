"""The operator at the terminal: whether there is one, and what the arm's sessions see of them.

Imports nothing heavy at the top, so that help can use it too.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from armload_controller.cli.screen import Screen
    from armload_controller.config.robot import Robot
    from armload_controller.session.live.live_view import LiveAddress
    from armload_controller.session.run_session import Operator


def attended() -> bool:
    """Whether an operator is at a terminal and can be asked."""
    return sys.stdin is not None and sys.stdin.isatty()


@contextmanager
def operator_at(arm: Robot, screen: Screen, *, agreed: bool, live: LiveAddress | None) -> Iterator[Operator]:
    """The operator of an arm: within the block signals and keys control it, and a question is answered at the terminal.

    Args:
        screen: Shows progress and asks.
        agreed: Whether the operator has agreed in advance to everything that allows it.
        live: Address of the live view; None for none.
    """
    from armload_controller.cli.keyboard import Keyboard
    from armload_controller.motion.motion_control import MotionControl
    from armload_controller.session.live.live_view import shown_live
    from armload_controller.session.run_session import Consent, Operator
    from armload_controller.session.stop_signals import StopSignals

    control = MotionControl()
    screen.keyboard = Keyboard.of_this_process(control)
    with StopSignals(control) as signals:
        consent = Consent(lambda question: signals.ask(question, screen.confirm), given=agreed)
        with shown_live(Operator(screen, control, consent), arm, live) as operator:
            yield operator
