"""The shipped excitations: within every limit with margin, and informative.

The properties proved by the design are checked independently: 20,000 samples of a period, frames and torques by
Pinocchio with the simulated arm's true body, and distances by separate formulas.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from armload_controller.analysis.robot_excitation import POSITION_MARGIN_RAD, RATE_SHARE, TORQUE_SHARE
from armload_controller.config.robot import load_robot
from armload_identification.excitation.information import named_criterion
from armload_identification.model.payload import InertialParameters
from tests.smallest_margin import smallest_margin

SHARES = (POSITION_MARGIN_RAD, RATE_SHARE, TORQUE_SHARE)
ROLES = ("identification", "validation")
CASES = pytest.mark.parametrize(("robot", "role"), [(robot, role) for robot in ("er50", "prbt") for role in ROLES])
SAMPLES = 20_000


class Driven:
    """A shipped excitation, sampled densely."""

    def __init__(self, robot: str, role: str) -> None:
        self.arm = load_robot(robot)
        self.excitation = self.arm.excitations[role]
        self.trajectory = self.excitation.trajectory
        self.state = self.trajectory.evaluate(np.linspace(0.0, self.trajectory.period_s, SAMPLES))


@pytest.fixture(scope="module")
def driven():
    return {(robot, role): Driven(robot, role) for robot in ("er50", "prbt") for role in ROLES}


@CASES
def test_room_is_left_for_the_ramps_and_the_servo(driven, robot, role):
    one = driven[robot, role]
    assert (one.trajectory.period_s, one.excitation.periods, one.trajectory.harmonics) == (5.0, 4, 5)
    assert one.trajectory.n == one.arm.n
    limits, state = one.arm.limits.motion, one.state
    assert np.all(state.position_rad > limits.position_min_rad + POSITION_MARGIN_RAD)
    assert np.all(state.position_rad < limits.position_max_rad - POSITION_MARGIN_RAD)
    speed = np.abs(state.velocity_rad_s)
    assert np.all(speed < RATE_SHARE * limits.velocity_max_rad_s)
    assert np.all(np.abs(state.acceleration_rad_s2) < RATE_SHARE * limits.acceleration_max_rad_s2)
    assert np.all(np.abs(state.jerk_rad_s3) < RATE_SHARE * limits.jerk_max_rad_s3)
    lag_s = 0.045 if robot == "er50" else 0.052
    assert np.all(speed * lag_s < RATE_SHARE * limits.following_error_rad)


@CASES
def test_nothing_is_touched(driven, robot, role, in_pinocchio):
    one = driven[robot, role]
    workspace, chain = one.arm.workspace, one.arm.chain
    massless = [InertialParameters.from_center_of_mass(1.0, np.zeros(3), np.eye(3))] * chain.n
    model = in_pinocchio(chain, massless)
    data = model.createData()
    centres = np.empty((SAMPLES // 4, len(workspace.spheres), 3))
    for row, q in zip(centres, one.state.position_rad[::4], strict=True):
        pin.framesForwardKinematics(model, data, q)
        poses = [pin.SE3.Identity(), *list(data.oMi)[1:], data.oMf[model.getFrameId("flange")]]
        row[:] = [poses[s.link].act(s.center_m) for s in workspace.spheres]
    keep_m = workspace.keep_m
    assert keep_m > 0.0
    links = np.array([s.link for s in workspace.spheres])
    radius = np.array([s.radius_m for s in workspace.spheres])
    for wall in workspace.half_spaces:
        distance = centres @ wall.normal - wall.offset_m - radius
        assert distance[:, np.isin(links, wall.links)].min() > keep_m
    for box in workspace.boxes:
        local = (centres - box.pose[:3, 3]) @ box.pose[:3, :3]
        beyond = np.linalg.norm(local - np.clip(local, -0.5 * box.size_m, 0.5 * box.size_m), axis=2) - radius
        assert beyond[:, np.isin(links, box.links)].min() > keep_m
    for first, second in workspace.apart:
        for a in np.flatnonzero(links == first):
            between = np.linalg.norm(centres[:, a, None] - centres[:, links == second], axis=2)
            assert (between - radius[a] - radius[links == second]).min() > keep_m


@CASES
def test_the_true_body_with_the_heaviest_payload_stays_below_the_torque_limits(driven, robot, role, in_pinocchio):
    """At any speed, empty and loaded, although the true arm has friction that the design does not know."""
    one = driven[robot, role]
    twin = one.arm.simulation.plant_spec(None)
    true = [j.link for j in twin.joints]
    links = [InertialParameters.from_center_of_mass(b.mass_kg, b.center_of_mass_m, b.inertia_kg_m2) for b in true]
    rotors, viscous, coulomb, stribeck, mu = (
        np.array([getattr(joint, name) for joint in twin.joints])
        for name in ("reflected_rotor_inertia_kg_m2", "viscous_nm_s_rad", "coulomb_nm", "stribeck_nm", "load_friction")
    )
    thin = slice(None, None, 10)
    q, dq, ddq = (a[thin] for a in (one.state.position_rad, one.state.velocity_rad_s, one.state.acceleration_rad_s2))
    for payload in (None, one.arm.payloads.heaviest):
        model = in_pinocchio(one.arm.chain, links, payload)
        data = model.createData()
        for rate in (0.0, 0.5, 1.0):
            rows = zip(q, rate * dq, rate**2 * ddq, strict=True)
            carried = np.array([pin.rnea(model, data, *row) for row in rows])
            friction = coulomb + stribeck + mu * np.abs(carried) + viscous * rate * np.abs(dq)
            needed = np.abs(carried + rotors * rate**2 * ddq) + friction
            assert np.all(needed.max(axis=0) < one.arm.limits.torque_max_nm)


@CASES
def test_the_file_says_what_it_is_worth_and_how_it_was_made(driven, robot, role):
    one = driven[robot, role]
    state = one.trajectory.evaluate(np.linspace(0.0, one.trajectory.period_s, 1000, endpoint=False))
    motion = (state.position_rad, state.velocity_rad_s, state.acceleration_rad_s2)
    payload = one.arm.payloads.expected
    criterion = named_criterion("a-optimal", one.arm.chain, one.arm.limits.torque_noise_nm, payload)
    design = one.excitation.design
    assert design["cost"] == pytest.approx(criterion.cost(*motion, one.trajectory.period_s), rel=0.01)
    assert design["cost"] < 0.0131
    assert str(design["command"]).startswith(
        f"armload design {robot} --output {robot}_{role}.toml --seed {design['seed']} "
    )


@CASES
def test_the_margins_in_the_file_are_those_of_the_configuration_beside_it(driven, robot, role):
    one = driven[robot, role]
    reported, found = one.excitation.margins, one.arm.envelope(*SHARES).margins(one.trajectory)
    assert smallest_margin(reported) > 0.0
    for name in ("position_rad", "velocity_rad_s", "acceleration_rad_s2", "jerk_rad_s3", "torque_nm"):
        np.testing.assert_allclose(getattr(reported, name), getattr(found, name), rtol=2e-5, atol=1e-9)
    assert reported.clearance_m == pytest.approx(found.clearance_m, rel=2e-5)


@pytest.mark.parametrize("robot", ["er50", "prbt"])
def test_validation_is_another_motion_than_identification(driven, robot):
    first, second = (driven[robot, role].state.position_rad[::100] for role in ROLES)
    assert np.median(np.abs(first - second).max(axis=1)) > 0.5
