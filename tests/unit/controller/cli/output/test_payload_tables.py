"""Tables and lines on the console: CAD beside the estimate, feed-forward, a payload over time, written files."""

import json
from types import SimpleNamespace

import numpy as np
import pytest

from armload_controller.cli import screen as screen_module
from armload_controller.cli.output.feedforward_output import following_error_table, offset_account
from armload_controller.cli.output.findings_output import finish
from armload_controller.feedforward.offset_check import OffsetVerdict
from armload_controller.session.feedforward_comparison import FollowingComparison, Measure
from armload_identification.results import payload_comparison
from armload_identification.verdict.agreement import Outcome
from armload_identification.verdict.cad_comparison import RelativeErrors

CERTAINTY = 0.12


class Screen(screen_module.Screen):
    """Notes what it is given."""

    def __init__(self, *, as_json=False):
        super().__init__(as_json=as_json)
        self.tables, self.lines = [], []

    def table(self, table):
        self.tables.append(table)

    def step(self, text):
        self.lines.append(text)


def test_ten_values_stand_beside_cad_with_their_error_or_as_not_determined():
    truth = np.arange(1.0, 11.0)
    determined = np.arange(10) != 9
    result = RelativeErrors("flange", 1.1 * truth, truth, np.full(10, 0.1), determined)
    agreement = SimpleNamespace(outcome=Outcome.RIGHT)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(payload_comparison, "agreement_sentences", lambda *_: ["a sentence"])
        table = payload_comparison.PayloadComparison(result, agreement, None).table()
    assert table.rows[0] == ("m", "1.0000", "1.1000", "10.00 %", "kg")
    assert table.rows[3] == ("c_z", "4.0000", "4.4000", "10.00 %", "m")
    assert table.rows[4][4] == "kg m2"
    assert len(table.rows) == 10
    assert table.rows[9][1:4] == ("10.0000", "not determined", "")
    assert table.sentences[-1] == "  a sentence"


def offset(gain):
    n = len(gain)
    return OffsetVerdict(("base", "elbow", "wrist")[:n], np.ones(n), np.array(gain), np.full(n, CERTAINTY / 2), 3)


def test_the_response_is_told_of_usable_joints_and_the_others_are_named():
    assert offset_account(offset([1.0, 1.01])).endswith("base 100 %, elbow 101 %")
    some = offset_account(offset([1.0, 5.0, -1.0]))
    assert "base 100 %; " in some
    assert "elbow, wrist" in some
    assert "500" not in some


def test_errors_with_feed_forward_are_told_as_less_and_loaded_joints_are_marked():
    error = np.ones((50, 2)) * [2e-3, 1e-3]
    following = FollowingComparison(
        next(iter(Measure)), ("base", "elbow"), np.arange(50.0), error, {"model": 0.25 * error}, np.array([0.01, 30.0])
    )
    found = following_error_table(following).rows
    assert found == [("base", "0.0", "2.000", "75.0 % less"), ("elbow *", "30.0", "1.000", "75.0 % less")]
    for measure in Measure:
        one = FollowingComparison(measure, ("base", "elbow"), np.arange(50.0), error, {}, np.array([0.01, 30.0]))
        assert ("subtracted" in following_error_table(one).sentences[0]) is (measure is Measure.TORQUES)


def findings(outcome=Outcome.RIGHT):
    made = []
    return SimpleNamespace(
        validation=None,
        payload=None,
        truth=None,
        notes=("one", "two"),
        outcome=outcome,
        save=lambda path: made.append(("payload", path)),
        report=lambda path: made.append(("report", path)),
        to_dict=lambda: {"outcome": outcome.name},
        made=made,
    )


@pytest.fixture
def unlisted(make_subject):
    """Findings of a shipped arm's payload."""

    def unlisted(**changes):
        found = findings(**changes)
        found.payload = make_subject().payload
        return found

    return unlisted


@pytest.mark.parametrize(
    ("payload", "report"), [(None, None), ("p.toml", None), (None, "r.html"), ("p.toml", "r.html")]
)
def test_the_files_that_are_wanted_are_written_and_named(unlisted, tmp_path, capsys, payload, report):
    paths = {"payload": payload and tmp_path / payload, "report": report and tmp_path / report}
    for as_json in (False, True):
        screen, found = Screen(as_json=as_json), unlisted()
        finish(screen, found, **paths)
        written = [(kind, path) for kind, path in paths.items() if path]
        assert found.made == written
        assert screen.lines == ["note: one", "note: two", *(f"written: {path}" for _, path in written)]
        assert len(screen.tables) == 1
        out = capsys.readouterr().out
        assert bool(out) is as_json
        if as_json:
            assert json.loads(out)["files"] == {kind: path and str(path) for kind, path in paths.items()}
