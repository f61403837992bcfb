"""`armload calibrate`: its inputs, and its messages for invalid ones."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from importlib import resources
from pathlib import Path

import msgspec
import numpy as np
import pytest

import armload as armload_package
from armload_controller.analysis.arm_in_use import arm_in_use
from armload_controller.config.robot import load_robot
from armload_controller.config.robot_runs import (
    is_run_table,
    masses_otherwise_recorded,
    read_runs,
    runs_of_commissioning,
)
from armload_controller.control_errors import ConfigurationError
from armload_identification.excitation.excitation_file import read_excitation
from armload_identification.files.calibration_file import read_calibration, write_calibration
from armload_identification.identification_errors import CalibrationFileError, ReportError, RunTableError
from armload_identification.recording.recording import Recording
from armload_identification.recording.run_format import RUN_ATTACHMENT
from armload_identification.report.calibration_report import render_calibration_report


@pytest.fixture
def ur10e():
    return load_robot("ur10e")


def test_a_table_is_distinguished_from_a_recording(tmp_path):
    table, log = tmp_path / "runs.csv", tmp_path / "log.csv"
    table.write_bytes(b"\xef\xbb\xbfmounting, recording ,mass_kg\r\n")
    log.write_text("0.0,1.0,2.0\n")
    assert is_run_table(table)
    (tmp_path / "semicolons.csv").write_text("recording;mounting;mass_kg\n")
    assert is_run_table(tmp_path / "semicolons.csv")
    assert not is_run_table(log)
    assert not is_run_table(tmp_path / "none.csv")


def test_a_recording_that_does_not_say_what_it_carried_is_named(ur10e, tmp_path):
    log = tmp_path / "log.csv"
    row = ",".join(["0.01"] * 31)
    log.write_text("\n".join(f"{0.01 * i},{row}" for i in range(100)))
    found = read_runs(ur10e, [log])
    assert found.runs == ()
    ((name, reason),) = found.left_out
    assert name == "log.csv"
    assert "give a table of runs" in reason


def test_the_start_of_a_run_may_be_in_the_table(ur10e, tmp_path):
    table, log = tmp_path / "runs.csv", tmp_path / "log.csv"
    row = ",".join(["0.01"] * 31)
    log.write_text("\n".join(f"{0.01 * i},{row}" for i in range(100)))
    for said, recorded in (("20260301", "2026-03-01T00:00:00"), ("2026-03-01T08:30", "2026-03-01T08:30:00"), ("", "")):
        table.write_text(f"recording,mounting,mass_kg,recorded\nlog.csv,,,{said}\n")
        (run,) = read_runs(ur10e, [table]).runs
        assert run.recorded == recorded


def test_a_table_among_recordings_is_refused(ur10e, tmp_path):
    table = tmp_path / "runs.csv"
    table.write_text("recording,mounting,mass_kg\na.csv,,\n")
    with pytest.raises(RunTableError, match="a table of runs cannot be combined"):
        read_runs(ur10e, [table, tmp_path / "log.csv"])


def test_a_commissioning_calibrates_with_the_mass_of_its_command_not_with_one_that_was_refused():
    """The recordings state 5 kg, which contradicted the data; the payload was then entered as 3 kg, or not at all."""
    time_s = 0.01 * np.arange(40)
    runs = []
    for load, said in (("unloaded", {}), ("loaded", {"mass_kg": 5.0})):
        made = Recording.from_arrays(
            time_s, np.sin(time_s)[:, None], torque_nm=np.cos(time_s)[:, None], name=f"a/{load}"
        )
        source = replace(made.source, attachments={RUN_ATTACHMENT: json.dumps({"load": load, **said})})
        runs.append(replace(made, source=source))
    assert runs_of_commissioning(runs, None).weighed == {}
    ((mounting, payload),) = runs_of_commissioning(runs, 3.0).weighed.items()
    assert (mounting, payload.mass_kg) == (runs_of_commissioning(runs, 3.0).runs[1].mounting, 3.0)
    assert masses_otherwise_recorded(runs, None) == masses_otherwise_recorded(runs, 3.0) == (5.0,)
    assert masses_otherwise_recorded(runs, 5.0) == ()


def test_nothing_usable_is_an_error_that_names_everything(armload, tmp_path):
    table = tmp_path / "runs.csv"
    table.write_text("recording,mounting,mass_kg\na.csv,,\nb.csv,disc,2.0\n")
    result = armload("calibrate", "ur10e", table, "-o", tmp_path / "arm.toml")
    assert result.exit_code == 1
    assert "no recording can be used" in str(result.exception)
    text = str(result.exception)
    assert "a.csv" in text
    assert "b.csv" in text
    assert text.endswith("Check the path).")
    assert not (tmp_path / "arm.toml").exists()


def test_a_calibration_that_is_none_is_refused(armload, today, tmp_path):
    wrong = tmp_path / "arm.toml"
    wrong.write_text("[arm]\n")
    loaded = today / "loaded_validation.mcap"
    result = armload("identify", "er50", "--loaded", loaded, "--calibration", wrong)
    assert result.exit_code == 1
    assert isinstance(result.exception, CalibrationFileError)
    assert "arm.toml" in str(result.exception)


def test_a_robots_file_names_its_calibration_and_the_command_line_wins(tmp_path):
    text = (Path(str(resources.files("armload_configs"))) / "ur10e.toml").read_text()
    own = tmp_path / "own.toml"
    own.write_text(text.replace("[robot]\n", '[robot]\ncalibration = "arm.calibration.toml"\n', 1))
    robot = load_robot(str(own))
    with pytest.raises(ConfigurationError, match=r"own\.toml: robot\.calibration .*armload calibrate"):
        arm_in_use(robot)
    (tmp_path / "arm.calibration.toml").write_text("[arm]\n")
    with pytest.raises(CalibrationFileError, match=r"arm\.calibration\.toml"):
        arm_in_use(robot)
    with pytest.raises(CalibrationFileError, match=r"other\.toml"):
        arm_in_use(robot, tmp_path / "other.toml")
    assert arm_in_use(load_robot("ur10e")).calibration is None


@pytest.fixture(scope="module")
def today(recorded_er50):
    return recorded_er50 / "runs" / "today"


@pytest.fixture(scope="module")
def calibrated(armload, today, tmp_path_factory):
    """The arm calibrated from its four recordings, which name their payloads; and the output."""
    path = tmp_path_factory.mktemp("calibrated") / "arm.calibration.toml"
    words = [*sorted(today.glob("*.mcap")), "-o", path, "--report", path.with_name("arm.html")]
    result = armload("calibrate", "er50", *words)
    assert result.exit_code == 0, result.output
    return path, result.output


def test_recordings_that_say_what_they_carry_need_no_table(calibrated):
    result = read_calibration(calibrated[0])
    assert [run.mounting for run in result.runs] == ["today", "today", "", ""]
    (payload,) = result.payloads
    assert payload.weighed_kg == pytest.approx(9.814)
    assert result.days == ("2026-03-01",)
    assert result.warnings == result.left_out == ()


def test_the_report_shows_gains_runs_and_where_they_are_from(calibrated):
    page = calibrated[0].with_name("arm.html").read_text()
    arm = read_calibration(calibrated[0])
    assert "4 runs of 2026-03-01, scale from a weighed payload" in page
    assert "Gains determined: 6 of 6" in page
    assert all(f"{gain:.4g}"[:-1] in page for gain in arm.gain_nm_a)
    assert all(f"{name}</th>" in page for name in ("joint_1", "joint_6"))
    assert page.count('role="img"') == 1 + arm.n
    assert arm.kinematics_sha256 in page
    assert all(run.name in page for run in arm.runs)
    # The page loads nothing and runs no script.
    assert "<script" not in page
    assert "http" not in page.replace("http-equiv", "")


def test_a_report_needs_a_name_per_joint(calibrated):
    with pytest.raises(ReportError, match="5 joint names for 6 joints"):
        render_calibration_report(read_calibration(calibrated[0]), "an arm", ["joint"] * 5)


def test_the_next_payload_of_an_arm_is_known_as_well_though_its_gains_may_drift(calibrated, today):
    """The validation runs serve as a second commissioning, nominal gains as the first.

    The interval allows for a drift of the gains since the calibration, as far as the unloaded run does not show it, and
    between the two runs; with nominal gains it does not.
    """
    pair = today / "loaded_validation.mcap", today / "unloaded_validation.mcap"
    first, second = (
        armload_package.identify("er50", *pair),
        armload_package.identify("er50", *pair, calibration=calibrated[0]),
    )
    width = [found.intervals["mass"][1] - found.intervals["mass"][0] for found in (first, second)]
    assert width[1] < 1.05 * width[0]
    low, high = second.intervals["mass"]
    assert low < 9.814 < high
    assert "are from arm.calibration.toml: 4 runs of 2026-03-01, scale from a weighed payload" in second.notes[0]
    assert set(second.payload.provenance.calibration_sha256) == {"arm.calibration.toml"}


def test_an_export_with_it_has_the_payloads_friction(armload, calibrated, today, tmp_path):
    words = ["er50", today / "payload.toml", "--format", "c", "--calibration", calibrated[0], "-o", tmp_path]
    result = armload("export", *words)
    assert result.exit_code == 0, result.output
    header = (tmp_path / "armload_er50.h").read_text()
    assert "Calibration of the arm: arm.calibration.toml, sha256" in header
    assert "void armload_er50_friction(" in header


def test_a_calibration_moves_a_payload_of_nominal_gains(armload, calibrated, today):
    result = armload("compare", today / "payload.toml", today / "payload.toml", "--calibration", calibrated[0])
    assert "verdict: CANNOT TELL" in result.output
    assert result.exit_code == 4
    found = re.search(r"with the gains of arm\.calibration\.toml: ([\d.]+) kg", result.output)
    assert found is not None, result.output
    assert float(found[1]) == pytest.approx(9.814, rel=0.01)


def test_a_calibration_of_another_arm_does_not_move_a_payload(armload, calibrated, today, tmp_path):
    text = (today / "payload.toml").read_text()
    other = tmp_path / "other.toml"
    other.write_text(text.replace('robot = "er50"', 'robot = "prbt"'))
    result = armload("compare", other, today / "payload.toml", "--calibration", calibrated[0])
    assert str(result.exception).startswith(f"{other}: provenance.robot is 'prbt': expected 'er50', the arm of")


@pytest.mark.long
def test_drift_holds_runs_against_the_calibration(armload, calibrated, today, tmp_path):
    names = sorted(today.glob("*.mcap"))
    files = ["--report", tmp_path / "drift.html", "--picture", tmp_path / "drift.svg"]
    result = armload("drift", "er50", *names, "--calibration", calibrated[0], *files, "--json")
    assert result.exit_code == 0, result.output
    found = json.loads(result.stdout)
    assert [run["carried"].split()[0] for run in found["runs"][2:]] == ["nothing", "nothing"]
    assert [float(run["carried"].split()[0]) for run in found["runs"][:2]] == pytest.approx([9.8, 9.8], abs=0.3)
    assert found["findings"] == []
    assert not found["out_of_date"]
    chart = found["joints"][2]["charts"]["residual"]
    assert len(chart["values"]) == 4
    assert chart["lower_limit"][0] < chart["values"][0] < chart["upper_limit"][0]
    page = (tmp_path / "drift.html").read_text()
    assert "Nothing has changed." in page
    assert page.count('role="img"') == 1
    assert page.count(">run</text>") == 3  # all four state the moment of the commissioning
    assert len(re.findall(r">\d{4}-\d\d-\d\d \d\d:\d\d UTC</td>", page)) == 4
    assert all(run.name in page for run in names)
    assert "<script" not in page
    assert "http" not in page.replace("http-equiv", "")
    assert (tmp_path / "drift.svg").stat().st_size > 10_000


def test_drift_takes_days_and_payloads_from_a_table(armload, calibrated, today, tmp_path):
    table = tmp_path / "runs.csv"
    one, other = (today / f"{load}_validation.mcap" for load in ("unloaded", "loaded"))
    rows = [f"{one},,,2026-05-02", f"{other},today,,2026-04-30T08:00", "none.mcap,,,2026-05-03"]
    table.write_text("\n".join(["recording,mounting,mass_kg,recorded", *rows]))
    result = armload("drift", "er50", table, "--calibration", calibrated[0], "--json")
    assert result.exit_code == 0, result.output
    found = json.loads(result.stdout)
    assert [(run["began"][:10], run["carried"]) for run in found["runs"]] == [
        ("2026-04-30", "today"),
        ("2026-05-02", "nothing"),
    ]
    assert [entry["name"] for entry in found["left_out"]] == ["none.mcap"]
    table.write_text("recording,mounting,mass_kg,recorded\na.mcap,,,yesterday\n")
    wrong = armload("drift", "er50", table, "--calibration", calibrated[0])
    assert wrong.exit_code == 1
    assert "line 2, recorded" in str(wrong.exception)
    nothing = armload("drift", "er50", one)
    assert nothing.exit_code == 1
    assert "armload calibrate" in str(nothing.exception)
    none = armload("drift", "er50", tmp_path / "none.mcap", "--calibration", calibrated[0])
    assert none.exit_code == 1
    assert "no recording can be used (none.mcap:" in str(none.exception)


@pytest.mark.long
def test_a_wiggle_is_designed_about_the_place_where_the_arm_stands(armload, calibrated, tmp_path):
    place, output = [0.1, 0.8, 0.2, 0.0, 0.3, 0.0], tmp_path / "wiggle.toml"
    words = ["design", "er50", "--for", "any-motion", "--calibration", calibrated[0], "--mass-within", "0.2"]
    result = armload(*words, "--at-rad", " ".join(map(str, place)), "--within-deg", "4", "-o", output, "--json")
    assert result.exit_code == 0, result.output
    found = json.loads(result.stdout)
    assert found["half_width_95_kg"] <= 0.2 * found["expected_kg"]
    assert found["measured_s"] > found["periods"] * found["period_s"]
    assert [joint["at_rad"] for joint in found["joints"]] == place
    assert max(joint["amplitude_rad"] for joint in found["joints"]) <= 0.07
    written = read_excitation(output)
    assert written.design["criterion"] == "mass"
    assert written.design["command"].startswith("armload design er50 --for any-motion")
    assert written.periods == found["periods"]
    np.testing.assert_allclose(written.trajectory.offset_rad, place)
    assert output.with_suffix(".png").is_file()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--for", "any-motion"], "armload calibrate"),
        (["--for", "any-motion", "--restarts", "2"], "--restarts: requires --for payload"),
        (["--mass-within", "0.1"], "--mass-within: requires --for any-motion"),
        (["--for", "any-motion", "--mass-within", "0.001", "CALIBRATION"], "more runs with weighed payloads"),
        (["--for", "any-motion", "--within-deg", "0"], "expected above 0"),
        (["--for", "any-motion", "--at-rad", "0 x"], "expected one position in rad per joint"),
        (["--for", "any-motion", "--at-rad", "0 0 0", "CALIBRATION"], "expected 6 positions in rad"),
        (["--for", "any-motion", "--at-rad", "0 0 0 0 0 9", "CALIBRATION"], "joint_6 is at 9.000 rad"),
    ],
)
def test_a_wiggle_that_makes_no_sense_is_refused(armload, calibrated, tmp_path, words, message):
    given = [part for word in words for part in (["--calibration", calibrated[0]] if word == "CALIBRATION" else [word])]
    result = armload("design", "er50", *given, "-o", tmp_path / "wiggle.toml")
    assert result.exit_code != 0
    assert message in f"{' '.join(result.output.split())} {result.exception}"
    assert not (tmp_path / "wiggle.toml").exists()


def test_a_wiggle_with_gains_of_nominal_scale_is_refused_before_the_search(armload, calibrated, tmp_path):
    """After half a minute, a larger amplitude or more speed was recommended, which cannot help."""
    found = read_calibration(calibrated[0])
    unweighed = tmp_path / "unweighed.toml"
    payloads = tuple(msgspec.structs.replace(payload, weighed_kg=np.nan) for payload in found.payloads)
    write_calibration(unweighed, replace(found, payloads=payloads))
    words = ["design", "er50", "--for", "any-motion", "--mass-within", "0.001", "--calibration", unweighed]
    result = armload(*words, "-o", tmp_path / "wiggle.toml")
    assert result.exit_code == 1
    assert "Calibrate the arm with a weighed payload (mass_kg)" in str(result.exception)
