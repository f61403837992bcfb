"""Friction of an arm as one number per joint."""

from types import SimpleNamespace

import numpy as np
import pytest

from armload_identification.estimation.empty_arm.arm_friction import ArmFriction
from armload_identification.model.body_model import BodyModel

pytestmark = pytest.mark.pure

BODY = SimpleNamespace(
    coulomb_nm=np.array([4.0, 1.0]), root_nm=np.array([3.0, 0.0]), viscous_nm_s_rad=np.array([2.0, 8.0])
)
BODY.unloaded_friction = lambda speed: BodyModel.unloaded_friction(BODY, speed)
VELOCITY_RAD_S = np.array([[0.1, 0.2], [-0.5, 1.0], [0.3, -0.8]])


def test_it_is_that_at_half_of_the_greatest_speed_in_either_direction():
    found = ArmFriction.of(BODY, VELOCITY_RAD_S)
    np.testing.assert_allclose(found.speed_rad_s, [0.25, 0.5])
    np.testing.assert_allclose(found.torque_nm, [4.0 + 3.0 * 0.5 + 2.0 * 0.25, 1.0 + 8.0 * 0.5])
