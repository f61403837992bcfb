"""The ranges in which the first excitations are searched for, and the initial pose of a simulated arm.

A design avoids spheres during its search, but checks meshes only afterwards: if the spheres do not cover the meshes, it
may find no motion in the full range that is clear of both. And in a range with little free space it may end up between
two obstacles.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from armload_controller.config.robot import Robot
from armload_identification.excitation.design_envelope import CLEARANCE_SCALE_M, Envelope
from armload_identification.float_array import FloatArray

_POSES: Final = 200
_SEED: Final = 1
_BOX_SHARES: Final = (1.0, 0.7, 0.5, 0.35, 0.25)
"""Shares of the joints' ranges to try, widest first."""
_CLEAR_SHARE: Final = 0.95
"""Share of a box's poses that must be clear."""


def design_range(robot: Robot, envelope: Envelope) -> tuple[tuple[FloatArray, ...], FloatArray]:
    """Find the ranges to search for the excitations of a robot.

    Returns:
        Boxes, each (2, n), least and greatest positions, in the order to try: the widest in which the spheres cover
        nearly all meshes, then, if different, the widest that is nearly clear of everything; and (n,) the random pose
        with the greatest clearance.

    Raises:
        ConfigurationError: the URDF that the file names cannot be used.
    """
    limits = robot.limits.motion
    whole = np.array([limits.position_min_rad, limits.position_max_rad])
    poses = _poses(whole)
    known, meshes = _margins_at_rest(envelope, poses), _mesh_clearances(robot, poses)
    roomiest = poses[np.minimum(known, meshes).argmax()]
    boxes: list[FloatArray] = []
    for everything in (False, True):
        for share in _BOX_SHARES:
            half = 0.5 * share * (whole[1] - whole[0])
            box = whole if share == 1.0 else np.clip(np.array([roomiest - half, roomiest + half]), whole[0], whole[1])
            poses = _poses(box)
            known, meshes = _margins_at_rest(envelope, poses), _mesh_clearances(robot, poses)
            asked = np.ones(_POSES, dtype=bool) if everything else known >= 0.0
            if asked.any() and np.mean(np.minimum(known, meshes)[asked] >= 0.0) >= _CLEAR_SHARE:
                break
        if not boxes or not np.array_equal(box, boxes[0]):
            boxes.append(box)
    return tuple(boxes), roomiest


def _poses(box: FloatArray) -> FloatArray:
    """(`_POSES`, n) random configurations of a box."""
    return np.random.default_rng(_SEED).uniform(box[0], box[1], (_POSES, box.shape[1]))


def _margins_at_rest(envelope: Envelope, poses: FloatArray) -> FloatArray:
    """(N,) margin at rest: the lesser of clearance over `CLEARANCE_SCALE_M` and remaining share of torque."""
    still = np.zeros_like(poses)
    demand = envelope.torque.demand(poses, still, still)
    torque = 1.0 - (demand / np.tile(envelope.torque.available_nm, envelope.torque.cases)).max(axis=1)
    near = envelope.workspace.clearances(poses).min(axis=1, initial=np.inf) - envelope.workspace.keep_m
    return np.asarray(np.minimum(torque, near / CLEARANCE_SCALE_M))


def _mesh_clearances(robot: Robot, poses: FloatArray) -> FloatArray:
    """(N,) clearance between meshes, in units of `CLEARANCE_SCALE_M`."""
    meshes = robot.obstacles.meshes
    if meshes is None:
        return np.full(len(poses), np.inf)
    return np.array([meshes.distances(q).min(initial=np.inf) - meshes.keep_m for q in poses]) / CLEARANCE_SCALE_M
