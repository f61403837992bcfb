"""Setpoints: the legs of a run, and the last stage before the drives.

    approach    straight in joint space from the arm's position to the start of the path, or through via points
    slow round  one period at a quarter of the rate or less; it begins and ends where the ramp up begins
    measured    ramp up, complete periods at rate 1, ramp down

`RuckigFollower` is the last stage before the drives: it passes a feasible reference unchanged (within 4e-10 rad) and
turns anything else into a jerk-limited motion.
"""

from __future__ import annotations

import numpy as np
from ruckig import (
    DurationDiscretization,
    InputParameter,
    OutputParameter,
    Result,
    Ruckig,
    RuckigError,
    Synchronization,
)

from armload_controller.motion.joint_limits import MotionLimits
from armload_controller.motion.paths import InfeasibleMotion, LinePath, bound_phase
from armload_controller.motion.phase import Leg, PhaseState, Segment, ramp_to_rate
from armload_controller.motion.slow_round_pace import reduced_pace
from armload_identification.excitation.fourier import Excitation
from armload_identification.excitation.geometry.cartesian_speed import SpeedLimit
from armload_identification.float_array import FloatArray

CYCLE_ROUNDING = 1e-6
"""Share of a cycle by which a period may differ from a whole number of cycles."""


def plan_measured(excitation: Excitation, limits: MotionLimits, cycle_s: float) -> Leg:
    """Plan ramp up, complete periods and ramp down.

    Args:
        excitation: Path and number of periods.
        limits: Limits of the joints.
        cycle_s: Time between setpoints.

    Raises:
        InfeasibleMotion: no ramp within the limits, or a period that is not a whole number of cycles.
    """
    path = excitation.trajectory
    in_period = path.period_s / cycle_s
    if abs(in_period - round(in_period)) > CYCLE_ROUNDING:
        raise InfeasibleMotion(
            f"one period of {path.period_s:g} s is {in_period:.3f} cycles of {cycle_s * 1e3:g} ms: choose a rate at "
            "which it is a whole number of cycles"
        )
    bounds = bound_phase(path, limits)
    lead_in_s = ramp_to_rate(PhaseState(0.0, 0.0, 0.0), 1.0, bounds, cycle_s).end.phase_s
    return Leg(path, bounds, -lead_in_s, excitation.periods * path.period_s, 1.0, Segment.PERIODS)


def plan_slow(excitation: Excitation, measured: Leg, speed: SpeedLimit) -> Leg:
    """Plan one period at reduced speed; it begins and ends where the measured leg begins.

    Args:
        excitation: Path and number of periods.
        measured: The leg from `plan_measured`.
        speed: Limit of the speed of the arm's points and of what it carries.
    """
    paced, bounds = reduced_pace(excitation.trajectory, measured.bounds, speed)
    start_s = paced.pace.phase_of(measured.start_s)
    return Leg(paced, bounds, start_s, start_s + paced.pace.lasts_s, 1.0, Segment.SLOW)


def plan_approach(line: LinePath, limits: MotionLimits) -> Leg:
    """The leg along a straight line in joint space."""
    return Leg(line, line.phase_limits(limits), 0.0, line.duration_s, 1.0, Segment.APPROACH)


class RuckigFollower:
    """The last stage before the drives: every setpoint passes through Ruckig."""

    def __init__(self, start_rad: FloatArray, limits: MotionLimits, cycle_s: float) -> None:
        n = len(start_rad)
        self._otg = Ruckig(n, cycle_s)
        self._input = InputParameter(n)
        self._output = OutputParameter(n)
        self._input.synchronization = Synchronization.Time
        self._input.duration_discretization = DurationDiscretization.Discrete
        self._input.max_velocity = limits.velocity_max_rad_s
        self._input.max_acceleration = limits.acceleration_max_rad_s2
        self._input.max_jerk = limits.jerk_max_rad_s3
        self._input.current_position = start_rad
        self._input.current_velocity = np.zeros(n)
        self._input.current_acceleration = np.zeros(n)

    def follow(
        self, position_rad: FloatArray, velocity_rad_s: FloatArray, acceleration_rad_s2: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """The state to command for this cycle: the reference itself, or the nearest feasible one.

        Raises:
            InfeasibleMotion: Ruckig refuses the reference.
        """
        # Ruckig takes a list ten times as fast as an array.
        self._input.target_position = position_rad.tolist()
        self._input.target_velocity = velocity_rad_s.tolist()
        self._input.target_acceleration = acceleration_rad_s2.tolist()
        try:
            result = self._otg.update(self._input, self._output)
        except RuckigError as error:
            raise InfeasibleMotion(f"Ruckig refuses a setpoint: {error}") from error
        if result not in (Result.Working, Result.Finished):
            raise InfeasibleMotion(f"Ruckig refuses a setpoint: {result}")
        output = self._output
        output.pass_to_input(self._input)
        state = np.array([output.new_position, output.new_velocity, output.new_acceleration])
        state.setflags(write=False)  # plug-ins receive them before the drives do
        position, velocity, acceleration = state
        return position, velocity, acceleration
