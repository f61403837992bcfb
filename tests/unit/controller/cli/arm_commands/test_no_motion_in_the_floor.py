"""A path in the floor is refused by every command that moves an arm, before anything is opened.

`prbt` with a test path 0.2 m below its floor that violates no joint limit and needs little torque.
"""

import re
from importlib import resources
from pathlib import Path

import numpy as np
import pytest

from armload_controller.config.robot import load_robot
from armload_controller.control_errors import ConfigurationError
from armload_controller.motion.joint_and_speed_checks import require_joint_limits, torque_objection
from armload_controller.motion.setpoints import plan_measured
from armload_identification.excitation.excitation_file import write_excitation
from armload_identification.excitation.fourier import Excitation, FourierTrajectory
from armload_identification.files.payload_file import write_payload
from armload_identification.model.payload import PayloadResult, Provenance

PROBE = FourierTrajectory(
    0.5, np.array([0.0, 2.2, 0.3, 0.0, 0.5, 0.0]), np.full((6, 1), 0.1), np.array([[0.05], [0.1], [-0.1]] * 2)
)
CONFIGS = Path(str(resources.files("armload_configs")))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """The test path as an excitation file, prbt files that use it as their excitation, and a payload file."""
    folder = tmp_path_factory.mktemp("floor")
    write_excitation(folder / "probe.toml", Excitation(PROBE, 1))
    text = (CONFIGS / "prbt.toml").read_text("utf-8")
    for role in ("identification", "validation"):
        (folder / f"prbt_{role}.toml").write_text((CONFIGS / f"prbt_{role}.toml").read_text("utf-8"))
        changed, count = re.subn(rf'^{role} = ".*"$', f'{role} = "probe.toml"', text, flags=re.MULTILINE)
        assert count == 1
        (folder / f"{role}.toml").write_text(changed)
    body = load_robot("prbt").simulation.payload("block")
    values = np.stack([body.values, body.values], axis=1)
    known, ones = np.ones(10, dtype=bool), np.ones(6)
    payload = PayloadResult("flange", body, known, values, ones, ones, Provenance("0", "0", {}))
    write_payload(folder / "payload.toml", payload)
    return folder


def test_nothing_but_the_floor_speaks_against_the_probe():
    robot = load_robot("prbt")
    constraints = robot.motion_constraints
    phase = plan_measured(Excitation(PROBE, 1), constraints.limits, 1 / robot.bus.cycle_hz).bounds
    require_joint_limits(PROBE.bounds(), phase, constraints)
    assert torque_objection(PROBE, phase, constraints) is None


@pytest.mark.parametrize("runs", ["both", "unloaded"])
@pytest.mark.parametrize("role", ["identification", "validation"])
def test_commission(armload, folder, tmp_path, role, runs):
    result = armload("commission", folder / f"{role}.toml", "--runs", runs, "--output", tmp_path / "run")
    refuses(result, rf"{role}\.toml: excitation\.{role}")


@pytest.mark.parametrize("command", ["trial", "compare", "run"])
def test_feedforward_along_a_path_given_to_it(armload, folder, command):
    words = ["feedforward", command, "prbt", folder / "payload.toml", "--excitation", folder / "probe.toml"]
    refuses(armload(*words), r"command line: --excitation .*probe\.toml")


@pytest.mark.parametrize("command", ["trial", "compare", "run"])
def test_feedforward_along_the_robots_own_path(armload, folder, command):
    words = ["feedforward", command, folder / "validation.toml", folder / "payload.toml"]
    refuses(armload(*words), r"validation\.toml: excitation\.validation")


def refuses(result, key):
    """Check that the path is refused because of the floor and named, and that nothing is opened."""
    assert result.exit_code == 1, result.output
    assert isinstance(result.exception, ConfigurationError)
    assert re.search(
        rf"{key} is \"a path that brings the tool within -0\.2\d* m of 'floor'\"", str(result.exception)
    ), result.exception
    assert "connecting" not in result.output
    assert "slow round" not in result.output
