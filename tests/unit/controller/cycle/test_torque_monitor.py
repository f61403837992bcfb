"""The torque of feedbacks: filter, window, and their edges."""

from types import SimpleNamespace

import numpy as np
import pytest

from armload_controller.cycle.torque_monitor import TorqueError, TorqueWindow, measured_torque
from armload_identification.signals.joint_torque import Transmission

PLAIN = Transmission(np.ones(2), np.eye(2))


def measured(torque_nm, *, moves=True):
    feedback = SimpleNamespace(torque_nm=np.array(torque_nm), current_a=None, position_rad=np.zeros(2))
    reference = SimpleNamespace(position_rad=0, velocity_rad_s=0, acceleration_rad_s2=0)
    return SimpleNamespace(feedback=feedback, sent_reference=reference if moves else None)


def test_torque_is_filtered_over_20_ms_and_may_be_the_greatest_one():
    """Cycles of 20 ms: half of each change passes."""
    window = TorqueWindow(("a", "b"), PLAIN, np.array([10.0, 20.0]), 0.02, None)
    window.on_cycle(measured([20.0, -40.0]))
    window.on_cycle(measured([10.0, -20.0]))
    with pytest.raises(TorqueError, match=r"^b: -20\.5 N m measured, -20\.0 to 20\.0 N m expected"):
        window.on_cycle(measured([10.0, -21.0]))
    window.on_cycle(measured([99.0, 99.0], moves=False))
    window.on_cycle(measured([20.0, 0.0]))
    with pytest.raises(TorqueError, match=r"^a: 10\.5 N m measured, -10\.0 to 10\.0"):
        window.on_cycle(measured([11.0, 0.0]))
    with pytest.raises(TorqueError, match=r"^a: nan"):
        window.on_cycle(SimpleNamespace(**vars(measured([0.0, 0.0])) | {"feedback": unreported()}))


def unreported():
    return SimpleNamespace(torque_nm=None, current_a=None, position_rad=np.zeros(2))


class Model:
    """Torque of 1 N m at first, and of 10 N m from the second call on."""

    calls = 0

    def bounds_nm(self, *state):
        self.calls += 1
        middle = np.array([0.0 if self.calls == 1 else 10.0, 0.0])
        return middle - 1.0, middle + 1.0


@pytest.mark.parametrize(("cycle_s", "last", "asked"), [(0.01, 10, 11), (0.02, 5, 6), (0.004, 24, 13), (0.1, 2, 3)])
def test_the_torque_may_be_that_of_any_setpoint_of_the_last_tenth_of_a_second(cycle_s, last, asked):
    """The model is asked every 10 ms, or cycle; in 0.1 s 10, 5, 12 (every second cycle) and at least 2 times."""
    model = Model()
    window = TorqueWindow(("a", "b"), PLAIN, np.full(2, 99.0), cycle_s, model)
    for _ in range(last):
        window.on_cycle(measured([0.0, 0.0]))
    with pytest.raises(TorqueError, match=r"^a: 0\.0 N m measured, 9\.0 to 11\.0"):
        window.on_cycle(measured([0.0, 0.0]))
    assert model.calls == asked


def test_measured_torque_is_the_reported_one_or_none():
    assert np.isnan(measured_torque(unreported(), PLAIN)).tolist() == [True, True]
    assert measured_torque(measured([3.0, -4.0]).feedback, PLAIN).tolist() == [3.0, -4.0]
