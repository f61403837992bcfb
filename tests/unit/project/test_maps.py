"""The READMEs that describe a folder name all of its content, and nothing that is not there."""

import re
from pathlib import Path

import pytest

from armload_controller.config.robot import shipped_robots
from armload_controller.config.tables.robot_file import RobotFile

ROOT = Path(__file__).parents[3]
ROOMS = ("drivers", "controller", "identification", "identification/armload_core")


@pytest.mark.parametrize("table", RobotFile.__struct_fields__)
def test_every_table_of_a_robots_file_is_on_the_map(table):
    text = (ROOT / "configs" / "README.md").read_text()
    assert f"`[{table}]`" in text or f"`[[{table}]]`" in text


def test_every_shipped_robot_is_on_the_map():
    text = (ROOT / "configs" / "README.md").read_text()
    for name in shipped_robots():
        assert f"| `{name}.toml` |" in text


def test_every_room_of_the_controller_is_on_the_map():
    text = (ROOT / "controller" / "README.md").read_text()
    rooms = {file.parent.name for file in (ROOT / "controller" / "armload_controller").glob("*/__init__.py")}
    assert rooms == {line.split("`")[1].rstrip("/") for line in text.splitlines() if line.startswith("| `")}


def test_every_room_of_the_drivers_is_on_the_map():
    text = (ROOT / "drivers" / "README.md").read_text()
    for file in (ROOT / "drivers" / "armload_drivers").glob("*/__init__.py"):
        assert f"`{file.parent.name}/`" in text


@pytest.mark.parametrize("page", ["CONTRIBUTING.md", *(f"{room}/README.md" for room in ROOMS)])
def test_a_map_names_no_file_that_is_not_there(page):
    there = {file.name for room in (*ROOMS, "tests", "benchmarks") for file in (ROOT / room).rglob("*.*")}
    named = re.findall(r"`(?:[\w-]+/)*(\w+\.(?:py|c|h))`", (ROOT / page).read_text())
    assert named
    assert set(named) - there == set()
