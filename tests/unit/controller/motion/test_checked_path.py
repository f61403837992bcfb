"""Motions that may be commanded: each check has a case that only it refuses, on paths and on the ways onto them.

If any check in `checked_path` or `joint_and_speed_checks` is removed, a test here fails.
"""

import copy
from dataclasses import fields, replace

import numpy as np
import pytest

from armload_controller.config.robot import load_robot
from armload_controller.control_errors import ConfigurationError
from armload_controller.motion import setpoints
from armload_controller.motion.checked_path import CheckedLeg, CheckedPath, check_path
from armload_controller.motion.joint_and_speed_checks import (
    require_joint_limits,
    require_reduced_speed,
    torque_objection,
)
from armload_controller.motion.joint_limits import BeyondLimit, LimitViolation
from armload_controller.motion.obstacles import Obstacles
from armload_controller.motion.paths import BlockedWay, LinePath, PhaseLimits
from armload_identification.excitation.fourier import Excitation, FourierBounds, FourierTrajectory
from armload_identification.excitation.geometry.cartesian_speed import ArmPoints, CarriedSphere, SpeedLimit
from armload_identification.excitation.geometry.workspace import Box, HalfSpace, Sphere, Workspace
from armload_identification.model.chain import pose_from_xyz_rpy
from tests.planned_leg import plan_leg

SAG_RAD = 0.01

ROBOT = load_robot("prbt")
CYCLE_S = 0.01
N = 6
CONSTRAINTS = ROBOT.motion_constraints
LIMITS = CONSTRAINTS.limits
FREE = Obstacles(Workspace(ROBOT.chain))
SWING = FourierTrajectory(
    0.5, np.array([0.0, 0.6, 1.2, 0.0, 0.5, 0.0]), np.full((N, 1), 0.1), np.array([[0.05], [0.1], [-0.1]] * 2)
)
STANDING = np.array([0.0, -1.2, 0.2, 0.0, 0.0, 0.0])
"""Stretched out backwards, where gravity of arm and payload takes the greatest torque."""
JOINT = 2
"""The joint that a test makes the weak one."""


def checked(constraints=CONSTRAINTS, trajectory=SWING):
    return check_path(Excitation(trajectory, 2), constraints, CYCLE_S, file="my.toml", key="excitation.probe")


def limited(**changes):
    """The constraints with some limits of one joint replaced."""
    limits = {}
    for key, value in changes.items():
        limits[key] = getattr(LIMITS, key).copy()
        limits[key][JOINT] = value
    return replace(CONSTRAINTS, limits=replace(LIMITS, **limits))


def reaches(**changes):
    """Range and rates, all zero but those given for one joint."""
    values = {
        key: np.zeros(N)
        for key in (
            "position_min_rad",
            "position_max_rad",
            "velocity_max_rad_s",
            "acceleration_max_rad_s2",
            "jerk_max_rad_s3",
        )
    }
    for key, value in changes.items():
        values[key][JOINT] = value
    return FourierBounds(**values)


class CloseMeshes:
    """Collision meshes that come close to each other on a path or on a line, but not at its ends."""

    keep_m = least_m = 0.05

    def __init__(self, on_path_m=1.0, on_line_m=1.0):
        self.on_path_m, self.on_line_m = on_path_m, on_line_m

    def nearest(self, path):
        return self.on_path_m, "hand to table"

    def nearest_on_line(self, start_rad, goal_rad):
        return 1.0 if np.array_equal(start_rad, goal_rad) else self.on_line_m, "hand to table"


# Checked paths are made by the checks only
# ------------------------------------------------------------------------------


def test_nobody_but_the_checks_makes_what_may_be_commanded():
    path = checked()
    for attempt in (
        lambda: CheckedLeg(path.measured.leg),
        CheckedLeg,
        lambda: CheckedPath(path.excitation, path.constraints, path.slow, path.measured),
        CheckedPath,
        lambda: replace(path, constraints=replace(CONSTRAINTS, torque=None)),
        lambda: replace(path.measured, leg=path.slow.leg),
    ):
        with pytest.raises(TypeError, match="check"):
            attempt()
    for attribute in ("leg", "anything"):
        with pytest.raises(AttributeError):
            setattr(path.measured, attribute, path.slow.leg)
    assert copy.copy(path.measured).leg is path.measured.leg


