"""The cutoff of the low-pass, and noise where a median fails."""

from __future__ import annotations

import numpy as np
import pytest

from armload_identification.signals.filters import low_pass, low_pass_cutoff, smoothing_loss, white_noise
from armload_identification.signals.signal_constants import LowPass

pytestmark = pytest.mark.pure


def swing(hz, interval_s, *, rows=1000, joints=1, size=1.0):
    time_s = interval_s * np.arange(rows)
    return size * np.sin(2.0 * np.pi * hz * time_s)[:, None] * np.ones(joints)


@pytest.mark.parametrize(
    ("hz", "interval_s", "cutoff_hz"),
    [(1.0, 0.01, 8.0), (2.0, 0.01, 16.0), (2.0, 0.02, 12.5), (0.05, 0.01, 2.0), (0.05, 0.2, 1.25)],
)
def test_the_cutoff_is_eight_times_the_motion_but_within_its_limits(hz, interval_s, cutoff_hz):
    found = low_pass_cutoff(swing(hz, interval_s, rows=10_000), interval_s)
    assert found == pytest.approx(cutoff_hz, rel=0.02)


def test_the_fastest_joint_decides_if_it_carries_power():
    slow, fast = swing(0.5, 0.01, rows=10_000, joints=2), swing(2.0, 0.01, rows=10_000)
    assert low_pass_cutoff(np.hstack([slow, fast]), 0.01) == pytest.approx(LowPass.bands * 2.0, rel=0.01)
    assert low_pass_cutoff(np.hstack([slow, 0.01 * fast]), 0.01) == pytest.approx(LowPass.bands * 0.5, rel=0.03)


def test_at_its_cutoff_two_passes_halve_the_amplitude():
    values = swing(5.0, 0.01, rows=2000)
    inner = slice(500, 1500)
    np.testing.assert_allclose(low_pass(values, 0.01, 5.0)[inner], 0.5 * values[inner], atol=1e-3)


@pytest.mark.parametrize("rows", [2, 3, 5, 40])
def test_a_straight_line_passes_a_filter_that_is_longer_than_it(rows):
    line = np.linspace(3.0, 5.0, rows)[:, None] * np.array([1.0, -2.0])
    np.testing.assert_allclose(low_pass(line, 0.01, 2.0), line, atol=1e-12)


def test_the_loss_of_smoothing_is_a_share_of_the_rms_and_none_for_no_signal():
    raw = np.array([[3.0, 0.0, 1.0], [-4.0, 0.0, -1.0]])
    np.testing.assert_allclose(smoothing_loss(raw, raw * [0.5, 1.0, 0.0]), [0.5, 0.0, 1.0])


def test_noise_of_mostly_equal_values_is_not_taken_for_none():
    """One step of 1 among zeros: its third differences are 1, -2, 1."""
    values = np.zeros((23, 2))
    values[10:, 0] = 1.0
    np.testing.assert_allclose(white_noise(values), [np.sqrt(6.0 / 20.0 / 20.0), 0.0])
