"""Long recordings: read and reduced in blocks, with the same result as from all rows."""

from __future__ import annotations

import itertools
import json
import subprocess
import sys
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
from mcap.writer import Writer

from armload_identification.excitation.excitation_file import format_excitation
from armload_identification.identification_errors import RecordingError
from armload_identification.pipeline.recording_survey import survey
from armload_identification.recording.file_reading import read_recording_file
from armload_identification.recording.garbage_rows import FIRST_WINDOW, GarbageFilter
from armload_identification.recording.reading_options import ReadingOptions
from armload_identification.recording.recording import Recording, RecordingSource
from armload_identification.recording.reduction.phase_advance import interruptions, measured_periods
from armload_identification.recording.reduction.repeated_values import RepeatCounter, repeated_values
from armload_identification.recording.reduction.time_average import TimeAverager
from armload_identification.recording.row_block import RowBlock, joined
from armload_identification.recording.run_format import EXCITATION_ATTACHMENT, MESSAGE_SCHEMA, SCHEMA_NAME, TOPIC
from armload_identification.signals.load_signal import load_signal
from armload_identification.signals.motion import ABOVE_BAND, SCATTER
from armload_identification.signals.recorded_run import Run
from armload_identification.verdict.recording_checks.usable_runs import usable_runs
from tests.recording_files import table_columns

pytestmark = pytest.mark.pure

COLUMNS = ReadingOptions(table_columns(0, tuple(range(1, 7)), None, tuple(range(7, 13))))


def test_a_file_of_more_rows_than_any_recording_is_refused(tmp_path, monkeypatch):
    """87 MB of Parquet were 60 million rows, which took 16 s."""
    monkeypatch.setattr("armload_identification.recording.file_reading.MOST_POSITIONS", 30_000)
    position = np.sin(0.001 * np.arange(10_001)[:, None] + np.arange(3))
    np.savez_compressed(tmp_path / "a.npz", time_s=0.01 * np.arange(10_001), position_rad=position, torque_nm=position)
    with pytest.raises(RecordingError, match=r"a\.npz: more than 10,000 rows of 3 joints"):
        read_recording_file(tmp_path / "a.npz")


EVERYTHING, NOTHING = 10**9, 100
"""Rows up to which a recording is not reduced."""


def write_mcap(path, run, chunk_rows=100):
    """A run as written by the recorder, with a second without phase before and after."""
    excitation = format_excitation(run.excitation)
    cycle_s = float(np.median(np.diff(run.time_s)))
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        writer.add_attachment(0, 0, EXCITATION_ATTACHMENT, "text/plain", excitation.encode())
        schema = writer.register_schema(SCHEMA_NAME, "jsonschema", json.dumps(MESSAGE_SCHEMA).encode())
        channel = writer.register_channel(TOPIC, "json", schema)
        order = [0] * 100 + list(range(run.size)) + [run.size - 1] * 100
        for k, row in enumerate(order):
            inside = 100 <= k < 100 + run.size
            message = {
                "time_s": run.time_s[row] if inside else run.time_s[row] + cycle_s * (k - 100 - row),
                "phase_s": run.phase_s[row] if inside else None,
                "position_rad": run.position_rad[row].tolist(),
                "current_a": (run.current_a[row] * (1.0 if inside else 1.0 - 1e-4 * k)).tolist(),
                "missing": [False] * run.n,
            }
            writer.add_message(channel, 0, json.dumps(message).encode(), 0)
            if k % chunk_rows == 0:
                writer.flush()
        writer.finish()
    return path


def write_csv(path, run):
    np.savetxt(path, np.column_stack([run.time_s, run.position_rad, run.current_a]), delimiter=",", fmt="%.9g")
    return path


@pytest.fixture(scope="module")
def runs(pinocchio_arm):
    """A loaded and an unloaded run of slightly more than six periods, with gaps."""
    trajectory = pinocchio_arm.trajectory()
    kept = np.ones(3000, dtype=bool)
    kept[[3, 700, 701, 1400]] = False
    kept[[42, 542, 1042, 1542, 2042, 2542]] = False
    return [pinocchio_arm.run(trajectory, load, seed=41 + load, periods=6).rows(kept) for load in (True, False)]


