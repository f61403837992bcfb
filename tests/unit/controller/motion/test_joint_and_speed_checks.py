"""The checks of a path by hand: rates with ramps, following error, torque and speed, on both sides of each limit."""

from contextlib import nullcontext
from types import SimpleNamespace

import numpy as np
import pytest

from armload_controller.motion.joint_and_speed_checks import (
    greatest_speed_m_s,
    require_joint_limits,
    require_reduced_speed,
    require_tcp_speed,
    torque_objection,
)
from armload_controller.motion.joint_limits import LimitViolation, MotionLimits
from armload_controller.motion.paths import LinePath, PhaseLimits
from armload_identification.excitation.fourier import FourierBounds

V, A, J, ALPHA, BETA = 2.0, 3.0, 7.0, 0.5, 0.25
"""Greatest derivatives of a path to its phase, and limits of the phase's."""


def checked(**changes):
    """Check a path of joint b at limits that it reaches exactly, with changes."""
    given = {
        "position_min_rad": -1.0, "position_max_rad": 1.0, "velocity_max_rad_s": V,
        "acceleration_max_rad_s2": A + V * ALPHA, "jerk_max_rad_s3": J + 3.0 * A * ALPHA + V * BETA,
        "following_error_rad": 0.1, "lag_s": 0.05,
    } | changes  # fmt: skip
    lag_s = given.pop("lag_s")
    sign = {"position_min_rad": -1.0}
    own = {name: np.array([sign.get(name, 1.0) * 99.0, value]) for name, value in given.items()}
    limits = MotionLimits(joint_names=("a", "b"), **own)
    following = own["following_error_rad"] / lag_s
    reach = FourierBounds(*(np.array([0.0, value]) for value in (-1.0, 1.0, V, A, J)))
    require_joint_limits(
        reach, PhaseLimits(ALPHA, BETA), SimpleNamespace(limits=limits, following_speed_rad_s=following)
    )


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({}, None),
        ({"position_max_rad": 0.99}, r"b: position 1\.0000 rad is beyond the limit of 0\.9900"),
        ({"position_min_rad": -0.99}, r"b: position -1\.0000 rad is beyond the limit of -0\.9900"),
        ({"velocity_max_rad_s": 1.99}, r"b: velocity 2\.0000 rad/s is beyond the limit of 1\.9900"),
        ({"acceleration_max_rad_s2": 3.99}, r"b: acceleration 4\.0000 rad/s2 is beyond the limit of 3\.9900"),
        ({"jerk_max_rad_s3": 11.99}, r"b: jerk 12\.0000 rad/s3 is beyond the limit of 11\.9900"),
        ({"lag_s": 0.0501}, r"b: following error 0\.1002 rad is beyond the limit of 0\.1000"),
    ],
)
def test_ramps_take_their_part_of_every_limit(changes, said):
    """a + v alpha = 4, j + 3 a alpha + v beta = 12, v lag = 0.1."""
    with pytest.raises(LimitViolation, match=said) if said else nullcontext():
        checked(**changes)


class Points:
    """Two points, the second at a lever of 0.5 m of the only joint."""

    names = ("wrist", "flange")

    def speeds(self, position_rad, velocity_rad_s):
        assert len(position_rad) == 2048
        return np.abs(velocity_rad_s) * [0.1, 0.5]

    def greatest_on(self, path):
        return np.array([0.1, 0.5]) * path


def leg(rate=1.0):
    path = LinePath(np.zeros(1), np.ones(1), 2.0)
    return SimpleNamespace(path=path, start_s=0.0, end_s=2.0, rate=rate)


def test_the_fastest_point_of_a_leg_is_named():
    assert greatest_speed_m_s(leg(), Points()) == pytest.approx(0.25)
    assert greatest_speed_m_s(leg(0.5), Points()) == pytest.approx(0.125)
    require_reduced_speed(leg(), SimpleNamespace(points=Points(), speed_m_s=0.25))
    with pytest.raises(LimitViolation, match=r"^flange: speed 0\.2500 m/s is beyond the limit of 0\.2490"):
        require_reduced_speed(leg(), SimpleNamespace(points=Points(), speed_m_s=0.249))


def test_a_path_is_limited_in_speed_if_the_file_says_so():
    require_tcp_speed(3.0, SimpleNamespace(speed=None))
    require_tcp_speed(3.0, SimpleNamespace(speed=SimpleNamespace(points=Points(), speed_m_s=1.5)))
    with pytest.raises(LimitViolation, match=r"^flange: speed 1\.5000 m/s is beyond the limit of 1\.4900"):
        require_tcp_speed(3.0, SimpleNamespace(speed=SimpleNamespace(points=Points(), speed_m_s=1.49)))


class Torque:
    """A joint of inertia 8 kg m2 that carries 10 N m, with friction of 4 N m s/rad; two cases, the second doubled."""

    cases = 2

    def __init__(self, available_nm):
        self.available_nm = np.array([available_nm])
        self.samples = []

    def demand(self, q, v, a):
        self.samples.append(len(q))
        one = np.abs(10.0 + 8.0 * a) + 4.0 * np.abs(v)
        return np.hstack([one, 2.0 * one])

    def friction(self, v):
        return np.hstack([4.0 * np.abs(v), 8.0 * np.abs(v)])


@pytest.mark.parametrize(
    ("alpha", "needed_nm"),
    [(0.5, 2.0 * (10.0 + 8.0 * 0.25 + 4.0 * 0.5)), (0.0, 2.0 * (10.0 + 4.0 * 0.5))],
)
def test_a_line_needs_the_torque_of_its_steepest_ramp_at_full_speed_in_the_worst_case(alpha, needed_nm):
    """0.5 rad/s, and 0.5 alpha rad/s2."""
    line, limits = LinePath(np.zeros(1), np.ones(1), 2.0), SimpleNamespace(joint_names=("elbow",))

    def objection(axis=None, **torque):
        constraints = SimpleNamespace(limits=limits, torque=torque.get("joint"), axis_torque=axis)
        return torque_objection(line, PhaseLimits(alpha, 1.0), constraints)

    enough, lacking = Torque(needed_nm), Torque(needed_nm - 0.1)
    assert objection(joint=enough, axis=enough) is None
    assert objection() is None
    assert set(enough.samples) == {102}, "a sample every 10 mrad, and the ends"
    assert objection(joint=lacking).startswith(f"requires {needed_nm:.0f} N m of elbow, which has")
    assert objection(joint=enough, axis=lacking).startswith(f"requires {needed_nm:.0f} N m of the motor of elbow")