def test_what_was_checked_cannot_be_changed_in_place():
    path = checked()
    limits, trajectory = path.constraints.limits, path.excitation.trajectory
    arrays = [getattr(each, part.name) for each in (limits, trajectory) for part in fields(each)]
    arrays = [array for array in (*arrays, path.constraints.following_speed_rad_s) if isinstance(array, np.ndarray)]
    assert len(arrays) > 10
    for array in arrays:
        with pytest.raises(ValueError, match="read-only"):
            array.flat[0] = 0.0


def test_what_was_checked_is_what_is_run():
    path = checked()
    assert path.measured.leg.path is SWING
    assert path.slow.leg.path.path is SWING
    np.testing.assert_allclose(plan_leg(path.measured.leg, CYCLE_S).position_rad[0], path.start_rad, atol=1e-12)
    np.testing.assert_allclose(plan_leg(path.slow.leg, CYCLE_S).position_rad[0], path.start_rad, atol=1e-12)


def test_the_measured_leg_goes_on_where_it_ended():
    path = checked()
    first, third = path.measured.leg, path.again(2).leg
    assert isinstance(path.again(1), CheckedLeg)
    assert path.again(1).leg.start_s == pytest.approx(first.start_s + first.end_s)
    assert (third.start_s, third.end_s) == pytest.approx((first.start_s + 2.0 * first.end_s, 3.0 * first.end_s))
    assert third.path is first.path


# Joint limits ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("reach", "phase", "quantity"),
    [
        ({"position_max_rad": LIMITS.position_max_rad[JOINT] + 1e-3}, (0.0, 0.0), "position"),
        ({"position_min_rad": LIMITS.position_min_rad[JOINT] - 1e-3}, (0.0, 0.0), "position"),
        ({"velocity_max_rad_s": 1.001 * LIMITS.velocity_max_rad_s[JOINT]}, (0.0, 0.0), "velocity"),
        ({"acceleration_max_rad_s2": 1.001 * LIMITS.acceleration_max_rad_s2[JOINT]}, (0.0, 0.0), "acceleration"),
        ({"velocity_max_rad_s": 1.0}, (1.001 * LIMITS.acceleration_max_rad_s2[JOINT], 0.0), "acceleration"),
        (
            {"velocity_max_rad_s": 1.0, "acceleration_max_rad_s2": 0.6 * LIMITS.acceleration_max_rad_s2[JOINT]},
            (0.41 * LIMITS.acceleration_max_rad_s2[JOINT], 0.0),
            "acceleration",
        ),
        ({"jerk_max_rad_s3": 1.001 * LIMITS.jerk_max_rad_s3[JOINT]}, (0.0, 0.0), "jerk"),
        ({"acceleration_max_rad_s2": 1.0}, (0.334 * LIMITS.jerk_max_rad_s3[JOINT], 0.0), "jerk"),
        ({"velocity_max_rad_s": 1.0}, (0.0, 1.001 * LIMITS.jerk_max_rad_s3[JOINT]), "jerk"),
        ({"velocity_max_rad_s": np.nan}, (0.0, 0.0), "velocity"),
    ],
)
def test_range_and_rates_with_their_ramps_are_within_the_limits(reach, phase, quantity):
    with pytest.raises(LimitViolation) as caught:
        require_joint_limits(reaches(**reach), PhaseLimits(*phase), CONSTRAINTS)
    assert (caught.value.joint, caught.value.quantity) == (LIMITS.joint_names[JOINT], quantity)


def test_the_following_error_of_a_known_lag_is_within_its_window():
    slow = replace(CONSTRAINTS, following_speed_rad_s=np.full(N, 0.5))
    require_joint_limits(reaches(velocity_max_rad_s=0.5), PhaseLimits(0.0, 0.0), slow)
    with pytest.raises(LimitViolation) as caught:
        require_joint_limits(reaches(velocity_max_rad_s=0.55), PhaseLimits(0.0, 0.0), slow)
    assert caught.value.quantity == "following error"
    assert caught.value.value == pytest.approx(1.1 * caught.value.bound)


