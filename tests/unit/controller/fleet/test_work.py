"""A job in this process: results, refusals and failures, with local and remote files."""

import functools
import http.server
import math
import shutil
import threading

import fsspec.asyn
import pytest

import armload
from armload_controller.cli.output.fleet_output import problem_lines
from armload_controller.fleet.fleet_run import do_jobs, new_jobs
from armload_controller.fleet.recording_row import RowOutcome, value_columns
from armload_controller.fleet.row_store import RowStore, read_rows
from armload_controller.fleet.work import run_job
from armload_identification.model.payload import PARAMETER_NAMES


class _Quiet(http.server.SimpleHTTPRequestHandler):
    def log_message(self, *_args):
        """Nothing on the console."""


@pytest.fixture(scope="module")
def server(recorded_er50):
    """The recordings on a server of this machine."""
    fsspec.asyn.get_loop()  # its thread lasts as long as the process
    handler = functools.partial(_Quiet, directory=str(recorded_er50))
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as serving:
        thread = threading.Thread(target=serving.serve_forever, args=(0.01,), daemon=True)
        thread.start()
        yield f"http://127.0.0.1:{serving.server_address[1]}"
        serving.shutdown()
        thread.join()


@pytest.fixture(scope="module")
def done(recorded_er50, server, tmp_path_factory):
    """A table with all kinds of jobs, done once; rows by arm, and their folder."""
    desk = tmp_path_factory.mktemp("jobs")
    today = recorded_er50 / "runs" / "today"
    shutil.copy(today / "loaded_identification.mcap", desk / "near.mcap")
    (desk / "damaged.mcap").write_bytes((today / "loaded_identification.mcap").read_bytes()[:300])
    (desk / "wrong.toml").write_text("[robot]\n")
    lines = [
        "arm,robot,loaded,unloaded,validation_loaded,validation_unloaded,mass_kg",
        f"far,er50,{server}/runs/*/loaded_identification.mcap,{server}/runs/*/unloaded_identification.mcap,,,9.8",
        f"near,er50,near.mcap,{today}/unloaded_identification.mcap,{today}/loaded_validation.mcap,"
        f"{today}/unloaded_validation.mcap",
        f"damaged,er50,damaged.mcap,{today}/unloaded_identification.mcap",
        f"alone,er50,{today}/loaded_identification.mcap",
        f"misconfigured,wrong.toml,{today}/loaded_validation.mcap",
        f"gone,er50,{server}/runs/none.mcap,{today}/unloaded_identification.mcap",
        "lost,er50,lost.mcap",
        f"homeless,er51,{today}/unloaded_validation.mcap",
    ]
    table, rows = desk / "jobs.csv", desk / "rows"
    table.write_text("\n".join(lines) + "\n")
    rows.mkdir()
    counts = []
    with RowStore(rows) as store:
        listing, jobs = new_jobs(table, store)
        tally = do_jobs(listing, jobs, store, functools.partial(map, run_job), counts.append)
    assert (tally.listed, tally.skipped, tally.done, counts) == (8, 0, 8, list(range(1, 9)))
    assert tally.to_dict()["outcomes"] == {"identified": 2, "refused": 3, "failed": 3}
    lines = problem_lines(tally, rows)
    assert lines[0].startswith(f"  refused: damaged: {desk}/damaged.mcap: ")
    assert lines[1].startswith(f"  refused: alone: {today}/loaded_identification.mcap: ")
    assert lines[5] == f"  and 1 more: `armload fleet report {rows}` lists them"
    assert "what failed is tried again" in lines[6]
    return table, rows, {row["arm"]: row for row in read_rows(rows, ())}


def test_a_row_holds_what_identify_finds(done, recorded_er50):
    row = done[2]["far"]
    run = str(recorded_er50 / "runs" / "today" / "{}_identification.mcap").format
    found = armload.identify("er50", run("loaded"), run("unloaded"), known=armload.KnownPayload(mass_kg=9.8))
    for name, columns in zip(PARAMETER_NAMES, value_columns(), strict=True):
        interval = found.intervals[name]
        assert (interval is None) == (row[columns[0]] is None)
        if interval is not None:
            assert (row[columns[1]], row[columns[2]]) == interval
    assert row["model"] == found.payload.model.values.tolist()
    assert row["loaded_sha256"] in found.payload.provenance.recordings_sha256.values()
    assert row["robot_sha256"] == found.payload.provenance.configuration_sha256
    identification = found.content.identification
    assert row["friction_nm"] == identification.arm_friction.torque_nm.tolist()
    assert row["gain_change"] == [math.expm1(value) for value in identification.gains.log_gain]
    assert row["notes"] == list(identification.notes)
    assert (row["verdict"], row["known_mass_kg"]) == ("Not validated", 9.8)
    assert row["joint_names"] == list(found.arm.joint_names)
    assert (row["recorded_utc"].isoformat(), row["recorded_by"]) == ("2026-03-01T10:00:00+00:00", "recording")
    assert list((done[1] / "day=2026-03-01").iterdir())


def test_a_validation_is_used(done):
    row = done[2]["near"]
    assert row["mass_kg"] == pytest.approx(9.81, abs=0.2)
    assert row["validation_outcome"] == "right"
    assert row["verdict"] == "Right within the tolerance"


@pytest.mark.parametrize(
    ("arm", "outcome", "problem"),
    [
        ("damaged", RowOutcome.REFUSED, "damaged.mcap"),
        ("alone", RowOutcome.REFUSED, "no unloaded recording was given"),
        ("misconfigured", RowOutcome.REFUSED, "wrong.toml: "),
        ("gone", RowOutcome.FAILED, "FileNotFoundError: http://127.0.0.1"),
        ("lost", RowOutcome.FAILED, "lost.mcap: cannot be read"),
        ("homeless", RowOutcome.FAILED, "/er51: cannot be read (No such file or directory), and no shipped"),
    ],
)
def test_what_goes_wrong_is_a_row(done, arm, outcome, problem):
    row = done[2][arm]
    assert row["outcome"] == outcome.value
    assert problem in row["error"]
    assert row["mass_kg"] is None
    assert row["cpu_s"] >= 0.0


def test_a_second_run_does_what_failed_and_what_is_new(done):
    table, rows, _ = done
    with RowStore(rows) as store:
        listing, jobs = new_jobs(table, store)
        assert [job.arm for job in jobs] == ["gone", "lost", "homeless"]
        assert len(listing.jobs) == 8
