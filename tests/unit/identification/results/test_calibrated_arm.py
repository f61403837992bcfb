"""A calibrated arm as tables and document, with a calibration whose numbers are chosen."""

from dataclasses import replace

import numpy as np
import pytest
from msgspec import structs

from armload_identification.recording.reading_options import Effort
from armload_identification.results.calibrated_arm import CalibratedArm

NAMES = ("a", "b", "c", "d", "e", "f")


@pytest.fixture
def arm(chosen):
    return CalibratedArm("an arm", NAMES, chosen)


def test_a_row_says_the_change_its_interval_friction_and_what_is_unexplained(arm):
    table = arm.table()
    result = arm.calibration
    wide_nm = 1.959964 * result.friction_deviation_nm[1]
    friction = (f"{result.friction_nm[1]:.3f}", f"{wide_nm:.3f}", f"{result.middle_speed_rad_s[1]:.2f}")
    assert table.rows[1] == ("b", "10", "10.2", "1.96 %", "+2.00 %", *friction, "0.030", "0.020", "1.0 %")
    assert "ampere" in table.title
    assert table.headings[1] == "nominal N m/A"
    assert len(table.rows) == 6


def test_gains_of_reported_torque_have_no_unit(arm):
    torque = replace(arm, calibration=replace(arm.calibration, effort=Effort.TORQUE))
    assert "N m that the drive reports" in torque.table().title
    assert torque.table().headings[1] == "nominal"
    assert torque.to_dict()["gain_unit"] == "N m/(N m)"
    assert arm.to_dict()["gain_unit"] == "N m/A"


def test_a_gain_that_is_hardly_better_than_assumed_is_in_brackets(arm):
    wide = arm.calibration.covariance.copy()
    wide[2, 2] = 1.0
    doubtful = replace(arm, calibration=replace(arm.calibration, covariance=wide))
    assert doubtful.table().rows[2][2] == "(10.2)"
    assert doubtful.table().rows[1][2] == "10.2"
    assert "In brackets" in str(doubtful)
    assert "In brackets" not in str(arm)


def test_every_run_says_what_it_carried_and_where_it_fits_worst(arm):
    run = arm.calibration.runs[0]
    empty = structs.replace(
        run,
        name="one.mcap",
        mounting="",
        off=1.234,
        residual_rms_nm=np.array([0.5, 0.5, 0.75, 0.5, 0.5, 0.5]),
        influence=np.array([0.1, 0.2, 0.3, 0.4, 0.9, 0.5]),
        struck=0,
    )
    payload = structs.replace(
        arm.calibration.payloads[0],
        mounting="box",
        weighed_kg=np.nan,
        theta=np.array([4.2, *np.zeros(9)]),
        deviation=np.full(10, 0.01),
    )
    loaded = structs.replace(empty, mounting="box", struck=3)
    shown = replace(arm, calibration=replace(arm.calibration, runs=(empty, loaded), payloads=(payload,)))
    first, second = shown.runs_table().rows
    assert first == ("one.mcap", "nothing", "1.23", "3: 1.5", "0.9 sd of gain 5", "")
    assert second[1] == "box: 4.200 +- 0.020 kg"
    assert second[5] == "3"
    weighed = structs.replace(payload, weighed_kg=4.2)
    shown = replace(arm, calibration=replace(arm.calibration, runs=(loaded,), payloads=(weighed,)))
    assert shown.runs_table().rows[0][1].endswith("kg, weighed")


def test_the_document_has_the_same_numbers(arm):
    document = arm.to_dict()
    joint = document["joints"][3]
    assert joint["name"] == "d"
    assert 10.2 in joint.values()
    assert len(document["runs"]) == len(arm.calibration.runs)
    assert {run["mounting"] for run in document["runs"]} == {run.mounting or None for run in arm.calibration.runs}
    assert document["left_out"] == [{"name": "lost.csv", "reason": 'it is "gone"'}]
    assert document["robot"] == arm.calibration.robot