@pytest.mark.parametrize(
    ("constraints", "quantity"),
    [
        (limited(position_max_rad=1.2), "position"),
        (limited(position_min_rad=1.2), "position"),
        (limited(velocity_max_rad_s=0.2), "velocity"),
        (limited(acceleration_max_rad_s2=1.0), "acceleration"),
        (limited(jerk_max_rad_s3=3.0), "jerk"),
        (replace(CONSTRAINTS, following_speed_rad_s=np.full(N, 0.2)), "following error"),
    ],
)
def test_a_path_beyond_a_joints_limit_is_refused(constraints, quantity):
    checked()
    with pytest.raises(LimitViolation) as caught:
        checked(constraints)
    assert caught.value.quantity == quantity
    if constraints.following_speed_rad_s is CONSTRAINTS.following_speed_rad_s:
        assert caught.value.joint == LIMITS.joint_names[JOINT]


@pytest.mark.parametrize(
    ("too_steep", "quantity"), [(PhaseLimits(20.0, 20.0), "acceleration"), (PhaseLimits(2.0, 1e4), "jerk")]
)
def test_a_plan_with_ramps_too_steep_for_a_joint_is_refused(monkeypatch, too_steep, quantity):
    """The planning of ramps keeps the limits by itself; here it does not, as from a defect."""
    monkeypatch.setattr(setpoints, "bound_phase", lambda path, limits: too_steep)
    with pytest.raises(LimitViolation) as caught:
        checked(replace(CONSTRAINTS, torque=None))
    assert caught.value.quantity == quantity


def test_a_path_of_another_arm_is_refused():
    with pytest.raises(
        ConfigurationError, match=r"my\.toml: excitation\.probe is 'a path of 2 joints': one of this arm's 6"
    ):
        checked(trajectory=FourierTrajectory(0.5, np.zeros(2), np.zeros((2, 1)), np.zeros((2, 1))))


# Torque ---------------------------------------------------------------------------------------------------------


def with_torque(share):
    """The constraints with a share of the torque that the path needs at constant speed."""
    steady = CONSTRAINTS.torque.greatest(SWING).reshape(CONSTRAINTS.torque.cases, N).max(axis=0)
    available = CONSTRAINTS.torque.available_nm.copy()
    available[JOINT] = share * steady[JOINT]
    return replace(CONSTRAINTS, torque=replace(CONSTRAINTS.torque, available_nm=available))


def test_a_path_that_a_joint_is_too_weak_for_is_refused():
    with pytest.raises(ConfigurationError, match=rf"excitation\.probe.*N m of {LIMITS.joint_names[JOINT]}, which has"):
        checked(with_torque(0.95))


@pytest.mark.parametrize("direction", [1.0, -1.0], ids=["forwards", "backwards"])
def test_the_torque_of_ramps_and_stops_counts_too(direction):
    """At constant speed the joint is strong enough; while the phase accelerates or decelerates it is not."""
    path = replace(SWING, sin_rad=direction * SWING.sin_rad)
    enough = with_torque(1.0005)
    assert torque_objection(path, PhaseLimits(0.0, 0.0), enough) is None
    with pytest.raises(ConfigurationError, match="N m of"):
        checked(enough, path)
    checked(with_torque(2.0), path)


HANGING = FourierTrajectory(
    0.4, np.array([0.0, 1.2, -1.2, 0.0, 0.0, 0.0]), 0.3 * np.eye(N)[:, [JOINT]], np.zeros((N, 1))
)
"""The forearm swings like a pendulum: where gravity's torque is greatest, the path's acceleration reduces it."""
SMOOTH = replace(CONSTRAINTS.torque.body, viscous_nm_s_rad=0.5 * CONSTRAINTS.torque.body.viscous_nm_s_rad)


