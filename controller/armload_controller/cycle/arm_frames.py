"""The frames of an arm as messages that Foxglove shows in 3-D.

References:
    Foxglove schemas, foxglove.FrameTransforms.
"""

from __future__ import annotations

from collections.abc import Sequence
from importlib.resources import files
from typing import Any, Final

import numpy as np
import orjson

from armload_identification.float_array import FloatArray
from armload_identification.model.chain import Chain

FRAMES_TOPIC: Final = "/frames"
FRAMES_SCHEMA_NAME: Final = "foxglove.FrameTransforms"
BASE_FRAME: Final = "base"
FLANGE_FRAME: Final = "flange"

FRAMES_SCHEMA: Final[dict[str, Any]] = orjson.loads(files(__package__).joinpath("frame_transforms.json").read_bytes())


class ArmFrames:
    """Makes messages with the pose of every link relative to the previous one.

    Args:
        chain: The arm of n joints.
        joint_names: Names of its joints, also used for the links that they move.
    """

    def __init__(self, chain: Chain, joint_names: Sequence[str]) -> None:
        frames = (BASE_FRAME, *joint_names)
        self._edges = list(zip((*frames[:-1], frames[-1]), (*frames[1:], FLANGE_FRAME), strict=True))
        poses = np.concatenate([chain.placement, chain.flange[None]])
        self._shifts = [dict(zip("xyz", pose[:3, 3].tolist(), strict=True)) for pose in poses]
        self._turns = np.array([_quaternion(pose[:3, :3]) for pose in poses])
        self._axes = np.vstack([chain.axis, np.zeros(3)])

    def message(self, position_rad: FloatArray, stamp_ns: int) -> bytes:
        """One message.

        Args:
            position_rad: (n,) positions of the joints.
            stamp_ns: Wall-clock time.
        """
        half = 0.5 * np.append(position_rad, 0.0)[:, None]
        scalar, vector = np.cos(half), np.sin(half) * self._axes
        own_scalar, own_vector = self._turns[:, 3:], self._turns[:, :3]
        dot = np.sum(own_vector * vector, axis=1, keepdims=True)
        product = own_scalar * vector + scalar * own_vector + np.cross(own_vector, vector)
        quaternions = np.hstack([product, own_scalar * scalar - dot]).tolist()
        stamp = {"sec": stamp_ns // 10**9, "nsec": stamp_ns % 10**9}
        transforms = [
            {
                "timestamp": stamp,
                "parent_frame_id": parent,
                "child_frame_id": child,
                "translation": shift,
                "rotation": dict(zip("xyzw", quaternion, strict=True)),
            }
            for (parent, child), shift, quaternion in zip(self._edges, self._shifts, quaternions, strict=True)
        ]
        return orjson.dumps({"transforms": transforms})


def _quaternion(rotation: FloatArray) -> FloatArray:
    """(4,) unit quaternion x, y, z, w of a rotation matrix (Bar-Itzhack, JGCD 23(6), 2000), exact at half turns too."""
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = rotation
    square = np.array(
        [
            [xx - yy - zz, xy + yx, xz + zx, zy - yz],
            [xy + yx, yy - xx - zz, yz + zy, xz - zx],
            [xz + zx, yz + zy, zz - xx - yy, yx - xy],
            [zy - yz, xz - zx, yx - xy, xx + yy + zz],
        ]
    )
    return np.asarray(np.linalg.eigh(square)[1][:, -1])
