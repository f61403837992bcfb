"""A motion with other torques, another delay, or a part of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from armload_identification.model.joint_states import JointStates
from armload_identification.signals.motion import ABOVE_BAND, Motion

pytestmark = pytest.mark.pure

STEP_S = 0.01
TIME_S = STEP_S * np.arange(200)
PHASE = 3.0 * TIME_S[:, None] + np.array([0.0, 1.0])
SWING = JointStates(np.sin(PHASE), 3.0 * np.cos(PHASE), -9.0 * np.sin(PHASE))
MOTION = Motion(
    time_s=TIME_S,
    periodic=True,
    states=SWING,
    raw_nm=np.column_stack([TIME_S, 2.0 * TIME_S]),
    torque_nm=np.column_stack([TIME_S, -TIME_S]),
    valid=TIME_S > 0.5,
    noise_nm=np.ones(2),
    averaged_noise_nm=np.ones(2),
    noise_source=ABOVE_BAND,
    smoothing_loss=np.zeros(2),
    periods=3,
    position_fit_rad=np.zeros(2),
    began_s=7.0,
)


def test_its_torques_can_be_those_of_other_gains():
    changed = MOTION.with_torque_times(np.array([[2.0, 0.0], [1.0, 3.0]]))
    np.testing.assert_allclose(changed.raw_nm, np.column_stack([4.0 * TIME_S, 6.0 * TIME_S]))
    np.testing.assert_allclose(changed.torque_nm, np.column_stack([TIME_S, -3.0 * TIME_S]))
    assert changed.noise_nm is MOTION.noise_nm
    assert changed.states is MOTION.states


def test_a_delayed_torque_belongs_to_an_earlier_motion():
    earlier = MOTION.with_delay(0.002)
    inner = slice(5, -5)
    np.testing.assert_allclose(earlier.states.position_rad[inner], np.sin(PHASE - 0.006)[inner], atol=1e-5)
    np.testing.assert_allclose(earlier.states.velocity_rad_s[inner], 3.0 * np.cos(PHASE - 0.006)[inner], atol=1e-4)
    assert earlier.torque_nm is MOTION.torque_nm
    np.testing.assert_allclose(MOTION.with_delay(0.0).states.position_rad, SWING.position_rad)


@pytest.mark.parametrize(
    ("start_s", "end_s", "rows"), [(0.0, 3.0, (0, 200)), (0.495, 1.005, (50, 101)), (-1.0, 0.0, (0, 0))]
)
def test_a_part_has_the_samples_from_its_start_to_before_its_end(start_s, end_s, rows):
    part, chosen = MOTION.part(start_s, end_s), slice(*rows)
    assert not part.periodic
    for name in ("time_s", "raw_nm", "torque_nm", "valid"):
        np.testing.assert_array_equal(getattr(part, name), getattr(MOTION, name)[chosen])
    for found, whole in zip(part.states, SWING, strict=True):
        np.testing.assert_array_equal(found, whole[chosen])


def test_joints_at_rest_and_reversals_have_no_weight():
    still = SWING.position_rad * [1.0, 0.0]
    motion = replace(MOTION, states=JointStates(still, SWING.velocity_rad_s, SWING.acceleration_rad_s2))
    assert (motion.n, motion.moves.tolist()) == (2, [True, False])
    assert motion.interval_s == pytest.approx(STEP_S)
    weight = motion.reversal_weight
    assert not weight[:, 1].any()
    assert weight[0, 0] > 0.9, "at its greatest speed"
    assert weight[np.argmin(np.abs(SWING.velocity_rad_s[:, 0])), 0] < 0.1
