"""The program's entry: an error of this project is shown as one line, any other is a bug and keeps its traceback.

Imports are inside the function, so that an interrupt during loading ends as quietly as a later one.
"""

from __future__ import annotations

import gc
import sys
import warnings
from collections.abc import Callable

from armload_controller.cli.exit_status import ExitStatus

_OBJECTS_BETWEEN_COLLECTIONS = 20_000
"""Python's default is 700. Loading makes 70,000 objects that stay: searching them for garbage again and again takes 3 %
of an identification's time."""


def main() -> None:
    """Run the command line and exit."""
    gc.set_threshold(_OBJECTS_BETWEEN_COLLECTIONS)
    try:
        from armload_controller.cli.command_tree import app
        from armload_controller.control_errors import ControlError
        from armload_drivers.driver_errors import DriverError
        from armload_identification.extras import missing_extra
        from armload_identification.identification_errors import IdentificationError

        warnings.formatwarning = _in_one_line()
        try:
            try:
                app()
            except SystemExit as end:
                from armload_controller.cli.printable_console import OutlivingStream

                if end.code or OutlivingStream.problem is None:
                    raise
                sys.stderr.write(f"error: the output could not be written: {OutlivingStream.problem}\n")
                sys.exit(ExitStatus.REFUSED)
            except ModuleNotFoundError as error:
                missing = missing_extra(error)
                if missing is None:
                    raise
                raise missing from error
        except (ControlError, DriverError, IdentificationError) as error:
            status = _exit_status(error)
            from armload_controller.cli.screen import Screen

            text = f"error: {error}" if status == ExitStatus.REFUSED else str(error)
            text = "\n".join([text, *_notes(error)])
            Screen(as_json=True).console.print(text, style="bold red", soft_wrap=True)
            sys.exit(status)
    except KeyboardInterrupt:
        sys.stderr.write("interrupted\n")
        sys.exit(ExitStatus.INTERRUPTED)


def _in_one_line() -> Callable[..., str]:
    """A format of warnings without their place in the program, where each text is shown once."""
    shown: set[str] = set()

    def line(message: Warning | str, *_where: object, **_more: object) -> str:
        text = f"warning: {message}\n"
        if text in shown:
            return ""
        shown.add(text)
        return text

    return line


def _notes(error: Exception) -> list[str]:
    """Notes of an error and of its cause, and the error that preceded it.

    Notes are, for example, problems of other drives and steps to do by hand; an error precedes if closing also failed.
    """
    notes = [note for reason in (error, error.__cause__) for note in getattr(reason, "__notes__", ())]
    if error.__context__ is not None and not error.__suppress_context__:
        notes.append(f"Before that: {error.__context__}")
    return notes


def _exit_status(error: Exception) -> int:
    """The shell's usual status for a requested stop, otherwise that of a refusal."""
    from armload_controller.motion.motion_control import OperatorStop, TerminationStop

    for reason in (error, error.__cause__):
        if isinstance(reason, OperatorStop | KeyboardInterrupt):
            return ExitStatus.INTERRUPTED
        if isinstance(reason, TerminationStop):
            return ExitStatus.BY_SIGNAL + reason.signal_number
    return ExitStatus.REFUSED
