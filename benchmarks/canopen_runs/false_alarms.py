"""False alarms: fault-free commissionings with many seeds, on fakes in virtual time.

A false alarm is a stopped run. A seed determines only the noise of the measured torque, which does not affect the
motion: the arm is moved once, with seed 0 and all monitors. For the other seeds, the monitors of torque are run on the
same motion with that seed's noise, in the drives' units, as in a run with that seed
(`tests/unit/benchmarks/test_benchmark_false_alarms.py` compares the two). Positions are the same for all seeds.

"Exactly zero while it moves" is too rare to be counted: its chance is computed from the noise and the counts of the
drives, as the sum over all cycles of the chance that every effort is rounded to zero until the axis has turned far.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from itertools import product
from math import sqrt

import numpy as np
from scipy.special import ndtr

from armload_controller.config.robot import Robot, load_robot
from armload_controller.control_errors import ControlError, MotionError
from armload_controller.cycle.feedback_truth import IDLE_RAD
from armload_controller.cycle.plugins import CycleStep
from armload_controller.cycle.slow_round_torque import SlowRoundRows
from armload_controller.motion.checked_path import check_path
from armload_controller.session.run_session import feedback_truth, no_operator, run_session, torque_window
from armload_controller.session.session_load import SessionLoad
from armload_drivers.cia402.arm_settings import EffortFeedback
from armload_drivers.cia402.process_data.drive_units import ArmUnits
from armload_drivers.servos import JointFeedback, JointServos
from armload_drivers.simulation.mujoco_plant import NOISE_CYCLE_S, ArmPlant, PlantSample
from armload_drivers.simulation.plant_spec import PlantSpec
from armload_identification.excitation.fourier import Excitation
from armload_identification.float_array import FloatArray
from benchmarks.arms.setups import Twin, twin_spec
from benchmarks.arms.trials import workers
from tests.fake_servos import FakeServos

ROBOTS = ("er50", "prbt")
SEEDS = 20


class RememberingPlant(ArmPlant):
    """An arm that records its measured torques without noise."""

    def __init__(self, spec: PlantSpec) -> None:
        super().__init__(replace(spec, joints=tuple(replace(j, torque_noise_nm=0.0) for j in spec.joints)))
        self.noise_nm = np.array([joint.torque_noise_nm for joint in spec.joints])
        self.torque_nm: list[FloatArray] = []
        self._seeded = np.random.default_rng(spec.seed)

    def sample(self, cycle_s: float) -> PlantSample:
        """Measure, record, and add the noise."""
        sample = super().sample(cycle_s)
        self.torque_nm.append(sample.axis_torque_nm)
        noise = self.noise_nm * (sqrt(NOISE_CYCLE_S / cycle_s) * self._seeded.standard_normal(self.n))
        return replace(sample, axis_torque_nm=sample.axis_torque_nm + noise)


@dataclass(frozen=True, eq=False)
class Motion:
    """Input of the monitors in one run, and the index of the plant's sample for each feedback."""

    role: str
    steps: list[CycleStep] = field(default_factory=list)
    samples: list[int] = field(default_factory=list)


class Witness:
    """Plug-in that records a run."""

    name = "witness"

    def __init__(self, motion: Motion, plant: RememberingPlant) -> None:
        self._motion, self._plant = motion, plant

    def on_cycle(self, step: CycleStep) -> None:
        """Record one cycle."""
        self._motion.steps.append(step)
        self._motion.samples.append(len(self._plant.torque_nm) - 1)


def run() -> None:
    """Print the stopped runs."""
    print(f"False alarms in commissionings (four runs each, slow rounds included), {SEEDS} seeds")
    with workers() as pool:
        found = _found(pool)
    for (name, twin), (stops, took_s, chance) in found.items():
        print(
            f"  {name:6s} {twin:12s} {4 * SEEDS} runs, {len(stops)} stopped; exactly zero while it moves: in at most "
            f"{chance:.0e} of runs  ({took_s:.0f} s)"
        )
        for stop in stops:
            print(f"    {stop}")


def _found(pool: Executor) -> dict[tuple[str, Twin], tuple[list[str], float, float]]:
    """Stopped runs, computing time and the greatest chance of an idling alarm in a run, by arm and plant."""
    kinds = list(product(ROBOTS, (Twin.NORMATIVE, Twin.HARSH)))
    jobs = {kind: [pool.submit(_half, *kind, load) for load in SessionLoad] for kind in kinds}
    return {
        kind: (
            [stop for job in halves for stop in job.result()[0]],
            sum(job.result()[1] for job in halves),
            max(job.result()[2] for job in halves),
        )
        for kind, halves in jobs.items()
    }


def _half(name: str, twin: Twin, load: SessionLoad) -> tuple[list[str], float, float]:
    """Stopped runs of one half with any seed, the computing time in s, and the chance of an idling alarm."""
    begun_s = time.process_time()
    robot = load_robot(name)
    payload = robot.simulation.plant_spec(robot.simulation.payload_name).payload if load is SessionLoad.LOADED else None
    excitations = {role: Excitation(found.trajectory, 1) for role, found in robot.excitations.items()}
    spec = twin_spec(robot, twin, payload)
    motions, plant, stops = moved(robot, load, replace(spec, seed=seed_of(0, load)), excitations)
    for seed in range(1, SEEDS):
        for motion, feedbacks in zip(motions, replayed(robot, plant, motions, seed_of(seed, load)), strict=True):
            try:
                judge(robot, load, motion, feedbacks)
            except ControlError as error:
                stops.append(f"seed {seed}, {load}, {motion.role}: {error}")
    chance = max((idling_chance(robot, plant, motion) for motion in motions), default=0.0)
    return stops, time.process_time() - begun_s, chance


