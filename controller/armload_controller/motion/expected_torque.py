"""The expected range of torque in a motion, from the links, friction and payload that the robot's file specifies.

    tau_arm + f_v dq + x tau_payload  +-  (FRICTION_SHARE f_c + LOSS_SHARE |tau_carried| + SPARE_SHARE tau_max)

with tau_payload of the heaviest payload, and x from -HALF to 1 + HALF if the flange is loaded, else 0: the actual
payload's centre of mass may be elsewhere. Without a [body] in the file, the arm's own torque is anything within its
`arm_torque_share`.

The shares cover friction near standstill, gears of low efficiency (0.75), a drive's gain error and the vibration of
elastic joints: no commissioning of either simulated plant uses more than four fifths of the range.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from armload_core import kernels
from armload_identification.float_array import FloatArray
from armload_identification.model.chain import Chain
from armload_identification.model.dynamics import ArmBody, ArmDynamics
from armload_identification.model.payload import InertialParameters
from armload_identification.model.regressor import feedforward_model

FRICTION_SHARE = 2.0
"""Friction at standstill divided by Coulomb friction."""
LOSS_SHARE = 0.35
"""Share of the transmitted torque that a gear may lose."""
SPARE_SHARE = 0.1
"""Share of a joint's greatest torque for noise, vibration and rounded values in the file."""
HALF = 0.5
"""A payload's torque may exceed the heaviest payload's, or have the opposite sign, by this share of it."""


@dataclass(frozen=True, eq=False)
class ExpectedTorque:
    """Bounds of joint torque along a motion.

    Attributes:
        chain: The arm.
        body: Its links, rotors and friction; massless if they are not specified.
        arm_nm: (n,) further torque of the arm itself, in either direction; 0 if the body is specified.
        payload: The heaviest payload; None if the flange is empty.
        torque_max_nm: (n,) greatest torque of each joint.
    """

    chain: Chain
    body: ArmBody
    arm_nm: FloatArray
    payload: InertialParameters | None
    torque_max_nm: FloatArray
    _dynamics: ArmDynamics = field(init=False, repr=False)
    _carried: kernels.PayloadTorque = field(init=False, repr=False)
    _least_room_nm: FloatArray = field(init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_dynamics", ArmDynamics(self.chain, self.body))
        theta = np.zeros(kernels.BODY_PARAMETERS) if self.payload is None else self.payload.theta
        carried = kernels.PayloadTorque(feedforward_model(self.chain, theta), np.zeros(self.chain.n))
        object.__setattr__(self, "_carried", carried)
        room = self.arm_nm + FRICTION_SHARE * self.body.coulomb_nm + SPARE_SHARE * self.torque_max_nm
        object.__setattr__(self, "_least_room_nm", room)

    def bounds_nm(
        self, position_rad: FloatArray, velocity_rad_s: FloatArray, acceleration_rad_s2: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Least and greatest torque of each joint at one state.

        Args:
            position_rad: (n,) joint positions.
            velocity_rad_s: (n,) joint velocities.
            acceleration_rad_s2: (n,) joint accelerations.

        Returns:
            (n,) each, in N m.
        """
        arm = self._dynamics.torque(position_rad[None], velocity_rad_s[None], acceleration_rad_s2[None])[0]
        carried = self._carried.torque_nm(position_rad, velocity_rad_s, acceleration_rad_s2)
        lightest, heaviest = -HALF * carried, (1.0 + HALF) * carried
        least, greatest = np.minimum(lightest, heaviest), np.maximum(lightest, heaviest)
        viscous = self.body.viscous_nm_s_rad * velocity_rad_s
        room = self._least_room_nm + LOSS_SHARE * (np.abs(arm) + np.maximum(-least, greatest) + np.abs(viscous))
        middle = arm + viscous
        return middle + least - room, middle + greatest + room
