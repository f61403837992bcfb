"""Findings of a fleet that need attention, acknowledgements, and what other programs are told."""

import http.server
import json
import re
import threading
from datetime import UTC, date, datetime, timedelta

import pytest

from armload_controller.control_errors import ConfigurationError, FleetError
from armload_controller.fleet.alerts import metrics_text, notify
from armload_controller.fleet.arm_runs import Quantity, QuantityKind
from armload_controller.fleet.attention import acknowledge, attention_of
from armload_controller.fleet.fleet_review import Anomaly, ArmReview, FleetReview, Suspicion

NOW = datetime(2026, 3, 20, 6, tzinfo=UTC)
TODAY = NOW.date()


def suspicion(cause, quantity, text):
    return Suspicion(cause, quantity, 8.0, text)


CHANGE = suspicion(Anomaly.CHANGE, Quantity(QuantityKind.MASS, "gripper"), "mass of gripper is 2.3 kg")
SILENCE = suspicion(Anomaly.SILENCE, None, "the 9 latest recordings gave no result: truncated")


def fleet(**suspicions):
    arms = tuple(ArmReview(arm, "er50", 9, 1, NOW, {}, tuple(found)) for arm, found in suspicions.items())
    return FleetReview(arms, (ArmReview("gone", "er50", 3, 1, NOW - timedelta(days=90)),), ())


def needed(review, folder, day=TODAY):
    return {(finding.arm, finding.kind) for finding in attention_of(review, folder, day).needed}


def test_suspicious_and_absent_arms_need_attention(tmp_path):
    assert needed(fleet(one=[CHANGE], two=[]), tmp_path) == {
        ("one", "change, mass of gripper"),
        ("gone", "no recent recording"),
    }


def test_what_is_acknowledged_is_quiet_until_its_day_and_only_that(tmp_path):
    review = fleet(one=[SILENCE])
    acknowledge(tmp_path, review, "one", "2026-03-31", "the reader is repaired", NOW)
    acknowledge(tmp_path, review, "gone", "2026-12-31", "scrapped", NOW)
    found = attention_of(review, tmp_path, TODAY)
    assert not found.needed
    assert {(finding.arm, known.why) for finding, known in found.acknowledged} == {
        ("one", "the reader is repaired"),
        ("gone", "scrapped"),
    }
    assert found.words["one"] == "acknowledged until 2026-03-31: the reader is repaired"
    assert needed(review, tmp_path, date(2026, 4, 1)) == {("one", "no result")}
    assert needed(fleet(one=[SILENCE, CHANGE]), tmp_path) == {("one", "change, mass of gripper")}


@pytest.mark.parametrize(
    ("arm", "until", "why", "problem"),
    [
        ("three", "2026-04-01", "x", "expected gone, one, two"),
        ("two", "2026-04-01", "x", "nothing to acknowledge: it needs no attention"),
        ("one", "2026-03-19", "x", "expected a day from 2026-03-20 on"),
        ("one", "tomorrow", "x", "expected a day, such as 2026-12-31"),
        ("one", "2026-04-01", "  ", "expected a reason"),
    ],
)
def test_an_acknowledgement_that_makes_no_sense_is_refused(tmp_path, arm, until, why, problem):
    with pytest.raises(ConfigurationError, match=problem):
        acknowledge(tmp_path, fleet(one=[CHANGE], two=[]), arm, until, why, NOW)
    assert not list(tmp_path.iterdir())


def test_a_damaged_acknowledgement_is_named_with_its_line(tmp_path):
    acknowledge(tmp_path, fleet(one=[CHANGE]), "one", "2026-03-31", "known", NOW)
    with (tmp_path / "acknowledged.jsonl").open("a") as file:
        file.write('{"arm": "one"\n')
    with pytest.raises(FleetError, match=r"acknowledged\.jsonl, line 2: no acknowledgement"):
        attention_of(fleet(one=[CHANGE]), tmp_path, TODAY)


