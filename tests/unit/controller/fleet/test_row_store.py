"""Rows survive the death of their writer, and are always read as one table."""

from dataclasses import replace
from datetime import UTC, datetime, timedelta
from types import SimpleNamespace

import pytest

from armload_controller.control_errors import FleetError
from armload_controller.fleet.arm_runs import IN_FUTURE
from armload_controller.fleet.job import Job
from armload_controller.fleet.recording_row import RowOutcome, column_kinds, empty_row, recorded_fields
from armload_controller.fleet.row_store import RowStore, latest_rows, read_rows

DAY = datetime(2026, 3, 1, 23, 30, tzinfo=UTC)
JOB = Job("k0", "one", "er50", {"loaded": "a.mcap", "unloaded": "b.mcap"}, "", "tool", None, DAY)


def row(number, outcome=RowOutcome.IDENTIFIED, **changes):
    """A row of a recording made that many hours after the first."""
    job = replace(JOB, key=f"k{number}", recordings={"loaded": f"{number}.mcap"})
    made = empty_row(job, "1.2") | {"recorded_utc": DAY + timedelta(hours=number), "outcome": outcome.value}
    return made | {"mass_kg": 2.0 + number, "gain_change": [0.01, None], "joint_names": ["a", "b"]} | changes


def test_rows_become_one_file_per_day_and_duckdb_reads_them(tmp_path, queried):
    with RowStore(tmp_path, rows_per_part=3) as store:
        for number in range(4):
            store.add(row(number))
        assert len(read_rows(tmp_path, ("key",))) == 3
        assert len(list(tmp_path.glob("journal-*.jsonl"))) == 1
    days = {folder.name: len(list(folder.iterdir())) for folder in tmp_path.iterdir()}
    assert days == {"day=2026-03-01": 1, "day=2026-03-02": 2}
    parts = f"'{tmp_path}/day=*/*.parquet'"
    by_day, columns = queried(
        f"select day, count(*), max(mass_kg), any_value(gain_change[1]), min(recorded_utc) from {parts} "
        "group by day order by day",
        f"describe from {parts}",
    )
    assert by_day == [
        ("2026-03-01", 1, 2.0, 0.01, "2026-03-01 23:30:00"),
        ("2026-03-02", 3, 5.0, 0.01, "2026-03-02 00:30:00"),
    ]
    assert [name for name, *_ in columns][:-1] == list(column_kinds())


def test_rows_of_a_killed_writer_are_kept_but_for_half_a_row(tmp_path):
    store = RowStore(tmp_path)
    store.add(row(0))
    store.add(row(1, RowOutcome.REFUSED, error="Mist, ü"))
    (journal,) = tmp_path.glob("journal-*.jsonl")
    with journal.open("a") as file:
        file.write('{"key": "k2", "arm": "on')
    again = RowStore(tmp_path)
    assert again.done_keys() == {"k0", "k1"}
    assert not journal.exists()
    assert {row["error"] for row in read_rows(tmp_path, ("error",))} == {None, "Mist, ü"}


def test_a_journal_that_is_parquet_already_gives_no_row_twice(tmp_path):
    store = RowStore(tmp_path)
    store.add(row(0))
    (journal,) = tmp_path.glob("journal-*.jsonl")
    kept = journal.read_bytes()
    store.flush()
    journal.write_bytes(kept)  # killed before the journal was removed
    RowStore(tmp_path)
    assert len(read_rows(tmp_path, ("key",))) == 1


def test_failed_is_not_done_and_the_latest_row_of_a_recording_counts(tmp_path):
    later = datetime.now(UTC) + timedelta(hours=1)
    with RowStore(tmp_path) as store:
        store.add(row(0, RowOutcome.FAILED))
        store.add(row(1))
        assert store.done_keys() == set()
        store.flush()
        assert store.done_keys() == {"k1"}
        store.add(row(0, identified_utc=later, mass_kg=7.0))
        store.add(row(1, identified_utc=later, arm="renamed"))
    found = latest_rows(tmp_path, ("mass_kg", "outcome"))
    assert [(row["mass_kg"], row["outcome"]) for row in found] == [(7.0, "identified"), (3.0, "identified")]
    assert [row["arm"] for row in found] == ["one", "renamed"]


