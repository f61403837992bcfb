"""Facts about a recording: its rate and gaps, when the arm moves, its period, and what is missing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from armload_identification.pipeline import recording_survey
from armload_identification.pipeline.recording_survey import pair_mismatch, survey
from armload_identification.recording.recording import Recording

pytestmark = pytest.mark.pure

STEP_S = 0.01


def recording(position, step_s=STEP_S, **effort):
    position = np.asarray(position, dtype=float)
    time_s = 3.0 + step_s * np.arange(len(position))
    return Recording.from_arrays(time_s, position, **(effort or {"torque_nm": 2.0 * position + 1.0}))


def swing(period_s=2.0, before_s=1.0, cycles=3, after_s=1.5, step_s=STEP_S):
    """A joint that swings in the middle of a run; the other one follows at half the size."""
    rest = [round(wait_s / step_s) for wait_s in (before_s, after_s)]
    phase = step_s * np.arange(round(cycles * period_s / step_s))
    motion = np.concatenate([np.zeros(rest[0]), np.sin(2.0 * np.pi * phase / period_s), np.zeros(rest[1])])
    return np.column_stack([motion, 0.5 * motion])


def test_rate_length_and_ranges_are_those_of_the_rows():
    found = survey(recording(swing()))
    assert found.rate_hz == pytest.approx(100.0)
    assert found.duration_s == pytest.approx(8.49)
    np.testing.assert_allclose(found.position_rad, [[-1.0, 1.0], [-0.5, 0.5]], atol=1e-3)
    np.testing.assert_allclose(found.effort, [[-1.0, 3.0], [0.0, 2.0]], atol=1e-3)
    np.testing.assert_allclose(found.speed_rad_s, [np.pi, 0.5 * np.pi], rtol=1e-3)
    assert (found.holes, found.longest_hole_s, found.interruptions) == (0, 0.0, 0)
    assert found.missing == ()


def test_the_motion_is_found_between_the_times_of_rest():
    start, end = survey(recording(swing())).moving_s
    assert start == pytest.approx(1.0, abs=0.11)
    assert end == pytest.approx(7.0, abs=0.11)


@pytest.mark.parametrize(("cycles", "periods"), [(3, 3), (4, 4), (1, 0)])
def test_a_motion_that_repeats_has_a_period(cycles, periods):
    found = survey(recording(swing(cycles=cycles)))
    assert found.periods == pytest.approx(periods, abs=0)
    assert found.period_s == (pytest.approx(2.0, rel=3e-3) if periods else None)


def test_noise_of_encoders_and_creeping_are_no_motion():
    noise = 2e-4 * np.random.default_rng(1).choice([-1.0, 1.0], size=(600, 2))
    slow = np.linspace(0.0, 0.03, 600)[:, None] * np.ones(2)
    for position in (noise, slow):
        found = survey(recording(position, torque_nm=1.0 + np.sin(np.arange(1200.0)).reshape(600, 2)))
        assert found.moving_s is None
        assert found.period_s is None
        assert any("no joint moves" in missing for missing in found.missing)


def test_gaps_are_counted_from_three_intervals_on():
    whole = recording(swing())
    keep = np.ones(whole.size, dtype=bool)
    keep[[200, 201, 300, 301, 302, 303]] = False
    gap = Recording.from_arrays(whole.time_s[keep], whole.position_rad[keep], torque_nm=whole.torque_nm[keep])
    found = survey(gap)
    assert found.holes == 1
    assert found.longest_hole_s == pytest.approx(0.05)


@pytest.mark.parametrize(("step_s", "told"), [(0.049, False), (0.0501, True), (0.1, True)])
def test_a_slow_log_is_told(step_s, told):
    found = survey(recording(swing(period_s=4.0, step_s=step_s), step_s))
    assert any("20 or more" in missing for missing in found.missing) is told


def test_a_torque_that_never_changes_is_missing():
    found = survey(recording(swing(), torque_nm=np.ones((850, 2))))
    assert len(found.missing) == 1
    one = np.column_stack([np.ones(850), swing()[:, 0]])
    assert survey(recording(swing(), torque_nm=one)).missing == ()


def test_the_effort_is_named():
    assert survey(recording(swing())).effort_kind == "joint torque"
    assert survey(recording(swing(), current_a=swing())).effort_kind == "motor current"


def test_a_pair_is_of_one_motion_and_one_quantity():
    motion = swing(before_s=0.5, cycles=1, after_s=0.5)
    run = recording(motion)
    assert pair_mismatch(run, run) is None
    assert pair_mismatch(run, recording(motion, current_a=motion)) is not None


def interrupted(monkeypatch, count, periods):
    """The survey of a run that was interrupted so often, of which so many whole periods were measured."""
    monkeypatch.setattr(recording_survey, "interruptions", lambda run: count)
    monkeypatch.setattr(recording_survey, "_period_of", lambda run, moving_s: (2.0, periods))
    return survey(recording(swing()))


@pytest.mark.parametrize(("count", "periods", "told"), [(0, 0, False), (0, 3, False), (2, 1, False), (2, 0, True)])
def test_a_part_that_was_never_measured_at_full_speed_is_missing(monkeypatch, count, periods, told):
    found = interrupted(monkeypatch, count, periods)
    assert found.interruptions == count
    assert any("a part of the period at full speed" in text for text in found.missing) is told


def test_a_file_that_was_cut_short_lacks_its_end():
    whole = recording(swing())
    cut = replace(whole, source=replace(whole.source, truncated=True))
    assert survey(cut).missing == ("its end: the file is truncated",)


@pytest.mark.parametrize(("speed_rad_s", "moves"), [(0.0098, False), (0.0102, True)])
def test_a_joint_moves_from_a_hundredth_of_a_radian_per_second_on(speed_rad_s, moves):
    position = np.clip(speed_rad_s * STEP_S * (np.arange(800) - 200.0), 0.0, 0.03)[:, None] * [1.0, 0.0]
    found = survey(recording(position, torque_nm=position + 1.0))
    assert (found.moving_s is not None) is moves
    if moves:
        assert found.moving_s == pytest.approx((1.9, 2.0 + 0.03 / speed_rad_s + 0.1), abs=0.12)


@pytest.mark.parametrize(("travel_rad", "moves"), [(0.0099, False), (0.0101, True)])
def test_a_joint_that_travels_less_than_a_hundredth_of_a_radian_does_not_move(travel_rad, moves):
    position = np.clip(0.1 * STEP_S * (np.arange(300) - 100.0), 0.0, travel_rad)[:, None] * [1.0, 0.0]
    assert (survey(recording(position, torque_nm=position + 1.0)).moving_s is not None) is moves


@pytest.mark.parametrize(("jumps", "counted"), [(1, False), (3, True)])
def test_steps_in_less_than_a_thousandth_of_the_rows_are_no_speed(jumps, counted):
    position = np.zeros((2001, 1))
    for k in range(jumps):
        position[500 * (k + 1) :] += 0.5
    assert bool(survey(recording(position, torque_nm=position)).speed_rad_s[0] > 1.0) is counted


@pytest.mark.parametrize(("end_s", "periods"), [(5.985, 3), (5.97, 2), (8.0, 4)])
def test_a_hundredth_of_a_period_may_be_missing(monkeypatch, end_s, periods):
    monkeypatch.setattr(recording_survey, "repeated_after", lambda *_: 2.0)
    assert recording_survey._period_of(recording(swing()), (0.0, end_s)) == (2.0, periods)
    assert recording_survey._period_of(recording(swing()), None) == (None, 0)
