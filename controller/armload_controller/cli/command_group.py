"""A group of commands that shows help without loading pydantic, and names the successors of removed commands."""

from __future__ import annotations

from typing import Any, Final

from typer.core import TyperGroup

_SUCCESSORS: Final = {
    "calibrate-gains": (
        "`armload calibrate ROBOT RUNS --output FILE` calibrates the gains from any runs, one of them with a weighed "
        "payload"
    ),
    "identify-body": "`armload calibrate ROBOT RUNS --output FILE` also identifies the body, from any runs",
}
"""Successor of each removed command."""


class CommandGroup(TyperGroup):
    """Typer's group, with False as the default of its own flags.

    Typer gives `--help` and the completion options no default. It then converts None through pydantic before every
    command, which takes as long as the rest of a command's help.
    """

    def get_params(self, ctx: Any) -> list[Any]:
        """Options and arguments of the group."""
        params = super().get_params(ctx)
        for param in params:
            if getattr(param, "is_flag", False) and param.default is None:
                param.default = False
        return params

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """The command by its name; for a removed one, an error that names its successor."""
        if args and args[0] in _SUCCESSORS:
            ctx.fail(f"{args[0]} has been removed: {_SUCCESSORS[args[0]]}.")
        return super().resolve_command(ctx, args)
