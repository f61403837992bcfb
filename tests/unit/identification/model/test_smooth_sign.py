"""The smoothed sign of a speed."""

import numpy as np
import pytest

from armload_identification.model.smooth_sign import smooth_sign

pytestmark = pytest.mark.pure


def test_it_is_the_hyperbolic_tangent_of_the_speed_by_each_joints_own():
    sign = smooth_sign(np.array([[0.0, 0.1], [-0.05, 9.0]]), np.array([0.1, 0.2]))
    assert sign == pytest.approx(np.array([[0.0, 0.46211716], [-0.46211716, 1.0]]))