def assert_same(reduced, whole, motion_atol=1e-9):
    assert (reduced.periodic, reduced.periods, reduced.noise_source) == (whole.periodic, whole.periods, SCATTER)
    np.testing.assert_array_equal(reduced.valid, whole.valid)
    np.testing.assert_allclose(reduced.time_s, whole.time_s, atol=1e-9)
    for name in ("raw_nm", "torque_nm", "noise_nm", "averaged_noise_nm", "smoothing_loss", "position_fit_rad"):
        np.testing.assert_allclose(getattr(reduced, name), getattr(whole, name), rtol=1e-9, atol=1e-9, err_msg=name)
    for one, two in zip(reduced.states, whole.states, strict=True):
        np.testing.assert_allclose(one, two, atol=motion_atol)


def test_the_average_period_of_a_long_run_is_that_of_all_its_rows(runs, pinocchio_arm, tmp_path):
    paths = [write_mcap(tmp_path / f"{number}.mcap", run) for number, run in enumerate(runs)]
    pairs = [[read_recording_file(path, short_rows=rows) for path in paths] for rows in (EVERYTHING, NOTHING)]
    (whole, _), (reduced, _) = pairs
    assert whole.average is None
    assert reduced.average.periods == 6
    assert reduced.size == 499
    assert reduced.source == whole.source
    motions = [Run.of(run, pinocchio_arm.transmission).motion for run in (reduced, whole)]
    assert_same(*motions)
    signals = [load_signal(*(Run.of(run, pinocchio_arm.transmission) for run in pair)) for pair in pairs[::-1]]
    np.testing.assert_allclose(signals[0].torque_nm, signals[1].torque_nm, atol=1e-9)
    np.testing.assert_allclose(signals[0].mismatch_rad, signals[1].mismatch_rad, rtol=1e-6)
    # A long run with a short one.
    mixed = load_signal(Run.of(reduced, pinocchio_arm.transmission), Run.of(pairs[0][1], pinocchio_arm.transmission))
    np.testing.assert_allclose(mixed.torque_nm, signals[1].torque_nm, atol=1e-9)


def test_phases_off_any_grid_are_interpolated_after_a_long_run_was_read_too(pinocchio_arm, tmp_path):
    trajectory = pinocchio_arm.trajectory()
    step = 0.01 * 0.7313
    phase = np.arange(1, int(20.0 / step)) * step
    position = trajectory.evaluate(phase).position_rad
    run = pinocchio_arm.run(trajectory, True, seed=6, periods=5, noise=0.0)
    current = np.column_stack([np.interp(phase, run.phase_s, column) for column in run.current_a.T])
    odd = replace(run, time_s=phase / 0.7313, position_rad=position, phase_s=phase, current_a=current)
    path = write_mcap(tmp_path / "odd.mcap", odd)
    whole, reduced = (
        Run.of(read_recording_file(path, short_rows=rows), pinocchio_arm.transmission).motion
        for rows in (EVERYTHING, NOTHING)
    )
    assert reduced.periods == whole.periods == 3
    inner = reduced.valid & whole.valid
    assert np.count_nonzero(~inner) <= 2
    np.testing.assert_allclose(reduced.raw_nm[inner], whole.raw_nm[inner], atol=1e-6)
    np.testing.assert_allclose(reduced.states.position_rad, whole.states.position_rad, atol=1e-5)


def paused(run, *rows):
    """The run with pauses: from each of these rows on, 80 rows are missing, and two more seconds pass."""
    kept, late_s = np.ones(run.size, dtype=bool), np.zeros(run.size)
    for row in rows:
        kept[row : row + 80] = False
        late_s[row:] += 2.0
    return replace(run, time_s=run.time_s + late_s).rows(kept)


@pytest.mark.parametrize("odd", [0.0, 0.3], ids=["on the grid", "off it"])
def test_pauses_cost_a_long_run_what_they_cost_a_short_one(runs, pinocchio_arm, tmp_path, odd):
    """Within periods, and across their boundaries; phases off the grid are not averaged while they are read."""
    shift = np.where(np.arange(runs[0].size) < 900, 0.0, odd * 0.01)
    run = replace(runs[0], phase_s=runs[0].phase_s + shift, time_s=runs[0].time_s + shift)
    for rows, periods in (((1799,), 5), ((460, 1700), 5), ((99, 600, 1101), 3)):
        path = write_mcap(tmp_path / f"{len(rows)}.mcap", paused(run, *rows))
        whole, reduced = (read_recording_file(path, short_rows=limit) for limit in (EVERYTHING, NOTHING))
        assert measured_periods(reduced) == periods
        assert (reduced.average is None) == (odd != 0.0)
        assert (interruptions(whole), interruptions(reduced)) == (len(rows), len(rows))
        motions = [Run.of(run, pinocchio_arm.transmission).motion for run in (reduced, whole)]
        assert_same(*motions, motion_atol=1e-9 if odd == 0.0 else 1e-6)


