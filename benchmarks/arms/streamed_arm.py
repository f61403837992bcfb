"""A simulated arm that follows setpoints, without noise; noise, quantisation and gain errors are added per seed."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from armload_drivers.cia402.arm_settings import ArmSettings
from armload_drivers.cia402.process_data.drive_units import ArmUnits
from armload_drivers.servos import JointCommand
from armload_drivers.simulation.mujoco_plant import ArmPlant
from armload_drivers.simulation.plant_spec import PlantSpec
from armload_identification.float_array import FloatArray


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


def streamed(spec: PlantSpec, arm: ArmSettings, setpoint_rad: FloatArray, force_n: FloatArray | None = None) -> Stream:
    """Follow setpoints, one per cycle; a sample at a SYNC is in the row of the setpoint that this SYNC latches.

    Args:
        spec: The arm with its load; noise, seed and gain errors are ignored.
        arm: Its drives.
        setpoint_rad: (K, n) joint positions.
        force_n: (K, 3) push against the last link, base frame; None for none.
    """
    units, cycle_s, nothing = ArmUnits(arm), arm.cycle_s, np.zeros(setpoint_rad.shape[1])
    plant = ArmPlant(replace(noiseless(spec), start_position_rad=setpoint_rad[0]))
    for axis in range(plant.n):
        plant.set_powered(axis, True)
    position, torque = np.empty((2, *setpoint_rad.shape))
    for row, target_rad in enumerate(setpoint_rad):
        if force_n is not None:
            plant.push(force_n[row])
        plant.advance((row + 1) * cycle_s)
        sample = plant.sample(cycle_s)
        position[row], torque[row] = sample.axis_position_rad, sample.axis_torque_nm
        target = units.targets(JointCommand(target_rad, nothing, nothing))
        for axis, scale in enumerate(units.axes):
            plant.set_target(axis, target.position_counts[axis] / scale.counts_per_rad, cycle_s)
    return Stream(cycle_s, position, torque)


def noiseless(spec: PlantSpec) -> PlantSpec:
    """The same arm without the noise and gain errors that are added per seed."""
    joints = tuple(replace(joint, torque_noise_nm=0.0) for joint in spec.joints)
    return replace(spec, joints=joints, seed=0, torque_gain_error=None, torque_gain_drift_per_s=None)
