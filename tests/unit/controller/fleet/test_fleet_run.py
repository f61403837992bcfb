"""Order of work: repeated looks at a changing table, and the report of the results."""

import json
import re
from collections import Counter
from dataclasses import replace
from datetime import timedelta
from fnmatch import fnmatch
from pathlib import Path

import pytest

from armload_controller.cli.output.fleet_output import suspicion_lines
from armload_controller.control_errors import ConfigurationError, FleetError, ListingError
from armload_controller.fleet.arm_runs import Quantity, QuantityKind
from armload_controller.fleet.attention import attention_of
from armload_controller.fleet.fleet_review import review_fleet
from armload_controller.fleet.fleet_rows import runs_of
from armload_controller.fleet.fleet_run import FleetTally, do_jobs, looks
from armload_controller.fleet.job import Job
from armload_controller.fleet.job_listing import JobListing, list_jobs
from armload_controller.fleet.job_table import read_job_table
from armload_controller.fleet.recording_row import RowOutcome, column_kinds, empty_row
from armload_controller.fleet.row_store import RowStore, latest_rows
from tests.fleet_nights import FIRST, NIGHTS, recorded_nights

PAGE = Path(__file__).resolve().parents[4] / "controller" / "FLEET.md"


class Over(Exception):
    """No more looks."""


def test_a_file_is_taken_when_it_is_no_longer_written_and_a_broken_table_is_waited_for(tmp_path, closed_store):
    table, recording = tmp_path / "jobs.csv", tmp_path / "a.mcap"
    text = "arm,robot,loaded\none,er50,*.mcap\n"
    between = [
        lambda: recording.write_bytes(b"beg"),  # no table at the first look
        lambda: table.write_text(text),
        lambda: recording.write_bytes(b"begun"),  # changed, so not yet seen twice
        lambda: None,
        lambda: None,  # done here
        lambda: table.write_text("arm\n"),
        lambda: table.write_text("arm,robot,loaded\none,er50," + closed_store + "/*.mcap\n"),
        lambda: table.write_text("arm,robot,loaded\none,er50,htp://cell/*.mcap\n"),
        lambda: table.write_text(text),
        lambda: table.write_text(text + "two,er50,two/*.mcap\n"),
        lambda: None,  # remarked on here
        lambda: None,  # and no more
    ]
    done, found = [], []

    def sleep(seconds):
        assert seconds == 7.0
        if not between:
            raise Over
        between.pop(0)()

    def do(jobs):
        for job in jobs:
            done.append(recording.read_bytes())
            yield empty_row(job, "1") | {"outcome": RowOutcome.IDENTIFIED.value}

    def look():
        with RowStore(tmp_path) as store:
            for result in looks(table, store, do, sleep, 7.0):
                found.append(result)

    with pytest.raises(Over):
        look()
    assert done == [b"begun"]
    assert [type(result) for result in found] == [ConfigurationError] * 2 + [
        *(FleetTally, ConfigurationError, ListingError, ListingError, JobListing)
    ]
    assert "line 3: no file matches two/*.mcap" in found[-1].remarks[0]
    assert (found[2].listed, found[2].done) == (1, 1)


def test_the_clock_of_a_worker_does_not_decide_which_row_counts(tmp_path):
    (tmp_path / "a.mcap").touch()
    (tmp_path / "jobs.csv").write_text("arm,robot,loaded\none,er50,a.mcap\n")
    for worker_days, mass in ((9, 1.0), (0, 2.0)):

        def do(jobs, off=timedelta(days=worker_days), mass=mass):
            for job in jobs:
                row = empty_row(job, "1")
                row |= {"identified_utc": row["identified_utc"] + off, "mass_kg": mass}
                yield row | {"outcome": RowOutcome.IDENTIFIED.value}

        with RowStore(tmp_path) as store:
            listing = list_jobs(read_job_table(tmp_path / "jobs.csv"), tmp_path / "jobs.csv")
            do_jobs(listing, listing.jobs, store, do)
    (row,) = latest_rows(tmp_path, ("mass_kg",))
    assert row["mass_kg"] == 2.0


@pytest.mark.long
def test_a_job_that_fails_is_tried_again_less_and_less_often(tmp_path):
    (tmp_path / "jobs.csv").write_text("arm,robot,loaded\none,er50,gone.mcap\n")
    slept, done = [], []

    def sleep(seconds):
        slept.append(seconds)
        if len(slept) == 150:
            raise Over

    def do(jobs):
        for job in jobs:
            done.append(len(slept))
            yield empty_row(job, "1") | {"outcome": RowOutcome.FAILED.value, "error": "gone.mcap is not there"}

    with RowStore(tmp_path) as store, pytest.raises(Over):
        for _ in looks(tmp_path / "jobs.csv", store, do, sleep, 60.0):
            pass
    first = done[0]
    assert [look - first for look in done] == [0, 2, 6, 14, 30, 62, 126]


@pytest.fixture
def nights(tmp_path):
    recorded_nights(tmp_path)
    return tmp_path


def lines_on(runs, folder):
    review = review_fleet(runs)
    return suspicion_lines(review, attention_of(review, folder, FIRST.date()))


