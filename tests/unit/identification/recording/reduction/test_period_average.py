"""The average period of a run that is read in blocks: against NumPy's mean over all periods, on and off the grid."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from armload_identification.excitation.fourier import Excitation, FourierTrajectory
from armload_identification.identification_errors import RecordingError
from armload_identification.recording.recording import RecordingSource
from armload_identification.recording.reduction.period_average import PeriodAverager
from armload_identification.recording.reduction.phase_advance import SETTLING_S
from armload_identification.recording.reduction.reduction import WrongReduction
from armload_identification.recording.row_block import RowBlock

pytestmark = pytest.mark.pure

PERIOD_S, STEP_S, PERIODS = 2.0, 0.02, 4
PHASES = round(PERIOD_S / STEP_S)
PATH = Path("long.mcap")
SOURCE = RecordingSource(PATH, "0" * 64, "mcap", 1, {})
EXCITATION = Excitation(
    FourierTrajectory(1.0 / PERIOD_S, np.zeros(2), 0.3 * np.ones((2, 2)), np.zeros((2, 2))), PERIODS
)


def run(by_torque=False, shift_s=0.0, periods=PERIODS, seed=1):
    """Rows of a run that passes 1.02 s in a second of phase, with noise on its effort."""
    phase = shift_s + STEP_S * np.arange(periods * PHASES)
    position = EXCITATION.trajectory.evaluate(phase).position_rad
    effort = 2.0 * position + np.random.default_rng(seed).normal(size=position.shape) * [0.1, 0.3]
    quantity = "torque_nm" if by_torque else "current_a"
    columns = {"current_a": None, "torque_nm": None} | {quantity: effort}
    return RowBlock(time_s=50.0 + 1.02 * phase, position_rad=position, velocity_rad_s=None, phase_s=phase, **columns)


def averaged(rows, blocks=1):
    averager = PeriodAverager(PATH, EXCITATION)
    for part in np.array_split(np.arange(rows.size), blocks):
        averager.add(rows.rows(part))
    return averager.recording(SOURCE)


def by_period(values):
    return values.reshape(-1, PHASES, 2)


@pytest.mark.parametrize("shift_s", [0.0, 0.3, 0.306, 0.313])
@pytest.mark.parametrize("blocks", [1, 7])
def test_mean_and_scatter_are_those_of_all_periods_but_the_settling_start(shift_s, blocks):
    rows = run(shift_s=shift_s)
    kept = by_period(rows.current_a.copy())
    settling = round(SETTLING_S / STEP_S / 1.02)
    kept[0, : settling - 1] = np.nan
    found = averaged(rows, blocks)
    assert found.size == PHASES
    assert found.average.periods == PERIODS
    later = slice(settling + 1, None)
    np.testing.assert_allclose(found.current_a[later], kept.mean(axis=0)[later], rtol=1e-12)
    np.testing.assert_allclose(found.current_a[:5], kept[1:].mean(axis=0)[:5], rtol=1e-12)
    np.testing.assert_allclose(found.phase_s, rows.phase_s[:PHASES], atol=1e-9)
    np.testing.assert_allclose(found.position_rad, rows.position_rad[:PHASES], atol=1e-12)
    np.testing.assert_allclose(np.diff(found.time_s), 1.02 * STEP_S, rtol=1e-9)
    scatter = kept - np.nanmean(kept, axis=0)
    rest = np.nan_to_num(scatter).reshape(-1, 2)
    freedom = np.isfinite(kept[:, :, 0]).sum() - PHASES
    np.testing.assert_allclose(found.average.effort_covariance, rest.T @ rest / freedom, rtol=0.05)
    assert np.sqrt(np.diag(found.average.effort_covariance)) == pytest.approx([0.1, 0.3], rel=0.15)


@pytest.mark.parametrize("by_torque", [True, False])
def test_the_average_is_of_what_the_run_reports(by_torque):
    found = averaged(run(by_torque))
    assert (found.current_a is None) is by_torque
    assert (found.torque_nm is None) is not by_torque
    assert found.excitation is EXCITATION
    assert found.repeats is not None


def test_samples_off_the_grid_are_refused():
    rows = run()
    phase = rows.phase_s + 0.3 * STEP_S * (np.arange(rows.size) // PHASES % 2)
    position = EXCITATION.trajectory.evaluate(phase).position_rad
    shifted = RowBlock(50.0 + phase, position, None, 2.0 * position, None, phase)
    with pytest.raises(WrongReduction):
        averaged(shifted)


def test_rows_outside_the_periods_and_without_effort_count_for_nothing():
    rows = run()
    before = RowBlock(
        rows.time_s[:9] - 5.0, rows.position_rad[:9], None, 99.0 + rows.current_a[:9], None, np.full(9, np.nan)
    )
    averager = PeriodAverager(PATH, EXCITATION)
    averager.add(before)
    averager.add(RowBlock(rows.time_s, rows.position_rad, None, None, None, rows.phase_s))
    averager.add(rows)
    np.testing.assert_array_equal(averager.recording(SOURCE).current_a, averaged(rows).current_a)


def test_less_than_a_period_is_no_average():
    rows = run()
    for few in (0, 1, PHASES - 2):
        with pytest.raises(WrongReduction):
            averaged(rows.rows(slice(0, few)))


def test_a_run_that_changes_its_speed_is_refused_by_name():
    rows = run()
    late = rows.time_s + np.where(np.arange(rows.size) > 2 * PHASES, 0.5 * (rows.phase_s - 2 * PERIOD_S), 0.0)
    slow = RowBlock(late, rows.position_rad, None, rows.current_a, None, rows.phase_s)
    with pytest.raises(RecordingError, match=r"long\.mcap: "):
        averaged(slow)
