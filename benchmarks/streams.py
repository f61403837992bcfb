"""What the drives of a simulated arm report while it follows any setpoints: positions and torques, sample by sample."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from armload_core.arrays import FloatArray
from armload_drivers.cia402.arm_settings import ArmSettings, EffortFeedback
from armload_drivers.cia402.drive_units import ArmUnits
from armload_drivers.servos import JointCommand
from armload_drivers.simulation.mujoco_plant import ArmPlant
from armload_drivers.simulation.plant_spec import PlantSpec
from armload_identification.recording.recording import Recording


def streamed(spec: PlantSpec, arm: ArmSettings, setpoint_rad: FloatArray, name: str) -> Recording:
    """A simulated arm that follows setpoints, one per cycle.

    Args:
        spec: The arm with its load, noise and seed.
        arm: Its drives.
        setpoint_rad: (K, n) joint positions.
        name: Of the recording.
    """
    units, cycle_s, nothing = ArmUnits(arm), arm.cycle_s, np.zeros(setpoint_rad.shape[1])
    plant = ArmPlant(replace(spec, start_position_rad=setpoint_rad[0]))
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
    counts = np.array([axis.counts_per_rad for axis in units.axes])
    per_nm = np.array([axis.effort_units_per_nm for axis in units.axes])
    effort = np.rint(torque * per_nm) * np.array([axis.effort_per_unit for axis in units.axes])
    reports_current = units.feedback is EffortFeedback.CURRENT
    return Recording.from_arrays(
        time_s=np.arange(len(position)) * cycle_s,
        position_rad=(np.rint(position * counts) / counts) @ arm.coupling.T,
        current_a=effort if reports_current else None,
        torque_nm=None if reports_current else effort @ np.linalg.inv(arm.coupling),
        name=name,
    )
