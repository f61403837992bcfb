"""The interface of the plant behind simulated drives, and a plant that stands still.

`mujoco_plant.ArmPlant` is the arm with mechanics. `StandingPlant` has none and needs no simulator.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from armload_drivers.servos import FloatArray


@dataclass(frozen=True, slots=True)
class AxisSample:
    """Measurements of drives at one instant.

    Attributes:
        axis_position_rad: (n,) positions, as the encoders have them.
        axis_velocity_rad_s: (n,) their velocities.
        axis_demand_rad: (n,) setpoints of the position loops.
        axis_torque_nm: (n,) torques.
    """

    axis_position_rad: FloatArray
    axis_velocity_rad_s: FloatArray
    axis_demand_rad: FloatArray
    axis_torque_nm: FloatArray


@dataclass(frozen=True, slots=True)
class EncoderFault:
    """A fault of an axis's encoder, inside the drive's own loops.

    From the fault on it reports

        p = p_0 + jump + scale (q - q_0) + drift (t - t_0)

    with q the axis's position, and p_0, q_0 as they are when the fault occurs at t_0.

    Attributes:
        scale: 1 if the encoder counts correctly, -1 if backwards, 0 if it is frozen.
    """

    scale: float = 1.0
    jump_rad: float = 0.0
    drift_rad_s: float = 0.0


REVERSED = EncoderFault(scale=-1.0)
FROZEN = EncoderFault(scale=0.0)


class Plant(Protocol):
    """Axes with servo loops, advanced to times given as arguments. See `mujoco_plant.ArmPlant` for details."""

    def advance(self, time_s: float) -> None:
        """Advance to `time_s`."""

    def set_target(self, axis: int, position_rad: float, over_s: float) -> None:
        """Move the setpoint linearly to a position within `over_s`, then hold it."""

    def slow_down(self, axis: int, over_s: float) -> None:
        """Bring the setpoint to a stop at constant deceleration within `over_s`."""

    def set_torque_offset(self, axis: int, torque_nm: float) -> None:
        """Add a torque inside the servo loop."""

    def set_powered(self, axis: int, on: bool) -> None:
        """Switch servo loop and torque on or off. If off, the brake engages; it holds after a delay."""

    def hold_by_brake(self, axis: int) -> None:
        """Engage the brake, and remove the torque when it holds: for an axis at standstill."""

    def keep_braked(self, axis: int, closed: bool) -> None:
        """Keep the brake closed also while torque is on, or leave it to `set_powered` again."""

    def fail_encoder(self, axis: int, fault: EncoderFault) -> None:
        """Let an encoder fail."""

    def hold_position(self, axis: int) -> float:
        """Present position of an axis, as its encoder has it."""

    def sample(self, cycle_s: float) -> AxisSample:
        """Present measurements of the drives."""


class PlantAxis(NamedTuple):
    """A plant, and the index of a drive's axis in it."""

    plant: Plant
    axis: int


class StandingPlant:
    """Axes that stand still whatever is commanded, for drives that are only asked.

    Args:
        position_rad: (n,) their positions.
    """

    def __init__(self, position_rad: FloatArray) -> None:
        self._position_rad = position_rad

    def _stand(self, *_command: object) -> None:
        """Whatever is commanded, nothing happens."""

    advance = set_target = slow_down = set_torque_offset = set_powered = _stand
    hold_by_brake = keep_braked = fail_encoder = _stand

    def hold_position(self, axis: int) -> float:
        """Where the axis stands."""
        return float(self._position_rad[axis])

    def sample(self, cycle_s: float) -> AxisSample:
        """Positions; nothing turns, and no torque is applied."""
        nothing = np.zeros_like(self._position_rad)
        return AxisSample(self._position_rad, nothing, self._position_rad, nothing)
