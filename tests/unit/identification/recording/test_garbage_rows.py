"""Which rows of a log are dropped, by reason, and which units are refused: each bound from both sides."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from armload_identification.identification_errors import RecordingError
from armload_identification.recording.column_units import DEGREE_RAD
from armload_identification.recording.garbage_rows import (
    GarbageFilter,
    WrongUnit,
    refuse_creeping,
    refuse_degrees,
    refuse_mixed_units,
    refuse_time_unit,
)
from armload_identification.recording.row_block import RowBlock

pytestmark = pytest.mark.pure

PATH = Path("log.csv")
INTERVAL_S = 0.01
ROWS = 400


def log(rows=ROWS, joints=2, interval_s=INTERVAL_S):
    """Joints that swing slowly, with currents of white noise."""
    time_s = 100.0 + interval_s * np.arange(rows)
    position = np.sin(time_s)[:, None] * np.ones(joints)
    current = np.random.default_rng(1).normal(size=(rows, joints))
    return RowBlock(time_s, position, np.cos(time_s)[:, None] * np.ones(joints), current)


def kept(rows):
    """Indices of the rows that pass, and the reasons of the others."""
    garbage = GarbageFilter(PATH)
    numbered = replace(rows, phase_s=np.arange(rows.size, dtype=float))
    passed = [block.phase_s for block in garbage.valid([numbered])]
    return np.concatenate(passed).astype(int).tolist(), dict(garbage.reasons)


@pytest.mark.parametrize("times", [2, 3])
def test_rows_that_are_there_several_times_are_counted_and_change_nothing(times):
    rows = log()
    again = rows.rows(np.repeat(np.arange(ROWS), times))
    assert kept(again) == (list(range(0, times * ROWS, times)), {"same as the row before": (times - 1) * ROWS})


def test_another_measurement_at_the_same_time_is_no_copy():
    rows = log().rows(np.repeat(np.arange(ROWS), [2, *[1] * (ROWS - 1)]))
    rows.current_a[1] += 0.1
    assert kept(rows)[1] == {"time not increasing": 1}


@pytest.mark.parametrize(
    ("quantity", "value", "reason"),
    [
        ("time_s", np.nan, "not finite"),
        ("position_rad", np.inf, "not finite"),
        ("current_a", np.nan, "not finite"),
        ("position_rad", 1000.1, "impossible value"),
        ("velocity_rad_s", -1000.1, "impossible value"),
        ("velocity_rad_s", -1000.0, None),
        ("current_a", 1.0001e4, "impossible value"),
        ("current_a", 1e4, None),
        ("time_s", 100.0 + 60.0 + 3.0 * ROWS * INTERVAL_S + 3.0, "time out of range"),
        ("time_s", 100.0 + 60.0 + 3.0 * ROWS * INTERVAL_S + 1.0, "time not increasing"),
        ("time_s", 101.99, "time not increasing"),
        ("time_s", 101.9901, None),
        ("time_s", 102.0099, None),
        ("time_s", 102.01, "time not increasing"),
        ("position_rad", np.sin(102.0) + 2.6, "position jumps"),
        ("position_rad", np.sin(102.0) - 2.6, "position jumps"),
        ("position_rad", np.sin(102.0) + 2.4, None),
    ],
)
def test_one_wrong_row_costs_itself_and_is_counted(quantity, value, reason):
    """Fifty radians per second reach 2.5 rad in half a window of 11 rows."""
    rows = log()
    values = getattr(rows, quantity).copy()
    values[200] = value
    found, reasons = kept(replace(rows, **{quantity: values}))
    if reason == "time not increasing" and value < 103.0:  # of two rows in the wrong order either may be dropped
        assert len(found) == ROWS - 1
    else:
        assert sorted(set(range(ROWS)) - set(found)) == ([] if reason is None else [200])
    assert reasons == ({} if reason is None else {reason: 1})


@pytest.mark.parametrize(("spikes", "joints", "dropped"), [(3, 2, True), (1, 2, False), (3, 1, False)])
def test_effort_that_jumps_on_several_joints_is_dropped_if_it_does_so_often(spikes, joints, dropped):
    """Half a percent of 400 rows is two."""
    rows = log(joints=3)
    current = rows.current_a.copy()
    places = [100, 150, 250][:spikes]
    current[places, :joints] += 40.0
    found, reasons = kept(replace(rows, current_a=current))
    assert sorted(set(range(ROWS)) - set(found)) == (places if dropped else [])
    assert reasons == ({"torque or current of several joints jumps": spikes} if dropped else {})
    stepped = rows.current_a.copy()
    stepped[200:] += 40.0
    assert kept(replace(rows, current_a=stepped))[1] == {}, "a step is a reversal"


def test_of_reported_torque_and_current_the_torque_counts():
    rows = log(joints=1)
    wild = rows.current_a.copy()
    wild[[100, 150, 250]] += 40.0
    assert kept(replace(rows, torque_nm=rows.current_a, current_a=wild))[1] == {}
    assert sum(kept(replace(rows, torque_nm=wild))[1].values()) == 3


@pytest.mark.parametrize("block", [7, 1000, 200_000])
def test_blocks_of_any_size_give_the_same_rows(block):
    rows = log(160_000, joints=1, interval_s=1e-3)
    time_s = rows.time_s.copy()
    time_s[[3, 131_070, 131_072, 140_000, 159_999]] = 0.0
    rows = replace(rows, time_s=time_s, velocity_rad_s=None)
    garbage = GarbageFilter(PATH)
    if block == 7:
        rows = rows.rows(slice(0, 3000))
    parts = (rows.rows(slice(first, first + block)) for first in range(0, rows.size, block))
    found = np.concatenate([part.time_s for part in garbage.valid(parts)])
    np.testing.assert_array_equal(found, rows.time_s[rows.time_s > 0.0])
    assert sum(garbage.reasons.values()) == rows.size - found.size


@pytest.mark.parametrize(("block", "gap_s"), [(7, 0.0), (150_000, 0.0), (150_000, 0.51)])
def test_positions_modulo_one_turn_go_on(block, gap_s):
    rows = replace(log(150_000 if block > 7 else 3000, joints=2, interval_s=1e-3), velocity_rad_s=None)
    turning, swinging = 0.5 * (rows.time_s - 100.0) + 1.0, 0.5 * np.sin(rows.time_s)
    modulo = np.column_stack([turning % (2.0 * np.pi), swinging % (2.0 * np.pi)])
    at = int(np.argmax(np.diff(modulo[:, 0]) < -3.0)) + 1
    time_s = rows.time_s + gap_s * (np.arange(rows.size) >= at)
    rows = replace(rows, time_s=time_s, position_rad=modulo)
    parts = (rows.rows(slice(first, first + block)) for first in range(0, rows.size, block))
    found = np.concatenate([part.position_rad for part in GarbageFilter(PATH).valid(parts)])
    if gap_s:  # long enough for a turn: it may have been made
        turning[at:] -= 2.0 * np.pi
    np.testing.assert_allclose(found, np.column_stack([turning, swinging]), atol=1e-9)


def test_a_log_needs_effort_unless_it_does_not_matter():
    bare = replace(log(), current_a=None)
    with pytest.raises(RecordingError, match=r"log\.csv: the recording has neither motor current nor joint torque"):
        kept(bare)
    garbage = GarbageFilter(PATH, with_effort=False)
    assert [block.size for block in garbage.valid([bare])] == [ROWS]


@pytest.mark.parametrize(
    ("count", "others", "text"),
    [
        (20, {}, None),
        (19, {}, "19 usable rows of 30 (no row dropped), expected 20 or more. Check that the file is complete"),
        (19, {"not a number": 4}, "19 usable rows of 30 (4 not a number, 7 not finite), expected 20 or more."),
    ],
)
def test_twenty_rows_are_enough(count, others, text):
    garbage = GarbageFilter(PATH)
    if others:
        garbage.reasons["not finite"] = 7
    with pytest.raises(RecordingError) if text else nullcontext() as caught:
        garbage.require_enough(count, 30, others)
    assert text is None or text in str(caught.value)


# Units -----------------------------------------------------------------------------------------------------------


def refused(check, *given):
    """Text and factors of the error that a check raises; none if it does not."""
    try:
        check(PATH, *given)
    except WrongUnit as error:
        return str(error), error.factors
    return "", {}


@pytest.mark.parametrize(("second", "refuses"), [(200, True), (40, True), (20, False)])
def test_a_clock_that_starts_again_is_two_runs(second, refuses):
    rows = log()
    time_s = rows.time_s.copy()
    time_s[-second:] += 100.0 - time_s[-second]
    if not refuses:
        assert kept(replace(rows, time_s=time_s))[1] == {"time not increasing": second}
        return
    with pytest.raises(RecordingError, match=f"start again at row {ROWS - second + 1} of {ROWS}") as found:
        kept(replace(rows, time_s=time_s))
    assert str(found.value).endswith("The recording contains several runs: give each its own file.")


@pytest.mark.parametrize(
    ("interval_s", "factor", "advice"),
    [
        (0.5, None, ""),
        (1e-5, None, ""),
        (0.51, 1e-3, "They look like milliseconds: convert them."),
        (9.9e-6, None, "Check the column of the time stamps."),
        (110.0, 1e-3, "They look like milliseconds: convert them."),
        (111.0, 1e-6, "They look like microseconds: convert them."),
        (1.1e5, 1e-6, "They look like microseconds: convert them."),
        (1.2e5, 1e-9, "They look like nanoseconds: convert them."),
        (1.2e8, None, "Check the column of the time stamps."),
    ],
)
def test_an_interval_that_no_log_has_is_in_another_unit(interval_s, factor, advice):
    text, factors = refused(refuse_time_unit, interval_s)
    assert text.endswith(advice)
    assert bool(text) is bool(advice)
    assert factors == ({} if factor is None else {"time_s": factor})


@pytest.mark.parametrize(("turns", "wrong"), [(2.99, False), (3.01, True), (-3.01, True)])
@pytest.mark.parametrize(("speed", "also"), [(1.0, True), (DEGREE_RAD, False), (0.79, False), (0.82, True)])
def test_angles_of_several_turns_are_degrees(turns, wrong, speed, also):
    angle = 2.0 * np.pi * turns * np.linspace(0.0, 1.0, 2001)
    position = np.tile(np.concatenate([angle, np.full(4000, angle[-1])])[:, None], 2)
    time_s = 0.01 * np.arange(len(position))
    velocity = np.gradient(position, time_s, axis=0) / speed
    rows = RowBlock(time_s, position, velocity, position)
    text, factors = refused(refuse_degrees, rows)
    assert factors == ({"position_rad": DEGREE_RAD} | ({"velocity_rad_s": DEGREE_RAD} if also else {}) if wrong else {})
    assert not wrong or text.startswith("log.csv: joint positions reach 19, expected radians within +-19. They look")
    assert set(refused(refuse_degrees, replace(rows, velocity_rad_s=None))[1]) == ({"position_rad"} if wrong else set())


def test_a_few_wrong_angles_are_no_degrees():
    position = np.zeros((1000, 2))
    position[:49] = 50.0
    position[49:60] = np.nan
    rows = RowBlock(np.arange(1000.0), position, None, position)
    assert refused(refuse_degrees, rows) == ("", {})
    position[:120] = 50.0
    assert refused(refuse_degrees, rows)[1] == {"position_rad": DEGREE_RAD}
    assert refused(refuse_degrees, replace(rows, position_rad=np.full((9, 2), np.nan))) == ("", {})


@pytest.mark.parametrize(
    ("ratio", "factors", "words"),
    [
        (1.0, {}, ""),
        (0.81e-3, {"time_s": 1e-3}, "look like milliseconds: convert them to seconds."),
        (0.79e-3, {}, ""),
        (1.24e-3, {"time_s": 1e-3}, "look like milliseconds: convert them to seconds."),
        (1.26e-3, {}, ""),
        (1e-6, {"time_s": 1e-6}, "look like microseconds: convert them to seconds."),
        (1e-9, {"time_s": 1e-9}, "look like nanoseconds: convert them to seconds."),
        (0.81 / DEGREE_RAD, {"position_rad": DEGREE_RAD}, "The positions look like degrees: convert them to radians."),
        (1.24 / DEGREE_RAD, {"position_rad": DEGREE_RAD}, "The positions look like degrees: convert them to radians."),
        (0.79 / DEGREE_RAD, {}, ""),
        (1.26 / DEGREE_RAD, {}, ""),
        (0.81 * DEGREE_RAD, {"velocity_rad_s": DEGREE_RAD}, "The velocities look like degrees: convert them"),
        (1.24 * DEGREE_RAD, {"velocity_rad_s": DEGREE_RAD}, "The velocities look like degrees: convert them"),
        (0.79 * DEGREE_RAD, {}, ""),
        (1.26 * DEGREE_RAD, {}, ""),
    ],
)
def test_positions_that_change_faster_than_the_velocities_say_are_in_another_unit(ratio, factors, words):
    time_s = 0.01 * np.arange(300)
    position = np.sin(3.0 * time_s)[:, None] * np.ones(2)
    velocity = 3.0 * np.cos(3.0 * time_s)[:, None] * np.ones(2) / ratio
    text, found = refused(refuse_mixed_units, time_s, position, velocity)
    assert found == factors
    assert words in text
    assert bool(text) is bool(factors)
    assert refused(refuse_mixed_units, time_s, position, 0.0 * velocity) == ("", {}), "velocities that are not measured"


@pytest.mark.parametrize(
    ("interval_s", "rows", "travel_rad", "refuses"),
    [
        (0.2, 100, 0.12, True),
        (0.2, 100, 0.09, False),
        (0.12, 100, 0.12, False),
        (0.11, 1000, 0.12, False),
        (0.12, 1000, 0.12, True),
        (5.0, 9, 0.2, False),
        (5.0, 10, 0.2, True),
    ],
)
def test_joints_that_creep_far_move_in_milliseconds(interval_s, rows, travel_rad, refuses):
    """At least 10 rows, more than 0.1 rad, and less than 0.01 rad/s."""
    time_s = interval_s * np.arange(rows)
    position = np.linspace(0.0, travel_rad * (rows - 1) / max(rows - 5, 1), rows)[:, None] * np.array([1.0, 0.5])
    text, factors = refused(refuse_creeping, interval_s, time_s, position)
    assert factors == ({"time_s": 1e-3} if refuses else {})
    assert not refuses or "The time stamps look like milliseconds: convert them to seconds." in text
