"""Signals that wait: nothing interrupts the removal of torque."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

_ENDING = (signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT, signal.SIGTSTP)


@contextmanager
def uninterrupted() -> Iterator[None]:
    """Signals that Python handles, such as Ctrl-C, or that end a program are handled after the block.

    If the block raised an error, it is more important than an interruption, which becomes a note. Effective in the main
    thread only.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    received: list[signal.Signals] = []

    def note(number: int, frame: FrameType | None) -> None:
        received.append(signal.Signals(number))

    before = {number: signal.getsignal(number) for number in signal.valid_signals()}
    before = {n: how for n, how in before.items() if callable(how) or (n in _ENDING and how is signal.SIG_DFL)}

    def restore() -> None:
        mask = signal.pthread_sigmask(signal.SIG_BLOCK, before)
        for number, handler in before.items():
            signal.signal(number, handler)
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)

    try:
        for number in before:
            signal.signal(number, note)
        yield
    except BaseException as error:
        restore()
        for late in received:
            try:
                if callable(before[late]):
                    signal.raise_signal(late)
            except BaseException as interruption:  # noqa: BLE001 - whatever a handler raises
                error.add_note(f"Interrupted: {type(interruption).__name__}")
        raise
    restore()
    for late in received:
        signal.raise_signal(late)
