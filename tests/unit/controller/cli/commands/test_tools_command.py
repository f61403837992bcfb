"""`armload tools` and `identify --minus`, from the command line."""

import re
from dataclasses import replace

import msgspec
import pytest

import armload as armload_python
from armload_controller.config.robot import load_robot
from armload_identification.identification_errors import IdentificationError


@pytest.fixture
def runs(recorded_er50, monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    return recorded_er50 / "runs" / "today"


def test_without_tools_the_list_says_how_to_add_one(armload, runs):
    assert "add one with `armload tools add NAME payload.toml`" in armload("tools", "list", columns=300).output


@pytest.mark.long
def test_the_workpiece_of_a_tool_that_is_the_whole_but_lighter(armload, runs, tmp_path):
    """The tool is the recorded payload, from a file in which it weighs 2 kg less."""
    text = (runs / "payload.toml").read_text()
    mass = float(re.search(r"^mass_kg = ([\d.]+)", text, re.MULTILINE)[1])
    (tmp_path / "tool.toml").write_text(text.replace(f"mass_kg = {mass!r}", f"mass_kg = {mass - 2.0!r}"))
    added = armload("tools", "add", "gripper", tmp_path / "tool.toml", columns=300)
    assert f"gripper: {mass - 2.0:.4g} kg, identified on er50" in added.output
    pair = ("--loaded", runs / "loaded_identification.mcap", "--unloaded", runs / "unloaded_identification.mcap")
    found = armload("identify", "er50", *pair, "--minus", "gripper", "-o", tmp_path / "part.toml", columns=300)
    assert found.exit_code == 0, found.output
    said = " ".join(found.output.split())
    whole = float(re.search(r"The workpiece alone: the whole, ([\d.]+) kg", said)[1])
    assert whole == pytest.approx(mass, abs=0.004), "a hundredth of the half width"
    assert f"minus the tool, {mass - 2.0:.4g} kg" in said
    part = (tmp_path / "part.toml").read_text()
    assert float(re.search(r"^mass_kg = ([\d.]+)", part, re.MULTILINE)[1]) == pytest.approx(2.0, abs=0.05)


def test_what_is_about_the_whole_is_refused_with_a_tool(armload, runs):
    loaded = runs / "loaded_identification.mcap"
    refused = armload("identify", "er50", "--loaded", loaded, "--minus", "x", "--report", "r.html", columns=300)
    assert refused.exit_code == 2
    assert "cannot be combined with --minus" in refused.output


def test_an_unknown_tool_is_named(armload, runs):
    loaded, unloaded = (runs / f"{load}_identification.mcap" for load in ("loaded", "unloaded"))
    refused = armload("identify", "er50", "--loaded", loaded, "--unloaded", unloaded, "--minus", "x")
    assert "no such tool, and no such file" in str(refused.exception)


def test_a_workpiece_has_no_validation():
    with pytest.raises(IdentificationError, match="a validation judges the whole load"):
        armload_python.identify("er50", "a.mcap", "b.mcap", validation=("c.mcap", "d.mcap"), minus="tool.toml")


@pytest.mark.long
def test_more_than_the_rated_payload_is_said(runs):
    robot = load_robot("er50")
    rated = msgspec.structs.replace(robot.tables.robot, rated_payload_kg=8.0)
    weak = replace(robot, tables=msgspec.structs.replace(robot.tables, robot=rated))
    pair = (runs / "loaded_identification.mcap", runs / "unloaded_identification.mcap")
    said = [
        [note for note in armload_python.identify(arm, *pair).notes if "more than its rated payload of 8 kg" in note]
        for arm in (weak, robot)
    ]
    assert [len(notes) for notes in said] == [1, 0]
