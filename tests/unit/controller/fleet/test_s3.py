"""Recordings on S3, served by moto on loopback: `armload fleet identify` as called by a user.

Needs s3fs and moto, which `.ci/run` installs from `s3.lock`: botocore requires an older python-dateutil than the rest
of the environment.
"""

import json
import os
import subprocess
import sys

import pytest

from armload_controller.fleet.recording_row import RowOutcome
from armload_controller.fleet.row_store import latest_rows

pytest.importorskip("moto", reason="needs moto and s3fs: .ci/run installs them")
import s3fs
from moto.server import ThreadedMotoServer

COMMAND = (sys.executable, "-c", "from armload_controller.cli.entry import main; main()", "fleet", "identify")


@pytest.fixture(scope="module")
def bucket(recorded_er50):
    """A bucket with the recordings of two days, an environment with access to it, and its file system."""
    server = ThreadedMotoServer("127.0.0.1", 0, verbose=False)
    server.start()
    host, port = server.get_host_and_port()
    environment = {
        "AWS_ENDPOINT_URL": f"http://{host}:{port}",
        "AWS_ACCESS_KEY_ID": "nobody",
        "AWS_SECRET_ACCESS_KEY": "nothing",
        "AWS_DEFAULT_REGION": "us-east-1",
    }
    with pytest.MonkeyPatch.context() as patch:
        for name, value in environment.items():
            patch.setenv(name, value)
        files = s3fs.S3FileSystem(skip_instance_cache=True)
        files.mkdir("cell")
        for day in ("monday", "tuesday"):
            for load in ("loaded", "unloaded"):
                recording = recorded_er50 / "runs" / "today" / f"{load}_identification.mcap"
                files.put(str(recording), f"cell/{day}/{load}.mcap")
        yield files, environment
    server.stop()


def identify(table, rows, environment):
    """The command in a separate process."""
    return subprocess.run(
        [*COMMAND, str(table), "-o", str(rows), "--workers", "1", "--json"],
        env=os.environ | environment,
        capture_output=True,
        text=True,
        check=False,
    )


def document(table, rows, environment, status):
    """The document that `fleet identify --json` prints."""
    done = identify(table, rows, environment)
    assert done.returncode == status, done.stderr
    return json.loads(done.stdout)


def test_recordings_on_s3_are_identified_skipped_and_done_again_where_they_changed(bucket, tmp_path):
    files, environment = bucket
    table, rows = tmp_path / "jobs.csv", tmp_path / "rows"
    table.write_text(
        "arm,robot,loaded,unloaded\n"
        "daily,er50,s3://cell/*/loaded.mcap,s3://cell/*/unloaded.mcap\n"
        "gone,er50,s3://cell/sunday/loaded.mcap,s3://cell/monday/unloaded.mcap\n"
    )
    first = document(table, rows, environment, 0)
    assert first["outcomes"] == {"identified": 2, "refused": 0, "failed": 1}
    found = {row["loaded"]: row for row in latest_rows(rows, ("mass_kg", "error", "outcome"))}
    for day in ("monday", "tuesday"):
        assert found[f"s3://cell/{day}/loaded.mcap"]["mass_kg"] == pytest.approx(9.81, abs=0.2)
    gone = found["s3://cell/sunday/loaded.mcap"]
    assert gone["outcome"] == RowOutcome.FAILED.value
    assert "cell/sunday/loaded.mcap" in gone["error"]

    files.pipe("cell/tuesday/loaded.mcap", files.cat("cell/tuesday/loaded.mcap")[:300])
    second = document(table, rows, environment, 1)  # no new recording gave a result
    assert (second["listed"], second["skipped"]) == (3, 1)
    assert second["outcomes"] == {"identified": 0, "refused": 1, "failed": 1}


def test_a_store_that_does_not_answer_is_a_sentence(tmp_path, bucket):
    table = tmp_path / "jobs.csv"
    table.write_text("arm,robot,loaded\ndaily,er50,s3://cell/*/loaded.mcap\n")
    nowhere = bucket[1] | {"AWS_ENDPOINT_URL": "http://127.0.0.1:1", "AWS_MAX_ATTEMPTS": "1"}
    done = identify(table, tmp_path / "rows", nowhere)
    assert done.returncode == 1, done.stdout
    assert "Traceback" not in done.stderr
    text = " ".join(done.stderr.split())
    assert text.startswith("error: s3://cell/*/loaded.mcap: cannot be listed (Could not connect to the endpoint")
