"""Programs as a shell starts them, whatever signals this process itself was started to ignore."""

import sys

_START = """
import os, signal, sys
for name in ("SIGINT", "SIGQUIT", "SIGHUP", "SIGTSTP", "SIGTERM"):
    signal.signal(getattr(signal, name), signal.SIG_IGN if name in sys.argv[1].split(",") else signal.SIG_DFL)
os.execv(sys.argv[2], sys.argv[2:])
"""

BACKGROUND = ("SIGINT", "SIGQUIT", "SIGHUP", "SIGTSTP")
"""What `nohup` in a background job of a script makes a program ignore from its start."""


def as_started(command, ignored=()):
    """A command that becomes another one, with some signals ignored and all others as at a prompt.

    A program inherits what its parent ignores: without this, tests in a background job would start programs that
    ignore SIGINT.

    Args:
        command: Arguments, an absolute path first.
        ignored: Names of the signals that it ignores.
    """
    return [sys.executable, "-c", _START, ",".join(ignored), *map(str, command)]
