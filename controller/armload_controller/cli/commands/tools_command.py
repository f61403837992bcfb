"""`armload tools`: payloads of tools by name, for `armload identify --minus`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from armload_controller.cli.command_group import CommandGroup
from armload_controller.cli.output.json_output import JsonOption

if TYPE_CHECKING:
    from armload_controller.cli.screen import Screen

tools = typer.Typer(cls=CommandGroup, help="Keep the payloads of tools by name.", no_args_is_help=True)


@tools.callback()
def _group() -> None:
    """Keep the payloads of tools by name."""


@tools.command("add")
def add_command(
    name: Annotated[str, typer.Argument(metavar="NAME", help="Name of the tool.")],
    payload: Annotated[Path, typer.Argument(metavar="FILE", help="Its payload file, from `armload identify`.")],
    as_json: JsonOption = False,
) -> None:
    """Keep a payload as a tool, so that `armload identify --minus NAME` gives what it carries alone."""
    from armload_controller.analysis.tools import add_tool
    from armload_controller.cli.screen import Screen

    screen = Screen(as_json=as_json)
    screen.step(f"written: {add_tool(name, payload)}")
    _show(screen)


@tools.command("list")
def list_command(as_json: JsonOption = False) -> None:
    """List the tools."""
    from armload_controller.cli.screen import Screen

    _show(Screen(as_json=as_json))


def _show(screen: Screen) -> None:
    """Show all tools."""
    from armload_controller.analysis.tools import tool_names, tool_payload, tools_folder
    from armload_identification.results.json_document import json_document

    payloads = {name: tool_payload(name) for name in tool_names()}
    for name, tool in payloads.items():
        screen.result(f"{name}: {tool.model.mass_kg:.4g} kg, identified on {tool.provenance.robot or 'an arm'}")
    if not payloads:
        screen.step(f"no tools in {tools_folder()}; add one with `armload tools add NAME payload.toml`")
    listed = [
        {"name": name, "mass_kg": tool.model.mass_kg, "robot": tool.provenance.robot or None}
        for name, tool in payloads.items()
    ]
    screen.document(lambda: json_document("tools", {"tools": listed}))
