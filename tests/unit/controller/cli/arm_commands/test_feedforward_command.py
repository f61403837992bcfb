"""`armload feedforward` from its user's view."""

import json
import re
from dataclasses import replace
from importlib import resources

import numpy as np
import pytest

from armload_controller.config.robot import load_robot
from armload_controller.cycle.control_cycle import Cycle
from armload_controller.cycle.run_recorder import Recorder
from armload_controller.cycle.torque_gate import TorqueGate
from armload_controller.motion.checked_path import check_path
from armload_controller.motion.motion_control import MotionControl
from armload_controller.session.arm_access import simulated_arm
from armload_controller.session.run_session import run_leg
from armload_controller.session.session_load import SessionLoad
from armload_identification.excitation.excitation_file import read_excitation, write_excitation
from armload_identification.excitation.fourier import Excitation, FourierTrajectory
from armload_identification.files.payload_file import write_payload
from armload_identification.model.payload import PayloadResult, Provenance

SWING_RAD = np.array([[0.2, 0.9, 0.0, 0.0, 0.3, 0.2], [0.0, 0.0, 0.9, 0.2, -0.7, 0.0]])[:, :, None]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """An excitation of one harmonic in 4 s, and the simulated payload as a payload file."""
    folder = tmp_path_factory.mktemp("feedforward")
    offset = np.array([0.0, 0.5, 1.2, 0.0, 0.6, 0.0])
    sweep = FourierTrajectory(0.25, offset, *SWING_RAD)
    write_excitation(folder / "sweep.toml", Excitation(sweep, 1))
    text = (resources.files("armload_configs") / "prbt.toml").read_text("utf-8")
    text = re.sub(r'^(identification|validation) = ".*"$', r'\1 = "sweep.toml"', text, flags=re.MULTILINE)
    (folder / "prbt.toml").write_text(text.replace("cycle_hz = 100.0", "cycle_hz = 50.0"))
    for role, shipped in load_robot("prbt").excitations.items():
        write_excitation(folder / f"{role}.toml", Excitation(shipped.trajectory, 2))
    body = load_robot("prbt").simulation.payload("block")
    values = np.stack([body.values, body.values], axis=1)
    known = np.ones(10, dtype=bool)
    result = PayloadResult("flange", body, known, values, np.ones(6), np.ones(6), Provenance("0", "0", {}))
    write_payload(folder / "payload.toml", result)
    unknown = known.copy()
    unknown[1] = False
    interval = np.where(unknown[:, None], values, np.nan)
    write_payload(folder / "unknown.toml", replace(result, determined=unknown, interval_95=interval))
    return folder


@pytest.fixture(scope="module")
def compared(armload, folder):
    words = ["feedforward", "compare", folder / "prbt.toml", folder / "payload.toml", "--mounted", "block"]
    result = armload(*words, "--excitation", folder / "sweep.toml", "--picture", folder / "ff.svg")
    assert result.exit_code == 0, result.output
    return result.output


@pytest.mark.long
def test_the_payloads_share_of_the_following_error_falls(compared, folder):
    lines = [line for line in compared.splitlines() if re.search("% (less|more)", line)]
    rows = {re.search(r"prbt_joint_\d", line)[0]: re.findall(r"([\d.]+) % less", line) for line in lines}
    assert set(rows) == {f"prbt_joint_{i}" for i in range(1, 7)}
    starred = re.findall(r"(prbt_joint_\d) \*", compared)
    assert {"prbt_joint_2", "prbt_joint_3", "prbt_joint_5"} == set(starred)
    for joint in ("prbt_joint_2", "prbt_joint_3"):
        identified, ideal = (float(share) for share in rows[joint])
        assert identified > 40.0
        assert ideal == pytest.approx(identified, abs=3.0)
    svg = (folder / "ff.svg").read_text()
    assert svg.lstrip().startswith("<?xml")


