"""From the table to jobs: columns, wildcards, files, and the changes that make a job new."""

import errno
import hashlib
import os
from dataclasses import replace
from pathlib import Path

import fsspec
import pytest

from armload_controller.control_errors import ConfigurationError, FleetError, ListingError
from armload_controller.fleet.job import job_key
from armload_controller.fleet.job_listing import list_jobs
from armload_controller.fleet.job_table import parse_job_table, read_job_table
from armload_controller.fleet.remote_files import RemoteFile, is_url, local_copy, matches, with_stars

HEADER = "arm,robot,loaded,unloaded,calibration,payload,mass_kg\n"


@pytest.fixture
def cells(tmp_path):
    """Two arms with two nights each, a file that is being written, and one night without its partner."""
    for cell in ("cell-1", "cell-2"):
        for night in ("mo", "tu"):
            for load in ("loaded", "unloaded"):
                file = tmp_path / cell / night / f"{load}.mcap"
                file.parent.mkdir(parents=True, exist_ok=True)
                file.write_bytes(b"0123456789")
    (tmp_path / "cell-1" / "mo" / ".loaded.mcap.tmp").write_bytes(b"01")
    (tmp_path / "cell-2" / "tu" / "unloaded.mcap").unlink()
    return tmp_path


def jobs_of(folder, *lines, header=HEADER):
    table = folder / "jobs.csv"
    table.write_text(header + "\n".join(lines) + "\n")
    return list_jobs(read_job_table(table), table)


def test_a_star_in_the_other_columns_is_what_it_is_in_the_first(cells):
    found = jobs_of(cells, "one,er50,cell-1/*/loaded.mcap,cell-1/*/unloaded.mcap,cal.toml,tool,2.5")
    assert [job.loaded for job in found.jobs] == [f"{cells}/cell-1/{night}/loaded.mcap" for night in ("mo", "tu")]
    assert [job.recordings["unloaded"] for job in found.jobs] == [
        f"{cells}/cell-1/{night}/unloaded.mcap" for night in ("mo", "tu")
    ]
    (first, _) = found.jobs
    assert (first.arm, first.robot, first.payload, first.mass_kg) == ("one", "er50", "tool", 2.5)
    assert first.calibration == f"{cells}/cal.toml"
    assert first.modified is not None
    assert not found.remarks


def test_hidden_files_do_not_match_and_a_star_at_the_end_does(cells):
    assert [Path(path).name for path, _ in matches(f"{cells}/cell-1/mo/*")[0]] == ["loaded.mcap", "unloaded.mcap"]
    assert [stars for _, stars in matches(f"{cells}/*-*/m*/loaded.mcap")[0]] == [
        ("cell", "1", "o"),
        ("cell", "2", "o"),
    ]
    assert with_stars("a*b*", ("1", "2", "3")) == "a1b2"


def test_lines_without_a_file_are_named_and_a_missing_partner_is_the_jobs_trouble(cells):
    found = jobs_of(cells, "one,er50,cell-9/*/loaded.mcap", "two,er50,cell-2/*/loaded.mcap,cell-2/*/unloaded.mcap")
    remark, other = found.remarks
    assert "line 2: no file matches cell-9/*/loaded.mcap" in remark
    assert f"line 3, unloaded: 1 of 2 files missing, such as {cells}/cell-2/tu/unloaded.mcap; each * stands" in other
    assert len(found.jobs) == 2


@pytest.mark.parametrize(
    ("change", "new"),
    [
        (lambda folder: None, False),
        (lambda folder: (folder / "cell-1" / "mo" / "loaded.mcap").write_bytes(b"01234567890"), True),
        (lambda folder: os.utime(folder / "cell-1" / "mo" / "unloaded.mcap", (1.0, 1.0)), True),
        (lambda folder: (folder / "my.toml").write_text("other"), True),
        (lambda folder: os.utime(folder / "my.toml", (1.0, 1.0)), False),
        (lambda folder: (folder / "cal.toml").write_text("now there is one"), True),
    ],
)
def test_a_job_is_new_where_anything_that_it_depends_on_has_changed(cells, change, new):
    (cells / "my.toml").write_text("robot")
    line = "one,my.toml,cell-1/mo/loaded.mcap,cell-1/mo/unloaded.mcap,cal.toml"
    (before,) = jobs_of(cells, line).jobs
    change(cells)
    (after,) = jobs_of(cells, line).jobs
    assert (before.key != after.key) is new


