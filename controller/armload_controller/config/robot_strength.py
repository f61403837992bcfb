"""How much torque a robot's joints have for a motion and a payload, from `[body]` or the joints' shares."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from armload_controller.config.robot_payloads import RobotPayloads
from armload_controller.config.robot_source import RobotSource
from armload_controller.motion.expected_torque import ExpectedTorque
from armload_core.arrays import FloatArray
from armload_identification.excitation.joint_strength import TorqueLimits
from armload_identification.model.dynamics import ArmBody

ROUNDED_SHARE = 1e-3
"""A drive's limit (6072) is a whole number of per mille: what that rounds off does not make an axis weaker."""


@dataclass(frozen=True, eq=False)
class RobotStrength:
    """The torque of the joints, and what the arm itself takes of it.

    Attributes:
        source: The robot's file.
        payloads: What the arm may carry.
        coupling: (n, n) C with q_joint = C q_axis.
    """

    source: RobotSource
    payloads: RobotPayloads
    coupling: FloatArray

    @cached_property
    def arm_body(self) -> ArmBody:
        """The arm itself, from `[body]`; massless without one."""
        body = self.source.tables.body
        return ArmBody.massless(self.source.n) if body is None else body.arm_body(self.coupling)

    @property
    def is_stated(self) -> bool:
        """Whether the file has a `[body]`, or a share for every joint."""
        return self._first_missing_share is None

    def limits(self, share: float) -> TorqueLimits:
        """What the joints can give.

        Args:
            share: Of every joint's torque_max_nm that a motion may use.

        Raises:
            ConfigurationError: neither a body nor the shares are given, no payload is, or a joint has no torque left
                to move with.
        """
        chain, payload = self.source.chain, self.payloads.heaviest
        usable = share * self._torque_max_nm
        if self.source.tables.body is not None:
            body = self.arm_body
            for i, left in enumerate(usable - body.coulomb_nm):
                if left <= 0.0:
                    raise self.source.refused(
                        f"body.links[{i + 1}].coulomb_nm",
                        float(body.coulomb_nm[i]),
                        f"expected less than the {usable[i]:g} N m that a motion may use",
                    )
            return TorqueLimits.from_body(chain, body, payload, usable)
        self._require_shares(
            "required to design an excitation: the greatest fraction of torque_max_nm that the arm's own links, rotor "
            "and friction need; or a [body] instead"
        )
        return TorqueLimits.from_share(chain, self._shares, payload, usable)

    def expected_torque(self, *, loaded: bool) -> ExpectedTorque | None:
        """Between which torques motions lie; None where the file says too little of arm or payload.

        Args:
            loaded: Something up to the heaviest payload hangs on the flange; else nothing.
        """
        heaviest = self.payloads.heaviest_if_stated
        if not self.is_stated or (loaded and heaviest is None):
            return None
        torque_max_nm = self._torque_max_nm
        has_body = self.source.tables.body is not None
        return ExpectedTorque(
            self.source.chain,
            self.arm_body,
            np.zeros_like(torque_max_nm) if has_body else self._shares * torque_max_nm,
            heaviest if loaded else None,
            torque_max_nm,
        )

    @property
    def limits_if_stated(self) -> TorqueLimits | None:
        """What the joints can give in all; None where the file says too little of arm or payload.

        Raises:
            ConfigurationError: friction alone uses up a joint's torque.
        """
        if self.payloads.heaviest_if_stated is None or not self.is_stated:
            return None
        return self.limits(1.0)

    @property
    def axis_limits_if_stated(self) -> TorqueLimits | None:
        """What the drives allow the motors' axes; None where it is not stated, or no less than the joints can ask for.

        Raises:
            ConfigurationError: friction alone uses up an axis's torque.
        """
        table, limits, sizes = self.source.tables.joints, self.limits_if_stated, np.abs(self.coupling)
        asked_nm = self._torque_max_nm @ sizes
        allowed_nm = np.array([joint.axis_torque_max_nm for joint in table])
        if limits is None or np.all(allowed_nm >= (1.0 - ROUNDED_SHARE) * asked_nm):
            return None
        itself_nm = (self._torque_max_nm - limits.available_nm) @ sizes
        left_nm = np.minimum(allowed_nm, asked_nm) - itself_nm
        for i, joint in enumerate(table):
            if left_nm[i] <= 0.0 and joint.drive is not None:
                raise self.source.refused(
                    f"joints[{i + 1}].drive.max_torque_permille",
                    joint.drive.max_torque_permille,
                    f"that is {allowed_nm[i]:g} N m, expected more than the {itself_nm[i]:g} N m that the arm itself "
                    "and its friction require on this axis",
                )
        return limits.of_axes(self.coupling, left_nm)

    def require_stated(self) -> None:
        """Refuse to move an arm that may be real where the file leaves out what its joints can give or must carry.

        Raises:
            ConfigurationError: naming the first key that is missing.
        """
        self._require_shares(
            "a real arm is moved only if its joints are known to be strong enough: give it, or a [body]"
        )
        if self.payloads.heaviest_if_stated is None:
            raise self.source.refused(
                "heaviest_payload", None, "required: the payload that a real arm may have to carry"
            )

    @property
    def _torque_max_nm(self) -> FloatArray:
        return np.array([joint.torque_max_nm for joint in self.source.tables.joints])

    @property
    def _shares(self) -> FloatArray:
        """(n,) what the arm itself takes of each joint's torque; nan where it is not stated."""
        shares = [joint.arm_torque_share for joint in self.source.tables.joints]
        return np.array([np.nan if share is None else share for share in shares])

    @property
    def _first_missing_share(self) -> int | None:
        """Number of the first joint without a share, where there is no `[body]`."""
        missing = np.flatnonzero(np.isnan(self._shares))
        return int(missing[0]) + 1 if missing.size and self.source.tables.body is None else None

    def _require_shares(self, expected: str) -> None:
        number = self._first_missing_share
        if number is not None:
            raise self.source.refused(f"joints[{number}].arm_torque_share", None, expected)
