"""The command line from its user's view: its output, and its answers to wrong input."""

import json
import re
import shutil
import signal
import subprocess
import sys
from dataclasses import replace
from importlib import resources
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pytest

from armload_controller.cli.commands.design_command import CriterionName
from armload_controller.config.robot import load_robot
from armload_identification.excitation.excitation_file import read_excitation
from armload_identification.excitation.fourier import CRITERIA
from armload_identification.files.payload_file import read_payload, write_payload
from armload_identification.model.payload import InertialParameters
from armload_identification.pipeline.payload_validation import validate_runs
from armload_identification.recording.file_reading import read_recording_file
from tests.bounded import await_that
from tests.short_commissioning import write_short_robot
from tests.started_programs import as_started

PROGRAM = [sys.executable, "-c", "from armload_controller.cli.entry import main; main()"]
CONFIGS = Path(str(resources.files("armload_configs")))


@pytest.fixture(scope="module")
def short_robot(tmp_path_factory):
    return write_short_robot(tmp_path_factory.mktemp("robot"))


@pytest.fixture(scope="module")
def first_half(armload, short_robot, tmp_path_factory):
    """Folder and result of a commissioning's unloaded half, with a live view."""
    output = tmp_path_factory.mktemp("halves") / "run"
    half = ("commission", short_robot, "--runs", "unloaded", "--output", output, "--json")
    result = armload(*half, "--live-address", "127.0.0.1:0")
    assert result.exit_code == 0, result.output
    return output, result


@pytest.fixture(scope="module")
def commissioned(armload, short_robot, first_half, tmp_path_factory):
    """Folder and console text of one commissioning, whose unloaded half was recorded before."""
    output = tmp_path_factory.mktemp("commissioned") / "run"
    shutil.copytree(first_half[0], output)
    result = armload("commission", short_robot, "--output", output)
    assert result.exit_code == 0, result.output
    return output, result.output


def test_commission_leaves_recordings_payload_and_report(commissioned):
    output, printed = commissioned
    assert sorted(p.name for p in output.iterdir()) == [
        "loaded_identification.mcap",
        "loaded_validation.mcap",
        "payload.toml",
        "report.html",
        "unloaded_identification.mcap",
        "unloaded_validation.mcap",
    ]
    payload = read_payload(output / "payload.toml")
    assert payload.model.mass_kg == pytest.approx(3.0, rel=0.1)
    assert payload.model.is_physical
    assert "truth" in printed
    assert "residual" in printed
    assert str(output / "report.html") in printed
    assert "warning: no calibration was written: the runs are too short" in printed


def test_what_is_not_determined_is_not_printed_as_a_number(commissioned):
    output, printed = commissioned
    payload = read_payload(output / "payload.toml")
    assert not payload.determined[4:].all()
    for name, determined in zip(("ixx", "iyy", "izz", "ixy", "ixz", "iyz"), payload.determined[4:], strict=True):
        row = next(line for line in printed.splitlines() if re.search(rf"\b{name}\b", line) and "kg m2" in line)
        assert ("not determined" in row) == (not determined)


def test_identify_and_validate_take_the_recordings_again(commissioned, armload, short_robot, tmp_path):
    output, _ = commissioned
    file = tmp_path / "again.toml"
    pair = ["--loaded", output / "loaded_identification.mcap", "--unloaded", output / "unloaded_identification.mcap"]
    result = armload("identify", short_robot, *pair, "-o", file)
    assert result.exit_code == 0, result.output
    assert read_payload(file).model.mass_kg == read_payload(output / "payload.toml").model.mass_kg
    fresh = ["--loaded", output / "loaded_validation.mcap", "--unloaded", output / "unloaded_validation.mcap"]
    result = armload("validate", short_robot, file, *fresh)
    titles = {0: "Repeatable within the tolerance", 4: "CANNOT TELL"}
    assert f"verdict: {titles[result.exit_code]}" in result.output


