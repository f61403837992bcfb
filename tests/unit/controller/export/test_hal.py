"""The exported HAL component as text; `test_halrun` builds and runs it where LinuxCNC is installed."""

import re
from dataclasses import replace

import numpy as np
import pytest

from armload_controller.config.robot import load_robot
from armload_controller.export.exported_payload import ExportSubject
from armload_controller.export.hal import export_hal

LONGEST_NAME = 22

LONGEST_IN_HAL = 47
"""Longest name of a pin or parameter, in characters."""


@pytest.fixture(scope="module")
def texts(make_subject):
    return export_hal(make_subject("er50"))


def test_pins_are_one_for_each_joint_and_the_payloads_numbers(make_subject, texts):
    component = texts["armload_er50.comp"]
    sizes = re.findall(r"^pin (?:in|out) float (\S+)-#\[(\d)\] ", component, re.MULTILINE)
    assert sizes == [(name, "6") for name in ("q", "dq", "ddq", "tau", "offset")]
    values = dict(re.findall(r"^pin in float (\S+) = (\S+) ", component, re.MULTILINE))
    body = make_subject("er50").payload.model
    assert float(values["mass"]) == body.mass_kg
    assert [float(values[f"com-{axis}"]) for axis in "xyz"] == list(body.center_of_mass_m)
    assert float(values["ixy"]) == body.inertia_about_com[0, 1]
    limits = re.findall(r"^param rw float limit-\d = (\S+) ", component, re.MULTILINE)
    np.testing.assert_allclose(np.array(limits, dtype=float), 0.8 * make_subject("er50").torque_max_nm, rtol=1e-15)


def test_drives_without_a_rated_torque_in_the_file_are_not_wired(make_subject, texts):
    assert list(texts) == ["armload_er50.comp", "armload_er50.hal"]
    (name,) = unwired = export_hal(make_subject("ur10e"))
    assert name == "armload_ur10e.comp"
    assert "offset" not in unwired[name].partition(";;")[0]


def test_names_are_no_longer_than_hal_takes(make_subject):
    (name,) = export_hal(replace(make_subject("ur10e"), robot="the left arm of the second cell"))
    component = name.removesuffix(".comp")
    assert len(component) <= LONGEST_NAME
    assert len(f"{component}.0.compute.tmax-increased") <= LONGEST_IN_HAL


def test_an_inertia_that_is_not_determined_is_marked(make_subject):
    component = export_hal(make_subject("er50", undetermined=("ixx", "iyz")))["armload_er50.comp"]
    assert "NOT DETERMINED by the measurement: ixx, iyz" in component.partition(";;")[0]


def test_a_drive_whose_gain_is_known_better_is_given_what_makes_the_torque_right(make_subject, any_calibration):
    """Coupling and nominal rated torque from the file, and the identified gain."""
    robot, plain = load_robot("er50"), make_subject("er50")
    calibration = any_calibration(plain.chain)
    calibration = replace(calibration, body=replace(calibration.body, coupling=robot.drives.coupling))
    known = ExportSubject.of(robot, plain.payload, "payload.toml", "0", calibration)
    torque_nm = np.arange(1.0, 7.0)
    expected = plain.permille_per_nm @ (torque_nm @ calibration.commanded(robot.drives.coupling))
    np.testing.assert_allclose(known.permille_per_nm @ torque_nm, expected, rtol=1e-12)
    rated_nm = [drive.rated_torque_nm for drive in robot.drives.settings.drives]
    given_nm = np.array(rated_nm) * (plain.permille_per_nm @ torque_nm) / 1e3
    np.testing.assert_allclose(given_nm, robot.drives.coupling.T @ torque_nm, rtol=1e-12)
