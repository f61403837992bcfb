"""A group of commands that shows a command's help without loading pydantic."""

from __future__ import annotations

from typing import Any

from typer.core import TyperGroup


class CommandGroup(TyperGroup):
    """Typer's group, whose own flags are False where they are not given.

    Typer gives `--help` and the options of completion no default. It then converts their None through pydantic before
    every command, which takes as long as the rest of a command's help.
    """

    def get_params(self, ctx: Any) -> list[Any]:
        """Options and arguments of the group."""
        params = super().get_params(ctx)
        for param in params:
            if getattr(param, "is_flag", False) and param.default is None:
                param.default = False
        return params