def test_validate_fails_on_another_payload(commissioned, armload, short_robot, tmp_path):
    output, _ = commissioned
    result = read_payload(output / "payload.toml")
    doubled = InertialParameters(2 * result.model.theta)
    wrong = tmp_path / "wrong.toml"
    write_payload(wrong, replace(result, model=doubled, determined=np.zeros(10, dtype=bool)))
    fresh = ["--loaded", output / "loaded_validation.mcap", "--unloaded", output / "unloaded_validation.mcap"]
    result = armload("validate", short_robot, wrong, *fresh)
    assert result.exit_code == 3
    assert "verdict: WRONG" in result.output
    assert "too high" in result.output
    assert "limit" in result.output


def test_the_first_half_is_left_to_the_second(first_half):
    folder, first = first_half
    assert "--runs loaded" in first.stderr
    assert "ws://127.0.0.1:" in first.stderr
    assert not (folder / "payload.toml").exists()
    assert json.loads(first.stdout) == {
        "schema": "armload/commission-half/1",
        "armload_version": version("armload"),
        "files": {"directory": str(folder)},
    }


@pytest.mark.long
def test_the_second_half_takes_up_the_first_and_makes_a_stopped_run_again(commissioned, armload, short_robot, tmp_path):
    """After a stop there are the first half, a complete loaded recording and a partial one."""
    complete, _ = commissioned
    output = tmp_path / "halves"
    shutil.copytree(complete, output)
    (output / "loaded_validation.mcap").rename(output / "loaded_validation.partial.mcap")
    for made in ("payload.toml", "report.html"):
        (output / made).unlink()
    second = armload("commission", short_robot, "--runs", "loaded", "--output", output, "--mass-kg", "3.0", "--json")
    assert second.exit_code == 0, second.output
    assert "identification, run" not in second.stderr
    assert "validation, run" in second.stderr
    assert (output / "loaded_validation.partial.mcap").exists()
    document = json.loads(second.stdout)
    assert (document["schema"], document["armload_version"]) == ("armload/payload/1", version("armload"))
    assert document["payload"]["mass_kg"] == read_payload(output / "payload.toml").model.mass_kg
    assert document["verdict"]["outcome"] == document["validation"]["outcome"] != "wrong"
    files = {"directory": output, "payload": output / "payload.toml", "report": output / "report.html"}
    assert document["files"] == {key: str(path) for key, path in files.items()}
    assert all(path.exists() for path in files.values())
    assert read_payload(output / "payload.toml").model.mass_kg == pytest.approx(3.0, rel=1e-3)
    said = [read_recording_file(output / f"{load}_validation.mcap").source.run() for load in ("unloaded", "loaded")]
    assert [run.get("mass_kg") for run in said] == [None, 3.0]


def test_the_second_half_without_the_first_is_refused(armload, short_robot, tmp_path):
    result = armload("commission", short_robot, "--runs", "loaded", "--output", tmp_path / "empty")
    assert result.exit_code == 1
    assert "--runs unloaded" in str(result.exception)
    result = armload("commission", short_robot, "--runs", "loaded")
    assert "--output" in str(result.exception)


def test_recordings_are_not_overwritten(commissioned, armload, short_robot):
    output, _ = commissioned
    before = (output / "unloaded_identification.mcap").read_bytes()
    result = armload("commission", short_robot, "--output", output)
    assert result.exit_code == 1
    assert "never overwritten" in str(result.exception)
    assert (output / "unloaded_identification.mcap").read_bytes() == before


def test_an_excitation_beyond_the_limits_switches_nothing_on(armload, short_robot, tmp_path):
    shutil.copytree(short_robot.parent, tmp_path / "robot")
    tight = tmp_path / "robot" / "tight.toml"
    tight.write_text(short_robot.read_text().replace("position_max_rad = 2.3562", "position_max_rad = 1.3", 1))
    result = armload("commission", tight, "--output", tmp_path / "run")
    assert "prbt_joint_3: position" in str(result.exception)
    assert "connecting" not in result.output


def test_the_verdict_is_about_the_validation_runs(commissioned, short_robot):
    output, printed = commissioned
    robot = load_robot(str(short_robot))
    loaded, unloaded = (read_recording_file(output / f"{load}_validation.mcap") for load in ("loaded", "unloaded"))
    payload = read_payload(output / "payload.toml")
    judged = validate_runs((loaded, unloaded), robot.chain, robot.drives.transmission, payload)
    for name, residual in zip(robot.joint_names, judged.left_in_band_nm, strict=True):
        row = next(line for line in printed.splitlines() if name in line)
        assert f"{residual:.3f}" in row


