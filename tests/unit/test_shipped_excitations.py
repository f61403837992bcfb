"""The excitations that come with the robots: within the limits with room to spare, and worth driving."""

from __future__ import annotations

from typing import Literal

import numpy as np
import pytest

from armload_controller.config import load_robot
from armload_identification.excitation import margins
from armload_identification.information import a_optimal
from armload_identification.regressor import body_regressor, payload_torque

ROLES: tuple[Literal["identification", "validation"], ...] = ("identification", "validation")
CASES = pytest.mark.parametrize(("robot", "role"), [(robot, role) for robot in ("er50", "prbt") for role in ROLES])


@CASES
def test_room_is_left_for_the_ramps_and_the_servo(robot, role):
    arm = load_robot(robot)
    excitation = arm.excitations[role]
    assert (excitation.trajectory.period_s, excitation.periods, excitation.trajectory.harmonics) == (10.0, 3, 5)
    assert excitation.trajectory.n == arm.n
    assert margins(excitation.trajectory, arm.excitation_limits().reduced(0.1, 0.7)).smallest > 0.0


@CASES
def test_the_file_says_what_it_is_worth_and_how_it_was_made(robot, role):
    arm = load_robot(robot)
    excitation = arm.excitations[role]
    trajectory = excitation.trajectory
    state = trajectory.evaluate(np.linspace(0.0, trajectory.period_s, 1000, endpoint=False))
    criterion = a_optimal(arm.chain(), arm.torque_noise_nm(), arm.expected_payload())
    cost = criterion.cost(state.position_rad, state.velocity_rad_s, state.acceleration_rad_s2, trajectory.period_s)
    assert excitation.design["cost"] == pytest.approx(cost, rel=0.01)
    assert cost < 0.005  # a random start within the same limits costs about five times as much
    command = str(excitation.design["command"])
    assert command.startswith(
        f"armload design {robot} --output {robot}_{role}.toml --seed {excitation.design['seed']} "
    )


@pytest.mark.parametrize("robot", ["er50", "prbt"])
def test_validation_is_another_motion_than_identification(robot):
    arm = load_robot(robot)
    first, second = (arm.excitations[role].trajectory for role in ROLES)
    times_s = np.linspace(0.0, 10.0, 200)
    apart = np.abs(first.evaluate(times_s).position_rad - second.evaluate(times_s).position_rad)
    assert np.median(apart.max(axis=1)) > 0.5


@CASES
def test_links_and_payload_stay_well_below_the_torque_limits(robot, role):
    arm = load_robot(robot)
    trajectory = arm.excitations[role].trajectory
    state = trajectory.evaluate(np.linspace(0.0, trajectory.period_s, 400))
    motion = (state.position_rad, state.velocity_rad_s, state.acceleration_rad_s2)
    links = [joint.link for joint in arm.plant_spec(None).joints]
    theta = np.zeros((arm.n, 10))
    for i, link in enumerate(links):
        c = link.center_of_mass_m
        about_origin = link.inertia_kg_m2 + link.mass_kg * (c @ c * np.eye(3) - np.outer(c, c))
        theta[i] = [link.mass_kg, *(link.mass_kg * c), *about_origin[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]]
    torque = body_regressor(arm.chain(), *motion) @ theta.ravel()
    torque += payload_torque(arm.chain(), arm.expected_payload().theta, *motion)
    assert np.all(np.abs(torque).max(axis=0) < 0.5 * arm.torque_max_nm())
