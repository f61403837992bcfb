"""Setups of the trials: arm, twin, excitation, payload.

Twins of one arm:

- CLEAN: MuJoCo's torque on the trajectory itself, no servo, no friction: only noise disturbs it.
- NORMATIVE: the normative plant, as configured.
- GEARS: the `harsh` plant, with the same friction in both runs.
- HARSH: the `harsh` plant, 3 % more friction in the loaded run; gain errors within 2 % are drawn per seed.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from armload_controller.config.robot import Robot
from armload_controller.config.robot_simulation import HARSH_SECOND_RUN_FRICTION
from armload_drivers.simulation.plant_spec import PlantSpec, PlantVariant, RigidBody
from armload_identification.excitation.design import optimal_excitation
from armload_identification.excitation.design_envelope import Envelope, ExcitationLimits
from armload_identification.excitation.design_search import PeriodRange, SearchSettings
from armload_identification.excitation.fourier import FourierTrajectory
from armload_identification.excitation.geometry.workspace import Workspace
from armload_identification.excitation.information import named_criterion
from armload_identification.excitation.torque_limits import TorqueLimits
from armload_identification.model.payload import InertialParameters
from armload_identification.signals.joint_torque import Transmission
from benchmarks.arms.bodies import Cuboid
from benchmarks.arms.simulated_recordings import DriveScales
from benchmarks.arms.steady_state import SteadyPeriod, Streaming, ideal_period, steady_period
from benchmarks.arms.trials import CalibrationLoad, Setup

PAPER_JOINTS = 3
PAPER_PERIODS = 50
PAPER_BASE_HZ = 0.05
PAPER_HARMONICS = 5
PAPER_RATE_HZ = 1000.0
PAPER_KEPT = 10
PAPER_DESIGN_SEED = 1
PAPER_RESTARTS = 8
CRITERION = "a-optimal"
"""Of the excitation of the paper's setup."""


class Twin(StrEnum):
    """Which simulated arm."""

    CLEAN = "white noise alone"
    NORMATIVE = "normative"
    GEARS = "harsh, the same friction in both runs"
    HARSH = "harsh"


@dataclass(frozen=True, eq=False)
class Motion:
    """A trajectory, how it is streamed, and what of it the identification uses.

    Attributes:
        trajectory: Of all axes.
        streaming: Drives, cycle and kept samples.
        joints: Number of joints, from the base, that the payload is identified from.
        periods: M of each run.
    """

    trajectory: FourierTrajectory
    streaming: Streaming
    joints: int
    periods: int


def paper_motion(robot: Robot, criterion: str) -> Motion:
    """The motion of Chen 2016: joints 4 to 6 held at zero, five harmonics of 0.05 Hz, 1 kHz, every tenth sample kept.

    Args:
        robot: er50, which has the paper's limits for joints 1 to 3.
        criterion: Name of the excitation's criterion.
    """
    n, limits = PAPER_JOINTS, robot.limits.excitation
    head = ExcitationLimits(
        limits.position_min_rad[:n],
        limits.position_max_rad[:n],
        limits.velocity_max_rad_s[:n],
        limits.acceleration_max_rad_s2[:n],
        limits.jerk_max_rad_s3[:n],
    )
    chain, payload = robot.chain.head(n), in_frame(robot, robot.payloads.expected, n)
    strong = TorqueLimits.from_share(chain, np.zeros(n), payload, robot.limits.torque_max_nm[:n])
    found = optimal_excitation(
        named_criterion(criterion, chain, robot.limits.torque_noise_nm[:n], payload),
        Envelope(head, strong, Workspace(chain)),
        SearchSettings(PAPER_HARMONICS, PeriodRange(*[1.0 / PAPER_BASE_HZ] * 3), PAPER_DESIGN_SEED, PAPER_RESTARTS),
    ).trajectory
    held = np.zeros((robot.n - n, PAPER_HARMONICS))
    trajectory = FourierTrajectory(
        found.base_frequency_hz,
        np.concatenate([found.offset_rad, held[:, 0]]),
        np.vstack([found.sin_rad, held]),
        np.vstack([found.cos_rad, held]),
    )
    arm = replace(robot.drives.settings, cycle_s=1.0 / PAPER_RATE_HZ)
    return Motion(trajectory, Streaming(arm, robot.limits.motion, PAPER_KEPT), n, PAPER_PERIODS)


def shipped_motion(
    robot: Robot, keep_every: int = 1, periods: int | None = None, role: str = "identification"
) -> Motion:
    """The robot's own excitation with all its joints, at its own cycle.

    Args:
        robot: The arm.
        keep_every: Cycles per kept sample.
        periods: M; None takes the file's.
        role: Name of the excitation in the robot's file.
    """
    excitation = robot.excitations[role]
    slow = robot.motion_constraints.reduced_speed
    streaming = Streaming(robot.drives.settings, robot.limits.motion, keep_every, slow)
    return Motion(excitation.trajectory, streaming, robot.n, periods or excitation.periods)


def in_frame(robot: Robot, payload: InertialParameters, joints: int) -> InertialParameters:
    """A payload of the flange frame in the last frame of the first joints' chain, the other joints at zero."""
    if joints == robot.n:
        return payload
    poses = robot.chain.forward(np.zeros(robot.n))
    return payload.transformed(np.linalg.inv(poses[joints - 1]) @ poses[-1])


def twin_spec(robot: Robot, twin: Twin, payload: RigidBody | None) -> PlantSpec:
    """The simulated arm with a payload on its flange."""
    spec = replace(robot.simulation.plant_spec(None), payload=payload)
    if twin in {Twin.GEARS, Twin.HARSH}:
        scale = 1.0 if payload is None or twin is Twin.GEARS else HARSH_SECOND_RUN_FRICTION
        return replace(spec, variant=PlantVariant.HARSH, friction_scale=scale)
    return spec


def setup_of(
    name: str,
    robot: Robot,
    twin: Twin,
    motion: Motion,
    payload: RigidBody,
    *,
    gain_spread: float = 0.0,
    calibration: Cuboid | None = None,
) -> Setup:
    """A setup, with its periods from MuJoCo or the cache.

    Args:
        name: Printed, and part of every seed.
        robot: The arm.
        twin: Its plant.
        motion: Excitation and streaming.
        payload: Truth, in the flange frame.
        gain_spread: Gain errors are uniform within this, as a share.
        calibration: Weighed payload that the gains are calibrated with.
    """
    n, arm = motion.joints, motion.streaming.arm
    nominal = robot.drives.transmission

    def period(body: RigidBody | None) -> SteadyPeriod:
        make = ideal_period if twin is Twin.CLEAN else steady_period
        return make(twin_spec(robot, twin, body), motion.streaming, motion.trajectory)

    chain = robot.chain if n == robot.n else robot.chain.head(n)
    known = None
    if calibration is not None:
        truth = in_frame(robot, calibration.inertial(), n)
        known = CalibrationLoad(period(calibration.rigid_body()), truth)
    truth = InertialParameters.from_center_of_mass(payload.mass_kg, payload.center_of_mass_m, payload.inertia_kg_m2)
    return Setup(
        name=name,
        loaded=period(payload),
        unloaded=period(None),
        scales=DriveScales.of(arm, robot.limits.torque_noise_nm, n),
        chain=chain,
        transmission=Transmission(nominal.gain_nm_a[:n], nominal.coupling[:n, :n]),
        truth=in_frame(robot, truth, n),
        periods=motion.periods,
        calibration=known,
    ).with_gains(gain_spread)
