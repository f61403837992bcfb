"""Which verdict a payload's own run may give."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from armload_identification.verdict.agreement import Outcome
from armload_identification.verdict.payload_verdict import PayloadVerdict

pytestmark = pytest.mark.pure


@pytest.mark.parametrize("own_run", [True, False])
@pytest.mark.parametrize("outcome", list(Outcome))
def test_a_payloads_own_run_can_contradict_it_but_not_confirm_it(own_run, outcome):
    verdict = PayloadVerdict(SimpleNamespace(outcome=outcome), None, None, None, own_run)
    assert verdict.outcome is (Outcome.CANNOT_TELL if own_run and outcome is Outcome.RIGHT else outcome)
