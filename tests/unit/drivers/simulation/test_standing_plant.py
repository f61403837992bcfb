"""The plant of drives that are only asked: nothing moves."""

import numpy as np
import pytest

from armload_drivers.simulation.plant_interface import StandingPlant

pytestmark = pytest.mark.pure


def test_it_stands_whatever_is_commanded():
    start = np.array([0.5, -1.0])
    plant = StandingPlant(start)
    plant.set_powered(0, True)
    plant.set_target(0, 2.0, 0.01)
    plant.slow_down(1, 0.1)
    plant.set_torque_offset(0, 3.0)
    plant.keep_braked(1, True)
    plant.hold_by_brake(1)
    plant.advance(1.0)
    assert [plant.hold_position(axis) for axis in (0, 1)] == [0.5, -1.0]
    sample = plant.sample(0.01)
    np.testing.assert_array_equal(sample.axis_position_rad, start)
    np.testing.assert_array_equal(sample.axis_demand_rad, start)
    assert not sample.axis_velocity_rad_s.any()
    assert not sample.axis_torque_nm.any()
