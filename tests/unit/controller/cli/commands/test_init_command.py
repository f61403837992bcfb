"""`armload init`: from a URDF to a robot file and its excitations, and refusals."""

import json
from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from armload_controller.cli.commands import init_command
from armload_controller.cli.screen import Screen
from armload_controller.config.robot import load_robot
from armload_controller.control_errors import ConfigurationError
from armload_identification.identification_errors import ExcitationError

LIMIT = '<limit lower="-1.5" upper="1.5" velocity="2" effort="120"/>'
JOINT = (
    '<joint name="j{0}" type="revolute"><parent link="l{1}"/><child link="l{0}"/><origin xyz="0 0 0.3"/>'
    '<axis xyz="{2}"/>{limit}</joint>'
)
LINK = (
    '<link name="l{0}"><inertial><origin xyz="0 0 0.1"/><mass value="2"/>'
    '<inertia ixx="0.02" iyy="0.02" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>'
)


@pytest.fixture
def urdf(tmp_path):
    """Four joints without geometry."""

    def urdf(limit=LIMIT):
        links = "".join(LINK.format(i) for i in range(5))
        axes = ("0 0 1", "0 1 0", "0 1 0", "1 0 0")
        joints = "".join(JOINT.format(i + 1, i, axis, limit=limit) for i, axis in enumerate(axes))
        path = tmp_path / "arm.urdf"
        path.write_text(f'<robot name="four">{links}{joints}</robot>')
        return path

    return urdf


@pytest.mark.long
def test_a_urdf_becomes_a_robot_with_two_excitations(armload, urdf, tmp_path):
    out = tmp_path / "new" / "four.toml"
    words = ("--payload-kg", "1.5", "--simulated", "--restarts", "1", "--output", out, "--json")
    result = armload("init", urdf(), *words)
    assert result.exit_code == 0, result.output
    found = json.loads(result.stdout)
    assert (found["schema"], found["holes"], found["no_excitation"]) == ("armload/init/1", [], None)
    assert found["joint_names"] == ["j1", "j2", "j3", "j4"]
    assert found["files"] == {"robot": str(out)} | {
        role: str(out.with_name(f"four_{role}.toml")) for role in ("identification", "validation")
    }
    assert found["next"].startswith("`armload commission")
    robot = load_robot(str(out))
    assert robot.simulation.payload("cube").mass_kg == 1.5
    assert set(robot.excitations) == {"identification", "validation"}
    trajectories = [excitation.trajectory for excitation in robot.excitations.values()]
    assert not np.allclose(trajectories[0].sin_rad, trajectories[1].sin_rad)
    assert "assumed, to be checked:" in result.stderr
    assert any("gravity" in sentence for sentence in found["assumed"])
    checked = armload("drives", "check", out)
    assert checked.exit_code == 0, checked.output


def test_holes_are_listed_and_no_excitation_is_designed(armload, urdf, tmp_path):
    out = tmp_path / "four.toml"
    result = armload("init", urdf('<limit lower="-1" upper="1"/>'), "--payload-kg", "1", "--output", out, "--json")
    assert result.exit_code == 0, result.output
    found = json.loads(result.stdout)
    assert "joints[4].torque_max_nm" in found["holes"]
    assert found["no_excitation"] == "values are missing"
    assert found["files"] == {"robot": str(out), "identification": None, "validation": None}
    assert "no excitation is designed" in result.stderr
    assert sorted(file.name for file in tmp_path.iterdir()) == ["arm.urdf", "four.toml"]
    checked = armload("drives", "check", out)
    assert isinstance(checked.exception, ConfigurationError)
    assert "joints[1].torque_max_nm is 'FILL IN'" in str(checked.exception)
    twin = armload("init", urdf(), "--simulated", "--output", tmp_path / "twin.toml")
    assert "--payload-kg is missing: required: the payload of the simulated arm" in str(twin.exception)
    for limit in ('lower="-1" upper="1"', 'lower="0" upper="0" velocity="2" effort="120"'):
        weak = urdf(f"<limit {limit}/>")
        twin = armload("init", weak, "--payload-kg", "1", "--simulated", "--output", tmp_path / "twin.toml")
        assert "only for a URDF with mass, effort, velocity and range" in str(twin.exception)


