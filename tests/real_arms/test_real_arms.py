"""Twelve arms from their published URDFs: the chain equals Pinocchio's, and a payload on it is identified.

The files are those of PyPI's `example-robot-data` (440 MB), which `.ci/run` installs from `robots.lock` in a separate
environment. Base and flange are chosen by the user's options.
"""

import json
import os
from pathlib import Path

import numpy as np
import pytest

import armload
from armload_controller.config.robot import load_robot
from armload_controller.motion.checked_path import check_path
from tests.urdf_simulation import PUBLISHED, PinocchioArm

FOLDER = Path(os.environ.get("ARMLOAD_EXAMPLE_ROBOTS", "not-given"))
MASS_KG = dict.fromkeys(PUBLISHED, 1.0) | {"SO-100": 0.1, "SO-101": 0.1}

pytestmark = pytest.mark.skipif(
    not FOLDER.is_dir(), reason="ARMLOAD_EXAMPLE_ROBOTS does not name the robots of example-robot-data"
)


@pytest.fixture(params=PUBLISHED, scope="module")
def case(request):
    """An arm of a URDF, Pinocchio's, and the payload's mass."""
    file, base, flange = PUBLISHED[request.param]
    arm = armload.read_urdf_arm(FOLDER / file, base=base, flange=flange)
    return (
        arm,
        PinocchioArm(FOLDER / file, arm.joint_names, arm.base, arm.flange),
        MASS_KG[request.param],
    )


def test_the_chain_is_pinocchios(case):
    arm, reference, _ = case
    rng = np.random.default_rng(0)
    for q in rng.uniform(-3.0, 3.0, (20, arm.n)):
        np.testing.assert_allclose(arm.chain.forward(q)[-1], reference.flange_pose(q), atol=1e-9, rtol=0.0)


def test_a_payload_is_found(case):
    """The recording has its joints in another order, and one joint more than the arm."""
    arm, reference, mass_kg = case
    center_m, size_m = np.array([0.02, -0.01, 0.05]), 0.08
    inertia = mass_kg * size_m**2 / 6.0 * np.eye(3)
    limits = arm.position_min_rad, arm.position_max_rad, arm.velocity_max_rad_s
    loaded, empty = reference.runs(*limits, mass_kg, center_m, inertia)
    order = np.random.default_rng(1).permutation(arm.n)

    def recorded(run, name):
        column = np.sin(run.time_s)[:, None]
        return armload.Recording.from_arrays(
            run.time_s,
            np.hstack([run.position_rad[:, order], 0.02 * column]),
            torque_nm=np.hstack([run.torque_nm[:, order], column]),
            joint_names=[*(arm.joint_names[i] for i in order), "a finger"],
            name=name,
        )

    found = armload.identify(arm, recorded(loaded, "loaded"), recorded(empty, "unloaded"))
    assert found.payload.determined[:4].all(), found
    assert found.payload.model.mass_kg == pytest.approx(mass_kg, rel=0.005)
    np.testing.assert_allclose(found.payload.model.center_of_mass_m, center_m, atol=0.005)
    assert any("not part of this arm: a finger" in note for note in found.notes)


@pytest.mark.parametrize("name", ["SO-101", "Baxter", "Talos"])
def test_init_gives_a_robot_file_and_two_excitations_that_can_be_run(armload, tmp_path, name):
    """The smallest arm, one of a torso with a head and a second arm, and one whose meshes restrict its ranges."""
    (file, base, flange), mass_kg = PUBLISHED[name], MASS_KG[name]
    out = tmp_path / "arm.toml"
    links = [word for option, link in (("--base", base), ("--flange", flange)) if link for word in (option, link)]
    words = ["init", FOLDER / file, *links, "--payload-kg", mass_kg, "--restarts", 3, "--output", out, "--json"]
    result = armload(*words)
    assert result.exit_code == 0, (result.output, result.exception)
    found = json.loads(result.stdout)
    assert (found["no_excitation"], found["holes"]) == (None, [])
    robot = load_robot(str(out))
    for role, excitation in robot.excitations.items():
        check_path(excitation, robot.motion_constraints, 0.01, file=str(out), key=role)
    assert set(robot.excitations) == {"identification", "validation"}
