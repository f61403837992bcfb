"""The advice of a comparison of runs with a calibration."""

from types import SimpleNamespace

import pytest

from armload_identification.report.compared_runs import ComparedRuns

pytestmark = pytest.mark.pure
ALONE, LASTING = SimpleNamespace(alone=True), SimpleNamespace(alone=False)


@pytest.mark.parametrize(
    ("out_of_date", "findings", "begins", "ends"),
    [
        (True, [LASTING], "Find out what changed on the arm", "runs since then."),
        (False, [ALONE, LASTING], "The calibration is still valid: friction is fitted", "dragging brake or wear."),
        (False, [ALONE], "Single runs are off: an impact", "The calibration is still valid."),
        (False, [], "The calibration is still valid.", "The calibration is still valid."),
    ],
)
def test_the_advice_follows_from_the_worst(out_of_date, findings, begins, ends):
    drift = SimpleNamespace(out_of_date=out_of_date, findings=findings)
    advice = ComparedRuns("arm", "", (), None, "a.toml", drift, ()).advice
    assert advice.startswith(begins)
    assert advice.endswith(ends)