@pytest.fixture(scope="module")
def calibrated(armload, folder):
    """The comparison with the arm calibrated from its empty runs."""
    robot = load_robot(str(folder / "prbt.toml"))
    runs = [folder / f"empty_{role}.mcap" for role in robot.excitations]
    with simulated_arm(robot, SessionLoad.UNLOADED) as servos:
        servos.connect()
        for role, file in zip(robot.excitations, runs, strict=True):
            excitation = folder / f"{role}.toml"
            path = check_path(
                read_excitation(excitation), robot.motion_constraints, 0.02, file=excitation.name, key="excitation"
            )
            with Recorder(file, recorded_with(excitation)) as kept:
                gate = TorqueGate(robot.limits.torque_max_nm, 0.02)
                cycle = Cycle(servos, robot.limits.motion, gate, MotionControl(), [kept])
                run_leg(cycle, path, path.measured, lambda done: None)
    found = armload("calibrate", folder / "prbt.toml", *runs, "-o", folder / "arm.toml")
    assert found.exit_code == 0, found.output
    words = ["feedforward", "compare", folder / "prbt.toml", folder / "payload.toml", "--mounted", "block"]
    words += ["--calibration", folder / "arm.toml"]
    result = armload(*words, "--excitation", folder / "sweep.toml", "--picture", folder / "arm.svg")
    assert result.exit_code == 0, result.output
    return result.output


def recorded_with(excitation):
    return {
        "excitation.toml": excitation.read_text(),
        "run.json": '{"robot": "prbt", "load": "unloaded", "cycle_hz": 50}',
    }


@pytest.mark.long
def test_with_a_calibration_the_arms_own_torque_is_a_third_curve(calibrated, folder):
    assert "Following error due to the payload, RMS over time" in calibrated
    first, second = calibrated.split("Following error beyond the servo's lag, RMS over time")
    for text, columns in ((first, 3), (second, 3)):
        for joint in range(1, 7):
            (row,) = [line for line in text.splitlines() if line.startswith(f"│ prbt_joint_{joint} ") and "%" in line]
            assert len(re.findall("% (?:less|more)", row)) == columns
    (row,) = [line for line in second.splitlines() if "prbt_joint_3" in line and "% less" in line]
    payload, _, arm = (float(share) for share in re.findall(r"([\d.]+) % less", row))
    assert arm > payload + 10.0
    assert "no torque can be added on" not in calibrated
    assert "payload and arm: " in (folder / "arm.svg").read_text()


def test_a_calibration_of_another_arm_is_refused_before_anything_moves(armload, folder, recorded_er50):
    another = recorded_er50 / "runs" / "today" / "arm.calibration.toml"
    result = armload("feedforward", "trial", folder / "prbt.toml", folder / "payload.toml", "--calibration", another)
    assert result.exit_code == 1
    assert f"{another}: the calibration belongs to an arm with different kinematics" in str(result.exception)
    assert "connecting" not in result.output


@pytest.mark.long
def test_the_offset_is_tried_and_what_is_left_out_is_said(compared):
    assert re.search(r"torque offset trial at standstill, response: prbt_joint_2 \d+ %", compared)
    assert "no torque can be added on prbt_joint_1" in compared


def test_a_trial_tries_the_offset_and_nothing_else(armload, folder):
    result = armload("feedforward", "trial", folder / "prbt.toml", folder / "payload.toml", "--mounted", "block")
    assert result.exit_code == 0, result.output
    assert "trial at standstill" in result.output
    assert "less" not in result.output


def test_a_payload_that_is_not_determined_switches_nothing_on(armload, folder):
    result = armload("feedforward", "compare", "prbt", folder / "unknown.toml")
    assert result.exit_code == 1
    assert "not determined: cx; a payload is fed forward only with" in str(result.exception)
    assert "slow round" not in result.output


def test_an_unknown_payload_to_mount_is_refused(armload, folder):
    refused = armload("feedforward", "trial", "prbt", folder / "payload.toml", "--mounted", "x")
    assert "block, gripper" in str(refused.exception)


@pytest.mark.parametrize("words", [("feedforward", "trial", "prbt", "payload.toml"), ("commission", "er50")])
def test_a_payload_is_mounted_only_on_the_simulated_arm_of_this_process(armload, tmp_path, monkeypatch, words):
    monkeypatch.setattr("armload_controller.session.arm_access.open_arm", None)
    monkeypatch.chdir(tmp_path)
    bus = ("--bus", "socketcan:vcan0", "--simulated-drives")
    result = armload(*words, *bus, "--mounted", "gripper")
    assert "--mounted is 'gripper'" in str(result.exception)
    assert "armload simulate --payload" in str(result.exception)
    assert list(tmp_path.iterdir()) == []


