"""Interruptions of a run's phase, and what was measured between them, in one piece and block by block."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from armload_identification.excitation.fourier import FourierTrajectory
from armload_identification.identification_errors import RecordingError
from armload_identification.recording.reduction.phase_advance import (
    PhaseAdvance,
    even_advance,
    interruptions,
    measured_periods,
    periodic_phase,
    phase_and_time,
    phases_of,
    shortest_period,
    whole_periods,
)

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


@pytest.mark.parametrize(
    ("gap_s", "lost_s", "interrupted"),
    [
        (0.0, 0.099, 0),
        (0.0, 0.103, 1),
        (0.04, 0.05, 0),
        (0.07, 0.05, 1),
        (0.07, 0.0150, 0),
        (0.07, 0.0155, 1),
        (3.0, 0.060, 0),
        (3.0, 0.062, 1),
    ],
)
def test_time_that_is_lost_beyond_jitter_in_a_gap_or_beyond_2_percent_of_a_period_is_an_interruption(
    gap_s, lost_s, interrupted
):
    """A gap is more than five samples of 0.01 s; there 1.5 samples or 2 % of the gap count, by a clock 1 % fast."""
    assert PhaseAdvance.of(*run(7.3, gap_s=gap_s, lost_s=lost_s), PERIOD_S).interruptions == interrupted


@pytest.mark.parametrize(("third_s", "periods"), [(12.6, 0), (12.75, 0), (12.85, 1), (14.4, 1)])
def test_what_follows_an_interruption_within_0_3_s_does_not_count(third_s, periods):
    """Pauses of 0.5 s take phases 2.0 to 2.8 and 2.3 to 3.1 s; a third one must leave 2.3 to 2.8 s."""
    advance = PhaseAdvance.of(*run(2.0, 7.3, third_s), PERIOD_S)
    assert (advance.periods, advance.held, advance.is_even) == (periods, 3, True)
    if periods:
        advance.require_even(Path("a.mcap"))
    else:
        with pytest.raises(RecordingError, match=r"a\.mcap: the run was paused .* never measured at full speed"):
            advance.require_even(Path("a.mcap"))


@pytest.mark.parametrize(("wave_s", "even"), [(0.099, True), (0.101, False)])
def test_a_stamp_may_be_2_percent_of_a_period_off_a_uniform_advance(wave_s, even):
    """Twenty waves a period leave the slope as it is."""
    phase, time_s = run()
    advance = PhaseAdvance.of(phase, time_s + wave_s * np.cos(8.0 * np.pi * phase), PERIOD_S)
    assert (advance.is_even, advance.interruptions) == (even, 0)
    if not even:
        with pytest.raises(RecordingError, match=r"phase is up to 0\.101 s off a uniform advance, 0\.1 s is allowed"):
            advance.require_even(Path("a.mcap"))


def test_a_phase_that_stands_has_no_rate():
    advance = PhaseAdvance(np.array([0.0, 0.01]), np.array([0.0, 0.01]), PERIOD_S)
    advance.add(np.array([0.0]), np.array([0.0]))
    assert (advance.rate, advance.is_even) == (0.0, False)


def recording(size=1499, **changes):
    """A run of three periods of 5 s, whose first five rows are before the excitation."""
    phase = np.r_[np.full(5, np.nan), np.arange(1, size + 1) * CYCLE_S]
    shape = np.array([[0.0, 0.1]])
    known = SimpleNamespace(trajectory=FourierTrajectory(1.0 / PERIOD_S, np.zeros(1), shape, shape))
    base = {"average": None, "excitation": known, "phase_s": phase, "size": phase.size}
    base |= {"time_s": 3.0 + CYCLE_S * np.arange(phase.size), "source": SimpleNamespace(path="a.mcap")}
    return SimpleNamespace(**(base | changes))


def test_periods_of_a_recording_are_those_of_its_phase_or_of_its_average():
    assert [whole_periods(recording(size)) for size in (1, 499, 500, 1499, 1500)] == [0, 0, 1, 2, 3]
    assert [measured_periods(recording(size)) for size in (1, 499, 1499)] == [0, 0, 2]
    nothing = recording(excitation=None)
    assert (whole_periods(nothing), measured_periods(nothing), interruptions(nothing)) == (0, 0, 0)
    unknown = recording(phase_s=None)
    assert (whole_periods(unknown), phase_and_time(unknown)[0].size) == (0, 0)
    average = recording(average=SimpleNamespace(periods=7, interruptions=2))
    assert (whole_periods(average), measured_periods(average), interruptions(average)) == (7, 7, 2)
    phase, time_s = run(7.3)
    paused = recording(phase_s=phase, time_s=time_s, size=phase.size)
    assert (whole_periods(paused), measured_periods(paused), interruptions(paused)) == (3, 2, 1)


def test_a_recording_of_whole_periods_has_phases_and_the_series_repeats_itself_in_half_the_period():
    phase, series = periodic_phase(recording())
    assert (phase[0], phase.size, series.period_s) == (0.01, 1499, 2.5)
    assert phases_of(*periodic_phase(recording())) == 250
    assert phases_of(0.5 * np.arange(9), recording().excitation.trajectory) == 10
    assert phases_of(1.0 * np.arange(9), recording().excitation.trajectory) == 8, "at least"
    for wrong in (recording(499), recording(excitation=None)):
        with pytest.raises(RecordingError, match=r"a\.mcap: no whole period of a known excitation"):
            periodic_phase(wrong)


def test_only_a_run_that_advances_evenly_over_a_period_can_be_averaged():
    series = recording().excitation.trajectory
    phase, time_s = run()
    assert even_advance(phase, time_s, series).periods == 6, "of 2.5 s"
    assert even_advance(phase[:499], time_s[:499], series) is None
    assert even_advance(phase[:1], time_s[:1], series) is None
    assert even_advance(phase, time_s + 0.1 * np.sin(8.0 * np.pi * phase), series) is None
    phase, time_s = run(4.0, lasts_s=9.9, gap_s=0.3)
    one = replace(series, sin_rad=np.array([[0.1, 0.1]]))
    assert even_advance(phase, time_s, one) is None, "no phase of the pause was measured in a whole period"