def test_a_long_run_is_refused_whose_every_period_was_interrupted_at_the_same_phase(runs, tmp_path):
    path = write_mcap(tmp_path / "paused.mcap", paused(runs[0], *range(200, 3000, 500)))
    with pytest.raises(RecordingError, match="a part of the period was never measured at full speed"):
        read_recording_file(path, short_rows=NOTHING)
    found = survey(read_recording_file(path, short_rows=EVERYTHING))
    assert found.periods == 0
    assert any("a part of the period at full speed" in reason for reason in found.missing)


def test_a_change_of_speed_is_refused_in_a_long_run_too(runs, tmp_path):
    run = runs[0]
    slower = replace(run, time_s=run.time_s + 0.2 * np.maximum(run.phase_s - 18.0, 0.0))
    with pytest.raises(RecordingError, match="paused or changed its speed"):
        read_recording_file(write_mcap(tmp_path / "slower.mcap", slower), short_rows=NOTHING)


@pytest.mark.parametrize("rate", [2, 5])
def test_means_over_10_ms_give_the_difference_of_two_long_runs(pinocchio_arm, tmp_path, rate):
    """Without a phase; the noise of a mean is that of one sample over the square root of their number."""
    trajectory = pinocchio_arm.trajectory(period_s=10.0)
    runs = [
        pinocchio_arm.run(trajectory, load, seed=50 + load, periods=2, cycle_s=0.01 / rate) for load in (True, False)
    ]
    paths = [write_csv(tmp_path / f"{number}.csv", run) for number, run in enumerate(runs)]
    whole, reduced = (
        load_signal(
            *(
                Run.of(run, pinocchio_arm.transmission)
                for run in (read_recording_file(path, COLUMNS, short_rows=short_rows) for path in paths)
            )
        )
        for short_rows in (EVERYTHING, NOTHING)
    )
    assert reduced.noise_source == ABOVE_BAND
    assert reduced.loaded.interval_s == pytest.approx(0.01, rel=1e-6)
    np.testing.assert_allclose(reduced.noise_nm, whole.noise_nm / np.sqrt(rate), rtol=0.15)
    times = slice(100, -100)
    torque = [np.interp(reduced.loaded.time_s[times], whole.loaded.time_s, column) for column in whole.torque_nm.T]
    # A mean of `rate` samples is stamped at the middle of its interval, not at its first sample.
    apart = reduced.torque_nm[times] - np.column_stack(torque)
    allowed = 0.02 * np.sqrt(np.mean(whole.torque_nm**2, axis=0)) + 0.5 * reduced.averaged_noise_nm
    assert (np.sqrt(np.mean(apart**2, axis=0)) < allowed).all()


@pytest.mark.parametrize("interval_s", [0.002, 0.01])
def test_means_become_longer_where_there_are_too_many(interval_s):
    """Their length doubles, whatever the blocks; each row is of its interval's samples, without gaps.

    Of a parabola the value at a mean's time is exact where neighbours follow evenly; elsewhere it is the mean.
    """
    time_s = 5.0 + interval_s * np.arange(20_000)
    time_s = np.delete(time_s, np.r_[3000:3700, 9001:9004])
    position = np.column_stack([time_s - 60.0, 0.7 * time_s])
    rows = RowBlock(time_s, position, current_a=position**2)
    averager = TimeAverager(None, most_means=600)
    rng = np.random.default_rng(4)
    edges = [0, *np.sort(rng.choice(np.arange(1, rows.size), 40, replace=False)), rows.size]
    for first, end in itertools.pairwise(edges):
        averager.add(rows.rows(slice(first, end)))
    kept = averager.recording(RecordingSource(Path("x"), "", "made", 0, {}))
    assert 300 <= kept.size <= 600
    width = float(np.median(np.diff(kept.time_s)))
    assert width == pytest.approx(max(interval_s, 0.01) * 2.0 ** round(np.log2(width / max(interval_s, 0.01))))
    number = np.floor((time_s - time_s[0] + 0.5 * interval_s) / width + 1e-9)
    around = np.full(kept.size, np.inf)
    around[2:-2] = kept.time_s[4:] - kept.time_s[:-4] - 4.0 * width
    assert np.count_nonzero(around < 1e-9) >= kept.size - 16
    for stamp, effort, uneven in zip(kept.time_s, kept.current_a, np.abs(around), strict=True):
        inside = number == np.floor((stamp - time_s[0] + 0.5 * interval_s) / width)
        if np.count_nonzero(inside) == round(width / interval_s):
            exact, mean = np.array([stamp - 60.0, 0.7 * stamp]) ** 2, (position[inside] ** 2).mean(axis=0)
            if uneven < 1e-9 or uneven > 0.1 * width:
                np.testing.assert_allclose(effort, exact if uneven < 1e-9 else mean, rtol=1e-9, atol=1e-9)
            np.testing.assert_allclose(stamp, time_s[inside].mean(), atol=1e-9)
    # Every sample except those next to a gap is in a mean.
    assert kept.size >= np.unique(number).size - 4


