"""The first gate: recordings that are mixed up, and velocities, currents and means that cannot be used."""

from __future__ import annotations

import json
from contextlib import nullcontext
from dataclasses import replace

import numpy as np
import pytest

from armload_identification.identification_errors import RecordingError
from armload_identification.recording.reading_options import Effort
from armload_identification.recording.reduction.repeated_values import repeated_values
from armload_identification.recording.run_format import RUN_ATTACHMENT
from armload_identification.verdict.recording_checks.usable_runs import usable_runs

pytestmark = pytest.mark.pure

DEGREE = np.pi / 180.0


@pytest.fixture(scope="module")
def run(pinocchio_arm):
    return pinocchio_arm.run(pinocchio_arm.trajectory(period_s=10.0), True, seed=5, periods=1, with_phase=False)


@pytest.fixture
def gate(pinocchio_arm):
    """Pass recordings, or see them refused with a text."""

    def gate(*recordings, refused=None, effort=None, n=6):
        with pytest.raises(RecordingError, match=refused) if refused else nullcontext():
            return usable_runs(recordings, n, pinocchio_arm.transmission, effort)

    return gate


def labelled(run, load, sha256):
    attachments = {RUN_ATTACHMENT: json.dumps({"load": load})} if load else {}
    return replace(run, source=replace(run.source, sha256=sha256, attachments=attachments))


@pytest.mark.parametrize(("column", "what"), [("position_rad", "positions"), ("current_a", "efforts")])
def test_a_column_that_was_taken_twice_is_refused(gate, run, column, what):
    values = getattr(run, column)[:, [0, 1, 2, 3, 3, 5]]
    copied = replace(run, **{column: values}, velocity_rad_s=None)
    gate(copied, refused=f"the {what} of joints 4 and 5 are the same in all rows: a column was taken twice")


def test_efforts_that_are_missing_and_written_as_0_are_refused(gate, run):
    """One row of 16: the mass would be 6 % too small. Coarse values of a light joint toggle about 0, which is right."""
    missing = np.array(run.current_a)
    missing[::16, 2] = 0.0
    gate(replace(run, current_a=missing), refused=r"joint 3 is 0 in 6.2 % of the rows, .* missing. Leave it empty")
    gate(replace(run, current_a=np.resize([1.0, 0.0, 1.0, 0.0, -1.0], run.size)[:, None] * np.ones(6)))


def test_joints_that_are_all_moved_alike_are_no_copies(gate, run):
    """As on a simulated arm of which every joint gets the same setpoints."""
    gate(replace(run, position_rad=run.position_rad[:, [2] * 6], velocity_rad_s=None))


@pytest.mark.parametrize(
    ("first", "second", "refused"),
    [
        ("loaded", "unloaded", None),
        ("loaded", None, None),
        (None, "unloaded", None),
        (None, None, None),
        ("unloaded", "unloaded", None),
        ("unloaded", "loaded", "was recorded as 'unloaded' and loaded.mcap as 'loaded'. Exchange the two files"),
        (None, "loaded", "was recorded as 'None' and loaded.mcap as 'loaded'. Exchange the two files"),
        ("loaded", "loaded", "was recorded as 'loaded' and loaded.mcap as 'loaded'. Exchange the two files"),
        ("unloaded", None, "was recorded as 'unloaded' and loaded.mcap as 'None'. Exchange the two files"),
    ],
)
def test_the_first_run_is_the_loaded_one(gate, run, first, second, refused):
    runs = gate(labelled(run, first, "1"), labelled(run, second, "2"), refused=refused)
    assert refused or [each.recording.source.sha256 for each in runs] == ["1", "2"]


def test_two_runs_are_two_files_of_this_arm_with_one_quantity(gate, run):
    gate(labelled(run, None, "1"), labelled(run, None, "1"), refused="are the same recording. Give one run with and")
    gate(run, n=5, refused="6")
    gate(run, effort=Effort.CURRENT)
    gate(run, effort=Effort.TORQUE, refused="torque")
    torque = replace(labelled(run, None, "2"), torque_nm=run.current_a, current_a=None)
    gate(labelled(run, None, "1"), torque, refused="torque")


def test_a_joint_a_turn_away_from_the_loaded_runs_is_on_its_turn(gate, run):
    turn = 2.0 * np.pi * np.array([1, 0, 0, -1, 0, 0])
    moved = replace(labelled(run, None, "2"), position_rad=run.position_rad + turn)
    first, second = gate(labelled(run, None, "1"), moved)
    np.testing.assert_allclose(second.recording.position_rad, first.recording.position_rad, atol=1e-12)


def with_velocity(run, change):
    velocity = np.gradient(run.position_rad, run.time_s, axis=0)
    return replace(run, velocity_rad_s=change(velocity))


@pytest.mark.parametrize(
    ("change", "refused"),
    [
        (lambda v: v, None),
        (lambda v: 1.2 * v, None),
        (lambda v: np.where(np.arange(6) == 2, np.nan, v), None),
        (lambda v: np.where(np.arange(6) == 2, -v, v), "the velocity of joint 3 is not the derivative of its position"),
        (lambda v: v[:, [0, 2, 1, 3, 4, 5]], "the velocity of joints 2 and 3 is not the derivative of its position"),
        (lambda v: v / DEGREE, r"joint 1 moves 0\.0175 times as fast as its velocity indicates. Its velocities look"),
        (lambda v: v * DEGREE, r"joint 1 moves 57\.3 times as fast as its velocity indicates. Its positions look"),
        (lambda v: np.where(np.arange(6) == 4, v / DEGREE, v), "joint 5 moves .* Its velocities look like degrees"),
    ],
)
def test_a_velocity_is_the_derivative_of_the_position(gate, run, change, refused):
    gate(with_velocity(run, change), refused=refused)


def test_torques_without_their_signs_are_named(gate, run):
    gate(replace(run, current_a=np.abs(run.current_a)), refused="no joint's .* absolute values were recorded")
    above_zero = run.current_a - run.current_a.min(axis=0)
    gate(replace(run, current_a=above_zero + 0.02 * above_zero.max(axis=0)))
    small = 0.05 * above_zero / above_zero.max(axis=0)
    gate(replace(run, current_a=small + 0.02 * 0.05))


@pytest.mark.parametrize(("joints", "refused"), [(6, True), (5, False)])
def test_a_velocity_on_every_joint_is_no_current(gate, run, joints, refused):
    velocity = np.gradient(run.position_rad, run.time_s, axis=0)
    current = np.where(np.arange(6) < joints, 3.0 * velocity, run.current_a)
    words = "the current or torque of every joint is the derivative of its position: these columns are velocities"
    gate(replace(run, current_a=current), refused=words if refused else None)


@pytest.mark.parametrize(("hz", "refused"), [(0.02, False), (1.0, True)])
def test_means_over_long_times_must_follow_the_motion(gate, run, hz, refused):
    time_s = 0.4 * np.arange(3000)
    swing = np.sin(2.0 * np.pi * hz * time_s)[:, None] * np.ones(6)
    current = np.random.default_rng(2).normal(size=swing.shape) + swing
    repeats = repeated_values(current, swing)
    long = replace(run, time_s=time_s, position_rad=swing, current_a=current, repeats=repeats)
    words = r"0\.3 h without a known excitation were reduced to means over 400 ms, which reduces .* `between_s=`"
    gate(long, refused=words if refused else None)
    gate(replace(long, repeats=None))