def test_prometheus_reads_the_metrics(tmp_path):
    review = fleet(**{'cell "1"\\\n': [CHANGE], "two": [SILENCE]})
    acknowledge(tmp_path, review, "two", "2026-03-31", "known", NOW)
    text = metrics_text(review, attention_of(review, tmp_path, TODAY), NOW)
    label = r'"(?:[^"\\\n]|\\["\\n])*"'
    sample = re.compile(rf"(\w+)(?:\{{arm=({label}),model={label}\}})? (-?[\d.e+]+)")
    values, typed = {}, set()
    for line in text.splitlines():
        if line.startswith("#"):
            typed |= {line.split()[2]} if line.startswith("# TYPE") and line.endswith(" gauge") else set()
        else:
            name, arm, value = sample.fullmatch(line).groups()
            values[name, arm] = float(value)
    assert {name for name, _ in values} == typed
    strange = r'"cell \"1\"\\\n"'
    assert values["armload_arm_attention", strange] == 1
    assert (values["armload_arm_attention", '"two"'], values["armload_arm_acknowledged", '"two"']) == (0, 1)
    assert values["armload_arm_latest_recording_timestamp_seconds", '"two"'] == NOW.timestamp()
    assert values["armload_arm_recordings_without_result", '"gone"'] == 1
    assert values["armload_fleet_report_timestamp_seconds", None] == NOW.timestamp()


class Hook(http.server.BaseHTTPRequestHandler):
    """Keeps what is posted, and answers with the status that the server has."""

    def do_POST(self):
        body = self.rfile.read(int(self.headers["Content-Length"]))
        self.server.posted.append((self.headers["Content-Type"], json.loads(body)))
        self.send_response(self.server.status)
        self.send_header("Location", "/elsewhere")
        self.end_headers()

    def log_message(self, *_arguments):
        pass


@pytest.fixture
def hook():
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), Hook) as server:
        server.posted, server.status = [], 204
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        yield server
        server.shutdown()
        thread.join()


def test_a_webhook_gets_each_new_finding_once(tmp_path, hook):
    url = f"http://127.0.0.1:{hook.server_port}/token"

    def notified(review):
        return [finding.arm for finding in notify(url, tmp_path, attention_of(review, tmp_path, TODAY), "1.2")]

    assert notified(fleet(one=[CHANGE])) == ["one", "gone"]
    assert notified(fleet(one=[CHANGE])) == []
    assert notified(fleet(one=[CHANGE], two=[SILENCE])) == ["two"]
    assert notified(fleet(one=[])) == []
    assert notified(fleet(one=[CHANGE])) == ["one"]
    assert len(hook.posted) == 3
    kind, document = hook.posted[1]
    assert kind == "application/json"
    assert document["schema"] == "armload/fleet-findings/1"
    assert document["findings"] == [{"arm": "two", "model": "er50", "kind": "no result", "text": SILENCE.text}]


@pytest.mark.parametrize("status", [500, 302])
def test_what_a_webhook_does_not_take_is_sent_again(tmp_path, hook, status):
    url = f"http://127.0.0.1:{hook.server_port}/secret-token"
    attention = attention_of(fleet(one=[CHANGE]), tmp_path, TODAY)
    hook.status = status
    with pytest.raises(FleetError, match=rf"refused the findings: HTTP {status}") as refusal:
        notify(url, tmp_path, attention, "1.2")
    assert "secret-token" not in str(refusal.value)
    hook.status = 200
    assert len(notify(url, tmp_path, attention, "1.2")) == 2


def test_a_webhook_that_is_not_there_or_no_url_is_named(tmp_path, hook):
    attention = attention_of(fleet(one=[CHANGE]), tmp_path, TODAY)
    with pytest.raises(FleetError, match=r"does not answer: .*; the next report tries again"):
        notify("http://127.0.0.1:9/", tmp_path, attention, "1.2")
    with pytest.raises(ConfigurationError, match="expected a URL of http or https"):
        notify("file:///etc/passwd", tmp_path, attention, "1.2")
