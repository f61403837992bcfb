"""All limits of a motion: the joints' ranges and rates, their torque, the workspace, and speed.

Every limit is a row k of the same form, the relative excess

    e_k(t) <= 0,   e_k = |value - centre| / room - 1   or   (keep - clearance) / CLEARANCE_SCALE_M,

so that an optimiser need not know its meaning. `worst` bounds every row at all times, also between samples; the proofs
are in `fourier` (joints), `torque_limits` (torque), `workspace` (clearances) and `cartesian_speed`.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from armload_identification.excitation.fourier import FourierBounds, FourierTrajectory
from armload_identification.excitation.geometry.cartesian_speed import SpeedLimit
from armload_identification.excitation.geometry.workspace import Workspace
from armload_identification.excitation.limit_margins import PER_JOINT, LimitMargins
from armload_identification.excitation.torque_limits import TorqueLimits
from armload_identification.float_array import FloatArray
from armload_identification.identification_errors import ExcitationError
from armload_identification.model.finite_array import finite_array, set_fields

CLEARANCE_SCALE_M = 0.2
"""A sphere this deep inside an obstacle has the same excess as a speed of twice its limit."""

_ORDERS = 4


@dataclass(frozen=True, eq=False, slots=True)
class ExcitationLimits(FourierBounds):
    """Limits of the motion of n joints.

    Raises:
        ExcitationError: shapes differ, a range is empty, or a limit is not a finite number above 0.
    """

    def __post_init__(self) -> None:
        n = np.size(self.position_min_rad)
        for name in FourierBounds.__slots__:
            above = None if name.startswith("position") else 0.0
            values = finite_array(name, getattr(self, name), (n,), above=above, error=ExcitationError)
            object.__setattr__(self, name, values)
        for i, (low, high) in enumerate(zip(self.position_min_rad, self.position_max_rad, strict=True)):
            if not low < high:
                raise ExcitationError(f"joint {i + 1}: positions from {low} to {high} rad; expected min < max")

    def reduced(self, position_margin_rad: float, rate_share: float) -> ExcitationLimits:
        """Tighter limits, to leave room for the ramps and the servo.

        Args:
            position_margin_rad: Subtracted at both ends of every range, at least 0.
            rate_share: Remaining share of speed, acceleration and jerk, above 0 and at most 1.

        Raises:
            ExcitationError: a range would become empty, or margin or share are out of range.
        """
        if not (0.0 < rate_share <= 1.0 and position_margin_rad >= 0.0):
            raise ExcitationError(
                f"margin {position_margin_rad} rad, share {rate_share}; expected at least 0, and above 0 up to 1"
            )
        low, high, *rates = (getattr(self, name) for name in FourierBounds.__slots__)
        return ExcitationLimits(
            low + position_margin_rad, high - position_margin_rad, *(rate_share * rate for rate in rates)
        )


@dataclass(frozen=True, eq=False)
class Envelope:
    """All limits of a motion.

    Attributes:
        joints: Ranges and rates of the joints.
        torque: Torque that the joints can provide, and that arm and payload require.
        workspace: Obstacles that the arm must not touch.
        speed: Speed limit of the arm's points; None if there is none.

    Raises:
        ExcitationError: numbers of joints that differ.
    """

    joints: ExcitationLimits
    torque: TorqueLimits
    workspace: Workspace
    speed: SpeedLimit | None = None
    _centre: FloatArray = field(init=False, repr=False)
    _room: FloatArray = field(init=False, repr=False)
    _available: FloatArray = field(init=False, repr=False)

    def __post_init__(self) -> None:
        n = len(self.joints.position_min_rad)
        if not n == self.torque.chain.n == self.workspace.chain.n:
            raise ExcitationError(
                f"limits of {n} joints, torque of {self.torque.chain.n}, workspace of {self.workspace.chain.n}"
            )
        joints = self.joints
        centre = np.zeros((_ORDERS, 1, n))
        centre[0] = 0.5 * (joints.position_max_rad + joints.position_min_rad)
        half = 0.5 * (joints.position_max_rad - joints.position_min_rad)
        room = np.stack([half, joints.velocity_max_rad_s, joints.acceleration_max_rad_s2, joints.jerk_max_rad_s3])
        available = np.tile(self.torque.available_nm, self.torque.cases)
        set_fields(self, {"_centre": centre, "_room": room[:, None, :], "_available": available})

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.joints.position_min_rad)

    @property
    def rows(self) -> int:
        """K, the number of limits."""
        return self._first_rows[2] + (0 if self.speed is None else len(self.speed.points.names))

    def excess(self, states: FloatArray) -> FloatArray:
        """Relative excess over every limit, at or below zero within the limits.

        Args:
            states: (4, N, n) position, velocity, acceleration, jerk in rad, rad/s, rad/s2, rad/s3.

        Returns:
            (N, K).
        """
        joints = np.abs(states - self._centre) / self._room - 1.0
        torque = self.torque.demand(*states[:3]) / self._available - 1.0
        clearance = (self.workspace.keep_m - self.workspace.clearances(states[0])) / CLEARANCE_SCALE_M
        fast = () if self.speed is None else (self.speed.points.speeds(*states[:2]) / self.speed.speed_m_s - 1.0,)
        return np.concatenate([*joints, torque, clearance, *fast], axis=1)

    def slope(self, weight: FloatArray, states: FloatArray) -> FloatArray:
        """Derivative of the weighted sum of all excesses by the states.

        Args:
            weight: (N, K) weight of each; zeros cost no time.
            states: (4, N, n) position, velocity, acceleration, jerk.

        Returns:
            (4, N, n).
        """
        joints, torque, clearance, speed = self._by_kind(weight)
        slope = np.stack(np.split(joints, _ORDERS, axis=1)) * np.sign(states - self._centre) / self._room
        slope[:3] += self.torque.slope(torque / self._available, *states[:3])
        slope[0] -= self.workspace.slope(clearance / CLEARANCE_SCALE_M, states[0])
        if self.speed is not None:
            slope[:2] += self.speed.points.moving(*states[:2]).slope(speed / self.speed.speed_m_s)
        return np.asarray(slope)

    def worst(self, trajectory: FourierTrajectory) -> FloatArray:
        """Upper bound of every excess along a trajectory, also between samples.

        Args:
            trajectory: One period of the motion.

        Returns:
            (K,).
        """
        reach = trajectory.bounds()
        furthest = np.maximum(reach.position_max_rad - self._centre[0, 0], self._centre[0, 0] - reach.position_min_rad)
        sizes = np.stack([furthest, reach.velocity_max_rad_s, reach.acceleration_max_rad_s2, reach.jerk_max_rad_s3])
        joints = (sizes / self._room[:, 0] - 1.0).ravel()
        torque = self.torque.greatest(trajectory) / self._available - 1.0
        clearance = (self.workspace.keep_m - self.workspace.least(trajectory)) / CLEARANCE_SCALE_M
        fast = () if self.speed is None else (self.speed.points.greatest_on(trajectory) / self.speed.speed_m_s - 1.0,)
        return np.concatenate([joints, torque, clearance, *fast])

    def most_exceeded(self, worst: FloatArray) -> str:
        """The limit that is exceeded most, and by how much, in words.

        Args:
            worst: (K,) from `worst`.
        """
        row = int(worst.argmax())
        torque, clearance, speed = self._first_rows
        excess = float(worst[row])
        if row < torque:
            kind = ("range", "speed", "acceleration", "jerk")[row // self.n]
            return f"exceeds the {kind} of joint {row % self.n + 1} by {100.0 * excess:.1f} %"
        if row < clearance:
            return f"requires {100.0 * excess:.1f} % more torque than joint {(row - torque) % self.n + 1} may use"
        if row < speed:
            part, other = self.workspace.between[row - clearance]
            return f"brings {part} {excess * CLEARANCE_SCALE_M:.3f} m too close to {other}"
        name = "" if self.speed is None else self.speed.points.names[row - speed]
        return f"is {100.0 * excess:.1f} % too fast at {name}"

    def margins(self, trajectory: FourierTrajectory) -> LimitMargins:
        """Smallest margins of a trajectory, also between samples.

        Args:
            trajectory: One period of the motion.
        """
        joints, torque, clearance, fast = self._by_kind(self.worst(trajectory))
        room = -joints.reshape(_ORDERS, -1) * self._room[:, 0]
        in_torque = (-torque * self._available).reshape(self.torque.cases, -1).min(axis=0)
        nearest: dict[str, float] = {}
        for name, excess in zip(self.workspace.names, clearance, strict=True):
            distance_m = float(self.workspace.keep_m - excess * CLEARANCE_SCALE_M)
            nearest[name] = min(nearest.get(name, np.inf), distance_m)
        limit = self.speed
        slower = {} if limit is None else dict(zip(limit.points.names, (-fast * limit.speed_m_s).tolist(), strict=True))
        states = dict(zip(PER_JOINT, [*room, in_torque], strict=True))
        return LimitMargins(**states, clearance_m=nearest, speed_m_s=slower)

    @property
    def _first_rows(self) -> tuple[int, int, int]:
        """Index of the first row of torque, of clearances and of speed."""
        torque = _ORDERS * self.n
        clearance = torque + self.torque.cases * self.n
        return torque, clearance, clearance + len(self.workspace.names)

    def _by_kind(self, rows: FloatArray) -> list[FloatArray]:
        """Rows (..., K) of joints, torque, clearances and speed."""
        return np.split(rows, self._first_rows, axis=-1)