ROBOT = """\
[robot]
calibration = "arm.calibration.toml"

[[joints]]
drive = {profile = "mine.toml"}

[[joints]]
drive = {profile = "elmo_gold"}
"""


@pytest.mark.parametrize(
    ("column", "change", "new"),
    [
        ("", lambda folder: (folder / "arm.calibration.toml").write_text("again"), True),
        ("", lambda folder: (folder / "arm.calibration.toml").unlink(), True),
        ("", lambda folder: os.utime(folder / "arm.calibration.toml", (1.0, 1.0)), False),
        ("cal.toml", lambda folder: (folder / "arm.calibration.toml").write_text("again"), False),
        ("", lambda folder: (folder / "mine.toml").write_text("again"), True),
        ("cal.toml", lambda folder: (folder / "mine.toml").write_text("again"), True),
        ("", lambda folder: (folder / "elmo_gold").write_text("again"), False),
    ],
)
def test_a_job_depends_on_the_files_that_its_robots_file_names(cells, column, change, new):
    (cells / "my.toml").write_text(ROBOT)
    (cells / "arm.calibration.toml").write_text("first")
    (cells / "mine.toml").write_text("first")
    line = f"one,my.toml,cell-1/mo/loaded.mcap,,{column}"
    (before,) = jobs_of(cells, line).jobs
    change(cells)
    (after,) = jobs_of(cells, line).jobs
    assert (before.key != after.key) is new


@pytest.mark.parametrize("robot", ["er50", "my.toml", "none.toml", "latin.toml"])
def test_the_key_of_a_job_whose_robot_names_no_file_is_that_of_earlier_rows(cells, robot):
    (cells / "my.toml").write_text("[robot]\n[[joints]]\n")
    (cells / "latin.toml").write_bytes(b'[robot]\ncalibration = "\xe4"\n')
    (job,) = jobs_of(cells, f"one,{robot},cell-1/mo/loaded.mcap,,,tool,2.5").jobs
    path = cells / robot
    content = hashlib.sha256(path.read_bytes()).hexdigest() if path.exists() else job.robot
    loaded = RemoteFile.of(job.loaded)
    stamps = {"loaded": loaded.stamp}
    expected = job_key("one", job.robot, {"loaded": loaded.url}, stamps, "", content, "", "tool", 2.5)
    assert job.key == expected


def test_what_is_said_of_the_payload_is_part_of_a_job(cells):
    entries = parse_job_table(HEADER + "one,er50,cell-1/mo/loaded.mcap,,,tool,2", "jobs.csv")
    table = cells / "jobs.csv"
    (job,) = list_jobs(entries, table).jobs
    for change in ({"arm": "two"}, {"payload": "other"}, {"mass_kg": 2.1}):
        (other,) = list_jobs([replace(entries[0], **change)], table).jobs
        assert other.key != job.key


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("arm,robot\na,b\n", "line 1, loaded is missing: the header must name arm, robot, loaded"),
        ("arm,robot,loaded,weight\na,b,c,1\n", "column 4 is 'weight': expected one of the columns arm, robot, loaded"),
        (HEADER, "the table has no rows; expected one or more arms"),
        (HEADER + "a,,c\n", "line 2, robot is missing: expected text"),
        (HEADER + "a,s3://robots/b.toml,c\n", "line 2, robot is 's3://robots/b.toml': expected a shipped robot, or"),
        (HEADER + "a,b,c,d,cal-*.toml\n", "line 2, calibration is 'cal-*.toml': expected one file"),
        (HEADER + "a,b,c,d,e,f,heavy\n", "line 2, mass_kg is 'heavy': expected a number above 0, or nothing"),
        (HEADER + "# one\na,b,c,d,e,f,1,7\n", "line 3 is 'a,b,c,d,e,f,1,7': expected 7 columns"),
        (
            "arm,robot,loaded,validation_loaded\na,b,c,d\n",
            "line 2, validation_unloaded is missing: a validation requires a loaded",
        ),
    ],
)
def test_a_table_that_makes_no_sense_is_refused_by_line_and_column(text, problem):
    with pytest.raises(ConfigurationError) as refused:
        parse_job_table(text, "jobs.csv")
    assert problem in str(refused.value)