def test_a_picture_that_is_no_picture_is_refused_before_anything_moves(armload, folder):
    result = armload("feedforward", "compare", "prbt", folder / "payload.toml", "--picture", folder / "ff.pdf")
    assert ".svg or .png" in str(result.exception)
    assert "slow round" not in result.output


@pytest.mark.parametrize("place", ["/proc/x.svg", "/proc/none/x.svg"])
def test_a_picture_that_cannot_be_written_is_refused_before_anything_moves(armload, folder, monkeypatch, place):
    monkeypatch.setattr("armload_controller.session.arm_access.open_arm", None)
    result = armload("feedforward", "compare", "prbt", folder / "payload.toml", "--picture", place)
    assert result.exit_code == 1
    assert re.search("/proc.* cannot be (created|written)", str(result.exception))


def test_any_other_bus_is_refused(armload, folder):
    result = armload("feedforward", "trial", "prbt", folder / "payload.toml", "--bus", "socketcan:can0")
    assert "--simulated-drives" in str(result.exception)


@pytest.mark.long
def test_a_run_adds_the_torque_of_the_payload(armload, folder):
    words = ["feedforward", "run", folder / "prbt.toml", folder / "payload.toml", "--mounted", "block", "--json"]
    result = armload(*words, "--excitation", folder / "sweep.toml")
    assert result.exit_code == 0, result.output
    assert "loaded, with feed-forward, run" in result.stderr
    found = json.loads(result.stdout)
    assert any(joint["usable"] for joint in found["offset"])
    assert found["comparisons"] == found["decisions"] == []


@pytest.fixture(scope="module")
def adapted(armload, folder, calibrated):
    """A run that adapts to the estimated payload."""
    words = ["feedforward", "run", "prbt", "--expect", "0..4", "--mounted", "gripper", "--json"]
    words += ["--calibration", folder / "arm.toml", "--excitation", folder / "sweep.toml"]
    result = armload(*words, "--decisions", folder / "decisions.jsonl")
    assert result.exit_code == 0, result.output
    return json.loads(result.stdout)


@pytest.mark.long
def test_torque_follows_what_the_arm_finds_out_and_every_decision_is_kept(adapted, folder):
    fed = [decision for decision in adapted["decisions"] if decision["kind"] == "fed"]
    truth = load_robot("prbt").simulation.payload("gripper")
    assert fed, adapted["decisions"]
    assert fed[-1]["mass_kg"] == pytest.approx(truth.mass_kg, rel=0.2)
    assert any(joint["usable"] for joint in adapted["offset"])
    kept = [json.loads(line) for line in (folder / "decisions.jsonl").read_text().splitlines()]
    assert kept == [{"robot": "prbt", **decision} for decision in adapted["decisions"]]


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (["payload.toml", "--expect", "0..3"], "takes no PAYLOAD"),
        (["--expect", "three"], "expected a range such as 0..3"),
        ([], "give a payload file, or --expect"),
    ],
)
def test_options_that_contradict_each_other(armload, words, text):
    result = armload("feedforward", "run", "prbt", *words)
    assert result.exit_code == 2
    assert text in result.output


def test_what_may_not_be_adapted_to(armload, folder):
    heavy = armload("feedforward", "run", "prbt", "--expect", "0..6")
    assert "limited to 80 % of the rated 6 kg" in str(heavy.exception)
    unknown = armload("feedforward", "run", "prbt", "--expect", "0..3", "--decisions", folder / "none.jsonl")
    assert "give that file as `calibration=`" in str(unknown.exception)
    assert "connecting" not in unknown.output


@pytest.mark.long
def test_decisions_that_cannot_be_kept_are_refused_before_anything_moves(armload, folder, calibrated):
    known = ("--calibration", folder / "arm.toml")
    nowhere = armload("feedforward", "run", "prbt", "--expect", "0..3", *known, "--decisions", folder / "no" / "a")
    assert "choose a --decisions" in str(nowhere.exception)