def test_means_do_not_depend_on_where_the_first_block_ends():
    """It has one row if `--between` begins at the last row of a reader's block."""
    time_s = 0.001 * np.arange(5000)
    time_s[1] -= 4e-4
    position = np.column_stack([np.sin(time_s), np.cos(0.7 * time_s)])
    rows = RowBlock(time_s, position, current_a=position**2)
    kept = []
    for edges in ([0, 5000], [0, 1, 5000], [0, 1, 2, 700, 5000], [0, 1, 700]):
        averager = TimeAverager(None)
        for first, end in itertools.pairwise(edges):
            averager.add(rows.rows(slice(first, end)))
        kept.append(averager.recording(RecordingSource(Path("x"), "", "made", 0, {})))
    whole, *others, shortest = kept
    assert whole.size == 500
    for other in others:
        np.testing.assert_array_equal(other.time_s, whole.time_s)
        np.testing.assert_array_equal(other.current_a, whole.current_a)
    np.testing.assert_array_equal(shortest.time_s, whole.time_s[:70])


def test_means_that_are_too_long_for_the_motion_are_refused(pinocchio_arm):
    time_s = 0.1 * np.arange(30_000)
    position = np.outer(np.sin(time_s / 0.15), np.full(6, 0.3))
    source = RecordingSource(Path("shift.csv"), "", "csv", 0, {})
    repeats = repeated_values(position, position)
    run = Recording(time_s=time_s, position_rad=position, current_a=position, source=source, repeats=repeats)
    with pytest.raises(
        RecordingError, match=r"0\.8 h .* means over 100 ms, .* 2 %.* with `between_s=`, such as its first 600 s"
    ):
        usable_runs([run], 6, pinocchio_arm.transmission)


def test_a_saturated_joint_is_found_in_a_long_run_too(runs, pinocchio_arm, tmp_path):
    run = runs[0]
    current = run.current_a.copy()
    bound = 0.6 * np.abs(current[:, 1]).max()
    # In one period only, so the average period does not show it.
    late = slice(2000, None)
    current[late, 1] = np.clip(current[late, 1], -bound, bound)
    current[:2000, 1] = np.clip(current[:2000, 1], -0.999 * bound, 0.999 * bound) * np.linspace(0.999, 1.0, 2000)
    path = write_mcap(tmp_path / "clipped.mcap", replace(run, current_a=current))
    for short_rows in (EVERYTHING, NOTHING):
        with pytest.raises(RecordingError, match="joint 2 stays at its maximum"):
            usable_runs([read_recording_file(path, short_rows=short_rows)], 6, pinocchio_arm.transmission)
    usable_runs(
        [read_recording_file(write_mcap(tmp_path / "clean.mcap", run), short_rows=NOTHING)],
        6,
        pinocchio_arm.transmission,
    )


def test_a_stuck_current_is_found_in_a_long_run_too(runs, pinocchio_arm, tmp_path):
    """In one period only, so that the average period still changes."""
    run = runs[0]
    current = run.current_a.copy()
    half = len(current) // 6
    current[half : 2 * half, 4] = current[half, 4]
    path = write_mcap(tmp_path / "stuck.mcap", replace(run, current_a=current))
    for short_rows in (EVERYTHING, NOTHING):
        with pytest.raises(RecordingError, match=rf"stuck.mcap: joint 5 moves back and forth .* for {half} samples"):
            usable_runs([read_recording_file(path, short_rows=short_rows)], 6, pinocchio_arm.transmission)


