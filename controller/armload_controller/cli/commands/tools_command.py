"""`armload tools`: payloads of tools by name, for `armload identify --minus`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from armload_controller.cli.command_group import Commands
from armload_controller.cli.screen import PLAIN, Screen

tools = Commands("Keep the payloads of tools by name.")


@tools.command("add")
def add_command(
    name: Annotated[str, typer.Argument(metavar="NAME", help="Name of the tool.")],
    payload: Annotated[Path, typer.Argument(metavar="FILE", help="Its payload file, from `armload identify`.")],
    screen: Screen = PLAIN,
) -> None:
    """Keep a payload as a tool, so that `armload identify --minus NAME` gives what it carries alone."""
    from armload_controller.analysis.tools import add_tool

    screen.step(f"written: {add_tool(name, payload)}")
    _show(screen)


@tools.command("list")
def list_command(screen: Screen = PLAIN) -> None:
    """List the tools."""
    _show(screen)


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
