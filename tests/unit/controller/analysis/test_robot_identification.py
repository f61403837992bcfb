"""Identification and validation of a configured arm's payload: verdicts, refusals, and joints with other names."""

import re
import shutil
from dataclasses import replace
from importlib import resources
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from msgspec import structs

import armload
from armload_controller.analysis import robot_identification
from armload_identification.calibration.calibration_result import ArmCalibration
from armload_identification.identification_errors import (
    EstimationError,
    NoPayloadMass,
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


# Notes and causes --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("rated_kg", "told"), [(16.0, False), (9.0, True)])
def test_more_than_the_rated_payload_is_told(recorded_er50, rated_kg, told):
    robot = armload.load_robot("er50")
    robot = robot.with_tables(robot=structs.replace(robot.tables.robot, rated_payload_kg=rated_kg))
    today = recorded_er50 / "runs" / "today"
    pair = [armload.read_recording(today / f"{load}_identification.mcap", robot) for load in ("loaded", "unloaded")]
    notes = armload.identify(robot, *pair).notes
    assert any("more than its rated payload of 9 kg" in note for note in notes) is told


def session(log_factor=0.0):
    return SimpleNamespace(log_factor=log_factor, deviation=0.03, origin="as stated")


@pytest.mark.parametrize(
    ("error", "unnamed", "drift", "text"),
    [
        (RecordingError("bad"), "Joints were taken in order.", None, "bad Joints were taken in order."),
        (RecordingError("bad"), None, session(), "bad"),
        (
            NoPayloadMass("no mass.", 0.1, 0.2),
            None,
            session(),
            "no mass. This allows for a drift of all gains of 3 % (as",
        ),
        (NoPayloadMass("no mass.", 0.1, 0.2), None, session(0.01), "no mass."),
        (NoPayloadMass("no mass.", 0.1, 0.2), "in order", None, "no mass."),
        (EstimationError("other"), "in order", session(), "other"),
    ],
)
def test_errors_name_what_may_have_caused_them(error, unnamed, drift, text):
    with pytest.raises(type(error)) as caught, robot_identification._explained(unnamed, drift):
        raise error
    assert str(caught.value).startswith(text)
    assert "`reference=`" not in str(caught.value)
    assert (str(caught.value) == text) is (not text.endswith("(as"))
    if isinstance(error, NoPayloadMass):
        assert (caught.value.mass_kg, caught.value.half_width_kg) == (0.1, 0.2)


@pytest.mark.parametrize(
    ("weighed_kg", "gains", "verified"),
    [
        ((2.0, np.nan), (), True),
        ((np.nan,), (True, True), False),
        (None, (True, True), True),
        (None, (True, False), False),
    ],
)
def test_a_weighed_payload_or_calibrated_gains_verify_the_scale(weighed_kg, gains, verified):
    payloads = weighed_kg and [SimpleNamespace(weighed_kg=value) for value in weighed_kg]
    calibration = payloads and SimpleNamespace(
        scale_weighed=ArmCalibration.scale_weighed.fget(SimpleNamespace(payloads=payloads))
    )
    used = SimpleNamespace(calibration=calibration, transmission=SimpleNamespace(calibrated=np.array(gains)))
    assert robot_identification._scale_verified(used) is verified


def test_windows_allow_for_a_drift_and_say_so(recorded_er50):
    today = recorded_er50 / "runs" / "today"

    def windows(share):
        run, stated = today / "loaded_identification.mcap", armload.StatedDrift(share)
        return armload.identify_over_time("er50", run, 10.0, calibration=today / "arm.calibration.toml", drift=stated)

    little, much = windows(1e-4), windows(0.2)
    narrow, wide = (found.windows[0].found.uncertainty.half_width_95[0] for found in (little, much))
    assert wide > 1.1 * narrow
    (note,) = much.to_dict()["notes"]
    assert "a drift of 1 % would change the mass by" in note
    assert f"note: {note}" in str(much)


@pytest.mark.parametrize(
    ("every_s", "refused"), [(robot_identification.SHORTEST_WINDOW_S, False), (1.99, True), (np.nan, True)]
)
def test_windows_are_not_too_short(recorded_er50, monkeypatch, every_s, refused):
    windows = SimpleNamespace(found=None)
    monkeypatch.setattr(robot_identification, "identify_windows", lambda *_: (windows,))
    today = recorded_er50 / "runs" / "today"
    given = ("er50", today / "loaded_identification.mcap", every_s)
    if not refused:
        assert armload.identify_over_time(*given, calibration=today / "arm.calibration.toml").windows == (windows,)
        return
    with pytest.raises(EstimationError, match=r"windows of .* s: expected .* s or more; 10 to 20 s of fast motion"):
        armload.identify_over_time(*given, calibration=today / "arm.calibration.toml")
