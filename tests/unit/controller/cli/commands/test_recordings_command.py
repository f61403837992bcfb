"""`armload recordings show`, and the options of `identify` that select parts of a recording."""

from __future__ import annotations

import json
import re

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from armload_controller.config.objects_or_paths import arm_of
from armload_identification.recording import file_reading
from armload_identification.recording.file_reading import read_recording_file

DEGREE = np.pi / 180.0
NAMES = [f"q{j}" for j in range(1, 4)]


def write_log(path, load=0.0, *, period_s=3.0, seconds=9.0, effort="tau", hole=(), seed=1):
    """A log of three joints: a second of standstill, motion, a second of standstill."""
    time_s = np.delete(0.01 * np.arange(round((seconds + 2.0) * 100)), hole)
    phase = 2.0 * np.pi / period_s * np.clip(time_s - 1.0, 0.0, seconds)
    q = np.column_stack([np.sin(phase), 0.5 * np.sin(2 * phase), 0.3 * np.sin(phase + 1.0)])
    noise = np.random.default_rng(seed).normal(size=q.shape)
    columns = [time_s, *q.T, *(20.0 + load + 5.0 * q + 0.1 * noise).T]
    header = ["t", *NAMES, *(f"{effort}{j}" for j in range(1, 4))]
    np.savetxt(path, np.column_stack(columns), delimiter=",", header=",".join(header), comments="")
    return path


def shown(armload, *words):
    result = armload("recordings", "show", *map(str, words))
    assert result.exit_code == 0, (result.output, result.exception)
    return result.stdout


def document(armload, *words):
    return json.loads(shown(armload, *words, "--json"))


def test_a_log_is_described(armload, tmp_path):
    path = write_log(tmp_path / "log.csv", hole=np.r_[500:508])
    text = shown(armload, path)
    for fact in (
        r"format +csv",
        r"rows +1092",
        r"time +10\.99 s, 100 rows per second, 1 gap, the longest 0\.09 s",
        r"joints +3, not named",
        r"effort +joint torque",
        r"motion +from (0\.9|1)\S* to (10|9\.9)\S* s, \d whole periods of [23]\.\d+ s, found in the motion",
        r"1 .* -1\.000 to 1\.000",
        "requires a second run of the same motion",
    ):
        assert re.search(fact, text), (fact, text)
    (facts,) = document(armload, path)["recordings"]
    assert facts["period_s"] == pytest.approx(3.0, rel=0.01)
    assert facts["periods"] == 3
    assert facts["joints"][0]["position_rad"] == pytest.approx([-1.0, 1.0], abs=1e-3)
    assert facts["missing"] == []


@pytest.fixture
def bare_table(tmp_path):
    """A table as a UR10e's logger writes it."""
    values = np.zeros((500, 24))
    values[:, 0] = 0.008 * np.arange(500)
    values[:, 1:7] = np.sin(values[:, :1] + np.arange(6))
    np.savetxt(tmp_path / "log.csv", values, delimiter=",")
    return tmp_path / "log.csv"


def test_a_table_without_a_header_is_read_by_the_log_of_the_arm(armload, bare_table):
    assert armload("recordings", "show", str(bare_table)).exit_code == 1
    assert re.search(r"joints +6, ", shown(armload, "--robot", "ur10e", bare_table))


def test_the_limits_of_the_arm_tell_degrees_from_radians(armload, bare_table, tmp_path, monkeypatch):
    given = []

    def read(path, options, **how):
        given.append(options)
        return read_recording_file(path, options, **how)

    monkeypatch.setattr(file_reading, "read_recording_file", read)
    shown(armload, write_log(tmp_path / "named.csv"))
    shown(armload, "--robot", "ur10e", bare_table)
    assert given[0].position_limits_rad is None
    np.testing.assert_array_equal(given[1].position_limits_rad, arm_of("ur10e").position_limits_rad)


def test_what_is_missing_is_said(armload, tmp_path):
    path = write_log(tmp_path / "log.csv", effort="x")
    (facts,) = document(armload, path)["recordings"]
    assert facts["effort"] is None
    assert "joint torque or motor current" in facts["missing"][0]
    assert "not sufficient to identify" in shown(armload, path)
    still = document(armload, write_log(tmp_path / "still.csv", seconds=0.0))["recordings"][0]
    assert (still["moving_s"], still["period_s"]) == (None, None)
    assert any("no joint moves" in sentence for sentence in still["missing"])


def test_two_runs_are_a_pair_or_it_is_said_why_not(armload, tmp_path):
    one, two = write_log(tmp_path / "a.csv"), write_log(tmp_path / "b.csv", load=3.0, seed=2)
    other = write_log(tmp_path / "c.csv", period_s=4.3, seed=3)
    assert document(armload, one, two)["pair"] == {"fits": True, "problem": None}
    assert "identify can use them as a pair" in shown(armload, one, two)
    refused = document(armload, one, other)["pair"]
    assert not refused["fits"]
    assert "not of the same trajectory" in refused["problem"]


