"""Parts of a run: what counts as its motion, its slow round, and the grid at which it is sampled."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from armload_identification.identification_errors import RecordingError
from armload_identification.signals.recorded_run import Run
from armload_identification.signals.signal_constants import Standstill

pytestmark = pytest.mark.pure

CYCLE_S = 0.01


@pytest.fixture
def rows(pair, pinocchio_arm):
    """A run whose joints swing together with some speed (rad/s) at (N,) times."""

    def rows(time_s, speed_rad_s=1.0, phase_s=None, truncated=False):
        time_s = np.asarray(time_s, dtype=float)
        travel = np.cumsum(speed_rad_s * np.gradient(time_s)) if np.ndim(speed_rad_s) else speed_rad_s * time_s
        position = travel[:, None] * np.ones(6)
        current = np.sin(np.arange(time_s.size))[:, None] * np.ones(6)
        source = replace(pair[0].source, truncated=truncated)
        recording = replace(
            pair[0],
            time_s=time_s,
            position_rad=position,
            current_a=current,
            phase_s=phase_s,
            excitation=pair[0].excitation if phase_s is not None else None,
            source=source,
        )
        return Run.of(recording, pinocchio_arm.transmission)

    return rows


def times(*parts):
    """Times of parts that last (start, end)."""
    return np.concatenate([np.arange(start, end, CYCLE_S) for start, end in parts])


def phases(*parts):
    """Phases of the same: NaN where False, else any."""
    return np.concatenate(
        [np.full(round((end - start) / CYCLE_S), 1.0 if inside else np.nan) for start, end, inside in parts]
    )


@pytest.mark.parametrize(
    ("parts", "began_s", "count"),
    [
        ([(0.0, 3.0, False), (3.0, 9.0, True)], 0.0, 300),
        ([(0.0, 1.0, False), (2.5, 6.5, False), (6.5, 9.0, True)], 2.5, 400),
        ([(0.0, 4.0, False), (5.5, 6.5, False), (6.5, 9.0, True)], 0.0, 400),
        ([(0.0, 1.0, False), (1.9, 3.9, False), (3.9, 9.0, True)], 0.0, 300),
        ([(0.0, 3.0, True), (3.0, 9.0, False)], None, 0),
        ([(0.0, 1.0, False), (2.5, 6.5, False)], 2.5, 400),
    ],
)
def test_the_slow_round_is_the_longest_part_before_the_first_phase(rows, parts, began_s, count):
    run = rows(times(*(part[:2] for part in parts)), phase_s=phases(*parts))
    before = run.before_periods.recording
    assert before.size == count
    assert (before.phase_s, before.excitation) == (None, None)
    if count:
        assert before.time_s[0] == pytest.approx(began_s)


def test_without_a_phase_all_is_the_motion_and_nothing_a_slow_round(rows):
    run = rows(times((0.0, 3.0)))
    assert run.moving_part is run
    assert run.before_periods.recording.size == 0


@pytest.mark.parametrize(("inside", "size"), [(2, 2), (300, 300), (1, 599), (0, 600)])
def test_two_phases_are_the_motion_and_fewer_leave_the_slow_round(rows, inside, size):
    phase_s = np.full(600, np.nan)
    phase_s[600 - inside :] = 1.0
    run = rows(times((0.0, 6.0)), phase_s=phase_s)
    assert run.moving_part.recording.size == size
    cut_short = rows(times((0.0, 6.0)), phase_s=phase_s, truncated=True)
    if inside >= 2:
        assert cut_short.moving_part.recording.size == size
    else:
        with pytest.raises(RecordingError, match="ends before the periods of its excitation start: the file is trunc"):
            _ = cut_short.moving_part


@pytest.mark.parametrize(("travel_rad", "refused"), [(0.0099, True), (0.0101, False)])
def test_a_run_needs_a_joint_that_moves(rows, travel_rad, refused):
    time_s = times((0.0, 3.0))
    speed = travel_rad / (time_s[-1] - time_s[0])
    if not refused:
        assert not rows(time_s, speed).from_torque
        return
    with pytest.raises(RecordingError, match=r"no joint moves more than 0\.01 rad, so nothing can be identified"):
        rows(time_s, speed)


def test_standstill_at_both_ends_is_not_sampled(rows):
    time_s = times((0.0, 10.0))
    speed = np.where((time_s > 2.0) & (time_s < 7.0), 1.0, 0.0)
    grid = rows(time_s, speed).moving_grid(0.0, 10.0)
    assert grid.interval_s == pytest.approx(CYCLE_S)
    assert grid.elapsed_s[0] == pytest.approx(2.0, abs=0.3)
    assert grid.elapsed_s[-1] == pytest.approx(7.0, abs=0.3)
    later = grid.later(0.5)
    np.testing.assert_allclose(later.elapsed_s, grid.elapsed_s + 0.5)
    part = rows(time_s).moving_grid(3.0, 4.0)
    assert part.elapsed_s.size == 100
    assert part.elapsed_s[0] == pytest.approx(3.0)


def test_a_run_of_which_most_is_missing_is_refused(rows):
    time_s = times((0.0, 3.0))
    time_s[-1] = Standstill.samples_over_rows * time_s.size * CYCLE_S
    with pytest.raises(RecordingError, match=r"300 rows, mostly 0\.01 s apart, in 30 s: most of the motion is missing"):
        rows(time_s).moving_grid(0.0, 30.02)
    assert rows(time_s).moving_grid(0.0, 5.0).interval_s == pytest.approx(CYCLE_S)


def test_samples_between_stamps_have_less_noise_and_gaps_are_not_valid(rows):
    time_s = np.delete(times((0.0, 10.0)), slice(400, 440))
    run = rows(time_s)
    motion = run.sampled(run.moving_grid(0.0, 9.9))
    elapsed = motion.time_s
    np.testing.assert_array_equal(motion.valid[(elapsed > 4.01) & (elapsed < 4.38)], False)
    np.testing.assert_array_equal(motion.valid[(elapsed < 3.98) | (elapsed > 4.41)], True)
    between = run.sampled(run.moving_grid(0.0, 9.9).later(0.5 * CYCLE_S))
    np.testing.assert_allclose(between.averaged_noise_nm, between.noise_nm * np.sqrt(0.5), rtol=0.02)
    assert between.began_s == pytest.approx(0.005)
    assert (motion.periods, motion.periodic) == (1, False)
    np.testing.assert_allclose(motion.states.velocity_rad_s[100:300], 1.0, atol=1e-6)
