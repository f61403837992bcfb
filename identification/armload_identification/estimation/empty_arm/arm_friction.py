"""Friction of the arm itself in a run: one number per joint, comparable from day to day."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from armload_identification.float_array import FloatArray
from armload_identification.model.body_model import BodyModel


@dataclass(frozen=True, eq=False)
class ArmFriction:
    """Friction of n joints without load, at half of each joint's greatest speed.

    Attributes:
        torque_nm: (n,) f_c + f_r sqrt(v) + f_v v.
        speed_rad_s: (n,) v.
    """

    torque_nm: FloatArray
    speed_rad_s: FloatArray

    @classmethod
    def of(cls, body: BodyModel, velocity_rad_s: FloatArray) -> ArmFriction:
        """The friction of a body that was fitted to a run of (K, n) rad/s."""
        speed = 0.5 * np.abs(velocity_rad_s).max(axis=0)
        return cls(body.unloaded_friction(speed), speed)
