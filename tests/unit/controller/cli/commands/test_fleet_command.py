"""`armload fleet`: what is written, said and returned."""

import json
from dataclasses import dataclass

import pytest

from armload_controller.cli.commands.fleet_command import FleetJobs
from armload_controller.control_errors import ConfigurationError
from armload_controller.fleet.job_listing import JobListing
from armload_controller.fleet.recording_row import empty_row
from tests.fleet_nights import recorded_nights


@pytest.fixture
def nights(tmp_path):
    """A folder with the rows of two arms, one of which needs attention."""
    recorded_nights(tmp_path)
    return tmp_path


def test_a_second_run_of_nothing_new_starts_no_workers(armload, nights, tmp_path):
    table = tmp_path / "jobs.csv"
    table.write_text("arm,robot,loaded\none,er50,none/*.mcap\n")
    result = armload("fleet", "identify", table, "-o", nights, "--scheduler", "tcp://nobody:1", "--json")
    assert result.exit_code == 0, (result.output, result.exception)
    assert json.loads(result.stdout)["remarks"] == [f"{table}, line 2: no file matches none/*.mcap"]
    assert "nothing new: 0 recordings processed before" in armload("fleet", "identify", table, "-o", nights).stdout
    both = armload("fleet", "identify", table, "-o", nights, "--scheduler", "tcp://nobody:1", "--workers", "2")
    assert both.exit_code == 2
    assert "cannot be combined with --scheduler" in both.output


class OneProcess:
    """Workers' place taken by this process; every job has an outcome decided beforehand."""

    def __init__(self, outcomes):
        self.outcomes = iter(outcomes)

    def __enter__(self):
        return self

    def __exit__(self, *_error):
        pass

    def rows(self, jobs):
        for job in jobs:
            yield empty_row(job, "1") | {"outcome": next(self.outcomes), "error": "cut short"}


@pytest.mark.parametrize(
    ("outcomes", "status"), [(["refused", "failed"], 1), (["refused", "identified"], 0), (["identified"] * 2, 0)]
)
def test_the_exit_status_is_1_if_no_new_recording_gave_a_result(armload, tmp_path, monkeypatch, outcomes, status):
    table = tmp_path / "jobs.csv"
    table.write_text("arm,robot,loaded,unloaded\none,er50,a.mcap,a.mcap\ntwo,er50,b.mcap,b.mcap\n")
    for name in "ab":
        (tmp_path / f"{name}.mcap").touch()
    monkeypatch.setattr("armload_controller.fleet.workforce.workforce", lambda *_given: OneProcess(outcomes))
    result = armload("fleet", "identify", table, "-o", tmp_path / "rows", "--json")
    assert result.exit_code == status, (result.output, result.exception)
    assert json.loads(result.stdout)["outcomes"]["identified"] == outcomes.count("identified")


def test_acknowledged_arms_are_listed_and_leave_the_exit_status_at_0(armload, nights):
    done = armload(
        "fleet", "acknowledge", nights, "one", "--until", "2999-12-31", "--why", "a new gripper", columns=300
    )
    assert done.exit_code == 0, (done.output, done.exception)
    report = armload("fleet", "report", nights, "--metrics", nights / "fleet.prom", columns=300)
    assert report.exit_code == 0, report.output
    assert "to be inspected: none of 2 arms" in report.output
    assert (
        "the latest recording gave no result: cut short; acknowledged until 2999-12-31: a new gripper" in report.output
    )
    assert "without a result: 1 recording of 1 arm" in report.output
    assert 'armload_arm_acknowledged{arm="one",model="er50"} 2' in (nights / "fleet.prom").read_text()


def test_the_history_of_an_arm_is_a_page(armload, nights):
    done = armload("fleet", "history", nights, "one", columns=300)
    assert done.exit_code == 0, (done.output, done.exception)
    assert "the latest recording gave no result: cut short" in done.output
    assert "mass of tool" in (nights / "one.html").read_text()
    refused = armload("fleet", "history", nights, "three")
    assert "expected one of one, two" in str(refused.exception)


