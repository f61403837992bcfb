"""Friction of the arm itself in a run: one number per joint, comparable from day to day."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from armload_core.arrays import FloatArray
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
    def of(cls, body: BodyModel, velocity_rad_s: FloatArray, change: FloatArray | None = None) -> ArmFriction:
        """The friction of a body in a run.

        Args:
            body: The empty arm.
            velocity_rad_s: (K, n) of the run.
            change: (2, n) the run's Coulomb (N m) and viscous friction (N m s/rad) minus the body's; 0 if not given,
                for a body that was fitted to the run.
        """
        speed = 0.5 * np.abs(velocity_rad_s).max(axis=0)
        coulomb, viscous = np.zeros((2, body.n)) if change is None else change
        torque = body.coulomb_nm + coulomb + body.root_nm * np.sqrt(speed) + (body.viscous_nm_s_rad + viscous) * speed
        return cls(torque, speed)
