"""Axes that follow exactly: a plant for tests of drives and masters, which has no dynamics of its own."""

from __future__ import annotations

import numpy as np

from armload_drivers.simulation.plant_interface import AxisSample, EncoderFault
from armload_identification.float_array import FloatArray


class IdealPlant:
    """Axes that follow their setpoints exactly, and carry a constant torque while powered.

    Args:
        position_rad: (n,) initial positions.
        torque_nm: (n,) torque of the powered axes; the torque offset is added to it.

    Attributes:
        n: Number of axes.
        time_s: Time that it has been advanced to.
        powered: Per axis, whether torque is on.
        kept_braked: Per axis, whether the brake is kept closed.
        torque_offset_nm: (n,) present offsets.
        lag_rad: (n,) distance of encoders behind setpoints; initially zero, to inject following errors.
        encoder_faults: Fault of each axis's encoder, with the position and time at which it occurred; it changes what
            is reported, because these axes have no loops that could act on it.
    """

    def __init__(self, position_rad: FloatArray, torque_nm: FloatArray | None = None) -> None:
        self._start = np.array(position_rad, dtype=np.float64)
        self._finish = self._start.copy()
        self._begin_s = np.zeros_like(self._start)
        self._over_s = np.zeros_like(self._start)
        self._slowing = np.zeros_like(self._start)
        self._torque_nm = np.zeros_like(self._start) if torque_nm is None else np.array(torque_nm)
        self.time_s = 0.0
        self.n = len(self._start)
        self.powered = [False] * len(self._start)
        self.kept_braked = [False] * len(self._start)
        self.torque_offset_nm = np.zeros_like(self._start)
        self.lag_rad = np.zeros_like(self._start)
        self.encoder_faults: dict[int, tuple[EncoderFault, float, float]] = {}

    def advance(self, time_s: float) -> None:
        """Advance; has no effect for a time in the past."""
        self.time_s = max(self.time_s, time_s)

    def _share(self) -> FloatArray:
        """(n,) completed share of each ramp."""
        elapsed = self.time_s - self._begin_s
        share = np.divide(elapsed, self._over_s, out=np.ones_like(elapsed), where=self._over_s > 0.0)
        return np.asarray(share.clip(0.0, 1.0))

    @property
    def position_rad(self) -> FloatArray:
        """(n,) positions of the axes."""
        return self._position(self._share())

    def _position(self, share: FloatArray) -> FloatArray:
        """(n,) positions at a share of each ramp."""
        return self._start + share * (1.0 + self._slowing * (1.0 - share)) * (self._finish - self._start)

    @property
    def velocity_rad_s(self) -> FloatArray:
        """(n,) velocities of the axes."""
        return self._velocity(self._share())

    def _velocity(self, share: FloatArray) -> FloatArray:
        """(n,) velocities at a share of each ramp."""
        moving = (share < 1.0) | (self.time_s == self._begin_s + self._over_s)
        travel = np.where(moving, self._finish - self._start, 0.0) * (1.0 + self._slowing * (1.0 - 2.0 * share))
        return np.divide(travel, self._over_s, out=np.zeros_like(travel), where=self._over_s > 0.0)

    def set_target(self, axis: int, position_rad: float, over_s: float) -> None:
        """Move a powered axis linearly to a position within `over_s`."""
        if self.powered[axis]:
            self._ramp(axis, position_rad, over_s)

    def slow_down(self, axis: int, over_s: float) -> None:
        """Stop within `over_s` at constant deceleration."""
        travel = 0.5 * over_s * self.velocity_rad_s[axis]
        self._ramp(axis, self.hold_position(axis) + travel, over_s)
        self._slowing[axis] = 1.0

    def _ramp(self, axis: int, position_rad: float, over_s: float) -> None:
        """Start a ramp from the present position, at constant speed."""
        self._start[axis] = self.hold_position(axis)
        self._finish[axis] = position_rad
        self._begin_s[axis] = self.time_s
        self._over_s[axis] = over_s
        self._slowing[axis] = 0.0

    def set_torque_offset(self, axis: int, torque_nm: float) -> None:
        """Add a torque to the axis's own."""
        self.torque_offset_nm[axis] = torque_nm

    def set_powered(self, axis: int, on: bool) -> None:
        """Switch torque on or off; the axis keeps its position."""
        self._ramp(axis, self.hold_position(axis), 0.0)
        self.powered[axis] = on

    def hold_by_brake(self, axis: int) -> None:
        """Switch torque off; the axis keeps its position."""
        self.set_powered(axis, False)

    def keep_braked(self, axis: int, closed: bool) -> None:
        """Record it: these axes have no brakes that could be tested."""
        self.kept_braked[axis] = closed

    def fail_encoder(self, axis: int, fault: EncoderFault) -> None:
        """Let an encoder fail; it replaces an earlier fault."""
        self.encoder_faults[axis] = fault, self.hold_position(axis), self.time_s

    def hold_position(self, axis: int) -> float:
        """Present position of an axis: that of `position_rad`, without computing the others."""
        over_s = self._over_s[axis]
        share = min(max((self.time_s - self._begin_s[axis]) / over_s, 0.0), 1.0) if over_s > 0.0 else 1.0
        share *= 1.0 + self._slowing[axis] * (1.0 - share)
        return float(self._start[axis] + share * (self._finish[axis] - self._start[axis]))

    def sample(self, cycle_s: float) -> AxisSample:
        """Present measurements of the drives; without noise, so `cycle_s` has no effect."""
        share = self._share()
        position = self._position(share)
        velocity = self._velocity(share)
        torque = np.where(self.powered, self._torque_nm + self.torque_offset_nm, 0.0)
        seen, speed = position - self.lag_rad, velocity.copy()
        for axis, (fault, at_rad, since_s) in self.encoder_faults.items():
            drifted = fault.jump_rad + fault.drift_rad_s * (self.time_s - since_s)
            seen[axis] += (fault.scale - 1.0) * (position[axis] - at_rad) + drifted
            speed[axis] = fault.scale * velocity[axis] + fault.drift_rad_s
        return AxisSample(seen, speed, position, torque)