@pytest.mark.parametrize(
    ("trajectory", "torque", "governing"),
    [
        (SWING, CONSTRAINTS.torque, lambda rate: rate == 1.0),
        (HANGING, replace(CONSTRAINTS.torque, body=SMOOTH), lambda rate: 0.0 < rate < 0.3),
    ],
    ids=["at full rate", "near standstill"],
)
def test_arm_and_heaviest_payload_and_both_directions_of_a_ramp_count(trajectory, torque, governing):
    """Compared with the sum at dense phases and rates, with the phase accelerating and decelerating, loaded and empty.

    On the hanging forearm ramps begin and end with more torque than they have anywhere at full rate.
    """
    path = checked(replace(CONSTRAINTS, obstacles=FREE, torque=None), trajectory)
    alpha = path.measured.leg.bounds.acceleration_1_s
    state = trajectory.evaluate(np.arange(0.0, trajectory.period_s, 1e-3))
    q, v, a = state.position_rad, state.velocity_rad_s, state.acceleration_rad_s2
    needed = {}
    for rate in (0.0, 0.1, 0.25, 0.5, 1.0):
        demand = [torque.demand(q, rate * v, rate**2 * a + ramp * v).max(axis=0) for ramp in (-alpha, alpha)]
        needed[rate] = np.max(demand, axis=0).reshape(torque.cases, N).max(axis=0)[JOINT]
    worst = max(needed, key=needed.get)
    assert governing(worst)
    for share, refused in ((0.9995, True), (1.01, False)):
        available = torque.available_nm.copy()
        available[JOINT] = share * needed[worst]
        changed = replace(CONSTRAINTS, torque=replace(torque, available_nm=available))
        assert (torque_objection(trajectory, path.measured.leg.bounds, changed) is not None) is refused


def coupled_axes(share):
    """The constraints with a motor that turns two joints and has a share of the torque that the path needs from it."""
    coupling = np.eye(N)
    coupling[JOINT, JOINT - 1] = 0.5
    loose = replace(CONSTRAINTS.torque, coupling=coupling, available_nm=np.full(N, 1e4))
    available = loose.available_nm.copy()
    available[JOINT - 1] = share * loose.greatest(SWING).reshape(loose.cases, N).max(axis=0)[JOINT - 1]
    return replace(CONSTRAINTS, axis_torque=replace(loose, available_nm=available))


def test_a_path_that_a_coupled_motor_is_too_weak_for_is_refused():
    """Every joint is strong enough by itself, but two of them together need more than their common motor has."""
    checked()
    weak = LIMITS.joint_names[JOINT - 1]
    with pytest.raises(ConfigurationError, match=rf"excitation\.probe.*N m of the motor of {weak}, which has"):
        checked(coupled_axes(0.95))
    with pytest.raises(BlockedWay, match=f"at its present position, requires .* N m of the motor of {weak}"):
        checked(coupled_axes(2.0)).approach_from(STANDING)


# Obstacles ------------------------------------------------------------------------------------------------------


def test_a_path_in_the_floor_is_refused():
    probe = replace(SWING, offset_rad=np.array([0.0, 2.2, 0.3, 0.0, 0.5, 0.0]))
    with pytest.raises(
        ConfigurationError, match=r"excitation\.probe is \"a path that brings the tool within -0\.2\d+ m of 'floor'\""
    ):
        checked(trajectory=probe)
    checked(replace(CONSTRAINTS, obstacles=FREE), probe)


def test_a_path_on_which_meshes_come_too_close_is_refused():
    with pytest.raises(ConfigurationError, match=r"brings hand to table \(meshes\) within 0\.040 m"):
        checked(replace(CONSTRAINTS, obstacles=Obstacles(FREE.workspace, CloseMeshes(on_path_m=0.04))))
    checked(replace(CONSTRAINTS, obstacles=Obstacles(FREE.workspace, CloseMeshes(on_path_m=0.05))))


# The way onto a path --------------------------------------------------------------------------------------------


def test_the_way_is_straight_from_where_the_arm_stands():
    (stretch,) = checked().approach_from(STANDING)
    leg = stretch.leg
    assert isinstance(leg.path, LinePath)
    plan = plan_leg(leg, CYCLE_S)
    np.testing.assert_allclose(plan.position_rad[[0, -1]], [STANDING, checked().start_rad], atol=1e-9)


