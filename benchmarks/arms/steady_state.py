"""One period of an excitation on the simulated arm in steady state: MuJoCo, without noise.

The arm is streamed as in a commissioning: setpoints from `plan_leg` in the drives' counts, latched at SYNC and
reached one cycle later, through the servo loops of the plant. The first period is discarded, the second kept with
its greatest difference from the first. Noise, quantisation of torque and gain errors are added per seed by
`recordings`, which is exact for the first two. A gain error does not change the motion, within the loops' stiffness,
so the drive reports 1 / (1 + e) of the torque. The slow round before the periods is streamed in the same way.

Two effects are neither noise nor friction, and yet visible. The torque that a drive reports at SYNC is that of the
servo step just ended, 0.8 ms older than the position: on the paper's arm it shifts I_yz by 1.8 and c_z by 1.0
standard deviations of the noise of 50 periods. And the load deflects the motion by some 3e-6 rad, which the arm's own
inertia turns into 0.1 N m above 2 Hz. `ideal_period` has neither.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from importlib.metadata import version
from pathlib import Path

import numpy as np

import armload_controller.motion.setpoints
import armload_controller.motion.slow_round_pace
import armload_core
import armload_drivers.cia402.process_data.drive_units
import armload_drivers.simulation.mujoco_model
import armload_drivers.simulation.mujoco_plant
import armload_drivers.simulation.servo_loops
import armload_identification.excitation.fourier
from armload_controller.motion.joint_limits import MotionLimits
from armload_controller.motion.phase import Segment
from armload_controller.motion.setpoints import plan_measured, plan_slow
from armload_drivers.cia402.arm_settings import ArmSettings
from armload_drivers.cia402.process_data.drive_units import ArmUnits
from armload_drivers.simulation.mujoco_model import build_model
from armload_drivers.simulation.plant_spec import PlantSpec
from armload_identification.excitation.fourier import Excitation, FourierTrajectory
from armload_identification.excitation.geometry.cartesian_speed import SpeedLimit
from armload_identification.float_array import FloatArray
from benchmarks.arms import streamed_arm
from benchmarks.arms.period_cache import cache_directory, cached, fingerprint
from benchmarks.arms.streamed_arm import noiseless, streamed
from tests.planned_leg import plan_leg

_MODULES = (
    armload_drivers.simulation.mujoco_plant,
    armload_drivers.simulation.mujoco_model,
    armload_drivers.simulation.servo_loops,
    armload_drivers.cia402.process_data.drive_units,
    armload_controller.motion.setpoints,
    armload_controller.motion.slow_round_pace,
    armload_identification.excitation.fourier,
    streamed_arm,
)
_SOURCES = (
    Path(__file__),
    Path(str(armload_core.__file__)).parent / "source" / "scalar" / "servo_loops.c",
    *(Path(str(module.__file__)) for module in _MODULES),
)
_LIBRARIES = ("mujoco", "numpy", "ruckig")
_SETTLED = 0.25
"""Share of the first period that may contain the start's transient; only the rest is compared."""


@dataclass(frozen=True, eq=False)
class SteadyPeriod:
    """K samples of one period, n axes; a sample every `sample_s`.

    Attributes:
        trajectory: The streamed trajectory.
        sample_s: Time between samples.
        axis_position_rad: (K, n) of the encoders.
        axis_torque_nm: (K, n) torque, as the drives report it without a gain error.
        unrepeated_nm: (n,) greatest change of that torque from the period before to this one.
        greatest_share: (n,) greatest torque as a share of the drive's maximum; 1 is saturated.
        slow_position_rad: (S, n) of the slow round; no rows if it is left out.
        slow_torque_nm: (S, n) likewise.
    """

    trajectory: FourierTrajectory
    sample_s: float
    axis_position_rad: FloatArray
    axis_torque_nm: FloatArray
    unrepeated_nm: FloatArray
    greatest_share: FloatArray
    slow_position_rad: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))
    slow_torque_nm: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))

    @property
    def samples(self) -> int:
        """K."""
        return int(self.axis_torque_nm.shape[0])


@dataclass(frozen=True, eq=False)
class Streaming:
    """How a trajectory is streamed and sampled.

    Attributes:
        arm: Drives and their cycle.
        limits: Of the joints, for approach and ramp.
        keep_every: Cycles per recorded sample.
        slow: Limit of the arm's points in the slow round; None to leave that out.
    """

    arm: ArmSettings
    limits: MotionLimits
    keep_every: int = 1
    slow: SpeedLimit | None = None


