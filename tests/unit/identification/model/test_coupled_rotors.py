"""The arm's torque with coupled motors, as specified and as identified, against MuJoCo's."""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np

from armload_controller.config.robot import load_robot
from armload_drivers.simulation.mujoco_model import build_model
from armload_identification.model.body_model import BodyModel
from armload_identification.model.dynamics import ArmBody, ArmDynamics
from armload_identification.model.payload import InertialParameters


def test_a_coupled_wrists_rotors_turn_as_they_do_in_mujoco():
    """er50 in the plant: each rotor is the armature of a tendon over the joints that its motor moves."""
    robot = load_robot("er50")
    spec = robot.simulation.plant_spec(None)
    assert (spec.coupling != np.eye(6)).any()
    theta = [
        InertialParameters.from_center_of_mass(
            joint.link.mass_kg, joint.link.center_of_mass_m, joint.link.inertia_kg_m2
        ).theta
        for joint in spec.joints
    ]
    rotors, still = np.array([joint.reflected_rotor_inertia_kg_m2 for joint in spec.joints]), np.zeros(6)
    specified = ArmBody(np.array(theta), rotors, still, still, robot.drives.coupling)
    identified = BodyModel(
        links=specified.links,
        rotor_inertia_kg_m2=rotors,
        viscous_nm_s_rad=still,
        coulomb_nm=still,
        coupling=robot.drives.coupling,
        base=np.ones((6, 10), dtype=bool),
        root_nm=still,
        offset_nm=still,
        load_friction=still,
        torque_delay_s=0.0,
        reversal_speed_rad_s=still + 1.0,
    )
    plant = build_model(spec)
    assert plant.hinges_per_joint == 1
    q, dq, ddq = motion = 3.0 * np.random.default_rng(6).normal(size=(3, 20, 6))
    expected, inertial = np.empty_like(q), np.empty(6)
    for i in range(len(q)):
        plant.data.qpos[:], plant.data.qvel[:] = q[i], dq[i]
        mujoco.mj_forward(plant.model, plant.data)
        mujoco.mj_mulM(plant.model, plant.data, inertial, ddq[i])
        expected[i] = inertial + plant.data.qfrc_bias
    for found in (ArmDynamics(robot.chain, specified).torque(*motion), identified.torque(robot.chain, *motion)):
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max())
    uncoupled = ArmDynamics(robot.chain, replace(specified, coupling=np.eye(6))).torque(*motion)
    assert (np.abs(uncoupled - expected).max(axis=0)[3:] > 0.02).all()