def test_the_tolerance_decides_between_right_and_cannot_tell(commissioned, armload, short_robot):
    """The same runs, with a tolerance that they can confirm, one that they cannot, and an invalid one."""
    output, _ = commissioned
    pair = ["--loaded", output / "loaded_validation.mcap", "--unloaded", output / "unloaded_validation.mcap"]
    words = ["validate", short_robot, output / "payload.toml", *pair, "--tolerance"]
    assert armload(*words, "0.3", "0.2").exit_code == 0
    result = armload(*words, "0.0001", "0.0001")
    assert result.exit_code == 4
    assert "verdict: CANNOT TELL" in result.output
    assert "the smallest error that would be detected" in result.output
    assert "expected 0 to 1" in str(armload(*words, "0.02", "-0.01").exception)


def test_compare_gives_the_verdict_beside_the_errors(commissioned, armload, tmp_path):
    output, _ = commissioned
    payload = read_payload(output / "payload.toml")
    cad = tmp_path / "cad.toml"
    values, known = payload.model.values, np.array([0.1, *[0.01] * 3, *[0.01] * 6])
    interval = np.stack([values - known, values + known], axis=1)
    write_payload(cad, replace(payload, mass_center=None, determined=np.ones(10, dtype=bool), interval_95=interval))
    same = armload("compare", output / "payload.toml", cad, "--tolerance", "0.3", "0.2")
    assert same.exit_code == 0, same.output
    assert "verdict: Right within the tolerance" in same.output
    write_payload(cad, replace(payload, model=InertialParameters(2 * payload.model.theta)))
    other = armload("compare", output / "payload.toml", cad)
    assert other.exit_code == 3
    assert "verdict: WRONG" in other.output
    assert "CAD gives a mass" in other.output


def test_an_output_that_is_a_file_is_refused(armload, short_robot, tmp_path):
    file = tmp_path / "file.txt"
    file.write_text("precious")
    result = armload("commission", short_robot, "--output", file)
    assert "cannot be created" in str(result.exception)
    assert file.read_text() == "precious"


def test_recordings_of_another_robot_are_refused(commissioned, armload):
    output, _ = commissioned
    pair = ["--loaded", output / "loaded_identification.mcap", "--unloaded", output / "unloaded_identification.mcap"]
    result = armload("identify", "er50", *pair)
    assert "recorded on prbt, not on er50" in str(result.exception)


def test_a_payload_in_another_frame_is_refused(commissioned, armload, short_robot, tmp_path):
    output, _ = commissioned
    file = tmp_path / "wrist.toml"
    file.write_text((output / "payload.toml").read_text().replace('frame = "flange"', 'frame = "wrist"'))
    pair = ["--loaded", output / "loaded_validation.mcap", "--unloaded", output / "unloaded_validation.mcap"]
    result = armload("validate", short_robot, file, *pair)
    assert "'wrist'" in str(result.exception)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTSTP])
