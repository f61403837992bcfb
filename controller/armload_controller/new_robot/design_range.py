"""Where in the joints' ranges the first excitations are looked for: where what a design avoids is clear of meshes too.

A design avoids spheres while it searches, and meshes only afterwards: where spheres leave out what meshes object to, it
may find no motion in the whole range that is clear of both.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from armload_controller.config.robot import Robot
from armload_core.arrays import FloatArray
from armload_identification.excitation.design_envelope import CLEARANCE_SCALE_M, Envelope

_POSES: Final = 200
_SEED: Final = 1
_BOXES: Final = (1.0, 0.7, 0.5, 0.35, 0.25)
"""Shares of the joints' ranges that are tried, the widest first."""
_CLEAR: Final = 0.95
"""Share of the poses within the limits of a design that must be clear of meshes."""


def design_range(robot: Robot, envelope: Envelope) -> FloatArray:
    """The widest box of joint positions, about the pose with most room, in which hardly any mesh surprises a design.

    Args:
        robot: The arm.
        envelope: What its excitations are designed within.

    Returns:
        (2, n) least and greatest positions.

    Raises:
        ConfigurationError: the URDF that the file names cannot be used.
    """
    limits = robot.limits.motion
    whole = np.array([limits.position_min_rad, limits.position_max_rad])
    middle = whole.mean(axis=0)
    for share in _BOXES:
        half = 0.5 * share * (whole[1] - whole[0])
        box = np.clip(np.array([middle - half, middle + half]), whole[0], whole[1])
        poses = np.random.default_rng(_SEED).uniform(box[0], box[1], (_POSES, robot.n))
        known, meshes = _room(envelope, poses), _mesh_room(robot, poses)
        if (known >= 0.0).any() and np.mean(meshes[known >= 0.0] >= 0.0) >= _CLEAR:
            break
        if share == _BOXES[0]:
            middle = poses[np.minimum(known, meshes).argmax()]
    return np.asarray(box)


def _room(envelope: Envelope, poses: FloatArray) -> FloatArray:
    """(N,) what a design has left at rest: of clearances in `CLEARANCE_SCALE_M`, of torque as a share of it."""
    still = np.zeros_like(poses)
    demand = envelope.torque.demand(poses, still, still)
    torque = 1.0 - (demand / np.tile(envelope.torque.available_nm, envelope.torque.cases)).max(axis=1)
    near = envelope.workspace.clearances(poses).min(axis=1, initial=np.inf) - envelope.workspace.keep_m
    return np.asarray(np.minimum(torque, near / CLEARANCE_SCALE_M))


def _mesh_room(robot: Robot, poses: FloatArray) -> FloatArray:
    """(N,) what is left between meshes, in `CLEARANCE_SCALE_M`."""
    meshes = robot.obstacles.meshes
    if meshes is None:
        return np.full(len(poses), np.inf)
    return np.array([meshes.distances(q).min(initial=np.inf) - meshes.keep_m for q in poses]) / CLEARANCE_SCALE_M
