"""The range in which the torques of a motion lie, as far as the robot's file specifies links, friction and payload.

    tau_arm + f_v dq + x tau_payload  +-  (FRICTION_SHARE f_c + LOSS_SHARE |tau_carried| + SPARE_SHARE tau_max)

with the heaviest payload expected and x from -HALF to 1 + HALF where a payload hangs on the flange, else 0: what hangs
there may have its centre of mass elsewhere. Where the file has no [body], the arm's own torque is anything within
its `arm_torque_share`.

The shares are what friction near standstill, gears of bad efficiency (0.75), a drive's gain and the ringing of elastic
joints need: no commissioning of either simulated plant uses more than four fifths of the room.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from armload_core import kernels
from armload_core.arrays import FloatArray
from armload_identification.model.chain import Chain
from armload_identification.model.dynamics import ArmBody, ArmDynamics
from armload_identification.model.payload import InertialParameters
from armload_identification.model.regressor import feedforward_model

FRICTION_SHARE = 2.0
"""Friction at standstill in terms of Coulomb friction."""
LOSS_SHARE = 0.35
"""What a gear may lose of the torque that it passes on."""
SPARE_SHARE = 0.1
"""Share of a joint's greatest torque for noise, ringing, and what the file has rounded."""
HALF = 0.5
"""So much of the heaviest payload's torque a payload may take beyond it, or the other way."""


@dataclass(frozen=True, eq=False)
class ExpectedTorque:
    """Bounds of joint torque along a motion.

    Attributes:
        chain: The arm.
        body: Its links, rotors and friction; massless where they are not specified.
        arm_nm: (n,) further torque of the arm itself, either way; 0 where the body is specified.
        payload: The heaviest one; None where the flange is empty.
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