def test_there_is_no_way_where_the_arm_stands_already():
    path = checked()
    assert path.approach_from(path.start_rad + 1e-12) == ()


def test_an_arm_that_stands_beyond_its_limits_is_not_moved():
    beyond = STANDING.copy()
    least_rad = LIMITS.position_min_rad[JOINT]
    beyond[JOINT] = least_rad - 0.01
    with pytest.raises(BeyondLimit) as caught:
        checked().approach_from(beyond)
    said = caught.value
    assert said.joint == LIMITS.joint_names[JOINT]
    assert str(said) == f"{said.joint} stands at {beyond[JOINT]:.4f} rad, beyond its limit of {least_rad:.4f} rad"


def test_an_arm_that_gave_way_beyond_its_limits_is_not_moved_back():
    path = checked(limited(position_min_rad=checked().measured.leg.path.bounds().position_min_rad[JOINT]))
    stood = STANDING.copy()
    stood[JOINT] = path.constraints.limits.position_min_rad[JOINT]
    sagged = stood.copy()
    sagged[JOINT] -= 0.5 * SAG_RAD
    with pytest.raises(BeyondLimit, match=f"{LIMITS.joint_names[JOINT]} stands at "):
        path.back_to(stood, sagged)


def test_that_it_stands_beyond_its_limits_is_said_before_any_way_is_looked_for():
    beyond = STANDING.copy()
    beyond[JOINT] = LIMITS.position_min_rad[JOINT] - 0.01
    blocked = Obstacles(FREE.workspace, CloseMeshes(on_line_m=0.01))
    with pytest.raises(BeyondLimit, match=f"{LIMITS.joint_names[JOINT]} stands at "):
        checked(replace(CONSTRAINTS, obstacles=blocked)).approach_from(beyond)


def with_a_lagging_servo():
    """A path with little motion, on an arm whose last servo reaches its following-error window at 0.1 rad/s."""
    following = np.full(N, np.inf)
    following[5] = 0.1
    small = replace(SWING, sin_rad=0.01 * SWING.sin_rad, cos_rad=0.01 * SWING.cos_rad)
    return checked(replace(CONSTRAINTS, following_speed_rad_s=following), small)


def test_a_way_on_which_a_servo_would_lag_too_far_is_not_gone():
    path = with_a_lagging_servo()
    far = path.start_rad.copy()
    far[5] += 2.0
    with pytest.raises(LimitViolation, match=f"{LIMITS.joint_names[5]}: following error"):
        path.approach_from(far)


def test_a_way_back_on_which_a_servo_would_lag_too_far_is_not_gone():
    path = with_a_lagging_servo()
    sagged = path.start_rad.copy()
    sagged[5] += 0.9 * SAG_RAD
    with pytest.raises(LimitViolation, match=f"{LIMITS.joint_names[5]}: following error"):
        path.back_to(path.start_rad, sagged)


def test_a_way_that_a_joint_is_too_weak_for_is_not_gone():
    available = CONSTRAINTS.torque.available_nm.copy()
    available[1] = 60.0  # gravity takes 10 N m on the path and 87 N m where the arm stands
    weak = replace(CONSTRAINTS, torque=replace(CONSTRAINTS.torque, available_nm=available))
    with pytest.raises(
        BlockedWay, match=rf"at its present position, requires .* N m of {LIMITS.joint_names[1]}, which has 60 N m"
    ):
        checked(weak).approach_from(STANDING)


REACHING = replace(SWING, offset_rad=np.array([0.0, 1.0, 0.0, 0.0, 0.0, 0.0]))
TURNED = np.array([np.pi - 0.6, 0.0, 0.0, 0.0, 0.0, 0.0])
TOOL = Sphere(N + 1, np.zeros(3), 0.02)


def tool_at(configuration):
    return ROBOT.chain.forward(configuration)[-1][:3, 3]