def test_repetitions_are_counted_across_blocks():
    rng = np.random.default_rng(3)
    values = np.round(np.clip(rng.normal(size=(5000, 3)), -1.2, 1.2), 1)
    values[2000:2040, 1] = 1.2
    values[100:130, 2] = 0.3
    values[3000:3800, 0] = 0.7
    position = np.sin(np.outer(0.012 * np.arange(5000), [1.0, 0.3, 0.1]))
    whole = repeated_values(values, position)
    counter = RepeatCounter(3)
    edges = np.sort(rng.choice(4999, 60, replace=False)) + 1
    for block, moved in zip(np.split(values, edges), np.split(position, edges), strict=True):
        counter.add(block, moved)
    for field in fields(whole):
        np.testing.assert_array_equal(getattr(counter.found, field.name), getattr(whole, field.name))
    assert whole.at_bound[1] >= 39
    assert whole.elsewhere[2] >= 29
    assert (whole.turned_for[0] >= 800, whole.turned_at[0]) == (True, 0.7)
    assert whole.turned_rad[0] == pytest.approx(2.0, abs=0.02)


def garbage_rows(rng, rows):
    """A plausible log with every kind of garbage at the borders of windows."""
    time_s = 10.0 + 0.001 * np.arange(rows)
    position = np.column_stack([np.sin(time_s), np.cos(time_s)])
    current = rng.normal(size=(rows, 2))
    bad = np.sort(rng.choice(np.arange(50, rows - 50), 60, replace=False))
    edges = FIRST_WINDOW + np.arange(-2, 3)
    position[bad[:10], 0] = np.nan
    current[bad[10:20], 1] = 1e9
    time_s[bad[20:30]] += 5.0
    time_s[bad[30:40]] += 1e5
    position[[*bad[40:50], *edges], 1] += 30.0
    time_s[bad[50:]] = time_s[bad[50:] - 1]
    return RowBlock(time_s, position, current_a=current)


def test_garbage_is_found_in_windows_as_in_one_piece(tmp_path):
    rows = garbage_rows(np.random.default_rng(8), FIRST_WINDOW + 70_000)
    filtered = GarbageFilter(tmp_path / "log")
    parts = (rows.rows(slice(first, first + 3000)) for first in range(0, rows.size, 3000))
    kept = joined(list(filtered.valid(parts)))
    assert len(filtered.reasons) == 5
    whole = GarbageFilter(tmp_path / "log")
    expected = joined(list(whole.valid([rows])))
    assert filtered.reasons == whole.reasons
    np.testing.assert_array_equal(kept.time_s, expected.time_s)
    assert (np.diff(kept.time_s) > 0.0).all()


def test_a_csv_log_reads_the_same_in_many_blocks(pinocchio_arm, tmp_path):
    """More lines than a block: only the last line can be truncated."""
    run = pinocchio_arm.run(pinocchio_arm.trajectory(), True, seed=3, periods=40)
    path = write_csv(tmp_path / "long.csv", run)
    lines = path.read_text().splitlines()
    lines[16_384] = "1,2,3"
    lines[18_000] = lines[18_000].replace(",", ",x", 1)
    path.write_text("\r\n".join([*lines, "9999.0,0.1"]))
    recording = read_recording_file(path, COLUMNS)
    assert recording.source.rows_read == 20_001
    assert dict(recording.source.reasons) == {"truncated last row": 1, "wrong number of columns": 1, "not a number": 1}
    np.testing.assert_allclose(recording.current_a[:1000], run.current_a[:1000], rtol=1e-8)


