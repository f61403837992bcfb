"""The plant that follows exactly: a single axis has the same position as in the vector of all."""

import numpy as np
import pytest

from tests.ideal_plant import IdealPlant


@pytest.mark.parametrize("time_s", [0.0, 0.25, 1.0, 1.5])
def test_one_axis_is_where_it_is_among_all(time_s):
    plant = IdealPlant(np.array([0.3, -0.2, 1.0]))
    for axis, (target_rad, over_s) in enumerate([(1.3, 1.0), (0.4, 0.5)]):
        plant.set_powered(axis, True)
        plant.set_target(axis, target_rad, over_s)
    plant.advance(time_s)
    np.testing.assert_array_equal([plant.hold_position(axis) for axis in range(3)], plant.position_rad)
    assert plant.position_rad[2] == 1.0
    assert plant.hold_position(0) == pytest.approx(0.3 + min(time_s, 1.0))
