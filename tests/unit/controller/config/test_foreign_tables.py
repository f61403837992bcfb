"""Tables of other programs, read for four arms without an option."""

from __future__ import annotations

import numpy as np
import pytest

import armload
from armload_identification.identification_errors import RecordingError
from tests.foreign_tables import ARMS, DIALECTS, Run, ambiguous_tables, urdf_of, written
from tests.urdf_simulation import PinocchioArm

MASS_KG, CENTER_M = 1.5, (0.02, -0.01, 0.06)


@pytest.fixture(scope="module")
def cell(tmp_path_factory):
    """For an arm's name: its description, a loaded and an empty run, and the payload found from NumPy archives."""
    known = {}

    def cell(name):
        if name not in known:
            folder = tmp_path_factory.mktemp(name)
            urdf, joints = folder / "arm.urdf", ARMS[name]
            urdf.write_text(urdf_of(joints))
            arm = armload.read_urdf_arm(urdf)
            simulated = PinocchioArm(urdf, joints, arm.base, arm.flange)
            limits = arm.position_min_rad, arm.position_max_rad, arm.velocity_max_rad_s
            runs = simulated.runs(*limits, MASS_KG, CENTER_M, 0.002 * np.eye(3))
            paths = []
            for run in runs:
                velocity = np.gradient(run.position_rad, run.time_s, axis=0)
                paths.append(folder / f"{len(paths)}.npz")
                np.savez(paths[-1], time_s=run.time_s, position_rad=run.position_rad, torque_nm=run.torque_nm)
                run.velocity_rad_s, run.names = velocity, joints
            mass = armload.identify(arm, *paths).payload.model.mass_kg
            known[name] = arm, runs, mass
        return known[name]

    return cell


def as_run(run):
    return Run(run.time_s, run.position_rad, run.velocity_rad_s, run.torque_nm, run.names)


@pytest.mark.long
@pytest.mark.parametrize("name", ARMS)
@pytest.mark.parametrize("dialect", DIALECTS)
def test_a_table_gives_the_archives_mass(cell, tmp_path, name, dialect):
    arm, runs, mass_kg = cell(name)
    paths = [
        DIALECTS[dialect](as_run(run), tmp_path / f"{load}.csv")
        for run, load in zip(runs, ("loaded", "empty"), strict=True)
    ]
    read = armload.read_recording(paths[0], arm)
    np.testing.assert_allclose(read.position_rad, runs[0].position_rad, atol=1e-6)
    np.testing.assert_allclose(read.torque_nm, runs[0].torque_nm, atol=1e-6)
    np.testing.assert_allclose(np.diff(read.time_s), np.diff(runs[0].time_s), atol=1e-6)
    found = armload.identify(arm, *paths)
    assert found.payload.model.mass_kg == pytest.approx(mass_kg, rel=1e-3)


@pytest.mark.parametrize("name", ARMS)
@pytest.mark.parametrize("dialect", DIALECTS)
def test_a_table_is_read_without_an_option(tmp_path, name, dialect):
    urdf = tmp_path / "arm.urdf"
    urdf.write_text(urdf_of(ARMS[name]))
    time_s = 0.01 * np.arange(200)
    angle = 3.0 * time_s[:, None] + np.arange(len(ARMS[name]))
    run = Run(time_s, 2.0 * np.sin(angle), 6.0 * np.cos(angle), 20.0 * np.cos(2.0 * angle), ARMS[name])
    read = armload.read_recording(DIALECTS[dialect](run, tmp_path / "log.csv"), armload.read_urdf_arm(urdf))
    assert read.joint_names in {ARMS[name], ()}
    np.testing.assert_allclose(read.position_rad, run.position_rad, atol=1e-6)
    np.testing.assert_allclose(read.torque_nm, run.torque_nm, atol=1e-6)
    np.testing.assert_allclose(np.diff(read.time_s), np.diff(time_s), atol=1e-6)


