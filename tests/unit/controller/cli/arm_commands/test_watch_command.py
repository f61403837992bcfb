"""`armload watch` on a recording: the drift of the gains as stated, or as measured by a run of the same day."""

from __future__ import annotations

import pytest

from armload_controller.analysis import payload_watch


@pytest.mark.long
@pytest.mark.parametrize(
    ("stated", "said"),
    [
        (("--gain-drift", "3%"), "3 %, as stated;"),
        (("--reference", "unloaded_validation.mcap"), "(measured by unloaded_validation.mcap): corrected."),
        (("--reference", "loaded_validation.mcap", "--reference-mass", "9.814"), "(measured by loaded_validation"),
    ],
)
def test_a_drift_is_stated_or_measured(armload, recorded_er50, monkeypatch, stated, said):
    monkeypatch.chdir(recorded_er50 / "runs" / "today")
    monkeypatch.setattr(payload_watch, "NOTED_S", 8.0)  # the joints move for 9 s of these 20
    run = armload("watch", "er50", "loaded_identification.mcap", "--calibration", "arm.calibration.toml", *stated)
    assert run.exit_code == 0, run.exception
    assert said in " ".join(run.output.split())
