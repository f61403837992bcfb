"""What the drives of a simulated arm report while it follows any setpoints, and random point-to-point motion.

As in `steady_state`, the arm moves once without noise; noise, quantisation and gain errors are added per seed.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from ruckig import InputParameter, Result, Ruckig, Synchronization, Trajectory

from armload_controller.config.robot import Robot
from armload_controller.control_errors import ControlError
from armload_core.arrays import FloatArray
from armload_drivers.cia402.arm_settings import ArmSettings, EffortFeedback
from armload_drivers.cia402.process_data.drive_units import ArmUnits
from armload_drivers.servos import JointCommand
from armload_drivers.simulation.mujoco_plant import NOISE_CYCLE_S, ArmPlant
from armload_drivers.simulation.plant_spec import PlantSpec
from armload_identification.recording.recording import Recording
from benchmarks.recordings import DriveScales
from benchmarks.steady_state import noiseless

SLOWEST, RANGE_RAD, PAUSE_S = 0.3, 1.2, 0.3
_TRIES = 200


@dataclass(frozen=True, eq=False)
class Stream:
    """K samples of n axes, without noise.

    Attributes:
        sample_s: Time between samples.
        axis_position_rad: (K, n) of the encoders.
        axis_torque_nm: (K, n) torque, as the drives report it without a gain error.
    """

    sample_s: float
    axis_position_rad: FloatArray
    axis_torque_nm: FloatArray


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


def streamed(spec: PlantSpec, arm: ArmSettings, setpoint_rad: FloatArray) -> Stream:
    """A simulated arm that follows setpoints, one per cycle.

    Args:
        spec: The arm with its load; noise, seed and gain errors are ignored.
        arm: Its drives.
        setpoint_rad: (K, n) joint positions.
    """
    units, cycle_s, nothing = ArmUnits(arm), arm.cycle_s, np.zeros(setpoint_rad.shape[1])
    plant = ArmPlant(replace(noiseless(spec), start_position_rad=setpoint_rad[0]))
    for axis in range(plant.n):
        plant.set_powered(axis, True)
    position, torque = np.empty((2, *setpoint_rad.shape))
    for row, target_rad in enumerate(setpoint_rad):
        plant.advance((row + 1) * cycle_s)
        sample = plant.sample(cycle_s)
        position[row], torque[row] = sample.axis_position_rad, sample.axis_torque_nm
        target = units.targets(JointCommand(target_rad, nothing, nothing))
        for axis, scale in enumerate(units.axes):
            plant.set_target(axis, target.position_counts[axis] / scale.counts_per_rad, cycle_s)
    return Stream(cycle_s, position, torque)


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
    sigma = scales.noise_nm * np.sqrt(NOISE_CYCLE_S / stream.sample_s)
    torque = stream.axis_torque_nm / (1.0 + gain_error) + sigma * rng.standard_normal(stream.axis_torque_nm.shape)
    effort = np.rint(torque * scales.effort_units_per_nm) * scales.effort_per_unit
    position = np.rint(stream.axis_position_rad * scales.counts_per_rad) / scales.counts_per_rad
    tells_current = scales.feedback is EffortFeedback.CURRENT
    return Recording.from_arrays(
        np.arange(len(position)) * stream.sample_s,
        position @ scales.coupling.T,
        current_a=effort if tells_current else None,
        torque_nm=None if tells_current else effort @ np.linalg.inv(scales.coupling),
        name=name,
    )
