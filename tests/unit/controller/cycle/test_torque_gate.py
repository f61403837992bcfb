"""Limits of amount and rate of the torque added at the drives."""

import numpy as np
import pytest

from armload_controller.cycle.torque_gate import TorqueGate

CYCLE_S = 0.01
TORQUE_MAX_NM = np.array([50.0, 200.0])


@pytest.fixture
def gate():
    return TorqueGate(TORQUE_MAX_NM, CYCLE_S)


def passed(gate, wanted_nm, cycles):
    return np.array([gate.passed(np.asarray(wanted_nm, dtype=float)) for _ in range(cycles)])


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_no_more_than_four_fifths_of_the_greatest_torque_is_added(gate, sign):
    torque = passed(gate, sign * np.array([1e9, 1e9]), 200)
    np.testing.assert_allclose(torque[-1], sign * 0.8 * TORQUE_MAX_NM)
    assert (np.abs(torque) <= 0.8 * TORQUE_MAX_NM + 1e-9).all()


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_torque_changes_by_its_greatest_value_in_half_a_second_and_no_faster(gate, sign):
    passed(gate, sign * np.ones(2), 100)
    before = gate.torque_nm
    torque = passed(gate, -sign * 0.8 * TORQUE_MAX_NM, 100)
    steps = np.abs(np.diff(torque, axis=0, prepend=before[None]))
    np.testing.assert_allclose(steps.max(axis=0), TORQUE_MAX_NM * CYCLE_S / 0.5)
    np.testing.assert_allclose(torque[-1], -sign * 0.8 * TORQUE_MAX_NM)


def test_a_gate_opens_in_0_4_s_from_the_first_torque_on(gate):
    assert not passed(gate, np.zeros(2), 100).any()
    torque = passed(gate, [0.5, 1.0], 45)
    np.testing.assert_allclose(torque[:40], np.linspace(1.0, 40.0, 40)[:, None] / 40.0 * [0.5, 1.0])
    np.testing.assert_allclose(torque[40:], np.tile([0.5, 1.0], (5, 1)))


def test_a_released_gate_empties_in_0_4_s_and_takes_nothing_any_more(gate):
    passed(gate, [20.0, -80.0], 100)
    gate.release()
    torque = passed(gate, [1e3, 1e3], 60)
    np.testing.assert_allclose(torque[:40], (1.0 - np.arange(1, 41)[:, None] / 40.0) * [20.0, -80.0], atol=1e-9)
    np.testing.assert_array_equal(torque[40:], 0.0)
    assert gate.empty
    gate.close()
    assert not gate.released
    np.testing.assert_allclose(passed(gate, [1.0, 1.0], 40)[-1], [1.0, 1.0])


def test_a_gate_is_not_empty_while_a_joint_has_torque(gate):
    passed(gate, [0.0, 1.0], 1)
    assert not gate.empty