def steady_period(
    spec: PlantSpec, streaming: Streaming, trajectory: FourierTrajectory, directory: Path | None = None
) -> SteadyPeriod:
    """The period, from the cache if it is there.

    Args:
        spec: The arm with its load; noise, seed and gain errors are ignored.
        streaming: Drives, cycle and sampling.
        trajectory: Of all axes.
        directory: The cache; None is the user's.
    """
    quiet = noiseless(spec)
    key = period_key(quiet, streaming, trajectory)
    arrays = cached(key, directory or cache_directory(), lambda: _simulate(quiet, streaming, trajectory))
    return SteadyPeriod(trajectory, streaming.arm.cycle_s * streaming.keep_every, **arrays)


def ideal_period(spec: PlantSpec, streaming: Streaming, trajectory: FourierTrajectory) -> SteadyPeriod:
    """The torque of links and payload on the trajectory itself, by MuJoCo: no servo, no friction, no rotors.

    Args:
        spec: The arm with its load.
        streaming: Which samples are kept.
        trajectory: Followed exactly.
    """
    built = build_model(spec)
    sample_s = streaming.arm.cycle_s * streaming.keep_every
    state = trajectory.evaluate(np.arange(round(trajectory.period_s / sample_s)) * sample_s)
    torque = np.empty_like(state.position_rad)
    for row, torque_row in enumerate(torque):
        built.data.qpos[:] = state.position_rad[row]
        built.data.qvel[:] = state.velocity_rad_s[row]
        built.data.qacc[:] = state.acceleration_rad_s2[row]
        built.mujoco.mj_fwdPosition(built.model, built.data)
        built.mujoco.mj_fwdVelocity(built.model, built.data)
        built.mujoco.mj_rne(built.model, built.data, 1, torque_row)
    nothing = np.zeros(trajectory.n)
    to_axis = np.linalg.inv(spec.coupling)
    return SteadyPeriod(trajectory, sample_s, state.position_rad @ to_axis.T, torque @ spec.coupling, nothing, nothing)


def period_key(spec: PlantSpec, streaming: Streaming, trajectory: FourierTrajectory) -> str:
    """Hash of everything that a period depends on, code and libraries included."""
    arm = streaming.arm
    counts = tuple(axis.counts_per_rad for axis in ArmUnits(arm).axes)
    streamed = (arm.cycle_s, arm.coupling, counts, streaming.limits, streaming.keep_every, streaming.slow)
    return fingerprint(spec, streamed, trajectory, _SOURCES, tuple(version(name) for name in _LIBRARIES))


def _simulate(spec: PlantSpec, streaming: Streaming, trajectory: FourierTrajectory) -> dict[str, FloatArray]:
    """Stream two periods and keep the second."""
    arm, cycle_s = streaming.arm, streaming.arm.cycle_s
    excitation = Excitation(trajectory, 2)
    measured = plan_measured(excitation, streaming.limits, cycle_s)
    plan = plan_leg(measured, cycle_s)
    rows = np.flatnonzero([segment is Segment.PERIODS for segment in plan.segment])
    stream = streamed(spec, arm, plan.position_rad[: rows[-1] + 1])
    position, torque, cycles = stream.axis_position_rad[rows], stream.axis_torque_nm[rows], rows.size // 2
    first = slice(0, cycles, streaming.keep_every)
    second = slice(cycles, 2 * cycles, streaming.keep_every)
    settled = int(_SETTLED * len(torque[first]))
    greatest = np.array([joint.max_torque_nm for joint in spec.joints])
    slow = {}
    if streaming.slow is not None:
        leg = plan_leg(plan_slow(excitation, measured, streaming.slow), cycle_s)
        once = streamed(spec, arm, leg.position_rad)
        slow["slow_position_rad"] = once.axis_position_rad[:: streaming.keep_every]
        slow["slow_torque_nm"] = once.axis_torque_nm[:: streaming.keep_every]
    return slow | {
        "axis_position_rad": position[second],
        "axis_torque_nm": torque[second],
        "unrepeated_nm": np.abs(torque[second] - torque[first])[settled:].max(axis=0),
        "greatest_share": np.abs(torque[second]).max(axis=0) / greatest,
    }
