"""A recorder whose file states the robot, its configuration and what is run."""

from __future__ import annotations

import json
from collections.abc import Mapping
from importlib.metadata import version
from pathlib import Path

from armload_controller.config.robot import Robot
from armload_controller.cycle.arm_frames import ArmFrames
from armload_controller.cycle.lateness import Lateness
from armload_controller.cycle.run_recorder import Recorder
from armload_identification.recording.run_format import CONFIGURATION_ATTACHMENT, RUN_ATTACHMENT


def robot_recorder(
    robot: Robot, path: Path, run: Mapping[str, object], lateness: Lateness | None = None, **attachments: str
) -> Recorder:
    """A recorder of one run.

    Args:
        path: File to write; it must not exist.
        run: What is run, beside the robot and this program's version.
        lateness: Counts late cycles, if this program runs the cycle.
        attachments: Further texts by name.

    Raises:
        CommissioningError: the file exists or cannot be written.
    """
    who = {"armload_version": version("armload"), "robot": robot.name, "joints": list(robot.joint_names)}
    attachments = {CONFIGURATION_ATTACHMENT: robot.text, **attachments, RUN_ATTACHMENT: json.dumps({**who, **run})}
    return Recorder(path, attachments, frames=ArmFrames(robot.chain, robot.joint_names), lateness=lateness)