def test_a_key_brings_the_arm_to_rest(short_robot, tmp_path, number):
    """Ctrl-C and Ctrl-Z. The signals that end a program are in tests/faults/test_program_signals.py."""
    output = tmp_path / "run"
    running = subprocess.Popen(
        as_started([*PROGRAM, "commission", short_robot, "--output", output]),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    for line in running.stdout:
        if "connecting" in line:
            break
    await_that(lambda: list(output.glob("*.mcap")) or running.poll() is not None, "a recording has begun", 60.0)
    assert running.poll() is None
    running.send_signal(number)
    _, errors = running.communicate(timeout=60)
    assert running.returncode == 130, errors
    assert "Traceback" not in errors
    assert not list(output.glob("unloaded_identification.mcap"))


@pytest.mark.parametrize("interface", ["socketcan", "slcan"])
def test_any_other_bus_is_refused(armload, interface, tmp_path):
    result = armload("commission", "er50", "--bus", "interface:can0", "--output", tmp_path / "x")
    assert result.exit_code == 1
    assert "--simulated-drives" in str(result.exception)
    assert not (tmp_path / "x").exists()


def test_a_cycle_that_does_not_fit_the_bus_is_refused(armload, tmp_path):
    result = armload("commission", "er50", "--cycle-hz", "900", "--output", tmp_path / "x")
    assert "command line: bus.cycle_hz is 900.0" in str(result.exception)
    assert not (tmp_path / "x").exists()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("init --payload-kg three --output a.toml", "'--payload-kg': 'three': expected a number"),
        ("design er50 --output a.toml --restarts 0", "'--restarts': '0': expected at least 1"),
        ("fleet identify jobs.csv --output rows --workers two", "'--workers': 'two': expected a whole number"),
        ("design er50 --output a.toml --for all", "'--for': 'all': expected one of 'payload', 'any-motion'"),
        ("identify er50 --loaded a.mcap --tolerance a 1", "'--tolerance': 'a': expected a number"),
        ("export er50 a.toml --format cc", "'--format': 'cc': expected one of 'c', 'fmu'"),
        ("simulate er50 --payload-at 10s", "'--payload-at': '10s': expected a time and a payload"),
    ],
)
def test_a_value_of_an_option_is_named_with_what_was_expected(armload, words, said):
    result = armload(*words.split())
    assert (result.exit_code, said in result.output) == (2, True), result.output


def test_simulate_needs_a_bus_that_others_can_reach(armload):
    assert "--bus" in str(armload("simulate", "er50").exception)


def test_simulate_writes_the_descriptions_of_its_drives(armload, tmp_path):
    result = armload("simulate", "er50", "--write-eds", str(tmp_path / "eds"))
    assert result.exit_code == 0, result.output
    assert sorted(path.name for path in (tmp_path / "eds").glob("*.eds")) == [f"joint_{k}.eds" for k in range(1, 7)]
    (tmp_path / "file").write_text("")
    result = armload("simulate", "er50", "--write-eds", str(tmp_path / "file"))
    assert "cannot be created" in str(result.exception)


def test_simulate_takes_one_description_or_one_per_joint(armload, tmp_path):
    armload("simulate", "er50", "--write-eds", str(tmp_path))
    two = [f"--description={path}" for path in sorted(tmp_path.glob("*.eds"))[:2]]
    result = armload("simulate", "er50", "--bus", "socketcan:vcan0", *two)
    assert "one for all joints, or one per joint: 6" in str(result.exception)
    result = armload("simulate", "er50", "--description", str(tmp_path / "none.eds"))
    assert "none.eds" in str(result.exception)


def test_simulate_names_the_payloads(armload):
    result = armload("simulate", "er50", "--bus", "socketcan:vcan0", "--payload", "crate")
    assert "paper" in str(result.exception)


def test_identify_without_unloaded_is_refused_with_the_reason(commissioned, armload, short_robot):
    output, _ = commissioned
    result = armload("identify", short_robot, "--loaded", output / "loaded_identification.mcap")
    assert result.exit_code == 1
    assert "`unloaded=`" in str(result.exception)


@pytest.mark.long
def test_design_writes_an_excitation_and_how_it_was_made(armload, tmp_path):
    for robot in ("prbt.toml", "prbt_identification.toml", "prbt_validation.toml"):
        shutil.copy(CONFIGS / robot, tmp_path)
    words = ["design", tmp_path / "prbt.toml", "-o", tmp_path / "new.toml", "--restarts", "1", "--harmonics", "2"]
    result = armload(*words, "--period-s", "5", "--seed", "4")
    assert result.exit_code == 0, result.output
    excitation = read_excitation(tmp_path / "new.toml")
    assert excitation.trajectory.harmonics == 2
    assert excitation.trajectory.period_s == pytest.approx(5.0)
    assert "--seed 4" in excitation.design["command"]


