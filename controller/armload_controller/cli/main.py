"""The command line `armload`: commands, and errors as one line with the fix in it."""

from __future__ import annotations

import sys
from importlib.metadata import version
from typing import Annotated

import typer

from armload_controller.cli.commission import commission
from armload_controller.cli.design import design
from armload_controller.cli.export import export
from armload_controller.cli.identify import identify
from armload_controller.cli.screen import Screen
from armload_controller.cli.simulate import simulate
from armload_controller.cli.validate import validate
from armload_controller.errors import ControlError
from armload_drivers.errors import DriverError
from armload_identification.errors import IdentificationError

EXIT_REFUSED = 1
EXIT_INTERRUPTED = 130

app = typer.Typer(
    name="armload",
    help="Find out what a robot arm is carrying, from the currents of its own motors.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)
for command in (commission, identify, validate, simulate, design, export):
    app.command()(command)


def _print_version(wanted: bool) -> None:
    if wanted:
        Screen().step(f"armload {version('armload')}")
        raise typer.Exit


@app.callback()
def _options(
    _version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Show the version and exit.")
    ] = False,
) -> None:
    """Find out what a robot arm is carrying, from the currents of its own motors."""


def main() -> None:
    """Entry point: what this project raises becomes one line; anything else is a defect and keeps its traceback."""
    try:
        app()
    except (ControlError, DriverError, IdentificationError) as error:
        Screen().errors.print(f"error: {error}", style="bold red", markup=False, soft_wrap=True)
        sys.exit(EXIT_REFUSED)
    except KeyboardInterrupt:
        Screen().errors.print("interrupted", style="bold red")
        sys.exit(EXIT_INTERRUPTED)