def test_more_stars_than_in_the_loaded_column_and_one_recording_twice_are_refused(cells):
    with pytest.raises(ConfigurationError, match=r"line 2, unloaded .* at most as many \* as in loaded"):
        jobs_of(cells, "one,er50,cell-1/*/loaded.mcap,*/*/unloaded.mcap")
    with pytest.raises(ConfigurationError, match=r"line 3, loaded .* line 2 already names it"):
        jobs_of(cells, "one,er50,cell-1/*/loaded.mcap", "two,er50,cell-1/mo/loaded.mcap")


def test_a_very_long_cell_names_its_line(tmp_path):
    """Beyond the limit of the csv module, whose error was a traceback."""
    table = tmp_path / "jobs.csv"
    table.write_text(f"{HEADER}a,er50,{'x' * 140_000},,,,\n")
    with pytest.raises(ConfigurationError, match=r"jobs\.csv") as caught:
        list_jobs(read_job_table(table), table)
    assert len(str(caught.value)) < 1000


@pytest.mark.parametrize("url", ["reference://x", "reference://x/*.mcap", "nothing://x"])
def test_a_kind_of_url_that_cannot_be_read_is_a_sentence(cells, url):
    with pytest.raises((ConfigurationError, ListingError, FleetError), match=url.split("/")[0]):
        jobs_of(cells, f"a,er50,{url},,,,")


def test_a_missing_table_names_it(tmp_path):
    with pytest.raises(ConfigurationError, match=r"jobs\.csv: cannot be read: No such file"):
        read_job_table(tmp_path / "jobs.csv")


def test_a_folder_changes_with_any_file_in_it(tmp_path):
    bag = tmp_path / "bag"
    (bag / "parts").mkdir(parents=True)
    (bag / "parts" / "0.db3").write_bytes(b"1")
    before = RemoteFile.of(str(bag))
    assert before.stamp == RemoteFile.of(str(bag)).stamp
    (bag / "parts" / "0.db3").write_bytes(b"12")
    assert RemoteFile.of(str(bag)).stamp != before.stamp
    assert RemoteFile.of(str(tmp_path / "none")).stamp == "missing"


def test_what_nothing_installed_reads_is_named_with_what_does():
    with pytest.raises(FleetError, match=r"s3://bucket/\*\.mcap: .*pip install s3fs"):
        matches("s3://bucket/*.mcap")
    with pytest.raises(FleetError, match="expected a path, or a URL that fsspec knows"):
        matches("ftps5://host/*.mcap")


def test_a_store_that_gives_nothing_is_a_sentence_where_it_is_listed_and_a_row_where_it_is_not(closed_store):
    with pytest.raises(
        ListingError, match=r"closed://cell/\*\.mcap: cannot be listed \(no credentials\); check the table"
    ):
        matches(f"{closed_store}/*.mcap")
    assert RemoteFile.of(f"{closed_store}/a.mcap").stamp == "missing: no credentials"


class LockedFolder(fsspec.AbstractFileSystem):
    """A store with two folders, one of which may not be listed."""

    protocol = "locked"
    cachable = False

    def ls(self, path, detail=True, **_options):
        if path.endswith("lost+found"):
            raise PermissionError(errno.EACCES, "Permission denied", path)
        names = {"disk": ["disk/cell-1", "disk/lost+found"], "disk/cell-1": ["disk/cell-1/a.mcap"]}[path.strip("/")]
        return [{"name": name, "size": 1, "type": "file"} for name in names] if detail else names


def test_a_folder_that_may_not_be_listed_does_not_stop_the_others(cells):
    fsspec.register_implementation("locked", LockedFolder, clobber=True)
    found = jobs_of(cells, "one,er50,locked://disk/*/*.mcap")
    assert [job.loaded for job in found.jobs] == ["locked://disk/cell-1/a.mcap"]
    (remark,) = found.remarks
    assert remark.endswith("line 2: no permission to list the folder disk/lost+found, so nothing in it is processed")
    with pytest.raises(ListingError, match=r"cannot be listed .*Permission denied"):
        matches("locked://disk/lost+found/*.mcap")


def test_a_file_of_this_machine_is_not_copied(tmp_path):
    assert not is_url("C:/runs")
    with local_copy(str(tmp_path)) as path:
        assert path == tmp_path
