"""The exit statuses of every command."""

from __future__ import annotations

from enum import IntEnum


class ExitStatus(IntEnum):
    """Exit statuses; those of a shell where a signal ended the program."""

    DONE = 0
    REFUSED = 1
    """Refused or failed, with one line that says why; `drives check`: a step is wrong; `fleet`: no result."""
    USAGE = 2
    """Options or arguments that do not exist or contradict each other."""
    WRONG_PAYLOAD = 3
    """The validation found the payload wrong."""
    CANNOT_TELL = 4
    """`validate` and `compare`: the data do not suffice for a verdict."""
    ATTENTION = 5
    """`fleet report`: an arm needs attention."""
    BY_SIGNAL = 128
    """Plus the signal's number: 129 for a lost terminal, 131 for SIGQUIT, 143 for `kill`."""
    INTERRUPTED = 130
    """Ctrl-C."""
