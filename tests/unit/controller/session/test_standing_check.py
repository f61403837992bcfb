"""The arm stands elsewhere than where the last recording ended: asked about beyond a motor turn, on a real arm."""

import json
import math
import os

import numpy as np
import pytest

from armload_controller.config.robot import load_robot
from armload_controller.session.standing_check import moved_since_recording
from armload_identification.recording.run_format import RUN_ATTACHMENT
from tests.recording_files import messages, write_mcap

ROBOT = load_robot("er50")
ENDED_RAD = np.array([0.1, -0.2, 0.3, 0.0, 0.5, -0.6])


@pytest.fixture
def recorded(tmp_path):
    """Makes a recording that ends at a position; the last one made is the newest."""
    made = []

    def make(name, position_rad, joints=ROBOT.joint_names, rows=20):
        content = messages(rows, 6, position_rad=list(position_rad))
        path = write_mcap(tmp_path / name, content, [(RUN_ATTACHMENT, json.dumps({"joints": list(joints)}))])
        made.append(path)
        os.utime(path, (1e9 + len(made), 1e9 + len(made)))
        return tmp_path

    return make


def turned(joint, turns):
    """A position that many motor turns of one axis away from the end of the recording."""
    axes_rad = np.linalg.solve(ROBOT.drives.coupling, ENDED_RAD)
    axes_rad[joint] += turns * 2.0 * math.pi / ROBOT.drives.settings.drives[joint].gear_ratio
    return ROBOT.drives.coupling @ axes_rad


def test_within_a_motor_turn_nothing_is_asked(recorded):
    folder = recorded("unloaded.mcap", ENDED_RAD)
    for joint in range(6):
        assert moved_since_recording(ROBOT, folder, turned(joint, 0.9)) == ""


@pytest.mark.parametrize(("joint", "turns"), [(0, 1.1), (3, -2.0), (5, 30.0)])
def test_beyond_it_the_axis_and_the_recording_are_named(recorded, joint, turns):
    folder = recorded("unloaded.mcap", ENDED_RAD)
    asked = moved_since_recording(ROBOT, folder, turned(joint, turns))
    assert "where unloaded.mcap ended" in asked
    assert f"joint_{joint + 1} by" in asked
    assert f"({abs(turns):.1f} motor turns)" in asked
    assert asked.count("motor turns") == 1, "coupled joints move with it, other motors do not"


def test_the_newest_recording_of_this_arm_counts(recorded):
    recorded("older.mcap", ENDED_RAD + 1.0)
    recorded("newer.mcap", ENDED_RAD)
    recorded("another_arm.mcap", ENDED_RAD + 2.0, joints=[f"axis_{n}" for n in range(6)])
    folder = recorded("begun.partial.mcap", ENDED_RAD, rows=0)
    assert moved_since_recording(ROBOT, folder, ENDED_RAD) == ""
    assert "newer.mcap" in moved_since_recording(ROBOT, folder, turned(2, 3.0))


def test_without_a_recording_nothing_is_asked(tmp_path):
    assert moved_since_recording(ROBOT, tmp_path, ENDED_RAD) == ""
