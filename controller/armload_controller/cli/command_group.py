"""A group of commands that shows a command's help without loading pydantic, and names what replaced a command."""

from __future__ import annotations

from typing import Any, Final

from typer.core import TyperGroup

_ENDED: Final = {
    "calibrate-gains": (
        "`armload calibrate ROBOT RUNS --output FILE` calibrates the gains from any runs, one of them with a weighed "
        "payload"
    ),
    "identify-body": "`armload calibrate ROBOT RUNS --output FILE` also identifies the body, from any runs",
}
"""What does the work of a command that is no longer there."""


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

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """The command by its name; one that has ended names its successor."""
        if args and args[0] in _ENDED:
            ctx.fail(f"{args[0]} has been removed: {_ENDED[args[0]]}.")
        return super().resolve_command(ctx, args)
