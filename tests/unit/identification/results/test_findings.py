"""A payload with everything known about it: what is empty without a fit, and what its table and files hold."""

from datetime import UTC, datetime
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from armload_identification.files.payload_file import read_payload
from armload_identification.model.payload import PARAMETER_NAMES
from armload_identification.pipeline.identification_result import Identification
from armload_identification.recording.recording import RecordingSource
from armload_identification.recording.run_format import RUN_ATTACHMENT
from armload_identification.report import report
from armload_identification.results.findings import Findings
from armload_identification.verdict.agreement import Outcome

ARM = SimpleNamespace(name="er50", description="an arm", joint_names=("base", "elbow"))


def recorded(name, run=""):
    return RecordingSource(
        Path(name), f"hash of {name}", "mcap", 9, {}, attachments={RUN_ATTACHMENT: run} if run else {}
    )


@pytest.fixture
def findings(make_subject):
    """Findings of a payload without its iyz, with any runs."""

    def findings(**runs):
        payload = make_subject(undetermined=("iyz",)).payload
        return Findings(ARM, payload, **runs)

    return findings


def test_without_a_validation_there_is_no_verdict_and_no_note(findings):
    found = findings()
    assert (found.outcome, found.notes, found.simulated) == (None, (), False)
    assert found.verdict.title == "Not validated"
    low, high = found.intervals["mass"]
    assert (low, high) == pytest.approx((2.6999, 2.7001))
    assert list(found.intervals) == list(PARAMETER_NAMES)
    assert found.intervals["iyz"] is None
    table = found.table()
    assert table.title == "Payload of er50 in the flange frame, inertia about its centre of mass"
    assert table.sentences == (f"Not validated. {found.verdict.text}",)
    assert str(found).splitlines()[0] == table.title
    assert found.to_dict()["schema"] == "armload/payload/1"


SIMULATED, REAL = recorded("a", '{"simulated": true}'), recorded("b", '{"simulated": false}')


@pytest.mark.parametrize(
    ("fitted", "validating", "simulated"),
    [
        ((SIMULATED,), (SIMULATED,), True),
        ((SIMULATED,), (), True),
        ((), (SIMULATED,), True),
        ((SIMULATED, SIMULATED), (REAL,), False),
        ((recorded("c"),), (), False),
        ((), (), False),
    ],
)
def test_findings_are_simulated_if_every_recording_is(findings, fitted, validating, simulated):
    runs = {"fitted": SimpleNamespace(sources=fitted), "validation": SimpleNamespace(sources=validating)}
    assert findings(**runs).simulated is simulated


def test_what_a_fit_and_a_validation_say_is_said(findings, monkeypatch):
    fitted = Identification(*[None] * 13, notes=("one", "two"))
    box = SimpleNamespace(title="Wrong", text="It is too heavy.")
    monkeypatch.setattr("armload_identification.report.reported_payload.verdict_box", lambda validation, names: box)
    found = findings(fitted=fitted, validation=SimpleNamespace(verdict=SimpleNamespace(outcome=Outcome.WRONG)))
    assert found.outcome is Outcome.WRONG
    assert found.table().sentences == ("Wrong. It is too heavy.", "note: one", "note: two")


def test_recordings_of_the_validation_are_written_with_the_payload(findings, tmp_path):
    fitted = SimpleNamespace(sources=(recorded("a.mcap"),))
    validation = SimpleNamespace(sources=(recorded("b.mcap"), recorded("c.mcap")))
    found = findings(fitted=fitted, validation=validation).with_validation_in_provenance()
    hashes = {name: f"hash of {name}" for name in ("b.mcap", "c.mcap")}
    assert found.payload.provenance.validation_sha256 == hashes
    found.save(str(tmp_path / "payload.toml"))
    read = read_payload(tmp_path / "payload.toml")
    assert read.provenance == found.payload.provenance
    np.testing.assert_array_equal(read.determined, found.payload.determined)


@pytest.mark.parametrize("created", [datetime(2026, 3, 1, 9, 5, tzinfo=UTC), None])
def test_a_report_has_the_day_on_which_it_was_made(findings, tmp_path, monkeypatch, created):
    monkeypatch.setattr(report, "render_report", lambda subject, day: f"{subject.arm.name} {day}")
    findings().report(str(tmp_path / "report.html"), created)
    text = (tmp_path / "report.html").read_text()
    when = datetime.strptime(text, "er50 %Y-%m-%d %H:%M UTC").replace(tzinfo=UTC)
    assert when == created if created else abs((datetime.now(UTC) - when).total_seconds()) < 3600.0
