"""A payload that changes during a run of Pinocchio's arm is noted with time and size; one that stays is not."""

from __future__ import annotations

import re

import numpy as np
import pytest

from armload_identification.model.payload import InertialParameters
from armload_identification.pipeline.payload_identification import identify_runs
from benchmarks.arms.modifications import MODIFICATIONS, ModifiedRun

PERIODS = 4


def recorded(arm, loaded, seed, *, with_phase=True):
    return arm.run(arm.trajectory(), loaded, seed=seed, periods=PERIODS, with_phase=with_phase)


def modified(arm, run, name):
    (modification,) = (each for each in MODIFICATIONS if each.name == name)
    return modification.change(ModifiedRun(run, arm.chain, arm.transmission, arm.payload))


def notes_of(arm, loaded, unloaded):
    found = identify_runs(loaded, unloaded, arm.chain, arm.transmission)
    return [note for note in found.notes if note.startswith("The payload changed")]


@pytest.mark.parametrize("with_phase", [True, False])
def test_a_constant_payload_is_not_noted(pinocchio_arm, with_phase):
    pair = (recorded(pinocchio_arm, loaded, 60 + loaded, with_phase=with_phase) for loaded in (True, False))
    assert not notes_of(pinocchio_arm, *pair)


@pytest.mark.parametrize("with_phase", [True, False])
def test_a_lost_part_is_noted_with_time_and_mass(pinocchio_arm, with_phase):
    """In the average period as much of it is missing as there are periods after the loss."""
    loaded, unloaded = (recorded(pinocchio_arm, each, 62 + each, with_phase=with_phase) for each in (True, False))
    (note,) = notes_of(pinocchio_arm, modified(pinocchio_arm, loaded, "a tenth of the payload lost halfway"), unloaded)
    middle_s = 0.5 * (loaded.time_s[-1] - loaded.time_s[0])
    at_s, change_kg, half_width_kg = map(float, re.findall(r"about (\d+) s .*by (-[\d.]+) \+- ([\d.]+) kg", note)[0])
    assert at_s == pytest.approx(middle_s, abs=1.1)
    assert change_kg == pytest.approx(-0.1 * pinocchio_arm.payload.mass_kg, abs=1.5 * half_width_kg)
    parts = re.findall(r"--between (\d+)s (\d+)s", note)
    assert [[int(end) for end in part] for part in parts] == [[0, at_s - 1], [at_s + 1, 2 * round(middle_s)]]


def test_a_slip_is_noted_with_its_way(pinocchio_arm):
    loaded, unloaded = (recorded(pinocchio_arm, each, 64 + each) for each in (True, False))
    (note,) = notes_of(pinocchio_arm, modified(pinocchio_arm, loaded, "slips 20 mm sideways halfway"), unloaded)
    moved_mm = [float(part) for part in re.findall(r"moved by (\S+), (\S+), (\S+) mm", note)[0]]
    np.testing.assert_allclose(moved_mm, [20.0, 0.0, 0.0], atol=4.0)


def test_what_an_unloaded_run_lost_is_noted_too(pinocchio_arm):
    """A tool that falls off the arm between its empty periods; of the loaded run nothing is said."""
    loaded, unloaded = (recorded(pinocchio_arm, each, 66 + each) for each in (True, False))
    arm = ModifiedRun(unloaded, pinocchio_arm.chain, pinocchio_arm.transmission, pinocchio_arm.payload)
    tool = InertialParameters(0.2 * pinocchio_arm.payload.theta)
    (note,) = notes_of(pinocchio_arm, loaded, arm.plus((arm.share < 0.5) * arm.of_body(tool)))
    assert "during the unloaded run" in note
    assert re.search(r"by -0\.\d+ \+- 0\.\d+ kg", note)


def test_friction_that_falls_evenly_is_no_change_of_the_payload(pinocchio_arm):
    """As of an arm that warms up: viscous friction that falls by a fifth of the payload's torque."""
    loaded, unloaded = (recorded(pinocchio_arm, each, 68 + each) for each in (True, False))
    warming = modified(pinocchio_arm, loaded, "viscous friction falls by 20 %")
    assert not notes_of(pinocchio_arm, warming, unloaded)


def test_a_run_that_is_too_short_is_not_tested(pinocchio_arm):
    """Nothing is said of it, rather than something wrong."""
    arm = pinocchio_arm
    loaded, unloaded = (arm.run(arm.trajectory(), each, seed=70 + each, periods=2) for each in (True, False))
    dropped = modified(arm, loaded, "all dropped after three quarters")
    assert loaded.time_s[-1] - loaded.time_s[0] < 12.0
    assert not notes_of(arm, dropped, unloaded)
