"""Means over 10 ms of a run without periods: their times and values, in blocks, with gaps, and merged."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from armload_identification.recording.recording import RecordingSource
from armload_identification.recording.reduction.time_average import TimeAverager
from armload_identification.recording.row_block import RowBlock

pytestmark = pytest.mark.pure

SOURCE = RecordingSource(Path("long.csv"), "0" * 64, "csv", 1, {})


def rows(count, step_s=0.001, path=np.square, keep=None):
    """Rows from 5 s on; positions of the time since then, currents three times as great."""
    elapsed = step_s * np.arange(count)
    if keep is not None:
        elapsed = elapsed[keep(elapsed)]
    position = np.column_stack([path(elapsed), -path(elapsed)])
    return RowBlock(5.0 + elapsed, position, velocity_rad_s=position, current_a=3.0 * position)


def averaged(given, blocks=1, **options):
    averager = TimeAverager(None, **options)
    for part in np.array_split(np.arange(given.size), blocks):
        averager.add(given.rows(part))
    return averager.recording(SOURCE)


@pytest.mark.parametrize("blocks", [1, 7])
def test_ten_samples_become_one_at_their_mean_time_with_the_value_of_that_time(blocks):
    """Of t^2 a mean is (1 - 1/100) (10 ms)^2 / 12 too great; the two at either end have no neighbours for that."""
    found = averaged(rows(2000), blocks)
    middle = 0.0045 + 0.01 * np.arange(200)
    np.testing.assert_allclose(found.time_s, 5.0 + middle, rtol=1e-12)
    np.testing.assert_allclose(found.position_rad[2:-2, 0], middle[2:-2] ** 2, atol=1e-12)
    np.testing.assert_allclose(found.current_a[2:-2, 1], -3.0 * middle[2:-2] ** 2, atol=1e-12)
    more = 0.99 * 1e-4 / 12.0
    np.testing.assert_allclose(found.position_rad[[0, 1, -2, -1], 0], middle[[0, 1, -2, -1]] ** 2 + more, atol=1e-12)
    assert found.velocity_rad_s is None


@pytest.mark.parametrize(
    ("step_s", "samples"), [(0.0101, 1), (0.0099, 1), (0.006, 1), (0.005, 2), (0.0033, 3), (0.002, 5), (0.00101, 9)]
)
def test_as_many_samples_are_averaged_as_are_within_10_ms(step_s, samples):
    found = averaged(rows(2400, step_s))
    assert np.median(np.diff(found.time_s)) == pytest.approx(samples * step_s)
    assert found.size == pytest.approx(2400 / samples, abs=1)
    if samples == 1:
        np.testing.assert_array_equal(found.position_rad[:, 0], (step_s * np.arange(2400)) ** 2)


@pytest.mark.parametrize(("lost", "means"), [(5, 200), (6, 199)])
def test_a_mean_of_less_than_half_of_its_samples_is_dropped(lost, means):
    found = averaged(rows(2000, keep=lambda t: (t < 0.9995) | (t > 0.9995 + 0.001 * lost)))
    assert found.size == means


def test_next_to_a_gap_means_are_left_as_they_are():
    """A mean in whose neighbourhood one lies more than a tenth of an interval off an even time."""
    found = averaged(rows(2000, keep=lambda t: (t < 0.9995) | (t > 1.0495)))
    elapsed = found.time_s - 5.0
    off = found.position_rad[:, 0] - elapsed**2
    changed = np.abs(off) > 1e-9
    assert np.flatnonzero(changed).tolist() == [0, 1, 98, 99, 100, 101, 193, 194]


def test_too_many_means_are_merged_in_pairs():
    """At most 150: of 200 pairs remain 100, over 20 ms, whose samples are 20."""
    found = averaged(rows(2000), most_means=150)
    middle = 0.0095 + 0.02 * np.arange(100)
    np.testing.assert_allclose(found.time_s, 5.0 + middle, rtol=1e-12)
    np.testing.assert_allclose(found.position_rad[2:-2, 0], middle[2:-2] ** 2, atol=1e-12)
    assert averaged(rows(2000), most_means=200).size == 200
    assert averaged(rows(2000), most_means=199).size == 100
    assert averaged(rows(2000), 9, most_means=60).size == 50
