"""Conversion of the drives' counts and per mille to and from SI units, for one arm. Only this file converts.

    q_joint = C q_axis                    position_counts = sign_position counts_per_rad q_axis
    tau_joint = C^-T tau_axis             per mille = sign_torque 1000 tau_axis / rated_torque
    tau_axis = C^T tau_joint              i_motor = sign_torque rated_current per mille / 1000

A vendor's object for the effort has its own scale in place of the rated one. An AXIS is one motor seen through its
gear. The signs are those of the polarity (607E) that the drive reports.
"""

from __future__ import annotations

import math
import struct
from array import array
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from msgspec import Struct

from armload_drivers.cia402.arm_settings import ArmSettings, DriveSettings, EffortFeedback
from armload_drivers.cia402.object_dictionary import POLARITY_POSITION, POLARITY_TORQUE, DataType
from armload_drivers.cia402.process_data.process_image import effort_entry
from armload_drivers.driver_errors import CommandError
from armload_drivers.servos import FloatArray, JointCommand

_COUNTS_LIMIT = DataType.I32.bounds[1]
_PERMILLE_LIMIT = DataType.I16.bounds[1]


def interpolation_times(cycle_s: float) -> list[tuple[int, int]]:
    """The cycle time in the forms that 60C2 can hold: value (1 to 255) and power of ten, in seconds.

    Raises:
        CommandError: no such pair equals the cycle time.
    """
    forms = [(cycle_s / 10.0**exponent, exponent) for exponent in range(0, -7, -1)]
    found = [
        (round(value), exponent)
        for value, exponent in forms
        if 1 <= round(value) <= DataType.U8.bounds[1] and math.isclose(value, round(value), rel_tol=1e-9)
    ]
    if not found:
        raise CommandError(
            f"cycle {cycle_s} s cannot be configured in a drive (60C2 holds 1 to 255 times a power of ten); "
            "choose a cycle such as 1, 2, 4, 5, 8, 10 or 20 ms"
        )
    return found


def microseconds(time_s: float) -> int:
    """Seconds in microseconds, as in 1006."""
    return round(time_s * 1e6)


def milliseconds(time_s: float) -> int:
    """Seconds in milliseconds, as in 1016, 1017 and event timers; at least 1, since 0 switches them off."""
    return max(1, round(time_s * 1e3))


def saturate(value: float, kind: DataType) -> int:
    """Nearest integer that an object can hold, as drives report values out of range."""
    lower, upper = kind.bounds
    nearest = round(value)
    if lower <= nearest <= upper:
        return nearest
    return lower if nearest < lower else upper


class AxisUnits(Struct, frozen=True):
    """Scale of one drive.

    Attributes:
        counts_per_rad: Position units per radian of the axis, with the sign of 607E bit 7.
        torque_nm_per_permille: Axis torque per per mille, with the sign of 607E bit 5.
        effort_per_unit: Motor current in A, or axis torque in N m, per unit of the reported effort, with the same
            sign.
        effort_units_per_nm: Units of the effort per N m at the axis. A drive uses one ratio between torque and
            current, so 1000 per mille of both are the same state. NaN if only a vendor's object has a scale.
    """

    counts_per_rad: float
    torque_nm_per_permille: float
    effort_per_unit: float
    effort_units_per_nm: float

    @classmethod
    def of(cls, drive: DriveSettings, polarity: int = 0) -> AxisUnits:
        """Units of a drive whose 607E reads `polarity`.

        Raises:
            CommandError: the scale is neither configured nor read from the drive yet.
        """
        if drive.counts_per_rad is None or drive.rated_torque_nm is None:
            raise CommandError(f"{drive.joint}: the drive's scale is unknown until it is connected")
        position_sign = -1.0 if polarity & POLARITY_POSITION else 1.0
        torque_sign = -1.0 if polarity & POLARITY_TORQUE else 1.0
        rated = drive.rated_torque_nm
        if drive.feedback is EffortFeedback.CURRENT:
            if drive.rated_current_a is None and drive.vendor_effort is None:
                raise CommandError(f"{drive.joint}: the motor's rated current is unknown until it is connected")
            rated = math.nan if drive.rated_current_a is None else drive.rated_current_a
        per_unit = 1e-3 * rated if drive.vendor_effort is None else drive.vendor_effort.per_unit
        return cls(
            counts_per_rad=position_sign * drive.counts_per_rad,
            torque_nm_per_permille=torque_sign * drive.rated_torque_nm * 1e-3,
            effort_per_unit=torque_sign * per_unit,
            effort_units_per_nm=torque_sign * rated / drive.rated_torque_nm / per_unit,
        )


