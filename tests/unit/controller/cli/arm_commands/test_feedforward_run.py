"""The range of mass that `feedforward run` adapts to, and what contradicts it."""

from pathlib import Path

import pytest
import typer

from armload_controller.cli.arm_commands.feedforward_run import declared_mass, require_one_kind
from armload_controller.config.robot import load_robot

PRBT = load_robot("prbt")


@pytest.mark.parametrize("text", ["0.5..3", " 0.5 .. 3 ", "0.5kg..3kg", "0.5 .. 3 kg"])
def test_a_range_is_two_masses_with_or_without_their_unit(text):
    found = declared_mass(PRBT, text)
    assert (found.least_kg, found.most_kg) == (0.5, 3.0)


@pytest.mark.parametrize("text", ["", "3", "0..1..2", "0...3", "a..b", "0-3", "0..3 g"])
def test_anything_else_is_refused(text):
    with pytest.raises(typer.BadParameter, match=r"expected a range such as 0\.\.3") as caught:
        declared_mass(PRBT, text)
    assert caught.value.param_hint == "--expect"
    assert caught.value.message.startswith(repr(text))


@pytest.mark.parametrize(
    ("payload", "expect", "hint"),
    [(Path("p.toml"), None, None), (None, "0..3", None), (Path("p.toml"), "0..3", "--expect"), (None, None, "PAYLOAD")],
)
def test_either_a_payload_or_a_range_is_given(payload, expect, hint):
    if hint is None:
        require_one_kind(payload, expect)
        return
    with pytest.raises(typer.BadParameter) as caught:
        require_one_kind(payload, expect)
    assert caught.value.param_hint == hint
