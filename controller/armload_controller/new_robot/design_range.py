"""Where in the joints' ranges the first excitations are looked for, and where a simulated arm stands at first.

A design avoids spheres while it searches, and meshes only afterwards: where spheres leave out what meshes object to, it
may find no motion in the whole range that is clear of both. And in a range of which little is clear it may end between
two obstacles.
"""

from __future__ import annotations

from dataclasses import dataclass
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
"""Share of a box's poses that must have room."""


@dataclass(frozen=True, eq=False)
class DesignRange:
    """Where to look for an excitation of n joints.

    Attributes:
        boxes: (2, n) least and greatest positions, the one to try first: the widest in which hardly any mesh surprises
            a design, then the widest that is clear of everything.
        roomiest_rad: (n,) pose with the most room among many.
    """

    boxes: tuple[FloatArray, ...]
    roomiest_rad: FloatArray


def design_range(robot: Robot, envelope: Envelope) -> DesignRange:
    """Where to look for the excitations of a robot.

    Args:
        robot: The arm.
        envelope: What its excitations are designed within.

    Raises:
        ConfigurationError: the URDF that the file names cannot be used.
    """
    limits = robot.limits.motion
    whole = np.array([limits.position_min_rad, limits.position_max_rad])
    poses = _poses(whole)
    known, meshes = _room(envelope, poses), _mesh_room(robot, poses)
    roomiest = poses[np.minimum(known, meshes).argmax()]
    boxes: list[FloatArray] = []
    for everything in (False, True):
        for share in _BOXES:
            half = 0.5 * share * (whole[1] - whole[0])
            box = whole if share == 1.0 else np.clip(np.array([roomiest - half, roomiest + half]), whole[0], whole[1])
            poses = _poses(box)
            known, meshes = _room(envelope, poses), _mesh_room(robot, poses)
            asked = np.ones(_POSES, dtype=bool) if everything else known >= 0.0
            if asked.any() and np.mean(np.minimum(known, meshes)[asked] >= 0.0) >= _CLEAR:
                break
        if not boxes or not np.array_equal(box, boxes[0]):
            boxes.append(box)
    return DesignRange(tuple(boxes), roomiest)


def _poses(box: FloatArray) -> FloatArray:
    """(`_POSES`, n) random configurations of a box."""
    return np.random.default_rng(_SEED).uniform(box[0], box[1], (_POSES, box.shape[1]))


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