def test_the_report_names_what_changed(armload, nights):
    result = armload("fleet", "report", nights, "--json")
    assert result.exit_code == 5, (result.output, result.exception)
    first, second = json.loads(result.stdout)["arms"]
    assert (first["name"], first["model"], first["runs"], first["without_result"]) == ("one", "er50", NIGHTS, 1)
    assert {found["cause"]: found["figure"] for found in first["suspicions"]} == {"change": "mass", "no result": None}
    assert "since 2026-03-07" in first["suspicions"][0]["text"]
    assert second["suspicions"] == []
    assert "mass of tool" in (nights / "report.html").read_text()
    runs = runs_of(nights)
    assert "  1. one: mass of tool is 2.30 kg since 2026-03-07" in lines_on(runs, nights)[1]
    today = [replace(run, recorded=run.recorded + timedelta(days=40)) for run in runs if run.arm == "two"]
    assert lines_on([*today, *(run for run in runs if run.arm == "one")], nights) == [
        "to be inspected: none of 1 arm",
        "no recent recording, not assessed: one (2026-03-10); removed, or their recordings no longer arrive",
    ]


def test_a_recording_that_was_moved_counts_once(tmp_path):
    with RowStore(tmp_path) as store:
        for hour, folder in enumerate(("data", "mnt")):
            for night in range(2):
                job = Job(f"{folder}{night}", "one", "er50", {"loaded": f"{folder}/{night}.mcap"}, "", "", None, None)
                made = FIRST + timedelta(days=night)
                row = empty_row(job, "1") | {"recorded_utc": made, "identified_utc": FIRST + timedelta(hours=hour)}
                store.add(row | {"outcome": RowOutcome.IDENTIFIED.value, "loaded_sha256": f"{night}"})
        for job_key, outcome, second in (("kept", "identified", 0), ("gone", "failed", 1)):  # one of two paths
            job = Job(job_key, "one", "er50", {"loaded": f"{job_key}/2.mcap"}, "", "", None, None)
            row = empty_row(job, "1") | {"outcome": outcome, "loaded_sha256": "2"}
            made = FIRST + timedelta(days=2)
            store.add(row | {"recorded_utc": made, "identified_utc": made + timedelta(seconds=second)})
    assert [run.recording for run in runs_of(tmp_path)] == ["mnt/0.mcap", "mnt/1.mcap", "kept/2.mcap"]


def test_figures_of_a_row_are_those_that_are_determined(nights):
    run = next(run for run in runs_of(nights) if run.recording == "two/0.mcap")
    assert set(run.figures) == {
        Quantity(QuantityKind.MASS, "tool"),
        Quantity(QuantityKind.GAIN, "a"),
        Quantity(QuantityKind.FRICTION, "a"),
        Quantity(QuantityKind.FRICTION, "b"),
        Quantity(QuantityKind.RESIDUAL, "a"),
        Quantity(QuantityKind.RESIDUAL, "b"),
    }
    assert run.figures[Quantity(QuantityKind.MASS, "tool")] == pytest.approx((2.001, 0.02 / 1.96), abs=1e-5)
    assert run.figures[Quantity(QuantityKind.RESIDUAL, "a")] == (2.0, 0.0)


def test_duckdb_answers_what_an_operator_asks(nights, queried):
    """The queries of FLEET.md."""
    parts = f"'{nights}/day=*/*.parquet'"
    latest, friction, refused = queried(
        f"select arm, recorded_utc, mass_kg, mass_low_kg, mass_high_kg from {parts} where outcome = 'identified' "
        "qualify row_number() over (partition by arm order by recorded_utc desc) = 1 order by arm",
        f"select arm, unnest(joint_names) as joint, unnest(friction_nm) as friction_nm from {parts} "
        "where arm = 'two' and day = '2026-03-01'",
        f"select arm, error from {parts} where outcome <> 'identified'",
    )
    assert [(arm, round(mass, 3)) for arm, _, mass, *_ in latest] == [("one", 2.301), ("two", 1.999)]
    assert friction == [("two", "a", 3.0), ("two", "b", 4.0)]
    assert refused == [("one", "cut short")]


def test_a_folder_without_rows_says_what_makes_them(tmp_path):
    with pytest.raises(FleetError, match="no rows there; `armload fleet identify JOBS --output"):
        runs_of(tmp_path)


def test_the_page_describes_every_column_and_no_other():
    table = PAGE.read_text("utf-8").partition("\n## The rows\n")[2].partition("\n## ")[0]
    rows = re.findall(r"^\| (`.*?`) \|", table, flags=re.MULTILINE)
    patterns = [name for row in rows for name in re.findall("`(.*?)`", row)]
    columns = column_kinds()
    assert [name for name in columns if not any(fnmatch(name, pattern) for pattern in patterns)] == []
    assert [pattern for pattern in patterns if not any(fnmatch(name, pattern) for name in columns)] == []


def test_a_run_over_the_jobs_is_summed_up_in_a_line():
    tally = FleetTally(7, 2, Counter({"identified": 4, "failed": 1}), cpu_s=3.0, wall_s=2.0)
    assert repr(tally) == (
        "5 recordings in 2.0 s, 2.50/s, 0.60 s of CPU each: 4 identified, 0 refused, 1 failed; 2 processed before"
    )
    assert "0.00/s" in repr(replace(tally, wall_s=0.0))
    assert repr(FleetTally(1, 1)) == "nothing new: 1 recording processed before"