@pytest.mark.parametrize(
    ("created", "first_s", "recorded", "by"),
    [
        ("2026-03-01T10:00:00+01:00", 0.0, "2026-03-01T09:00:00+00:00", "recording"),
        ("", 1772359200.0, "2026-03-01T10:00:00+00:00", "time stamps"),
        ("2062-03-01T10:00:00+00:00", 1772359200.0, "2026-03-01T10:00:00+00:00", "time stamps"),
        ("1970-01-01T00:00:09+00:00", 12.5, None, None),
        ("0001-01-01T00:00:00+14:00", 4e9, None, IN_FUTURE),
        ("2062-03-01T10:00:00+00:00", 0.0, None, IN_FUTURE),
        ("", 1e12, None, None),
        ("", 1e300, None, None),
    ],
)
def test_the_time_of_a_recording_is_the_first_possible_one(created, first_s, recorded, by):
    source = SimpleNamespace(rows_read=2, rows_dropped=0, sha256="a", between_s=None, run=lambda: {"created": created})
    made = recorded_fields(SimpleNamespace(source=source, time_s=[first_s]), DAY)
    assert made.get("recorded_by") == by
    assert (made["recorded_utc"].isoformat() if recorded else made.get("recorded_utc")) == recorded


def test_a_file_dated_in_the_future_is_one_without_a_date():
    made = empty_row(replace(JOB, modified=datetime.now(UTC) + timedelta(days=9)), "1.2")
    assert (made["recorded_by"], made["recorded_utc"]) == ("identification", made["identified_utc"])
    assert empty_row(JOB, "1.2")["recorded_by"] == "file"


def test_a_name_that_is_not_utf_8_does_not_make_the_folder_unusable(tmp_path):
    with RowStore(tmp_path) as store:
        store.add(row(0, loaded="M\udcfcller.mcap", joint_names=["a\udcff"]))
    (found,) = read_rows(tmp_path, ("loaded", "joint_names"))
    assert found == {"loaded": "M\\udcfcller.mcap", "joint_names": ["a\\udcff"]}


def test_rows_that_failed_while_a_server_was_down_do_not_count_once_there_is_a_result(tmp_path):
    later = datetime.now(UTC) + timedelta(hours=1)
    with RowStore(tmp_path) as store:
        store.add(row(0))
        store.add(row(1, RowOutcome.REFUSED))
        for number in range(3):
            store.add(row(number, RowOutcome.FAILED, key=f"without server {number}", identified_utc=later))
    assert RowStore(tmp_path).done_keys() == {"k0", "k1"}, "these are not repeated when the server is back"
    assert [row["outcome"] for row in latest_rows(tmp_path, ())] == ["identified", "refused", "failed"]


@pytest.mark.parametrize("at_once", [True, False])
def test_a_change_that_is_undone_makes_a_job_new_again(tmp_path, at_once):
    with RowStore(tmp_path) as store:
        for minute, key in enumerate(("old", "new")):
            if not at_once:
                store.done_keys()
            store.add(row(0, key=key, loaded="\udcfc.mcap", identified_utc=DAY + timedelta(minutes=minute)))
            store.flush()
        assert store.done_keys() == {"new"}


def test_finished_jobs_are_read_once(tmp_path):
    with RowStore(tmp_path) as store:
        store.add(row(0))
    with RowStore(tmp_path) as store:
        assert store.done_keys() == {"k0"}
        for part in tmp_path.glob("day=*/*.parquet"):
            part.write_bytes(b"not read again")
        store.add(row(1))
        store.add(row(2, RowOutcome.FAILED))
        assert store.done_keys() == {"k0"}
        store.flush()
        assert store.done_keys() == {"k0", "k1"}


def test_a_strange_file_among_the_rows_is_named(tmp_path):
    (tmp_path / "day=2026-03-01").mkdir()
    (tmp_path / "day=2026-03-01" / "x.parquet").write_bytes(b"nothing")
    with pytest.raises(FleetError, match=r"x\.parquet: not a file of `armload fleet`"):
        RowStore(tmp_path).done_keys()


def test_a_row_that_cannot_be_written_is_said(tmp_path):
    with pytest.raises(FleetError, match="a row cannot be written"), RowStore(tmp_path / "none") as store:
        store.add(row(0))


@pytest.mark.parametrize("text", ["{\n", "\0\0\n", "[]\n", '{"arm": "one"}\n'])
def test_a_journal_that_holds_something_else_is_named_with_its_line(tmp_path, text):
    (tmp_path / "journal-a.jsonl").write_text(text)
    with pytest.raises(FleetError, match=r"journal-a\.jsonl, line 1: not a row .* move the file away"):
        RowStore(tmp_path)


def test_the_line_is_counted_from_the_top_of_the_journal(tmp_path):
    store = RowStore(tmp_path)
    store.add(row(0))
    store.add(row(1))
    (journal,) = tmp_path.glob("journal-*.jsonl")
    with journal.open("a") as file:
        file.write("{\n")
    with pytest.raises(FleetError, match="line 3: not a row"):
        RowStore(tmp_path)