@pytest.mark.parametrize(("new", "text"), [(2, "webhook: 2 new findings sent"), (0, "webhook: nothing new")])
def test_a_report_is_written_and_what_is_new_is_sent(armload, nights, monkeypatch, new, text):
    sent = []
    monkeypatch.setattr("armload_controller.fleet.alerts.notify", lambda url, *_: sent.append(url) or range(new))
    page, metrics = nights / "page.html", nights / "fleet.prom"
    words = ("fleet", "report", nights, "-o", page, "--metrics", metrics, "--webhook", "http://here")
    result = armload(*words, columns=300)
    assert result.exit_code == 5
    assert sent == ["http://here"]
    for line in (text, f"written: {page}", f"written: {metrics}", "  1. one: mass of tool is 2.30 kg since"):
        assert line in result.output
    assert page.is_file()
    assert not (nights / "report.html").exists()
    assert json.loads(armload("fleet", "report", nights, "--json").stdout)["files"] == {
        "report": str(nights / "report.html"),
        "metrics": None,
    }
    assert "webhook" not in armload("fleet", "report", nights).output


@dataclass
class Looks:
    """What repeated looks at a table find, and with which period it was looked."""

    found: list
    period_s: float = 0.0

    def __call__(self, table, store, do, sleep, every_s):
        self.period_s = every_s
        yield from self.found
        raise KeyboardInterrupt


@pytest.mark.parametrize(("words", "period_s"), [((), 60.0), (("--every-s", "5"), 5.0), (("--every-s", "1"), 1.0)])
def test_watching_tells_remarks_and_mistakes_until_it_is_ended(armload, tmp_path, monkeypatch, words, period_s):
    looks = Looks([JobListing((), ("line 2: no file",)), ConfigurationError("jobs.csv", "line 3", "x", "expected y")])
    monkeypatch.setattr("armload_controller.fleet.fleet_run.looks", looks)
    monkeypatch.setattr("armload_controller.fleet.workforce.workforce", lambda *_given: OneProcess([]))
    result = armload("fleet", "watch", tmp_path / "jobs.csv", "-o", tmp_path, *words, columns=300)
    assert result.exit_code == 0, (result.output, result.exception)
    assert looks.period_s == period_s
    assert f"jobs.csv, every {period_s:g} s; a recording" in result.output
    assert "warning: line 2: no file\n" in result.output
    assert "expected y; nothing is processed until this is corrected" in result.output
    assert result.output.endswith("stopped watching; finished rows are kept\n")


def test_looks_are_at_least_a_second_apart_and_a_cluster_has_a_process(armload, tmp_path):
    for word in ("--every-s", "--workers"):
        result = armload("fleet", "watch", tmp_path / "jobs.csv", "-o", tmp_path, word, "0")
        assert result.exit_code == 2
        assert "expected at least 1" in result.output
    assert FleetJobs(tmp_path, tmp_path).workers is None


def test_ctrl_c_says_that_the_rest_can_be_done_later(armload, tmp_path, monkeypatch):
    def stopped(*_given):
        raise KeyboardInterrupt

    table = tmp_path / "jobs.csv"
    table.write_text("arm,robot,loaded\none,er50,a.mcap\n")
    (tmp_path / "a.mcap").touch()
    monkeypatch.setattr("armload_controller.fleet.workforce.workforce", lambda *_given: OneProcess([]))
    monkeypatch.setattr("armload_controller.fleet.fleet_run.do_jobs", stopped)
    result = armload("fleet", "identify", table, "-o", tmp_path / "rows", columns=300)
    assert result.exit_code != 0
    assert "1 recording, none processed before" in result.output
    assert "stopped: finished rows are kept, and the same command processes the rest" in result.output
