"""Torque available to a robot's joints for a motion with a payload, from `[body]` or the joints' shares."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from armload_controller.config.robot_payloads import RobotPayloads
from armload_controller.config.robot_source import RobotSource
from armload_controller.motion.expected_torque import ExpectedTorque
from armload_identification.excitation.torque_limits import TorqueLimits
from armload_identification.float_array import FloatArray
from armload_identification.model.dynamics import ArmBody

ROUNDED_SHARE = 1e-3
"""A drive's limit (6072) is an integer in per mille; an axis is not considered weaker because of its rounding."""


@dataclass(frozen=True, eq=False)
class RobotStrength:
    """The torque of the joints, and the part that the arm itself requires.

    Attributes:
        source: The robot's file.
        payloads: Payloads of the robot.
        coupling: (n, n) C with q_joint = C q_axis.
        torque_max_nm: (n,) greatest torque of each joint.
    """

    source: RobotSource
    payloads: RobotPayloads
    coupling: FloatArray
    torque_max_nm: FloatArray

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
        """Torque limits of the joints.

        Args:
            share: Share of every joint's torque_max_nm that a motion may use.

        Raises:
            ConfigurationError: the file gives neither a body nor the shares, or no payload, or friction leaves a joint
                no torque for motion.
        """
        chain, payload = self.source.chain, self.payloads.heaviest
        usable = share * self.torque_max_nm
        if self.source.tables.body is not None:
            body = self.arm_body
            for i, left in enumerate(usable - body.coulomb_nm):
                if left <= 0.0:
                    expected = f"expected less than the {usable[i]:g} N m that a motion may use"
                    raise self.source.refused(f"body.links[{i + 1}].coulomb_nm", float(body.coulomb_nm[i]), expected)
            return TorqueLimits(chain, body, payload, usable - body.coulomb_nm)
        self._require_shares(
            "required to design an excitation: the greatest fraction of torque_max_nm that the arm's own links, rotor "
            "and friction need; or a [body] instead"
        )
        return TorqueLimits.from_share(chain, self._shares, payload, usable)

    def expected_torque(self, *, loaded: bool) -> ExpectedTorque | None:
        """The range of torque expected in motion; None if the file does not describe arm or payload sufficiently.

        Args:
            loaded: Whether the flange carries a payload up to the heaviest one; otherwise it is empty.
        """
        heaviest = self.payloads.heaviest_if_stated
        if not self.is_stated or (loaded and heaviest is None):
            return None
        torque_max_nm = self.torque_max_nm
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
        """Limits at the joints' full torque; None if the file does not describe arm or payload sufficiently.

        Raises:
            ConfigurationError: friction alone uses up a joint's torque.
        """
        if self.payloads.heaviest_if_stated is None or not self.is_stated:
            return None
        return self.limits(1.0)

    @property
    def axis_limits_if_stated(self) -> TorqueLimits | None:
        """Limits by which the drives (6072) restrict the axes; None if not stated, or not below the joints' limits.

        Raises:
            ConfigurationError: friction alone uses up an axis's torque.
        """
        table, limits, sizes = self.source.tables.joints, self.limits_if_stated, np.abs(self.coupling)
        asked_nm = self.torque_max_nm @ sizes
        allowed_nm = np.array([joint.axis_torque_max_nm for joint in table])
        if limits is None or np.all(allowed_nm >= (1.0 - ROUNDED_SHARE) * asked_nm):
            return None
        itself_nm = (self.torque_max_nm - limits.available_nm) @ sizes
        left_nm = np.minimum(allowed_nm, asked_nm) - itself_nm
        for i, joint in enumerate(table):
            if left_nm[i] <= 0.0 and joint.drive is not None:
                raise self.source.refused(
                    f"joints[{i + 1}].drive.max_torque_permille",
                    joint.drive.max_torque_permille,
                    f"that is {allowed_nm[i]:g} N m, expected more than the {itself_nm[i]:g} N m that the arm itself "
                    "and its friction require on this axis",
                )
        return replace(limits, coupling=self.coupling, available_nm=left_nm)

    def require_stated(self) -> None:
        """Refuse to move an arm that may be real if the file does not state its joints' torque shares or its payload.

        Raises:
            ConfigurationError: naming the first key that is missing.
        """
        self._require_shares(
            "a real arm is moved only if its joints are known to be strong enough: give it, or a [body]"
        )
        if self.payloads.heaviest_if_stated is None:
            expected = "required: the payload that a real arm may have to carry"
            raise self.source.refused("heaviest_payload", None, expected)

    @property
    def _shares(self) -> FloatArray:
        """(n,) share of each joint's torque that the arm itself requires; NaN if not stated."""
        shares = [joint.arm_torque_share for joint in self.source.tables.joints]
        return np.array([np.nan if share is None else share for share in shares])

    @property
    def _first_missing_share(self) -> int | None:
        """Number of the first joint without a share; None if there is none or the file has a `[body]`."""
        missing = np.flatnonzero(np.isnan(self._shares))
        return int(missing[0]) + 1 if missing.size and self.source.tables.body is None else None

    def _require_shares(self, expected: str) -> None:
        number = self._first_missing_share
        if number is not None:
            raise self.source.refused(f"joints[{number}].arm_torque_share", None, expected)
