"""A group of commands that shows help without loading pydantic."""

from __future__ import annotations

from typing import Any

from typer.core import TyperGroup


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
