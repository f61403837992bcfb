"""Identification and validation of a configured arm's payload: verdicts, refusals, and joints with other names."""

import re
import shutil
from dataclasses import replace
from importlib import resources
from pathlib import Path

import numpy as np
import pytest

import armload
from armload_identification.identification_errors import (
    EstimationError,
    RecordingError,
)
from armload_identification.model.payload import PARAMETER_NAMES, InertialParameters
from armload_identification.verdict.agreement import Outcome


def test_the_payload_is_found_within_its_intervals(found):
    true_values = armload.load_robot("er50").simulation.payload("paper").values
    assert list(found.intervals) == list(PARAMETER_NAMES)
    determined = {name: interval for name, interval in found.intervals.items() if interval is not None}
    assert {"mass", "cx", "cy", "cz"} <= set(determined)
    inside = [low <= true_values[PARAMETER_NAMES.index(name)] <= high for name, (low, high) in determined.items()]
    assert np.mean(inside) >= 0.7


@pytest.mark.long
def test_validating_the_file_says_what_the_identification_said(found, recorded_er50, tmp_path):
    found.save(tmp_path / "payload.toml")
    pair = [recorded_er50 / f"runs/today/{load}_validation.mcap" for load in ("loaded", "unloaded")]
    again = armload.validate("er50", tmp_path / "payload.toml", *pair)
    assert again.outcome is found.outcome is Outcome.RIGHT
    again.report(tmp_path / "report.html")
    page = (tmp_path / "report.html").read_text()
    assert "plain least squares estimate" in page
    assert 'id="identification"' not in page


def test_the_recording_that_a_payload_was_identified_from_cannot_confirm_it(found, recorded_er50):
    """It agreed with itself: "Right within the tolerance"."""
    pair = [str(recorded_er50 / f"runs/today/{load}_identification.mcap") for load in ("loaded", "unloaded")]
    judged = armload.validate("er50", found.payload, *pair)
    assert judged.outcome is Outcome.CANNOT_TELL
    assert "identified from this recording, which therefore cannot confirm it" in judged.to_dict()["verdict"]["text"]
    model = found.payload.model
    half = replace(found.payload, model=InertialParameters(0.5 * model.theta))
    assert armload.validate("er50", half, *pair).outcome is Outcome.WRONG
    part = [armload.read_recording(file, "er50", between_s=(0.0, 20.0)) for file in pair]
    assert armload.validate("er50", found.payload, *part).outcome is not None


def test_a_mass_that_the_arm_cannot_carry_is_refused(recorded_er50, tmp_path):
    """Gear ratios ten times too large gave 98 kg on an arm for 16 kg."""
    configs = Path(str(resources.files("armload_configs")))
    for name in ("er50_identification.toml", "er50_validation.toml"):
        shutil.copy(configs / name, tmp_path)
    text = re.sub(r"gear_ratio = (\d+)", r"gear_ratio = \g<1>0", (configs / "er50.toml").read_text())
    (tmp_path / "er50.toml").write_text(text)
    pair = [str(recorded_er50 / f"runs/today/{load}_identification.mcap") for load in ("loaded", "unloaded")]
    with pytest.raises(EstimationError, match=r"the mass would be 9\d(\.\d)? kg, 6.\d times the rated payload of er50"):
        armload.identify(str(tmp_path / "er50.toml"), *pair)


def test_a_run_of_another_arm_is_refused(recorded_er50):
    with pytest.raises(Exception, match="recorded on er50, not on prbt"):
        armload.read_recording(recorded_er50 / "runs/today/loaded_validation.mcap", "prbt")


def test_joints_that_are_called_otherwise_are_taken_in_their_order_and_that_is_said(recorded_er50):
    today = recorded_er50 / "runs" / "today"
    names = ("base", "shoulder", "elbow", "roll", "pitch", "yaw")
    runs = [armload.read_recording(today / f"{load}_identification.mcap") for load in ("loaded", "unloaded")]
    other = [replace(run, source=replace(run.source, joint_names=names)) for run in runs]
    (said,) = (note for note in armload.identify("er50", *other).notes if "None of the recorded joints" in note)
    assert "(base, shoulder, elbow, roll, pitch, yaw) is a joint name of er50" in said
    assert "`joints=`" in said
    assert not any("None of the recorded" in note for note in armload.identify("er50", *runs).notes)
    with pytest.raises(RecordingError, match=r"Exchange the two files.* None of the recorded joints \(base, "):
        armload.identify("er50", *other[::-1])
