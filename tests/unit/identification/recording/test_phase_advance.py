"""Interruptions of a run's phase, and what was measured between them, in one piece and block by block."""

import numpy as np
import pytest

from armload_identification.excitation.fourier import FourierTrajectory
from armload_identification.recording.reduction.phase_advance import PhaseAdvance, shortest_period

pytestmark = pytest.mark.pure

CYCLE_S = 0.01
PERIOD_S = 5.0


def run(*pauses_s, lasts_s=15.0, gap_s=0.5, lost_s=2.0):
    """Phases and times of a run; from each pause on, a part of the phase is missing, and more time passes."""
    phase = np.arange(1, round(lasts_s / CYCLE_S) + 1) * CYCLE_S
    time_s, kept = 7.0 + 1.01 * phase, np.ones(phase.size, dtype=bool)
    for pause_s in pauses_s:
        kept &= ~((phase > pause_s) & (phase < pause_s + gap_s))
        time_s = time_s + lost_s * (phase > pause_s)
    return phase[kept], time_s[kept]


@pytest.mark.parametrize("block", [1, 73, 730])
def test_blocks_of_rows_give_what_all_rows_give(block):
    """Row 730 is the last one before the first pause."""
    phase, time_s = run(7.3, 13.5)
    whole = PhaseAdvance(phase, time_s, PERIOD_S)
    since_s = whole.add(phase, time_s)
    pieces = PhaseAdvance(phase, time_s, PERIOD_S)
    parts = [pieces.add(phase[k : k + block], time_s[k : k + block]) for k in range(0, phase.size, block)]
    np.testing.assert_array_equal(np.concatenate(parts), since_s)
    assert (pieces.interruptions, pieces.periods, pieces.held, pieces.is_even) == (2, 2, 3, True)
    assert (whole.interruptions, whole.periods, whole.held, whole.is_even) == (2, 2, 3, True)
    assert (pieces.rate, whole.rate) == pytest.approx((1.01, 1.01), rel=1e-9)
    np.testing.assert_allclose(pieces.time_at(phase[:100]), time_s[:100], atol=1e-9)


def test_a_short_time_at_a_slightly_lower_speed_is_an_interruption():
    """The key - and at once + lose 0.02 s: 0.4 % of the period, but the arm settles as after a pause."""
    phase, time_s = run(7.3, gap_s=0.4, lost_s=0.02)
    advance = PhaseAdvance(phase, time_s, PERIOD_S)
    since_s = advance.add(phase, time_s)
    assert (advance.interruptions, advance.periods, advance.is_even) == (1, 2, True)
    assert since_s[730] == 0.0


def test_skipped_cycles_are_no_interruption():
    """The phase waits for a skipped cycle, so that no part of it is missing."""
    phase, time_s = run()
    time_s = time_s + CYCLE_S * (2.0 * (phase > 3.0) + (phase > 9.0))
    advance = PhaseAdvance.of(phase, time_s, PERIOD_S)
    assert (advance.interruptions, advance.periods, advance.is_even) == (0, 3, True)


def test_missing_rows_are_no_interruption_as_time_passes_by_no_more_than_the_phase():
    phase, time_s = run()
    kept = (phase < 4.0) | ((phase > 4.07) & (phase < 11.0)) | (phase > 13.5)
    jitter_s = CYCLE_S * np.where(phase < 4.0, -0.6, 0.6) * (np.abs(phase - 4.0) < 0.1)
    slower_clock_s = 0.01 * np.maximum(phase - 10.0, 0.0)
    time_s = time_s + jitter_s + slower_clock_s
    advance = PhaseAdvance.of(phase[kept], time_s[kept], PERIOD_S)
    assert (advance.interruptions, advance.periods, advance.is_even) == (0, 3, True)


def test_only_whole_periods_count_of_a_run_that_ends_early():
    """The part that the pause took from the first period is in the second, which is not whole and is not averaged."""
    assert PhaseAdvance.of(*run(4.0, lasts_s=9.9, gap_s=0.1), PERIOD_S).periods == 0
    assert PhaseAdvance.of(*run(4.0, lasts_s=10.0, gap_s=0.1), PERIOD_S).periods == 1


def test_a_phase_that_starts_again_is_no_interruption():
    phase, time_s = run()
    advance = PhaseAdvance.of((phase - CYCLE_S) % PERIOD_S, time_s, PERIOD_S)
    assert (advance.interruptions, advance.is_even) == (0, False)


@pytest.mark.parametrize(
    ("harmonics", "times"),
    [((1, 2), 1), ((2, 4), 2), ((5, 10), 5), ((3, 6, 9), 1), ((2, 3), 1), ((4, 6), 2), ((7,), 1)],
)
def test_a_series_without_low_harmonics_repeats_itself_within_its_period(harmonics, times):
    """A third or a seventh of 500 samples would be no whole number of them."""
    size = np.isin(np.arange(1, 11), harmonics) * np.array([[0.1], [0.02]])
    series = FourierTrajectory(1.0 / PERIOD_S, np.array([0.3, -0.2]), size, -2.0 * size)
    phase = np.arange(1, 1200) * CYCLE_S
    found = shortest_period(phase, series)
    assert found.period_s == pytest.approx(PERIOD_S / times)
    assert (found.harmonics == 10) == (times == 1)
    np.testing.assert_allclose(found.evaluate(phase).position_rad, series.evaluate(phase).position_rad, atol=1e-12)


def test_a_series_that_does_not_move_keeps_its_period():
    nothing = np.zeros((2, 4))
    still = FourierTrajectory(1.0 / PERIOD_S, np.zeros(2), nothing, nothing)
    assert shortest_period(np.arange(1, 1200) * CYCLE_S, still).period_s == pytest.approx(PERIOD_S)
