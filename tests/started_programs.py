"""Programs with the signal handling of a shell's prompt, whatever signals this process ignores, or with priority."""

import shutil
import signal
import subprocess
import sys
from contextlib import contextmanager
from functools import cache

_START = """
import os, signal, sys
for name in ("SIGINT", "SIGQUIT", "SIGHUP", "SIGTSTP", "SIGTERM"):
    signal.signal(getattr(signal, name), signal.SIG_IGN if name in sys.argv[1].split(",") else signal.SIG_DFL)
os.execv(sys.argv[2], sys.argv[2:])
"""

BACKGROUND = ("SIGINT", "SIGQUIT", "SIGHUP", "SIGTSTP")
"""Signals that a program started with `nohup` in a script's background job ignores."""


def as_started(command, ignored=()):
    """A command that executes another one, with some signals ignored and all others as at a prompt.

    A program inherits the ignored signals of its parent: tests in a background job would start programs that ignore
    SIGINT.

    Args:
        command: Arguments, an absolute path first.
        ignored: Names of the ignored signals.
    """
    return [sys.executable, "-c", _START, ",".join(ignored), *map(str, command)]


@cache
def armload_before_others():
    """The command of armload, with priority over the other programs of this machine if permitted."""
    armload = [sys.executable, "-c", "from armload_controller.cli.entry import main; main()"]
    first = ["chrt", "--rr", "1"]
    if shutil.which("chrt") is None or subprocess.run([*first, "true"], capture_output=True, check=False).returncode:
        return armload
    return [*first, *armload]


@contextmanager
def signals_as_before():
    """Handles signals afterwards as before: a command that failed leaves them ignored, as its program would end."""
    before = {number: signal.getsignal(number) for number in signal.valid_signals()}
    try:
        yield
    finally:
        for number, handler in before.items():
            if signal.getsignal(number) is not handler:
                signal.signal(number, handler)