def test_where_the_straight_way_is_not_free_the_arm_goes_round():
    """The path and the arm's position are clear of the wall; only the straight way between them is not."""
    start = checked(trajectory=REACHING).start_rad
    standing = start + TURNED
    positions = [tool_at(start + share * TURNED) for share in (0.0, 0.5, 1.0)]
    away = positions[1] - 0.5 * (positions[0] + positions[2])
    normal = -away / np.linalg.norm(away)
    wall = HalfSpace("wall", normal, normal @ positions[1] + 0.05, (N + 1,))
    walled = replace(CONSTRAINTS, obstacles=Obstacles(Workspace(ROBOT.chain, (TOOL,), (wall,))))
    path = checked(walled, REACHING)
    assert len(path.approach_from(start + 0.01)) == 1
    legs = path.approach_from(standing)
    assert 2 <= len(legs) <= 4
    plans = [plan_leg(stretch.leg, CYCLE_S) for stretch in legs]
    way = np.vstack([plan.position_rad for plan in plans])
    np.testing.assert_allclose(way[[0, -1]], [standing, start], atol=1e-9)
    assert np.abs(np.diff(way, axis=0)).max() <= LIMITS.velocity_max_rad_s.max() * CYCLE_S
    assert min(normal @ tool_at(q) for q in way) > wall.offset_m + TOOL.radius_m
    assert all(plan.velocity_rad_s[[0, -1]] == pytest.approx(0.0, abs=1e-9) for plan in plans)
    again = path.approach_from(standing)
    assert [stretch.leg.path.goal_rad.tolist() for stretch in again] == [s.leg.path.goal_rad.tolist() for s in legs]


def test_where_no_way_is_free_the_refusal_says_what_is_in_it():
    """A slab through the base that the tool must cross on any way."""
    start = checked(trajectory=REACHING).start_rad
    across = tool_at(start + 0.5 * TURNED) * [1.0, 1.0, 0.0]
    slab = Box(
        "slab",
        pose_from_xyz_rpy([0.0, 0.0, 0.0], [0.0, 0.0, np.arctan2(across[1], across[0])]),
        np.array([9.0, 0.05, 9.0]),
        (N + 1,),
    )
    path = checked(replace(CONSTRAINTS, obstacles=Obstacles(Workspace(ROBOT.chain, (TOOL,), (), (slab,)))), REACHING)
    with pytest.raises(BlockedWay, match=r"straight path brings the tool within -0\.\d+ m of 'slab'.*no path round it"):
        path.approach_from(start + TURNED)


def test_an_arm_that_stands_in_an_obstacle_is_not_moved():
    start = checked(trajectory=REACHING).start_rad
    standing = start + TURNED
    box = Box("crate", pose_from_xyz_rpy(tool_at(standing), [0.0, 0.0, 0.0]), np.full(3, 0.1), (N + 1,))
    path = checked(replace(CONSTRAINTS, obstacles=Obstacles(Workspace(ROBOT.chain, (TOOL,), (), (box,)))), REACHING)
    with pytest.raises(
        BlockedWay, match=r"the arm, at its present position, brings the tool within -0\.\d+ m of 'crate'"
    ):
        path.approach_from(standing)


# Speed ----------------------------------------------------------------------------------------------------------


def reaching_points(tool_m=0.2):
    return replace(CONSTRAINTS, points=ArmPoints(ROBOT.chain, np.array([0.0, 0.0, tool_m])))


def test_no_point_of_the_arm_is_fast_on_the_slow_round_and_on_the_way_to_it():
    constraints = reaching_points()
    trajectory = ROBOT.excitations["identification"].trajectory
    path = check_path(Excitation(trajectory, 2), constraints, CYCLE_S, file="my.toml", key="probe")
    for stretch in (path.slow, *path.approach_from(STANDING)):
        plan = plan_leg(stretch.leg, CYCLE_S)
        assert constraints.points.speeds(plan.position_rad, plan.velocity_rad_s).max() <= 0.245 + 1e-9
    assert path.slow_speed_m_s == pytest.approx(0.245, abs=1e-3)
    assert path.slow_round_s < 60.0


