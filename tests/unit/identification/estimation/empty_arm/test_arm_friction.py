"""Friction of an arm as one number per joint."""

from types import SimpleNamespace

import numpy as np
import pytest

from armload_identification.estimation.empty_arm.arm_friction import ArmFriction

pytestmark = pytest.mark.pure

BODY = SimpleNamespace(
    n=2, coulomb_nm=np.array([4.0, 1.0]), root_nm=np.array([3.0, 0.0]), viscous_nm_s_rad=np.array([2.0, 8.0])
)
VELOCITY_RAD_S = np.array([[0.1, 0.2], [-0.5, 1.0], [0.3, -0.8]])


@pytest.mark.parametrize(
    ("change", "torque_nm"),
    [
        (None, [4.0 + 3.0 * 0.5 + 2.0 * 0.25, 1.0 + 8.0 * 0.5]),
        (np.array([[0.5, -0.5], [4.0, -2.0]]), [4.5 + 3.0 * 0.5 + 6.0 * 0.25, 0.5 + 6.0 * 0.5]),
    ],
)
def test_it_is_that_at_half_of_the_greatest_speed_in_either_direction(change, torque_nm):
    found = ArmFriction.of(BODY, VELOCITY_RAD_S, change)
    np.testing.assert_allclose(found.speed_rad_s, [0.25, 0.5])
    np.testing.assert_allclose(found.torque_nm, torque_nm)