def test_nothing_is_replaced_and_nothing_asked_without_a_terminal(armload, urdf, tmp_path):
    out = tmp_path / "four.toml"
    out.write_text("mine")
    result = armload("init", urdf(), "--output", out)
    assert "is not overwritten: choose another" in str(result.exception)
    assert out.read_text() == "mine"
    assert "no terminal to ask at" in str(armload("init", "--output", tmp_path / "other.toml").exception)
    heavy = armload("init", urdf(), "--payload-kg", "2400", "--output", tmp_path / "heavy.toml")
    assert "expected a payload that this joint can carry" in str(heavy.exception)
    assert not (tmp_path / "heavy.toml").exists()


# Steps of the command ----------------------------------------------------------------------------------------------


class Person(Screen):
    """Notes what is said."""

    def __init__(self):
        super().__init__()
        self.said = []

    def step(self, text):
        self.said.append(text)


@pytest.mark.parametrize(
    ("holes", "has_bus", "designed", "text"),
    [
        (["a"], True, True, "fill these in, then `armload drives check new/my.toml`"),
        (["a"], False, False, "fill these in"),
        ([], True, False, "`armload design new/my.toml --seed 1 --output my_identification.toml`"),
        ([], False, True, "use your own recordings with `armload identify new/my.toml ...`, or fill in the drives in"),
        ([], True, True, "`armload drives check new/my.toml`"),
    ],
)
def test_the_next_step_is_the_first_that_is_missing(holes, has_bus, designed, text):
    drafted = SimpleNamespace(holes=holes, unchecked=("gear ratios",))
    found = init_command._next_step(Path("new/my.toml"), drafted, has_bus=has_bus, designed=designed)
    assert found.startswith(text)
    person = Person()
    init_command._show_open_points(person, drafted)
    missing = ["to be filled in; the file is refused until then:", "  a"] if holes else []
    assert person.said == [*missing, "assumed, to be checked:", "  gear ratios"]


def test_without_a_scan_or_a_description_the_drives_are_left_open(monkeypatch):
    assert init_command._bus(6, None, 500_000, None, Path("my.toml")) is None
    asked = []
    monkeypatch.setattr(
        "armload_controller.session.arm_access.nodes_on", lambda *given: asked.append(given) or ["node"]
    )
    monkeypatch.setattr("armload_controller.new_robot.drive_drafts.drives_found", lambda nodes, n, _: (nodes, n))
    bus = init_command._bus(6, "socketcan:can3", 500_000, None, Path("my.toml"))
    assert asked == [("socketcan", "can3", 500_000)]
    assert (bus.drives, bus.interface, bus.channel, bus.bitrate) == ((["node"], 6), "socketcan", "can3", 500_000)


@pytest.mark.parametrize(
    ("failing", "excitations", "problem", "narrower"),
    [
        ((), ("my_identification.toml", "my_validation.toml"), None, 0),
        (("wide",), ("my_identification.toml", "my_validation.toml"), None, 1),
        (("wide", "narrow"), None, "none in narrow", 1),
    ],
)
def test_excitations_are_sought_in_narrower_ranges(monkeypatch, tmp_path, failing, excitations, problem, narrower):
    searched = []

    class Found:
        def save(self, path):
            path.write_text("excitation")

    def design(box, *, search, progress):
        assert not (tmp_path / "my.toml").exists()  # killed here, the same command is not refused the next time
        searched.append((box, search.seed, search.restarts))
        if box in failing:
            raise ExcitationError(f"none in {box}")
        return Found()

    robot = "armload_controller.analysis.robot_excitation"
    monkeypatch.setattr(f"{robot}.design", design)
    monkeypatch.setattr(f"{robot}.design_envelope", lambda robot: None)
    monkeypatch.setattr("armload_controller.config.robot.parse_robot", lambda text, _file, _folder: text)
    monkeypatch.setattr("armload_controller.new_robot.arm_draft.within", lambda arm, box: box)
    monkeypatch.setattr(
        "armload_controller.new_robot.design_range.design_range", lambda *_given: (("wide", "narrow"), "roomiest")
    )
    person = Person()
    person.track = lambda *_given: nullcontext()
    made = init_command._designed(person, tmp_path / "my.toml", "arm", lambda box: SimpleNamespace(text=box), 5)
    assert (made.names, made.problem, made.roomiest_rad) == (excitations, problem, "roomiest")
    narrowed = [text for text in person.said if text.startswith("none found in this part")]
    assert len(narrowed) == narrower
    assert searched[0] == ("wide", 1, 5)
    if excitations:
        assert [(seed, restarts) for _, seed, restarts in searched[-2:]] == [(1, 5), (2, 5)]
        assert all((tmp_path / name).is_file() for name in excitations)