def idling_chance(robot: Robot, plant: RememberingPlant, motion: Motion) -> float:
    """Upper bound of the chance that a run is stopped because a moving motor seems to draw nothing.

    Args:
        robot: The arm.
        plant: Its plant, after the run.
        motion: The run.
    """
    units, to_axes = ArmUnits(robot.drives.settings), np.linalg.inv(robot.drives.coupling)
    torque = np.array(plant.torque_nm)[motion.samples]
    noise = plant.noise_nm * sqrt(NOISE_CYCLE_S * robot.bus.cycle_hz)
    half_count = 0.5 / np.abs([axis.effort_units_per_nm for axis in units.axes])
    edges = ((half_count - torque) / noise, (-half_count - torque) / noise)
    zero = np.log(np.maximum(ndtr(edges[0]) - ndtr(edges[1]), 1e-300)).cumsum(axis=0)
    position = np.array([to_axes @ step.feedback.position_rad for step in motion.steps])
    return sum(_chance_of_a_stretch(position[:, axis], zero[:, axis]) for axis in range(plant.n))


def _chance_of_a_stretch(position: FloatArray, zero: FloatArray) -> float:
    """Sum over all samples i of the chance that all later ones are zero until the axis has turned by `IDLE_RAD`.

    Args:
        position: (N,) positions of the axis.
        zero: (N,) cumulative sum of the logarithm of the chance that a sample is zero.
    """
    total = 0.0
    for i in range(len(position)):
        far = np.abs(position[i : i + 4000] - position[i]) > IDLE_RAD
        if far.any():
            total += float(np.exp(zero[i + int(far.argmax())] - zero[i]))
    return total


def seed_of(seed: int, load: SessionLoad) -> int:
    """The plant's seed in one half of a commissioning."""
    return 1000 * seed + (load is SessionLoad.LOADED)


def moved(
    robot: Robot, load: SessionLoad, spec: PlantSpec, excitations: dict[str, Excitation]
) -> tuple[list[Motion], RememberingPlant, list[str]]:
    """Run one half with all its monitors.

    Args:
        robot: The arm.
        load: Whether the payload is mounted.
        spec: Its plant.
        excitations: By role, one period each.

    Returns:
        Input of the monitors, the plant, and the stopped runs.
    """
    plant, cycle_s = RememberingPlant(spec), 1 / robot.bus.cycle_hz
    motions, stops = [], []

    @contextmanager
    def opened(load: SessionLoad) -> Iterator[JointServos]:
        servos = FakeServos(robot.drives.settings, plant)
        try:
            yield servos
        finally:
            servos.close()

    with run_session(robot, load, opened, no_operator()) as session:
        for role, excitation in excitations.items():
            path = check_path(excitation, robot.motion_constraints, cycle_s, file=robot.file, key=f"excitation.{role}")
            motion = Motion(role)
            try:
                session.run(path, role, plugins=[Witness(motion, plant)])
            except MotionError as error:
                stops.append(f"seed 0, {load}, {role}: {error}")
                break
            motions.append(motion)
    return motions, plant, stops


def replayed(robot: Robot, plant: RememberingPlant, motions: list[Motion], seed: int) -> list[list[JointFeedback]]:
    """The feedback of every run with another seed."""
    units = ArmUnits(robot.drives.settings)
    clean_nm = np.array(plant.torque_nm)
    size = plant.noise_nm * sqrt(NOISE_CYCLE_S * robot.bus.cycle_hz)
    noisy_nm = clean_nm + size * np.random.default_rng(seed).standard_normal(clean_nm.shape)
    still = np.zeros(plant.n)

    def reported(feedback: JointFeedback, sample: int) -> JointFeedback:
        effort = units.measured(still, noisy_nm[sample]).effort
        if units.feedback is EffortFeedback.CURRENT:
            return feedback._replace(current_a=units.motor_current_a(effort))
        return feedback._replace(torque_nm=units.joint_torque_nm(effort))

    return [
        [reported(step.feedback, sample) for step, sample in zip(motion.steps, motion.samples, strict=True)]
        for motion in motions
    ]


def judge(robot: Robot, load: SessionLoad, motion: Motion, feedbacks: list[JointFeedback]) -> None:
    """Run the monitors of torque on a recorded run.

    Raises:
        ControlError: one of them stops the run.
    """
    cycle_s = 1 / robot.bus.cycle_hz
    rows = SlowRoundRows(cycle_s)
    monitors = (feedback_truth(robot, cycle_s), torque_window(robot, load, cycle_s), rows)
    begun = 0
    for step, feedback in zip(motion.steps, feedbacks, strict=True):
        begun += step.sent is None
        if step.sent is None and begun == 2:  # the slow round is over
            found = rows.fitted(robot.joint_names, robot.chain, robot.drives.transmission)
            if found is not None and (doubts := found.doubts(robot.limits.torque_max_nm)):
                raise ControlError("; ".join(doubts))
        seen = replace(step, feedback=feedback)
        for monitor in monitors:
            monitor.on_cycle(seen)


if __name__ == "__main__":
    run()
