"""The program's entry: what this project raises becomes one line, anything else is a defect and keeps its traceback.

Imports stand inside, so that an interrupt while they are loading ends as quietly as a later one.
"""

from __future__ import annotations

import sys

EXIT_REFUSED = 1
EXIT_INTERRUPTED = 130


def main() -> None:
    """Run the command line and exit."""
    try:
        from armload_controller.cli.main import app
        from armload_controller.cli.screen import Screen
        from armload_controller.errors import ControlError
        from armload_drivers.errors import DriverError
        from armload_identification.errors import IdentificationError

        try:
            app()
        except (ControlError, DriverError, IdentificationError) as error:
            stopped = isinstance(error.__cause__, KeyboardInterrupt)
            text = str(error) if stopped else f"error: {error}"
            Screen().errors.print(text, style="bold red", markup=False, soft_wrap=True)
            sys.exit(EXIT_INTERRUPTED if stopped else EXIT_REFUSED)
    except KeyboardInterrupt:
        sys.stderr.write("interrupted\n")
        sys.exit(EXIT_INTERRUPTED)