def test_a_leg_faster_than_reduced_speed_is_not_passed():
    path = checked()
    with pytest.raises(LimitViolation, match=r"speed 0\.\d+ m/s is beyond the limit of 0\.2500 m/s"):
        require_reduced_speed(path.measured.leg, SpeedLimit(ArmPoints(ROBOT.chain, np.array([0.0, 0.0, 0.5])), 0.25))


def test_a_speed_limit_of_the_file_below_reduced_speed_holds_on_the_approach_too():
    trajectory = ROBOT.excitations["identification"].trajectory
    gentle = FourierTrajectory(
        trajectory.base_frequency_hz, trajectory.offset_rad, 0.01 * trajectory.sin_rad, 0.01 * trajectory.cos_rad
    )
    slow = replace(reaching_points(), speed=SpeedLimit(reaching_points().points, 0.05))
    path = check_path(Excitation(gentle, 2), slow, CYCLE_S, file="my.toml", key="probe")
    sagged = path.back_to(STANDING, STANDING + 0.009)
    assert sagged is not None
    for stretch in (path.slow, path.measured, sagged, *path.approach_from(STANDING)):
        plan = plan_leg(stretch.leg, CYCLE_S)
        assert slow.points.speeds(plan.position_rad, plan.velocity_rad_s).max() <= 0.05


def test_a_low_speed_limit_of_the_file_leaves_room_for_a_slow_round_with_what_is_carried():
    """What is carried may be faster than the arm's own points, which the file limits at full speed."""
    swing = FourierTrajectory(0.2, SWING.offset_rad, SWING.sin_rad, SWING.cos_rad)
    own_m_s = 1.01 * float(ROBOT.limits.points.greatest_on(swing).max())
    carrying = ArmPoints(ROBOT.chain, np.zeros(3), (CarriedSphere("payload", np.array([0.0, 0.0, 0.3]), 3.0),))
    assert 0.25 * carrying.greatest_on(swing).max() > own_m_s
    path = checked(replace(CONSTRAINTS, points=carrying, speed=SpeedLimit(ROBOT.limits.points, own_m_s)), swing)
    assert path.slow_speed_m_s <= 0.98 * own_m_s


class Underestimated(ArmPoints):
    """Points that the planning takes as standing still, as from a defect."""

    def greatest_between(self, motion, rates, duration_s, samples):
        return np.zeros((samples, len(self.names)))


def test_a_plan_that_takes_the_arm_for_slower_than_it_is_is_refused():
    trajectory = ROBOT.excitations["identification"].trajectory
    honest = ArmPoints(ROBOT.chain, np.array([0.0, 0.0, 0.2]))
    wrong = replace(CONSTRAINTS, points=Underestimated(ROBOT.chain, honest.tool_m))
    with pytest.raises(
        LimitViolation, match=r"tool centre point: speed 0\.4\d+ m/s is beyond the limit of 0\.2500 m/s"
    ):
        check_path(Excitation(trajectory, 2), wrong, CYCLE_S, file="my.toml", key="probe")
    with pytest.raises(LimitViolation, match=r"speed 0\.\d+ m/s is beyond the limit of 0\.2500 m/s"):
        checked(replace(wrong, points=Underestimated(ROBOT.chain, 4.0 * honest.tool_m))).approach_from(STANDING)


def test_a_path_faster_than_the_file_allows_is_refused():
    points = ROBOT.limits.points
    fastest = float(points.greatest_on(SWING).max())
    checked(replace(CONSTRAINTS, speed=SpeedLimit(points, 1.001 * fastest)))
    with pytest.raises(LimitViolation, match=r"joint 6: speed .* is beyond the limit"):
        checked(replace(CONSTRAINTS, speed=SpeedLimit(points, 0.99 * fastest)))


def test_a_way_on_which_meshes_come_too_close_is_not_gone():
    path = checked(replace(CONSTRAINTS, obstacles=Obstacles(FREE.workspace, CloseMeshes(on_line_m=0.04))))
    with pytest.raises(BlockedWay, match=r"straight path brings hand to table \(meshes\) within 0\.040 m"):
        path.approach_from(STANDING)
