"""Recordings of a seed: any streamed motion with its drives' noise, units and gains; random point-to-point motion."""

from __future__ import annotations

import numpy as np
from ruckig import InputParameter, Result, Ruckig, Synchronization, Trajectory

from armload_controller.config.robot import Robot
from armload_controller.control_errors import ControlError
from armload_identification.float_array import FloatArray
from armload_identification.recording.recording import Recording
from benchmarks.arms.simulated_recordings import DriveScales
from benchmarks.arms.streamed_arm import Stream

SLOWEST, RANGE_RAD, PAUSE_S = 0.3, 1.2, 0.3
_TRIES = 200


def point_to_point(robot: Robot, seed: int, lasts_s: float) -> FloatArray:
    """Setpoints of random point-to-point motion, straight in joint space, clear of the obstacles in the robot's file.

    Each move is planned by Ruckig at 0.3 to 1 of the joints' speed, and ends with a pause.

    Args:
        robot: The arm.
        seed: Of poses and speeds.
        lasts_s: Least duration.

    Returns:
        (K, n) in rad, one row per cycle.

    Raises:
        ControlError: no move or no clear pose was found.
    """
    rng, limits, cycle_s = np.random.default_rng(seed), robot.limits.motion, 1.0 / robot.bus.cycle_hz
    low, high = np.maximum(limits.position_min_rad, -RANGE_RAD), np.minimum(limits.position_max_rad, RANGE_RAD)
    here, rows, count = robot.simulation.start_rad.copy(), [], 0
    otg = Ruckig(robot.n)
    while count * cycle_s < lasts_s:
        there = _free_place(robot, here, low, high, rng)
        move = InputParameter(robot.n)
        move.synchronization = Synchronization.Phase
        move.current_position, move.target_position = here.tolist(), there.tolist()
        move.max_velocity = (rng.uniform(SLOWEST, 1.0) * limits.velocity_max_rad_s).tolist()
        move.max_acceleration = limits.acceleration_max_rad_s2.tolist()
        move.max_jerk = limits.jerk_max_rad_s3.tolist()
        way = Trajectory(robot.n)
        if otg.calculate(move, way) not in (Result.Working, Result.Finished):
            raise ControlError(f"Ruckig finds no move from {here.tolist()} to {there.tolist()}")
        times_s = np.arange(cycle_s, way.duration + PAUSE_S, cycle_s)
        rows.append(np.array([way.at_time(min(time_s, way.duration))[0] for time_s in times_s]))
        here, count = there, count + len(times_s)
    return np.vstack(rows)


def _free_place(
    robot: Robot, here: FloatArray, low: FloatArray, high: FloatArray, rng: np.random.Generator
) -> FloatArray:
    """A random pose that a clear straight line leads to."""
    for _ in range(_TRIES):
        there = rng.uniform(low, high)
        if robot.obstacles.objection_on_line(here, there) is None:
            return np.asarray(there)
    raise ControlError(f"no way from {here.tolist()} in {_TRIES} tries")


def as_recorded(
    stream: Stream, scales: DriveScales, rng: np.random.Generator, gain_error: FloatArray, name: str
) -> Recording:
    """A run with its drives' noise, units and gains, as it would be read from a file.

    Args:
        stream: The motion.
        scales: Units and noise of the drives.
        rng: Draws the noise.
        gain_error: (n,) e; the motor gives 1 + e times the torque that the drive reports.
        name: Of the recording.
    """
    current_a, torque_nm = scales.reported_effort(stream.axis_torque_nm / (1.0 + gain_error), stream.sample_s, rng)
    position = scales.reported_position(stream.axis_position_rad)
    time_s = np.arange(len(position)) * stream.sample_s
    return Recording.from_arrays(time_s, position, current_a=current_a, torque_nm=torque_nm, name=name)
