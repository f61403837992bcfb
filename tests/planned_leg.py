"""Every setpoint of an uninterrupted leg at once, for comparisons with what is streamed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from armload_controller.motion.leg_interpolator import LegInterpolator, along
from armload_controller.motion.motion_control import MotionControl
from armload_controller.motion.phase import Leg, PhaseState, Segment
from armload_identification.float_array import FloatArray


@dataclass(frozen=True, eq=False, slots=True)
class MotionPlan:
    """N cycles, n joints: (N, n) arrays, and (N,) of the phase on the path and ds/dt."""

    position_rad: FloatArray
    velocity_rad_s: FloatArray
    acceleration_rad_s2: FloatArray
    phase_s: FloatArray
    phase_rate: FloatArray
    segment: tuple[Segment, ...]

    def __len__(self) -> int:
        return len(self.segment)


def plan_leg(leg: Leg, cycle_s: float) -> MotionPlan:
    """The setpoints, including the start at rest."""
    rows = list(iter(LegInterpolator(leg, cycle_s, MotionControl()).next_reference, None))
    states = [PhaseState(leg.start_s, 0.0, 0.0), *(row.state for row in rows)]
    s, rate = np.array([(x.phase_s, x.rate) for x in states]).T
    return MotionPlan(*along(leg.path, states), s, rate, (rows[0].segment, *(row.segment for row in rows)))
