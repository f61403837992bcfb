"""The error for an axis that is not held without torque."""

from dataclasses import replace

import pytest

from armload_drivers.cia402.axis_brakes import axis_moves

HELD_RAD, HOLDING_WATCH_S, STANDSTILL_RAD_S = 0.01, 0.2, 0.005

pytestmark = pytest.mark.pure


@pytest.mark.parametrize(("has_brake", "why"), [(True, "its brake does not hold it"), (False, "it has no brake")])
def test_an_axis_that_is_not_held_is_named_with_its_way_and_why(arm_settings, has_brake, why):
    error = axis_moves(replace(arm_settings().drives[1], has_brake=has_brake), 0.0523)
    assert (error.node_id, error.joint) == (3, "joint_3")
    assert f"moved by 0.052 rad within {HOLDING_WATCH_S} s of losing its torque: {why}" in str(error)


def test_a_gripped_finger_is_noticed_before_it_is_hurt_and_rest_is_less_than_what_is_not_held():
    """At one metre, 0.01 rad is a centimetre; what counts as rest may not add up to it while axes are watched."""
    assert STANDSTILL_RAD_S * HOLDING_WATCH_S < 0.2 * HELD_RAD
    assert HELD_RAD * 1.0 <= 0.01