@pytest.mark.long
def test_design_chooses_the_period_on_request(armload, tmp_path):
    words = [
        "design",
        "prbt",
        "-o",
        tmp_path / "auto.toml",
        "--restarts",
        "1",
        "--harmonics",
        "1",
        "--period-s",
        "auto",
    ]
    result = armload(*words)
    assert result.exit_code == 0, result.output
    excitation = read_excitation(tmp_path / "auto.toml")
    assert 2.0 <= excitation.trajectory.period_s < 10.0
    assert excitation.trajectory.period_s * 100 == pytest.approx(round(excitation.trajectory.period_s * 100))
    assert excitation.periods * excitation.trajectory.period_s >= 30.0 - 1e-9


@pytest.mark.parametrize(
    ("options", "text"),
    [
        (["--period-s", "10.005"], "10.005 s is 1000.500 cycles at 100 Hz.*give 10 or 10.01"),
        (["--period-s", "0.4"], "harmonic 5 of 0.4 s has 8.0 setpoints per period.*--period-s 0.5 or more"),
        (["--period-s", "-1"], "--period-s: '-1' is not a period"),
        (["--period-s", "nan"], "'nan' is not a period"),
        (["--seed", "-1"], "--seed.*expected at least 0"),
        (["--harmonics", "0"], "--harmonics.*expected at least 1"),
        (["--periods", "0"], "--periods.*expected at least 1"),
        (["--criterion", "best"], "--criterion.*'a-optimal', 'a-optimal-mean'"),
    ],
)
def test_design_refuses_what_makes_no_sense_before_it_works(armload, tmp_path, options, text):
    result = armload("design", "prbt", "-o", tmp_path / "x.toml", *options)
    assert result.exit_code == 2
    assert re.search(text, " ".join(re.sub("[│╭╮╰╯─]", " ", result.output).split())), result.output
    assert not (tmp_path / "x.toml").exists()


def test_every_criterion_can_be_named(armload):
    assert tuple(CriterionName) == CRITERIA


def program(*words):
    return subprocess.run([*PROGRAM, *words], capture_output=True, text=True, check=False)


def test_errors_are_one_line_with_the_fix_and_no_traceback():
    done = program("commission", "nonsense")
    assert done.returncode == 1
    assert done.stderr.count("\n") == 1
    assert done.stderr.startswith("error: ")
    assert "er50, prbt, ur10e" in done.stderr
    assert "Traceback" not in done.stderr


def test_version():
    assert program("--version").stdout.startswith("armload 0.")


def test_a_package_that_is_skipped_is_named_once(tmp_path, monkeypatch):
    information = tmp_path / "thief-2.dist-info"
    information.mkdir()
    (information / "METADATA").write_text("Metadata-Version: 2.1\nName: thief\nVersion: 2\n")
    (information / "entry_points.txt").write_text("[armload.exports]\nkuka = thief:it\nlabel = thief:it\n")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    command = [*PROGRAM, "export", "er50", str(tmp_path / "none.toml"), "--format", "label"]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=60.0)
    assert done.stderr.count("kuka of thief 2") == 1
    assert "'label': no such format" in done.stderr


@pytest.mark.parametrize(
    "command",
    [
        "identify er50 --loaded a.csv --report there",
        "identify er50 --loaded a.csv --every 10s --picture there",
        "validate er50 a.toml --loaded a.csv --unloaded b.csv --report there",
        "report er50 a.toml --output there",
        "calibrate er50 a.csv --output there",
        "calibrate er50 a.csv --output new --report there",
        "drift er50 a.csv --report there",
        "drift er50 a.csv --picture there",
        "design er50 --output there",
        "watch er50 a.csv --report there",
        "init --output new.toml",
        "simulate er50 --write-eds .",
    ],
)
def test_no_command_writes_over_a_file_of_another_kind(armload, tmp_path, monkeypatch, command):
    """Refused before the inputs are read, which do not exist."""
    monkeypatch.chdir(tmp_path)
    joint = load_robot("er50").joint_names[0]
    names = ("there", "there.png", "new_identification.toml", f"{joint}.eds")
    for name in names:
        (tmp_path / name).write_text("time_s,joint_1_position_rad\n")
    result = armload(*command.split())
    assert "it is not overwritten" in str(result.exception), (result.output, result.exception)
    assert all((tmp_path / name).read_text() == "time_s,joint_1_position_rad\n" for name in names)
