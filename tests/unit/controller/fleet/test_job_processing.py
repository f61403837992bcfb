"""A job in this process: results, refusals and failures, with local and remote files."""

import errno
import functools
import hashlib
import http.server
import math
import shutil
import threading
from importlib import resources

import fsspec.asyn
import pytest

import armload
from armload_controller.cli.output.fleet_output import problem_lines
from armload_controller.control_errors import ConfigurationError, FleetError
from armload_controller.fleet.fleet_run import do_jobs, new_jobs
from armload_controller.fleet.job import Job
from armload_controller.fleet.job_processing import run_job, run_on_worker
from armload_controller.fleet.recording_row import RowOutcome, value_columns
from armload_controller.fleet.repeatable import outcome_of
from armload_controller.fleet.row_store import RowStore, read_rows
from armload_identification.identification_errors import (
    ExcitationFileError,
    ExtraMissing,
    ModelError,
    RecordingError,
)
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
    identification = found.identification
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
    assert row["verdict"] == "Repeatable within the tolerance"


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


PROFILE = '[product]\nname = "mine"\nsource = "manual"\n[drive]\nfeedback = "current"\n'


@pytest.fixture
def own_robot(tmp_path):
    """Writes a robot's file with a text added to its [robot] or to its first drive."""
    text = (resources.files("armload_configs") / "er50.toml").read_text("utf-8")
    text = text[: text.index("[simulation]")]
    excitation = text[text.index("[excitation]") : text.index("[bus]")]

    def make(robot="", drive="", excitations=""):
        path = tmp_path / "own.toml"
        own = text.replace(excitation, excitations).replace("[robot]\n", f"[robot]\n{robot}\n", 1)
        path.write_text(own.replace("[joints.drive]\n", f"[joints.drive]\n{drive}\n", 1))
        return str(path)

    return make


def job_of(robot, loaded, unloaded=None, calibration=""):
    recordings = {"loaded": str(loaded)} | ({} if unloaded is None else {"unloaded": str(unloaded)})
    return Job("k", "one", robot, recordings, calibration, "", None, None)


def test_a_worker_reads_a_robot_again_if_one_of_its_profiles_has_changed(own_robot, tmp_path):
    profile = tmp_path / "mine.toml"
    profile.write_text(PROFILE)
    job = job_of(own_robot(drive='profile = "mine.toml"'), tmp_path / "none.mcap")
    assert "none.mcap: cannot be read" in run_job(job)["error"]
    profile.write_text(PROFILE + "speed = 1\n")
    row = run_job(job)
    assert (row["outcome"], "mine.toml: drive.speed is 1" in row["error"]) == ("refused", True), row["error"]


@pytest.mark.parametrize(
    ("given", "problem"),
    [
        ({"robot": 'calibration = "none.toml"'}, "robot.calibration is 'none.toml': cannot be read beside"),
        ({"drive": 'profile = "none.toml"'}, "joints[1].drive.profile is 'none.toml': expected a shipped"),
        ({"drive": 'description = "none.eds"'}, "none.eds: the file: cannot be read"),
        ({"drive": 'description = "own.toml"'}, "expected a usable EDS or DCF file"),
        ({"excitations": '[excitation]\nidentification = "own.toml"\nvalidation = "own.toml"\n'}, "own.toml: "),
    ],
)
def test_a_file_beside_the_robots_that_a_worker_lacks_or_no_payload_depends_on_is_tried_again(
    own_robot, recorded_er50, given, problem
):
    run = str(recorded_er50 / "runs" / "today" / "{}_identification.mcap").format
    row = run_job(job_of(own_robot(**given), run("loaded"), run("unloaded")))
    assert problem in row["error"]
    assert row["outcome"] == "failed"


def test_what_a_robots_file_says_wrongly_is_refused(own_robot, tmp_path):
    row = run_job(job_of(own_robot(drive='profile = "none"'), tmp_path / "none.mcap"))
    assert (row["outcome"], "profile is 'none'" in row["error"]) == ("refused", True), row["error"]


def test_a_row_states_when_the_loaded_run_was_made_even_if_the_other_is_missing(recorded_er50):
    run = recorded_er50 / "runs" / "today" / "loaded_identification.mcap"
    row = run_job(job_of("er50", run, run.with_name("none.mcap")))
    assert (row["outcome"], row["recorded_by"]) == ("failed", "recording")
    assert row["loaded_sha256"] == hashlib.sha256(run.read_bytes()).hexdigest()


def test_a_url_that_the_worker_has_no_library_for_is_tried_again():
    row = run_job(job_of("er50", "s3://bucket/a.mcap"))
    assert (row["outcome"], "pip install s3fs" in row["error"]) == ("failed", True), row["error"]


def caused(problem, cause):
    problem.__cause__ = cause
    return problem


@pytest.mark.parametrize(
    ("problem", "outcome"),
    [
        (RecordingError("no rows"), "refused"),
        (ConfigurationError("a.toml", "key", None, "expected"), "refused"),
        (caused(ConfigurationError("a.toml", "workspace", {}, "expected"), ModelError("radius")), "refused"),
        (ExcitationFileError("a.mcap, attachment", "key", None, "expected"), "refused"),
        (caused(RecordingError("damaged"), OSError("Corrupt snappy compressed data")), "refused"),
        (caused(RecordingError("a"), PermissionError(errno.EACCES, "Permission denied")), "failed"),
        (caused(RecordingError("a"), caused(RecordingError("b"), OSError(errno.EIO, "I/O error"))), "failed"),
        (caused(RecordingError("a bag needs rosbags"), ImportError("rosbags")), "failed"),
        (ExtraMissing("needs SciPy"), "failed"),
        (FleetError("another version"), "failed"),
        (caused(ConfigurationError("a", "b", "c", "d"), ExcitationFileError("e", "f", None, "g")), "failed"),
        (MemoryError(), "failed"),
        (ZeroDivisionError("division by zero"), "failed"),
    ],
)
def test_only_what_would_be_refused_again_is_refused(problem, outcome):
    assert outcome_of(problem) == outcome


def test_a_worker_that_joined_with_another_version_does_nothing():
    with pytest.raises(FleetError, match=r"has armload .*, the coordinator 0\.0; install the same version everywhere"):
        run_on_worker(job_of("er50", "none.mcap"), "0.0")


def test_a_second_run_does_what_failed_and_what_is_new(done):
    table, rows, _ = done
    with RowStore(rows) as store:
        listing, jobs = new_jobs(table, store)
        assert [job.arm for job in jobs] == ["gone", "lost", "homeless"]
        assert len(listing.jobs) == 8
