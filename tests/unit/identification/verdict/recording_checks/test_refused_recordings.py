"""Common faults of recordings: rejected, or explained in a sentence, never identified without a message.

Runs of an arm with Pinocchio's torque are falsified and written as CSV files.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from armload_identification.identification_errors import EstimationError, RecordingError
from armload_identification.pipeline.payload_identification import identify_runs
from armload_identification.pipeline.recording_survey import pair_mismatch
from armload_identification.recording.file_reading import read_recording_file
from armload_identification.recording.reading_options import ReadingOptions
from armload_identification.recording.reduction.repeated_values import repeated_values
from armload_identification.verdict.recording_checks.usable_runs import usable_runs
from tests.recording_files import table_columns

pytestmark = pytest.mark.pure

COLUMNS = ReadingOptions(table_columns(0, tuple(range(1, 7)), None, tuple(range(7, 13))))
POSITION, CURRENT = slice(1, 7), slice(7, 13)


@pytest.fixture(scope="module")
def tables(pinocchio_arm):
    """The loaded and the unloaded run as (N, 13) numbers: time, positions, currents."""
    trajectory = pinocchio_arm.trajectory()
    runs = [pinocchio_arm.run(trajectory, load, seed=31 + load, periods=2) for load in (True, False)]
    return [np.column_stack([run.time_s, run.position_rad, run.current_a]) for run in runs]


@pytest.fixture
def outcome(pinocchio_arm, tmp_path):
    """Write two tables, read them back, identify."""

    def outcome(loaded, unloaded):
        runs = []
        for name, table in (("loaded", loaded), ("unloaded", unloaded)):
            path = tmp_path / f"{name}.csv"
            np.savetxt(path, table, delimiter=",", fmt="%.9g")
            runs.append(read_recording_file(path, COLUMNS))
        return identify_runs(*runs, pinocchio_arm.chain, pinocchio_arm.transmission)

    return outcome


def test_unspoiled_they_are_identified(tables, outcome, pinocchio_arm):
    result = outcome(*tables)
    assert not any("joint order" in note for note in result.notes)
    assert result.parameters.mass_kg == pytest.approx(pinocchio_arm.payload.mass_kg, rel=0.01)


def test_torque_of_one_run_and_current_of_the_other_are_not_subtracted(pinocchio_arm):
    """Half of the difference would have the errors of nominal gains, which neither the interval nor a note stated."""
    current = [pinocchio_arm.run(pinocchio_arm.trajectory(), load, seed=31 + load, periods=2) for load in (True, False)]
    both = [replace(run, torque_nm=pinocchio_arm.transmission.joint_torque(run.current_a)) for run in current]
    torque = [replace(run, current_a=None) for run in both]
    for runs, content in (
        ((torque[0], current[1]), "loaded.mcap contains joint torque, and unloaded.mcap contains motor current:"),
        ((current[0], torque[1]), "loaded.mcap contains motor current, and unloaded.mcap contains joint torque:"),
        (
            (both[0], current[1]),
            "loaded.mcap contains joint torque and motor current, of which the torque is used, and",
        ),
    ):
        with pytest.raises(RecordingError, match=content):
            usable_runs(runs, 6, pinocchio_arm.transmission)
        assert content in pair_mismatch(*runs)
    usable_runs((both[0], torque[1]), 6, pinocchio_arm.transmission)
    assert pair_mismatch(both[0], torque[1]) is None
    with pytest.raises(RecordingError, match=r"unloaded\.mcap: neither motor current nor joint torque"):
        usable_runs((torque[0], replace(current[1], current_a=None)), 6, pinocchio_arm.transmission)


@pytest.mark.parametrize(
    ("value", "reason"), [(np.nan, "not finite"), (1e127, "impossible value"), (np.inf, "not finite")]
)
def test_garbage_in_some_rows_is_left_out_and_counted(tables, outcome, pinocchio_arm, value, reason):
    loaded = tables[0].copy()
    loaded[100:105, 3] = value
    loaded[200, 8] = value
    result = outcome(loaded, tables[1])
    assert result.parameters.mass_kg == pytest.approx(pinocchio_arm.payload.mass_kg, rel=0.01)
    assert any(f"6 of 1000 rows dropped (6 {reason})" in note for note in result.notes)


def scaled(columns, factor, joints=slice(None)):
    def spoil(table):
        table = table.copy()
        table[:, columns][:, joints] *= factor
        return table

    return spoil


def swapped(columns):
    def spoil(table):
        table = table.copy()
        table[:, [columns.start + 1, columns.start + 2]] = table[:, [columns.start + 2, columns.start + 1]]
        return table

    return spoil


def clipped(table):
    table = table.copy()
    bound = 0.6 * np.abs(table[:, 8]).max()
    table[:, 8] = np.clip(table[:, 8], -bound, bound)
    return table


def stuck(table):
    """A wrist's current as at the beginning of the second half, while its joint moves."""
    table = table.copy()
    table[len(table) // 2 :, 11] = table[len(table) // 2, 11]
    return table


def same(table):
    return table


@pytest.mark.parametrize(
    ("loaded", "unloaded", "said"),
    [
        (lambda t: t * np.nan, same, "0 usable rows"),
        (scaled(CURRENT, 0.0), same, "every column of current_a is constant"),
        (scaled(CURRENT, 0.0, 2), same, "joint 3 moves, but its current or torque is constant at -?0"),
        (scaled(POSITION, 0.0), same, "no joint moves"),
        (scaled(POSITION, 180.0 / np.pi), scaled(POSITION, 180.0 / np.pi), "look like degrees"),
        (swapped(POSITION), same, "not of the same trajectory"),
        (scaled(CURRENT, -1.0), scaled(CURRENT, -1.0), "sign of the current or torque is flipped"),
        (scaled(CURRENT, -1.0, 4), scaled(CURRENT, -1.0, 4), "joint 5"),
        (clipped, same, "joint 2 stays at its maximum"),
        (same, clipped, "joint 2 stays at its maximum"),
        (stuck, same, r"/loaded.csv: joint 5 moves back and forth by .* for 500 samples"),
        (same, stuck, r"/unloaded.csv: joint 5 moves back and forth by"),
        (lambda t: t[:15], same, "15 usable rows"),
        (lambda t: t[::-1], same, "1 usable rows"),
    ],
    ids=[
        "all NaN",
        "constant currents",
        "one constant current",
        "constant positions",
        "degrees",
        "swapped in one",
        "flipped",
        "one flipped",
        "saturated",
        "saturated when empty",
        "stuck",
        "stuck when empty",
        "nearly empty",
        "time runs backwards",
    ],
)
def test_what_cannot_be_right_is_refused(tables, outcome, loaded, unloaded, said):
    with pytest.raises((RecordingError, EstimationError), match=said):
        outcome(loaded(tables[0]), unloaded(tables[1]))


def test_a_coarse_signal_that_often_repeats_its_values_is_neither_saturated_nor_stuck(pinocchio_arm):
    """Steps of a fifth of the greatest current, without noise: its greatest value too stays for a while."""
    run = pinocchio_arm.run(pinocchio_arm.trajectory(), False, seed=3, periods=1, noise=0.0)
    step = np.abs(run.current_a).max(axis=0) / 5.0
    coarse = replace(run, current_a=step * np.round(run.current_a / step))
    repeats = repeated_values(coarse.current_a, coarse.position_rad)
    assert (repeats.at_bound >= 7).any()
    usable_runs([coarse], 6, pinocchio_arm.transmission)


@pytest.mark.parametrize(
    ("groups", "said"),
    [((POSITION,), "the positions"), ((CURRENT,), "the currents or torques"), ((POSITION, CURRENT), "all columns")],
    ids=["q", "i", "both"],
)
def test_joints_swapped_in_both_files_are_named(tables, outcome, groups, said):
    """Both trajectories agree; only the dynamics contradict."""
    spoiled = list(tables)
    for group in groups:
        spoiled = [swapped(group)(table) for table in spoiled]
    with pytest.raises(RecordingError, match=rf"loaded\.csv and .*: {said} of joints 2 and 3 are exchanged"):
        outcome(*spoiled)


def test_exchanged_runs_are_named(tables, outcome):
    with pytest.raises(EstimationError, match="exchange them"):
        outcome(*tables[::-1])


def test_runs_of_different_trajectories_are_refused(tables, outcome, pinocchio_arm):
    other = pinocchio_arm.run(pinocchio_arm.trajectory(seed=9), False, seed=33, periods=2)
    with pytest.raises(RecordingError, match="not of the same trajectory"):
        outcome(tables[0], np.column_stack([other.time_s, other.position_rad, other.current_a]))


def test_one_period_only_is_used_and_reported(pinocchio_arm):
    trajectory = pinocchio_arm.trajectory()
    pair = [pinocchio_arm.run(trajectory, load, seed=35 + load, periods=1) for load in (True, False)]
    result = identify_runs(*pair, pinocchio_arm.chain, pinocchio_arm.transmission)
    assert any("contains only one period" in note for note in result.notes)
    assert result.parameters.mass_kg == pytest.approx(pinocchio_arm.payload.mass_kg, rel=0.01)


def test_a_motion_too_slow_and_small_says_so(pinocchio_arm):
    """A hundredth of the stroke, with noise: no wrong value may be reported as determined."""
    full = pinocchio_arm.trajectory()
    small = replace(full, sin_rad=0.02 * full.sin_rad, cos_rad=0.02 * full.cos_rad)
    pair = [pinocchio_arm.run(small, load, seed=37 + load, noise=10.0) for load in (True, False)]
    try:
        result = identify_runs(*pair, pinocchio_arm.chain, pinocchio_arm.transmission)
    except EstimationError as error:
        assert "payload" in str(error)  # noqa: PT017
        return
    assert not result.uncertainty.determined[4:].any()
    assert any("Not even the mass" in note or "Not determined" in note for note in result.notes)


def test_an_empty_file_is_named(tmp_path):
    (tmp_path / "empty.csv").write_text("\n")
    with pytest.raises(RecordingError, match="the file is empty"):
        read_recording_file(tmp_path / "empty.csv", COLUMNS)


def test_friction_is_asked_of_all_joints_together(pinocchio_arm):
    """Without friction, energy flows between an arm's joints: one of them can gain energy without a wrong sign."""
    gaining = 0
    for seed in range(20):
        run = pinocchio_arm.run(pinocchio_arm.trajectory(seed), True, seed=seed, periods=1, noise=0.0)
        trajectory = run.excitation.trajectory
        state = trajectory.evaluate(run.phase_s)
        motion = state.position_rad, state.velocity_rad_s, state.acceleration_rad_s2
        friction = np.tanh(motion[1] / 0.01) * 4.0 + 5.0 * motion[1]
        torque = pinocchio_arm.torque(*motion, pinocchio_arm.payload) - friction
        frictionless = replace(run, position_rad=motion[0], current_a=None, torque_nm=torque)
        usable_runs([frictionless], 6, pinocchio_arm.transmission)
        work = torque[:-1] * np.diff(motion[0], axis=0)
        gaining += bool((work.sum(axis=0) < -0.3 * np.abs(work).sum(axis=0)).any())
    assert gaining >= 5


@pytest.mark.parametrize("cut_run", [0, 1], ids=["loaded", "unloaded"])
def test_a_run_that_was_cut_short_is_used_as_far_as_it_goes(pinocchio_arm, cut_run):
    """The motion repeats within its period, so positions alone do not determine the short run's alignment."""
    trajectory = pinocchio_arm.trajectory(period_s=10.0)
    runs = [pinocchio_arm.run(trajectory, load, seed=61 + load, periods=2) for load in (True, False)]
    short = runs[cut_run].rows(slice(0, 700))
    runs[cut_run] = replace(short, source=replace(short.source, truncated=True))
    result = identify_runs(*runs, pinocchio_arm.chain, pinocchio_arm.transmission)
    assert result.parameters.mass_kg == pytest.approx(pinocchio_arm.payload.mass_kg, rel=0.02)
    for rows, said in (
        (60, "share 0.59 s of their excitation, because .* ends there: the file is truncated"),
        (1, "truncated"),
    ):
        runs[cut_run] = replace(
            short.rows(slice(0, rows + 20)), phase_s=short.phase_s[: rows + 20].copy(), source=runs[cut_run].source
        )
        runs[cut_run].phase_s[rows:] = np.nan
        with pytest.raises(RecordingError, match=said):
            identify_runs(*runs, pinocchio_arm.chain, pinocchio_arm.transmission)


def test_what_only_one_run_did_before_and_after_is_left_out(outcome, pinocchio_arm):
    """Recordings started and stopped by hand: different approaches, a pause, the motion, a standstill."""
    tables = [
        driven(pinocchio_arm, load, way_rad, way_s, pause_s)
        for load, way_rad, way_s, pause_s in ((True, 1.5, 2.0, 0.5), (False, -0.8, 3.5, 0.9))
    ]
    result = outcome(*tables)
    assert result.parameters.mass_kg == pytest.approx(pinocchio_arm.payload.mass_kg, rel=0.02)


def driven(arm, load, way_rad, way_s, pause_s):
    """(N, 13) rows of such a run; the motion is a period of a series with its rate from 0 to 1 and back."""
    step_s, ramp_s = 0.01, 1.0
    trajectory = arm.trajectory(period_s=10.0)
    rate = np.concatenate(
        [
            np.zeros(round((way_s + pause_s) / step_s)),
            0.5 - 0.5 * np.cos(np.pi * np.arange(0.0, 1.0, step_s / ramp_s)),
            np.ones(round(9.0 / step_s)),
            0.5 + 0.5 * np.cos(np.pi * np.arange(0.0, 1.0, step_s / ramp_s)),
            np.zeros(250),
        ]
    )
    position = trajectory.evaluate(np.cumsum(rate) * step_s).position_rad
    way = np.linspace(0.0, np.pi, round(way_s / step_s))
    position[: way.size] += way_rad * (0.5 + 0.5 * np.cos(way))[:, None]
    velocity = np.gradient(position, step_s, axis=0)
    torque = arm.torque(position, velocity, np.gradient(velocity, step_s, axis=0), arm.payload if load else None)
    noise = np.random.default_rng(71 + load).normal(size=torque.shape) * arm.noise_nm
    current = ((torque + noise) @ arm.transmission.coupling) / arm.transmission.gain_nm_a
    return np.column_stack([50.0 + step_s * np.arange(len(position)), position, current])
