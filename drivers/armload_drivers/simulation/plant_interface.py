"""What simulated drives move: the interface of a plant, and an ideal one.

`plant.ArmPlant` is the arm with mechanics. `IdealPlant` has none and needs no simulator: for tests of the bus.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from armload_core.arrays import FloatArray


class AxisSample(Protocol):
    """What drives measure at one instant."""

    @property
    def axis_position_rad(self) -> FloatArray:
        """(n,) axis positions."""

    @property
    def axis_velocity_rad_s(self) -> FloatArray:
        """(n,) axis velocities."""

    @property
    def axis_demand_rad(self) -> FloatArray:
        """(n,) setpoints of the position loops at this instant."""

    @property
    def axis_torque_nm(self) -> FloatArray:
        """(n,) axis torques."""


class Plant(Protocol):
    """Axes under servo loops, advanced by an argument called time. `plant.ArmPlant` has the full account."""

    def advance(self, time_s: float) -> None:
        """Let time pass up to `time_s`."""

    def set_target(self, axis: int, position_rad: float, over_s: float) -> None:
        """Move the setpoint linearly to a position within `over_s`, then hold it."""

    def slow_down(self, axis: int, over_s: float) -> None:
        """Bring the setpoint to a stop evenly within `over_s`."""

    def set_torque_offset(self, axis: int, torque_nm: float) -> None:
        """Add a torque inside the servo loop."""

    def set_powered(self, axis: int, on: bool) -> None:
        """Servo loop and torque on or off."""

    def hold_position(self, axis: int) -> float:
        """Present position of an axis."""

    def sample(self, cycle_s: float) -> AxisSample:
        """What the drives measure now."""


@dataclass(frozen=True, slots=True)
class IdealSample:
    """Sample of an ideal plant; see `AxisSample`."""

    axis_position_rad: FloatArray
    axis_velocity_rad_s: FloatArray
    axis_demand_rad: FloatArray
    axis_torque_nm: FloatArray


class IdealPlant:
    """Axes that are exactly where their setpoints are, and carry a constant torque while powered.

    Args:
        position_rad: (n,) where the axes are at first.
        torque_nm: (n,) torque of the powered axes; the torque offset is added to it.

    Attributes:
        n: Number of axes.
        time_s: Time that it has been advanced to.
        powered: Per axis, whether torque is on.
        torque_offset_nm: (n,) offsets in force.
        lag_rad: (n,) how far encoders stay behind setpoints; zero, for following errors to be injected.
    """

    def __init__(self, position_rad: FloatArray, torque_nm: FloatArray | None = None) -> None:
        self._start = np.array(position_rad, dtype=np.float64)
        self._finish = self._start.copy()
        self._begin_s = np.zeros_like(self._start)
        self._over_s = np.zeros_like(self._start)
        self._torque_nm = np.zeros_like(self._start) if torque_nm is None else np.array(torque_nm)
        self.time_s = 0.0
        self.n = len(self._start)
        self.powered = [False] * len(self._start)
        self.torque_offset_nm = np.zeros_like(self._start)
        self.lag_rad = np.zeros_like(self._start)

    def advance(self, time_s: float) -> None:
        """Let time pass; a time that has passed already changes nothing."""
        self.time_s = max(self.time_s, time_s)

    def _share(self) -> FloatArray:
        """(n,) share of each ramp that is over."""
        elapsed = self.time_s - self._begin_s
        share = np.divide(elapsed, self._over_s, out=np.ones_like(elapsed), where=self._over_s > 0.0)
        return np.asarray(share.clip(0.0, 1.0))

    @property
    def position_rad(self) -> FloatArray:
        """(n,) where the axes are."""
        return self._start + self._share() * (self._finish - self._start)

    @property
    def velocity_rad_s(self) -> FloatArray:
        """(n,) how fast they move."""
        moving = (self._share() < 1.0) | (self.time_s == self._begin_s + self._over_s)
        travel = np.where(moving, self._finish - self._start, 0.0)
        return np.divide(travel, self._over_s, out=np.zeros_like(travel), where=self._over_s > 0.0)

    def set_target(self, axis: int, position_rad: float, over_s: float) -> None:
        """Move a powered axis linearly to a position within `over_s`."""
        if self.powered[axis]:
            self._ramp(axis, position_rad, over_s)

    def slow_down(self, axis: int, over_s: float) -> None:
        """Stop within `over_s`, over the distance that an even deceleration needs."""
        travel = 0.5 * over_s * self.velocity_rad_s[axis]
        self._ramp(axis, self.hold_position(axis) + travel, over_s)

    def _ramp(self, axis: int, position_rad: float, over_s: float) -> None:
        """Start a ramp from where the axis is."""
        self._start[axis] = self.hold_position(axis)
        self._finish[axis] = position_rad
        self._begin_s[axis] = self.time_s
        self._over_s[axis] = over_s

    def set_torque_offset(self, axis: int, torque_nm: float) -> None:
        """Add a torque to the axis's own."""
        self.torque_offset_nm[axis] = torque_nm

    def set_powered(self, axis: int, on: bool) -> None:
        """Torque on or off; either way the axis stays where it is."""
        self._ramp(axis, self.hold_position(axis), 0.0)
        self.powered[axis] = on

    def hold_position(self, axis: int) -> float:
        """Present position of an axis: that of `position_rad`, without computing the others."""
        over_s = self._over_s[axis]
        share = min(max((self.time_s - self._begin_s[axis]) / over_s, 0.0), 1.0) if over_s > 0.0 else 1.0
        return float(self._start[axis] + share * (self._finish[axis] - self._start[axis]))

    def sample(self, cycle_s: float) -> IdealSample:
        """What the drives measure now; without noise, so `cycle_s` does not matter."""
        position = self.position_rad
        torque = np.where(self.powered, self._torque_nm + self.torque_offset_nm, 0.0)
        return IdealSample(position - self.lag_rad, self.velocity_rad_s, position, torque)
