"""The exit statuses of every command."""

from __future__ import annotations

from enum import IntEnum
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from armload_identification.verdict.agreement import Outcome


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


def exit_status(outcome: Outcome) -> ExitStatus:
    """0 if the payload is right, 3 if it is wrong, 4 if the runs cannot tell."""
    return {
        "RIGHT": ExitStatus.DONE,
        "WRONG": ExitStatus.WRONG_PAYLOAD,
        "CANNOT_TELL": ExitStatus.CANNOT_TELL,
    }[outcome.name]


def require_not_wrong(outcome: Outcome | None) -> None:
    """Exit with the status of a wrong payload if the validation found it wrong.

    Raises:
        typer.Exit: with status 3.
    """
    import typer

    if outcome is not None and exit_status(outcome) is ExitStatus.WRONG_PAYLOAD:
        raise typer.Exit(ExitStatus.WRONG_PAYLOAD)
