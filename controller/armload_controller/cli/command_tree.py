"""The commands of `armload`.

A command's module declares its arguments and imports everything else inside the command, so that help, version and
completion do not wait for it; `tests/unit/controller/cli/test_startup.py` checks this.
"""

from __future__ import annotations

import os
import shlex
import sys
from collections.abc import Callable
from importlib.metadata import version
from typing import Annotated

import typer

from armload_controller.cli.arm_commands.commission_command import commission_arm
from armload_controller.cli.arm_commands.drives_command import drives
from armload_controller.cli.arm_commands.feedforward_command import feedforward
from armload_controller.cli.arm_commands.simulate_command import simulate
from armload_controller.cli.arm_commands.watch_command import watch_payload
from armload_controller.cli.attendance import attended
from armload_controller.cli.command_group import CommandGroup
from armload_controller.cli.commands.calibrate_command import calibrate_arm_command
from armload_controller.cli.commands.compare_command import compare_payload
from armload_controller.cli.commands.design_command import design_motion
from armload_controller.cli.commands.drift_command import watch_drift
from armload_controller.cli.commands.export_command import export_payload
from armload_controller.cli.commands.fleet_command import fleet
from armload_controller.cli.commands.identify_command import identify_payload
from armload_controller.cli.commands.init_command import init
from armload_controller.cli.commands.recordings_command import recordings
from armload_controller.cli.commands.report_command import report
from armload_controller.cli.commands.schema_command import schema
from armload_controller.cli.commands.tools_command import tools
from armload_controller.cli.commands.validate_command import validate_payload
from armload_controller.cli.exit_status import ExitStatus
from armload_controller.cli.option_groups import with_option_groups

app = typer.Typer(
    name="armload",
    cls=CommandGroup,
    help="Identify what a robot arm is carrying from its motor currents.",
    invoke_without_command=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,  # its boxes cut off option names on narrow consoles
)
COMMANDS: dict[str, Callable[..., None]] = {
    "commission": commission_arm,
    "identify": identify_payload,
    "validate": validate_payload,
    "report": report,
    "compare": compare_payload,
    "calibrate": calibrate_arm_command,
    "drift": watch_drift,
    "init": init,
    "simulate": simulate,
    "design": design_motion,
    "export": export_payload,
    "watch": watch_payload,
    "schema": schema,
}
for name, command in COMMANDS.items():
    app.command(name)(with_option_groups(command))

app.add_typer(feedforward, name="feedforward")
app.add_typer(drives, name="drives")
app.add_typer(recordings, name="recordings")
app.add_typer(fleet, name="fleet")
app.add_typer(tools, name="tools")


def _print_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"armload {version('armload')}")
        raise typer.Exit


@app.callback()
def _options(
    context: typer.Context,
    _version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Show the version and exit.")
    ] = False,
) -> None:
    """Identify what a robot arm is carrying from its motor currents."""
    # The matrices are small, and threads waiting for each other would delay the cycle. The libraries read these
    # variables when they are loaded, which is later.
    for library in ("OPENBLAS", "MKL", "BLIS", "OMP"):
        os.environ[f"{library}_NUM_THREADS"] = "1"
    if context.invoked_subcommand is None:
        _without_command(context)


def _without_command(context: typer.Context) -> None:
    """Show help; at a terminal, ask what to do instead, run it, and show the command."""
    if not (attended() and sys.stdout.isatty()):
        typer.echo(context.get_help())
        raise typer.Exit(ExitStatus.USAGE)
    from armload_controller.cli.guide import guided_words
    from armload_controller.cli.screen import Screen
    from armload_controller.config.robot import shipped_robots

    screen = Screen()
    words = guided_words(screen.ask, screen.step, shipped_robots())
    if not words:
        return
    try:
        typer.main.get_command(app)(words, standalone_mode=False)
    finally:
        screen.step(f"the same as: armload {shlex.join(words)}")