def test_a_damaged_file_is_refused(runs, tmp_path):
    data = bytearray(write_mcap(tmp_path / "good.mcap", runs[0]).read_bytes())
    data[len(data) // 2] ^= 0xFF
    path = tmp_path / "bad.mcap"
    path.write_bytes(data)
    with pytest.raises(RecordingError, match="damaged"):
        read_recording_file(path)


PEAK = """
import json, os, resource, sys
from pathlib import Path
import numpy as np
from armload_identification.excitation.fourier import Excitation, FourierTrajectory
from armload_identification.recording import file_reading
from armload_identification.recording.row_block import RowBlock
from armload_identification.excitation.excitation_file import format_excitation
from armload_identification.signals.joint_torque import Transmission
from armload_identification.signals.recorded_run import Run

period = 4000
trajectory = FourierTrajectory(0.25, np.zeros(6), np.full((6, 2), 0.2), np.full((6, 2), 0.1))
one = trajectory.evaluate(np.arange(1, period + 1) * 1e-3)
noise = np.random.default_rng(1).normal(size=(2 * period, 6))


class Endless:
    kind = "made"

    def __init__(self, rows, periodic):
        # What has no period is averaged over 10 ms: rows so far apart soon fill what is kept.
        self.rows, self.pace = rows, 1.0 if periodic else 10.0
        excitation = format_excitation(Excitation(trajectory, rows // period))
        self.attachments = {"excitation.toml": excitation} if periodic else {}

    def blocks(self, account):
        for first in range(0, self.rows, period):
            phase = (first + np.arange(1, period + 1)) * 1e-3
            other = first // period * 7919 % period
            current = one.velocity_rad_s + noise[other : other + period]
            account.rows_read += period
            yield RowBlock(100.0 + self.pace * phase, one.position_rad, current_a=current, phase_s=phase)


def peak(rows, periodic):
    file_reading.reader_of = lambda path, options: Endless(rows, periodic)
    run = file_reading.read_recording_file(Path("made"))
    if periodic:
        motion = Run.of(run, Transmission(np.ones(6), np.eye(6))).motion
        assert motion.periods == rows // period, motion.periods
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def apart(rows, periodic):
    reading, writing = os.pipe()
    child = os.fork()
    if not child:
        os.write(writing, str(peak(rows, periodic)).encode())
        os._exit(0)
    os.close(writing)
    os.waitpid(child, 0)
    with os.fdopen(reading) as found:
        return int(found.read())


peak(20_000, True)  # loads what is loaded late
FEW = {"periodic": 200_000, "aperiodic": 400_000}
print(json.dumps({kind: [apart(rows, kind == "periodic") for rows in (few, 2_000_000)] for kind, few in FEW.items()}))
"""


@pytest.fixture(scope="module")
def peaks_kib():
    """By kind of motion: peak memory in KiB for few rows and for 2 million, each in a forked process.

    The rows come from a generator, so only reading and reducing is measured. A started program would inherit the peak
    of this process.
    """
    answer = subprocess.run([sys.executable, "-c", PEAK], capture_output=True, text=True, timeout=200, check=False)
    assert answer.returncode == 0, answer.stderr
    return json.loads(answer.stdout)


@pytest.mark.parametrize("kind", ["periodic", "aperiodic"])
@pytest.mark.long
def test_memory_does_not_grow_with_the_recording(peaks_kib, kind):
    peaks = peaks_kib[kind]
    assert peaks[1] < 1.1 * peaks[0], peaks
    # For comparison: two million unreduced rows would take 250 MB.
    assert peaks[1] < peaks[0] + 50_000


def test_from_arrays_is_cleaned_and_hashed(pair, pinocchio_arm):
    run = pair[0]
    time_s, position, current = run.time_s.copy(), run.position_rad, run.current_a.copy()
    current[7, 2] = np.nan
    made = Recording.from_arrays(time_s, position, current_a=current, name="my run")
    assert made.size == run.size - 1
    assert dict(made.source.reasons) == {"not finite": 1}
    assert (made.source.kind, made.source.path.name) == ("arrays", "my run")
    again = Recording.from_arrays(time_s, position, current_a=current)
    assert again.source.sha256 == made.source.sha256
    other = Recording.from_arrays(time_s, position, torque_nm=current)
    assert other.source.sha256 != made.source.sha256
    periodic = Recording.from_arrays(
        run.time_s, position, current_a=run.current_a, phase_s=run.phase_s, excitation=run.excitation
    )
    whole = Run.of(replace(run, average=None, repeats=None), pinocchio_arm.transmission).motion
    assert_same(Run.of(periodic, pinocchio_arm.transmission).motion, whole, 0.0)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"current_a": None}, "neither motor current nor joint torque"),
        ({"current_a": np.zeros((30, 2))}, r"current_a has shape \(30, 2\); expected \(30, 3\)"),
        ({"time_s": np.arange(29.0)}, r"time_s has shape \(29,\)"),
        ({"position_rad": np.arange(30.0)}, "a row per sample"),
        ({"phase_s": np.arange(30.0)}, "belong together"),
        ({"time_s": np.zeros(30)}, "1 usable rows of 30"),
    ],
)
def test_arrays_that_are_no_recording_are_refused(changes, said):
    given = {"time_s": 0.01 * np.arange(30.0), "position_rad": np.zeros((30, 3)), "current_a": np.ones((30, 3))}
    given = given | changes
    with pytest.raises(RecordingError, match=said):
        Recording.from_arrays(given.pop("time_s"), given.pop("position_rad"), **given)