class RawAxes(NamedTuple):
    """One value per axis in drive units.

    Attributes:
        position_counts: 607A, 60C1:1 or 6064.
        effort: 60B2 in per mille; or the reported effort, 6077 or 6078 in per mille or a vendor's object.
    """

    position_counts: list[int]
    effort: list[int]


class ArmUnits:
    """Conversion of a cycle's values, including coupling and signs.

    Args:
        polarity: 607E of every drive; zeros if None.

    Attributes:
        axes: Units per axis.
        feedback: Kind of effort that all drives send.

    Raises:
        CommandError: some drives send current and others torque.
    """

    def __init__(self, arm: ArmSettings, polarity: Sequence[int] | None = None) -> None:
        bits = [0] * len(arm.drives) if polarity is None else list(polarity)
        self.axes = tuple(AxisUnits.of(drive, sign) for drive, sign in zip(arm.drives, bits, strict=True))
        self._joints = tuple(drive.joint for drive in arm.drives)
        coupling = np.asarray(arm.coupling, dtype=np.float64)
        inverse = np.linalg.inv(coupling)
        self._counts = counts = np.array([axis.counts_per_rad for axis in self.axes])
        self._torque = torque = np.array([axis.torque_nm_per_permille for axis in self.axes])
        self._counts_from_joint = counts[:, None] * inverse
        self._joint_from_counts = coupling / counts
        self._permille_from_joint = coupling.T / torque[:, None]
        effort = np.array([axis.effort_per_unit for axis in self.axes])
        self._joint_from_effort = inverse.T * effort
        self._motor_from_effort = effort
        self._joint_from_permille = inverse.T * torque
        self._effort_per_nm = np.array([axis.effort_units_per_nm for axis in self.axes])
        kinds_of_effort = [effort_entry(drive).type.bounds[1] for drive in arm.drives]
        self._effort_limit = np.array(kinds_of_effort, dtype=np.float64)
        kinds = {drive.feedback for drive in arm.drives}
        if len(kinds) != 1:
            raise CommandError("all drives of an arm must send the same kind of feedback, current or torque")
        self.feedback = kinds.pop()
        self._without_offset = [axis for axis, drive in enumerate(arm.drives) if not drive.torque_offset]
        self._pack = struct.Struct(f"{len(arm.drives)}d").pack_into
        self._packed = array("d", bytes(8 * len(arm.drives)))
        self._seen = np.frombuffer(self._packed)
        self._inverse = inverse
        self._arm = arm

    def targets(self, command: JointCommand) -> RawAxes:
        """Setpoints of one cycle in drive units.

        Args:
            command: Joint setpoints.

        Returns:
            Target positions and torque offsets, rounded to the nearest integers.

        Raises:
            CommandError: a value is not finite or does not fit its object, or a drive without a torque offset would
                get one.
        """
        counts = self._raw("target position", command.position_rad, self._counts_from_joint, _COUNTS_LIMIT)
        permille = self._raw("torque offset", command.torque_offset_nm, self._permille_from_joint, _PERMILLE_LIMIT)
        if any(map(permille.__getitem__, self._without_offset)):
            without = [self._joints[axis] for axis in self._without_offset]
            raise CommandError(
                f"the drives of {', '.join(without)} do not accept a torque offset (60B2); run without feed-forward or "
                "exclude these joints"
            )
        return RawAxes(counts, permille)

    def measured(self, axis_position_rad: FloatArray, axis_torque_nm: FloatArray) -> RawAxes:
        """Values as drives report them: quantised and saturated.

        Args:
            axis_position_rad: (n,) axis positions.
            axis_torque_nm: (n,) axis torques.
        """
        counts = np.rint(self._counts * axis_position_rad).clip(-_COUNTS_LIMIT, _COUNTS_LIMIT)
        effort = np.rint(axis_torque_nm * self._effort_per_nm).clip(-self._effort_limit, self._effort_limit)
        return RawAxes(counts.astype(np.int64).tolist(), effort.astype(np.int64).tolist())

    def _raw(self, what: str, values: FloatArray, axis_from_joint: FloatArray, limit: int) -> list[int]:
        """Values (n,) of all joints in the axes' units, rounded.

        Refuses a wrong number of values, values that are not finite, and values that the drives' objects cannot hold.
        """
        if values.shape != self._torque.shape:
            raise CommandError(f"{what}s of shape {values.shape} for {len(self._joints)} joints")
        numbers = values.tolist()  # of six numbers Python is faster than NumPy
        if not any(numbers):  # usual for torque offsets
            return [0] * len(numbers)
        if not all(map(math.isfinite, numbers)):
            joint = [*map(math.isfinite, numbers)].index(False)
            raise CommandError(
                f"{self._joints[joint]}: {what} {numbers[joint]} is not a finite number; nothing was sent"
            )
        raw = axis_from_joint.dot(values).tolist()
        if not -limit <= min(raw) <= max(raw) <= limit:
            axis = int(np.abs(raw).argmax())
            raise CommandError(
                f"{self._joints[axis]}: {what} is {raw[axis]:.0f} in drive units, outside +-{limit}. Either the "
                "setpoint or the scaling in the configuration is wrong; nothing was sent"
            )
        return [round(number) for number in raw]

    def joint_position_rad(self, counts: Sequence[int]) -> FloatArray:
        """(n,) joint positions from the drives' 6064."""
        return np.asarray(self._joint_from_counts.dot(self._as_array(counts)))

    def joint_torque_nm(self, effort: Sequence[int]) -> FloatArray:
        """(n,) joint torques from the reported effort."""
        return np.asarray(self._joint_from_effort.dot(self._as_array(effort)))

    def joint_offset_nm(self, permille: Sequence[int]) -> FloatArray:
        """(n,) joint torques from torque offsets (60B2)."""
        return np.asarray(self._joint_from_permille.dot(np.array(permille, dtype=np.float64)))

    def motor_current_a(self, effort: Sequence[int]) -> FloatArray:
        """(n,) motor currents from the reported effort."""
        return self._motor_from_effort * self._as_array(effort)

    def _as_array(self, numbers: Sequence[int]) -> FloatArray:
        """(n,) the numbers, until the next call; takes half the time of a new array."""
        self._pack(self._packed, 0, *numbers)
        return self._seen

    def rates(self, axis: int) -> tuple[float, float]:
        """Greatest speed in rad/s and acceleration in rad/s2 of one axis: those of the joints, added where coupled."""
        row = np.abs(self._inverse[axis])
        speed = np.array([drive.velocity_max_rad_s for drive in self._arm.drives])
        acceleration = np.array([drive.acceleration_max_rad_s2 for drive in self._arm.drives])
        return float(row @ speed), float(row @ acceleration)

    def position_limits_counts(self, axis: int) -> tuple[int, int]:
        """607D of one axis: the joints' limits, widened to the box that contains every coupled position."""
        row = self._inverse[axis]
        lower = np.array([drive.position_min_rad for drive in self._arm.drives])
        upper = np.array([drive.position_max_rad for drive in self._arm.drives])
        ends = np.stack([row * lower, row * upper])
        span = np.array([ends.min(axis=0).sum(), ends.max(axis=0).sum()]) * self.axes[axis].counts_per_rad
        limit = float(_COUNTS_LIMIT)
        return math.floor(max(span.min(), -limit)), math.ceil(min(span.max(), limit))
