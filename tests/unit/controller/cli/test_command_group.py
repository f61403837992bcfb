"""Errors of options in this program's words, with the value that was given."""

from typing import Annotated

import pytest
import typer
from typer.testing import CliRunner

from armload_controller.cli.command_group import Commands


def raised(cause):
    """The error of a command whose option is refused for a reason."""
    app = Commands("Tests.")

    @app.command()
    def refuse(number: Annotated[int, typer.Option()] = 1) -> None:
        raise typer.BadParameter("no good") from cause

    @app.command()
    def other() -> None:
        """Nothing."""

    return CliRunner().invoke(app, ["refuse"], standalone_mode=False).exception


class Refused(Exception):
    """An error with pydantic's list."""

    def __init__(self, *found):
        self.found = found

    def errors(self):
        return [{"msg": message, "input": given} for message, given in self.found]


@pytest.mark.parametrize(
    ("cause", "said"),
    [
        (None, "no good"),
        (ValueError("any"), "no good"),
        (Refused(), "no good"),
        (Refused(("Value error, expected 1 to 3.", "9"), ("Value error, second", "0")), "expected 1 to 3"),
        (Refused(("Input should be above 0", "-1")), "'-1': expected above 0"),
        (Refused(("Input should be a number, unable to parse", "x")), "'x': expected a number"),
    ],
)
def test_the_first_error_of_an_option_names_its_value(cause, said):
    assert raised(cause).message == said


def test_without_a_command_its_help_is_shown():
    app = Commands("What they are for.")
    app.command("one")(lambda: None)
    app.command("two")(lambda: None)
    result = CliRunner().invoke(app, [])
    assert "What they are for." in result.output
