"""The log of decisions: complete, in order, and never waited for."""

from __future__ import annotations

import json
import threading
from pathlib import Path

import pytest

from armload_controller.control_errors import CommissioningError, RecordingFailed
from armload_controller.feedforward.adaptation import AdaptationDecision, DecisionKind
from armload_controller.session.decision_log import DecisionLog
from armload_controller.session.run_session import NoDisplay


def decision(time_s):
    return AdaptationDecision.of(time_s, DecisionKind.REFUSED, "too light", None, None)


class HaltedTerminal(NoDisplay):
    """Accepts a line only once it is released."""

    def __init__(self):
        self.released = threading.Event()
        self.shown = []

    def step(self, text):
        self.released.wait(2.0)
        self.shown.append((self.released.is_set(), text))


def test_the_cycle_does_not_wait_for_a_halted_terminal(tmp_path):
    display, path = HaltedTerminal(), tmp_path / "decisions.jsonl"
    path.write_text('{"robot": "earlier"}\n')
    with DecisionLog(path, "er50", display) as log:
        for time_s in (1.0, 2.0, 3.0):
            log.report(decision(time_s))
        display.released.set()
    assert display.shown == [(True, str(decision(time_s))) for time_s in (1.0, 2.0, 3.0)]
    earlier, *lines = path.read_text().splitlines()
    assert earlier == '{"robot": "earlier"}'
    assert [json.loads(line) for line in lines] == [{"robot": "er50", **decision(t).to_dict()} for t in (1.0, 2.0, 3.0)]


def test_the_thread_runs_before_the_first_decision(tmp_path):
    """Started by the cycle, it would write at the cycle's priority on its CPU."""
    with DecisionLog(tmp_path / "decisions.jsonl", "er50", NoDisplay()):
        assert [thread for thread in threading.enumerate() if thread.name.startswith("decisions")]


def test_a_log_that_cannot_be_written_ends_the_run(tmp_path):
    with pytest.raises(CommissioningError, match="choose a --decisions file that can be written"):
        DecisionLog(tmp_path / "none" / "decisions.jsonl", "er50", NoDisplay())
    (tmp_path / "notes").write_text("mine")
    with pytest.raises(CommissioningError, match=r"is not armload's decisions: .* Give another --decisions,"):
        DecisionLog(tmp_path / "notes", "er50", NoDisplay())
    log = DecisionLog(Path("/dev/full"), "er50", NoDisplay())
    log.report(decision(1.0))
    log._last_written.exception()  # it has been tried
    with pytest.raises(RecordingFailed, match="/dev/full could not be written: No space"):
        log.report(decision(2.0))
    with pytest.raises(RecordingFailed), log:
        pass
