"""`armload init`: from a URDF to a robot file and its excitations, and refusals."""

import json

import numpy as np
import pytest

from armload_controller.config.robot import load_robot
from armload_controller.control_errors import ConfigurationError

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
    heavy = armload("init", urdf(), "--payload-kg", "3000", "--output", tmp_path / "heavy.toml")
    assert "expected a payload that this joint can carry" in str(heavy.exception)
    assert not (tmp_path / "heavy.toml").exists()
