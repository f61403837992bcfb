"""A group of commands that shows help without loading pydantic, and says what an option expected."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

import typer
from typer.core import TyperGroup

from armload_controller.cli.option_groups import with_option_groups

_WORDS: Final = {
    " is not one of ": ": expected one of ",
    "a valid number": "a number",
    "a valid integer": "a whole number",
    "greater than or equal to": "at least",
    "less than or equal to": "at most",
}
"""Typer's words, and this program's."""


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

    def invoke(self, ctx: Any) -> Any:
        """Run a command; an option's error names the value, which Typer's leaves out, in the words of this program."""
        try:
            return super().invoke(ctx)
        except typer.BadParameter as error:
            for found in getattr(error.__cause__, "errors", list)()[:1]:  # pydantic's, which is not imported for this
                what = str(found["msg"]).removeprefix("Value error, ").removesuffix(".").partition(", unable")[0]
                for theirs, ours in _WORDS.items():
                    what = what.replace(theirs, ours)
                error.message = what.replace("Input should be", f"'{found['input']}': expected")
            raise


class Commands(typer.Typer):
    """Commands whose options may stand in groups; without one of them, their help is shown.

    Args:
        help_text: What they are for.
    """

    def __init__(self, help_text: str) -> None:
        super().__init__(cls=CommandGroup, help=help_text, no_args_is_help=True)

    def command(self, name: str | None = None, **settings: Any) -> Callable[[Any], Any]:
        """See `typer.Typer.command`."""
        register = super().command(name, **settings)
        return lambda command: register(with_option_groups(command))