def test_a_data_set_in_percent_is_asked_about(tmp_path):
    """LeRobot's other unit is the percentage of a joint's range, which ends at exactly 100."""
    urdf = tmp_path / "arm.urdf"
    urdf.write_text(urdf_of(ARMS["xArm"]))
    angle = np.linspace(0.0, 6.0 * np.pi, 241)[:, None] * np.ones(6)
    run = Run(0.01 * np.arange(241), np.deg2rad(100.0 * np.sin(angle)), np.cos(angle), np.sin(angle), ARMS["xArm"])
    folder = DIALECTS["lerobot"](run, tmp_path / "log.csv")
    arm = armload.read_urdf_arm(urdf)
    with pytest.raises(RecordingError, match=r"percent.*position\[deg\]=0") as caught:
        armload.read_recording(folder, arm)
    columns = str(caught.value).split('"')[1]
    read = armload.read_recording(folder, arm, columns=columns)
    np.testing.assert_allclose(read.position_rad, run.position_rad, atol=1e-9)


def test_what_was_concluded_is_said(tmp_path):
    urdf = tmp_path / "arm.urdf"
    urdf.write_text(urdf_of(ARMS["xArm"]))
    angle = 0.03 * np.arange(241)[:, None] + np.arange(6)
    run = Run(0.01 * np.arange(241), 2.0 * np.sin(angle), np.cos(angle), np.sin(angle), ARMS["xArm"])
    read = armload.read_recording(DIALECTS["lerobot"](run, tmp_path / "log.csv"), armload.read_urdf_arm(urdf))
    assert "read in degrees" in read.source.remarks[0]


AMBIGUOUS = [
    pytest.param(name, *table, id=f"{name}, {table[0]}, {table[1][1]}")
    for name, joints in ARMS.items()
    for table in ambiguous_tables(joints)
]


def test_there_are_enough_tables():
    assert len(DIALECTS) >= 24
    assert len(AMBIGUOUS) >= 200


@pytest.mark.parametrize(("name", "question", "header", "factors"), AMBIGUOUS)
def test_an_ambiguous_table_is_asked_about(tmp_path, name, question, header, factors):
    """None is read with a wrong unit, joint or quantity; the answer is an option that the message prints."""
    urdf = tmp_path / "arm.urdf"
    urdf.write_text(urdf_of(ARMS[name]))
    arm = armload.read_urdf_arm(urdf)
    time_s = 0.01 * np.arange(400)
    series = []
    for k, column in enumerate(header[1:]):
        phase = 3.0 * time_s + k
        kind = 3 if "tau" in column or "torque" in column or "effort" in column else 2 if "dq" in column else 1
        series.append(
            factors[kind] * {1: np.sin(3.0 * time_s), 2: 3.0 * np.cos(3.0 * time_s), 3: 20.0 * np.sin(phase)}[kind]
        )
    path = written(tmp_path / "log.csv", header, [factors[0] * time_s, *series], ";")
    with pytest.raises(RecordingError) as caught:
        armload.read_recording(path, arm)
    assert str(path) in str(caught.value)
    assert question == "mNm, unstated" or "--columns" in str(caught.value)


ANSWERABLE = {"degrees, unstated", "degrees and deg/s, unstated", "deg/s, unstated", "ms, unstated", "us, unstated"}


@pytest.mark.parametrize(
    ("name", "question", "header", "factors"), [case for case in AMBIGUOUS if case.values[1] in ANSWERABLE]
)
def test_the_printed_option_gives_the_right_units(tmp_path, name, question, header, factors):
    urdf = tmp_path / "arm.urdf"
    urdf.write_text(urdf_of(ARMS[name]))
    arm, path = armload.read_urdf_arm(urdf), tmp_path / "log.csv"
    time_s = 0.01 * np.arange(400)
    wave = {
        "dq": 3.0 * np.cos(3.0 * time_s) * factors[2],
        "tau": np.cos(time_s),
        "q": np.sin(3.0 * time_s) * factors[1],
    }
    series = [next(values for word, values in wave.items() if word in column) for column in header[1:]]
    written(path, header, [factors[0] * time_s, *series])
    with pytest.raises(RecordingError) as caught:
        armload.read_recording(path, arm)
    read = armload.read_recording(path, arm, columns=str(caught.value).split('"')[1])
    np.testing.assert_allclose(read.position_rad[:, 0], np.sin(3.0 * time_s), atol=1e-6)
    np.testing.assert_allclose(read.time_s, time_s, atol=1e-6)