def test_a_part_and_some_joints_can_be_chosen(armload, tmp_path):
    path = write_log(tmp_path / "log.csv")
    (facts,) = document(armload, path, "--between", "2s", "0.1min", "--joints", "3,1")["recordings"]
    assert facts["duration_s"] == pytest.approx(4.0, abs=0.02)
    assert [joint["position_rad"][1] for joint in facts["joints"]] == pytest.approx([0.3, 1.0], abs=0.01)
    mapped = document(armload, path, "--columns", "time=0 position=2-3 torque=5-6")["recordings"][0]
    assert len(mapped["joints"]) == 2


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--between", "5s", "2s"], "5 s is not before 2 s"),
        (["--between", "soon", "2s"], "'soon' is not a time"),
        (["--joints", "0-2"], "'0-2' is neither a joint"),
        (["--joints", "1,1"], "names a joint twice"),
        (["--episode", "last"], "'last' is not an episode number"),
        (["--episode", "1,2"], "2 numbers for 1 recordings"),
    ],
)
def test_options_that_make_no_sense_are_wrong_usage(armload, tmp_path, words, said):
    result = armload("recordings", "show", str(write_log(tmp_path / "log.csv")), *words)
    assert result.exit_code == 2
    assert said in " ".join(re.sub("[│\n]", " ", result.output).split())


def test_times_outside_the_recording_are_named_with_its_length(armload, tmp_path):
    path = str(write_log(tmp_path / "log.csv"))
    beyond = armload("recordings", "show", path, "--between", "400s", "500s")
    assert "no row between 400 and 500 s (`between_s=`): the recording has rows from 0 to 11.0 s." in str(
        beyond.exception
    )
    few = armload("recordings", "show", path, "--between", "0s", "50ms")
    assert re.search(r"6 usable rows of 1100 \(1094 outside `between_s=`\)", str(few.exception))


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--every", "-5s"], "'--every': '-5s' is not a time; write 10s"),
        (["--every", "0s"], "'--every': '0s': expected a time above zero"),
        (
            ["--every", "10s", "--report", "x.html", "--symmetric"],
            "--report, --symmetric: cannot be combined with --every",
        ),
    ],
)
def test_options_of_windows_that_make_no_sense_are_named(armload, tmp_path, monkeypatch, words, said):
    monkeypatch.chdir(tmp_path)
    result = armload("identify", "ur10e", "--loaded", "none.csv", *words)
    assert result.exit_code == 2
    assert said in " ".join(re.sub("[│\n]", " ", result.output).split())


def test_joints_that_are_not_there_are_named(armload, tmp_path):
    result = armload("recordings", "show", str(write_log(tmp_path / "log.csv")), "--joints", "2-4")
    assert "no joint 4, the recording has 3" in str(result.exception)


def test_identify_and_validate_use_the_part_and_the_joints_that_are_given(armload, recorded_er50, tmp_path):
    """The runs of er50 as tables, with a gripper's column among them and garbage before; and as two episodes."""
    from armload_identification.recording.file_reading import read_recording_file

    today = recorded_er50 / "runs" / "today"
    paths, episodes = [], []
    for load in ("loaded", "unloaded"):
        run = read_recording_file(today / f"{load}_identification.mcap")
        inside = np.isfinite(run.phase_s)
        finger = np.zeros((np.count_nonzero(inside), 1))
        q, i = (np.hstack([finger, values[inside]]) for values in (run.position_rad, run.current_a))
        table = np.column_stack([run.time_s[inside], q, i])
        junk = table[:200].copy()
        junk[:, 0] = table[0, 0] - 20.0 + 0.05 * np.arange(200)
        path = tmp_path / f"{load}.csv"
        header = ["t", *(f"q{j}" for j in range(7)), *(f"i{j}" for j in range(7))]
        np.savetxt(path, np.vstack([junk, table]), delimiter=",", header=",".join(header), comments="", fmt="%.9g")
        paths.append(str(path))
        columns = dict(zip(header, table.T, strict=True))
        episodes.append(pa.table(columns | {"episode_index": np.full(len(table), len(episodes))}))
    words = ["identify", "er50", "--loaded", paths[0], "--unloaded", paths[1], "--json"]
    result = armload(*words, "--joints", "2-7", "--between", "20s", "1h")
    assert result.exit_code == 0, (result.output, result.exception)
    mass_kg = json.loads(result.stdout)["payload"]["model"]["mass_kg"]
    known = armload(
        "identify", "er50", *(f"--{k}={today / f'{k}_identification.mcap'}" for k in ("loaded", "unloaded")), "--json"
    )
    assert mass_kg == pytest.approx(json.loads(known.stdout)["payload"]["model"]["mass_kg"], rel=0.02)
    assert armload(*words).exit_code != 0

    again = armload("validate", "er50", today / "payload.toml", *words[2:], "--joints", "2-7", "--between", "20s", "1h")
    assert json.loads(again.stdout)["validation"]["outcome"] != "wrong"
    assert armload("validate", "er50", today / "payload.toml", *words[2:]).exit_code == 1

    both = tmp_path / "both.parquet"
    pq.write_table(pa.concat_tables(episodes), both)
    named = {"both.parquet episode 0", "both.parquet episode 1"}
    words = ["identify", "er50", "--loaded", both, "--unloaded", both, "--joints", "2-7", "--json"]
    result = armload(*words, "--episode", "0,1")
    assert json.loads(result.stdout)["payload"]["model"]["mass_kg"] == pytest.approx(mass_kg, rel=0.02)
    assert set(json.loads(result.stdout)["payload"]["recordings_sha256"]) == named
    assert "`episode=`, such as 3" in str(armload(*words).exception)
