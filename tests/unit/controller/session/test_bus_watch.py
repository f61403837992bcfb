"""Moments of a live arm before there is anything to estimate: they have no time, and can be shown everywhere."""

from __future__ import annotations

import json
from types import SimpleNamespace

import numpy as np
import pytest

from armload_controller.analysis.payload_watch import PayloadWatch
from armload_controller.analysis.watch_history import WatchDiary
from armload_controller.cli.output.watch_output import moment_text
from armload_controller.session.bus_watch import BusWatch
from armload_drivers.listening.overheard_arm import OverheardCycle
from armload_drivers.servos import JointFeedback
from armload_identification.files.calibration_file import write_calibration
from armload_identification.recording.reading_options import Effort

SILENT, STEP_S = 25, 0.1


def cycle(number, *, enabled):
    """A cycle of an arm whose clock began long ago."""
    feedback = JointFeedback(
        cycle=number,
        time_s=5000.0 + STEP_S * number,
        position_rad=np.zeros(6),
        velocity_rad_s=None,
        current_a=np.zeros(6),
        torque_nm=None,
        statusword=np.zeros(6, dtype=np.uint16),
        missing=np.zeros(6, dtype=np.bool_),
    )
    return OverheardCycle(feedback, None, enabled=enabled)


@pytest.fixture
def robot(pinocchio_arm):
    return SimpleNamespace(
        name="six",
        description="",
        file="six.toml",
        n=6,
        chain=pinocchio_arm.chain,
        transmission=pinocchio_arm.transmission,
        joint_names=tuple(f"j{joint}" for joint in range(1, 7)),
        calibration_file=None,
    )


@pytest.fixture
def payload(robot, calibration, tmp_path):
    write_calibration(tmp_path / "arm.calibration.toml", calibration)
    return PayloadWatch(robot, tmp_path / "arm.calibration.toml")


@pytest.mark.parametrize("enabled", [False, True])
def test_silence_before_the_first_cycle(robot, payload, enabled):
    cycles = iter([*[None] * SILENT, *(cycle(number, enabled=enabled) for number in range(15))])
    ticks = iter(STEP_S * np.arange(1000.0))
    left = iter(range(SILENT + 15))
    watching = BusWatch(robot, payload, None, 1.0, clock=lambda: next(ticks), effort=Effort.CURRENT)
    moments = list(watching.moments(cycles, lambda: next(left, None) is not None))
    assert [each.time_s for each in moments] == pytest.approx([None, None, 5001.0, 5001.4])
    diary = WatchDiary(robot, payload, "here", "0")
    for each in moments:
        diary.add(each)
        json.dumps(each.to_dict("six"), allow_nan=False)
    assert moment_text(moments[0]).strip() == "nothing received from the arm yet"
    assert np.array_equal(diary.history().time_s, [5001.0, 5001.4])
