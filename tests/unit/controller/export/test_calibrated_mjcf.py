"""A calibrated arm as MJCF: MuJoCo's inverse dynamics gives the calibrated torque."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from armload_controller.config.robot import load_robot
from armload_controller.export.calibrated_mjcf import arm_mjcf
from armload_identification.calibration.possible_links import PossibleLinks


@pytest.fixture(scope="module")
def arm():
    return load_robot("prbt")


def states(n, count=50):
    return np.random.default_rng(7).uniform(-1.5, 1.5, (3, count, n))


def made(arm, calibration, any_body):
    """The text for random possible links, and the calibration that has them."""
    rng = np.random.default_rng(3)
    links = np.array([any_body(rng).theta for _ in range(arm.n)])
    calibration = replace(calibration, body=replace(calibration.body, links=links))
    ((name, text),) = arm_mjcf(arm, calibration, PossibleLinks(links, True, 0.0, np.zeros(arm.n)), "a test").items()
    assert name == "prbt_calibrated.xml"
    return text, calibration


@pytest.mark.parametrize("coupled", [False, True])
def test_mujoco_finds_links_rotors_and_damping(arm, any_calibration, any_body, coupled):
    """The any_calibration fixture's motors are coupled and its base is not level."""
    calibration = any_calibration(arm.chain)
    if not coupled:
        calibration = replace(calibration, body=replace(calibration.body, coupling=np.eye(arm.n)))
    text, calibration = made(arm, calibration, any_body)
    model = mujoco.MjModel.from_xml_string(text)
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    data = mujoco.MjData(model)
    found = []
    for state in zip(*states(arm.n), strict=True):
        data.qpos, data.qvel, data.qacc = state
        mujoco.mj_inverse(model, data)
        found.append(data.qfrc_inverse.copy())
    q, dq, ddq = states(arm.n)
    body, chain = calibration.body, calibration.level(arm.chain)
    expected = body.link_torque(chain, q, dq, ddq) + ddq @ body.rotor_mass_kg_m2 + body.viscous_nm_s_rad * dq
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-9)
    assert ("<tendon>" in text) == coupled


def test_dry_friction_limits_and_flange_are_there(arm, any_calibration, any_body):
    text, calibration = made(arm, any_calibration(arm.chain), any_body)
    model = mujoco.MjModel.from_xml_string(text)
    np.testing.assert_array_equal(model.dof_frictionloss, calibration.body.coulomb_nm)
    np.testing.assert_array_equal(model.jnt_range[:, 1], arm.limits.motion.position_max_rad)
    np.testing.assert_array_equal(model.jnt_actfrcrange[:, 1], arm.limits.torque_max_nm)
    data = mujoco.MjData(model)
    data.qpos = states(arm.n)[0][0]
    mujoco.mj_kinematics(model, data)
    base = data.body("base").xmat.reshape(3, 3)
    pose = arm.chain.forward(states(arm.n)[0][0])[-1]
    np.testing.assert_allclose(data.site("flange").xpos, base @ pose[:3, 3], atol=1e-12)
    np.testing.assert_allclose(data.site("flange").xmat.reshape(3, 3), base @ pose[:3, :3], atol=1e-12)


def test_what_mjcf_cannot_say_is_listed(arm, any_calibration, any_body):
    text, _ = made(arm, any_calibration(arm.chain), any_body)
    words = " ".join(text.split())
    assert "MJCF has no elements for these" in words
    for what in ("Friction per torque of the links", "Friction per root of the speed", "Torque reported at no load"):
        assert what in words
    assert "armature), row by row" not in words
