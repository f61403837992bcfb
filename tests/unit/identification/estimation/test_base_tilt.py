"""Directions in which gravity tilts, and the torque of one rad of tilt."""

import numpy as np
import pytest

from armload_identification.estimation.base_tilt import sideways, tilt_axes

pytestmark = pytest.mark.pure


@pytest.mark.parametrize(
    "gravity", [[0.0, 0.0, -9.81], [0.0, 9.81, 0.0], [-9.81, 0.0, 0.0], [3.0, -4.0, 8.0], [9.8, 0.1, 0.1]]
)
def test_two_orthogonal_unit_vectors_across_gravity(gravity):
    axes = tilt_axes(np.array(gravity))
    np.testing.assert_allclose(axes @ axes.T, np.eye(2), atol=1e-12)
    np.testing.assert_allclose(axes @ np.array(gravity), 0.0, atol=1e-12)
    np.testing.assert_allclose(np.cross(gravity, axes[0]) / np.linalg.norm(gravity), axes[1], atol=1e-12)


def test_gravity_along_each_axis_is_the_change_of_a_small_tilt(pinocchio_arm):
    chain = pinocchio_arm.chain
    size = np.linalg.norm(chain.gravity_m_s2)
    across = sideways(chain)
    for part, axis in zip(across, tilt_axes(chain.gravity_m_s2), strict=True):
        np.testing.assert_allclose(part.gravity_m_s2, size * axis)
        np.testing.assert_array_equal(part.placement, chain.placement)
        np.testing.assert_array_equal(part.flange, chain.flange)
    assert sideways(chain) is across
