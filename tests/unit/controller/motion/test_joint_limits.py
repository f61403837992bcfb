"""The check of setpoints."""

from dataclasses import replace

import numpy as np
import pytest

from armload_controller.motion.joint_limits import (
    BeyondLimit,
    LimitViolation,
    MotionLimits,
    check_setpoints,
    require_within,
)

LIMITS = MotionLimits(
    joint_names=("base", "elbow"),
    position_min_rad=np.array([-1.0, -2.0]),
    position_max_rad=np.array([1.0, 2.0]),
    velocity_max_rad_s=np.array([0.5, 0.6]),
    acceleration_max_rad_s2=np.array([3.0, 4.0]),
    jerk_max_rad_s3=np.array([30.0, 40.0]),
    following_error_rad=np.array([0.1, 0.1]),
)
REST = np.zeros(2)


def test_limits_themselves_are_allowed():
    check_setpoints(LIMITS.position_max_rad, LIMITS.velocity_max_rad_s, LIMITS.acceleration_max_rad_s2, LIMITS)
    check_setpoints(LIMITS.position_min_rad, -LIMITS.velocity_max_rad_s, -LIMITS.acceleration_max_rad_s2, LIMITS)


@pytest.mark.parametrize(
    ("quantity", "position", "velocity", "acceleration", "value", "bound"),
    [
        ("position", [0.0, 2.1], REST, REST, 2.1, 2.0),
        ("position", [0.0, -2.1], REST, REST, -2.1, -2.0),
        ("velocity", REST, [0.0, -0.7], REST, 0.7, 0.6),
        ("acceleration", REST, REST, [0.0, 5.0], 5.0, 4.0),
        ("acceleration", REST, REST, [0.0, -5.0], 5.0, 4.0),
    ],
)
def test_violation_names_joint_quantity_value_and_bound(quantity, position, velocity, acceleration, value, bound):
    with pytest.raises(LimitViolation) as caught:
        check_setpoints(np.array(position), np.array(velocity), np.array(acceleration), LIMITS)
    error = caught.value
    assert (error.joint, error.quantity) == ("elbow", quantity)
    assert error.value == pytest.approx(value)
    assert error.bound == pytest.approx(bound)
    assert "elbow" in str(error)
    assert f"{value:.4f}" in str(error)


@pytest.mark.parametrize("where", range(3))
def test_nan_is_refused(where):
    states = [np.zeros((4, 2)) for _ in range(3)]
    states[where][2, 1] = np.nan
    with pytest.raises(LimitViolation) as caught:
        check_setpoints(*states, LIMITS)
    assert caught.value.joint == "elbow"


def test_one_bad_row_of_a_plan_is_found():
    position = np.zeros((100, 2))
    position[57, 0] = -1.001
    with pytest.raises(LimitViolation, match=r"base: position -1\.0010 rad"):
        check_setpoints(position, np.zeros_like(position), np.zeros_like(position), LIMITS)


@pytest.mark.parametrize("range_rad", [1e-6, 1.0, 1e4])
def test_rounding_beyond_a_position_limit_is_a_share_of_the_range(range_rad):
    """A fixed tolerance in radians would be a tenth of a small range, and below the rounding error of a large one."""
    limits = replace(LIMITS, position_min_rad=np.full(2, 0.0), position_max_rad=np.full(2, range_rad))
    for bound, outwards in ((0.0, -1.0), (range_rad, 1.0)):
        check_setpoints(np.full(2, bound + outwards * 0.5e-9 * range_rad), REST, REST, limits)
        with pytest.raises(LimitViolation) as caught:
            check_setpoints(np.full(2, bound + outwards * 2e-9 * range_rad), REST, REST, limits)
        assert (caught.value.quantity, caught.value.bound) == ("position", bound)


def test_what_rounding_explains_is_not_named_in_place_of_what_breaks_a_limit():
    with pytest.raises(LimitViolation, match="elbow: velocity"):
        check_setpoints(np.array([1.0 + 1e-10, 0.0]), np.array([0.0, 0.7]), REST, LIMITS)


def test_an_arm_that_stands_beyond_a_limit_is_named_with_both():
    require_within(np.array([1.0, -2.0]), LIMITS)
    with pytest.raises(BeyondLimit, match=r"^elbow stands at -2\.5000 rad, beyond its limit of -2\.0000 rad") as caught:
        require_within(np.array([1.1, -2.5]), LIMITS)
    assert caught.value.joint == "elbow"


def test_excess_is_the_distance_beyond_a_limit_on_either_side():
    found = LIMITS.excess(np.array([[[1.5, -2.5]], [[-0.6, 0.5]], [[0.0, -4.5]]]))
    np.testing.assert_allclose(found, [[[0.5, 0.5]], [[0.1, -0.1]], [[-3.0, 0.5]]], atol=1e-7)
