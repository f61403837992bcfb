"""Options that commands share: a parameter that is a dataclass becomes its fields, and comes back as one."""

import inspect
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import pytest
import typer

from armload_controller.cli.option_groups import with_option_groups
from armload_controller.control_errors import CommissioningError


@dataclass
class Where:
    folder: str
    depth: int = 3


@dataclass
class Deeper(Where):
    name: str = "x"


def command(first: int, where: Deeper, last: str = "z") -> None:
    """What it does."""
    CALLS.append((first, where, last))


CALLS = []


def test_a_group_is_its_fields_with_those_that_it_inherits_by_keyword():
    given = with_option_groups(command)
    parameters = inspect.signature(given).parameters.values()
    assert [(each.name, each.annotation) for each in parameters] == [
        ("first", int), ("folder", str), ("depth", int), ("name", str), ("last", str),
    ]  # fmt: skip
    assert {each.kind for each in parameters} == {inspect.Parameter.KEYWORD_ONLY}
    assert [each.default for each in parameters if each.default is not each.empty] == [3, "x", "z"]
    assert given.__doc__ == "What it does."


def reads(loaded: Annotated[Path, typer.Argument()], output: Annotated[Path, typer.Option("--output", "-o")]) -> None:
    CALLS.append((loaded, output))


def test_a_command_is_not_called_to_write_over_what_it_reads():
    CALLS.clear()
    with pytest.raises(CommissioningError, match="a is given as --output, to be written, and as LOADED: give another"):
        with_option_groups(reads)(loaded=Path("a"), output=Path("a"))
    assert CALLS == []


def test_the_command_gets_one_value_of_the_group():
    CALLS.clear()
    with_option_groups(command)(first=1, folder="a", depth=5, name="b", last="c")
    assert [(1, Deeper("a", 5, "b"), "c")] == CALLS
