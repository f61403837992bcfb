"""Which small faults of feedback are found, and when: prints `controller/FOUND.md`.

Positions: in the first period at full speed an axis's position is wrong by a step or a drift, either as it is reported
on the bus, while the drive's own loops use the right one, or inside the drive's loops. All monitors of a session watch,
over CANopen in lockstep. Torques: the reports of a run with its slow round are scaled, reversed or displaced, as a
wrong torque constant, sign or zero would, and shown to the monitors of torque.
"""

from __future__ import annotations

import math
from contextlib import ExitStack
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from armload_controller.config.robot import Robot, load_robot
from armload_controller.control_errors import ControlError
from armload_controller.cycle.feedback_truth import TorqueMissing, TorqueReversed
from armload_controller.cycle.plugins import CycleStep
from armload_controller.cycle.torque_monitor import TorqueError, measured_torque
from armload_controller.session.session_load import SessionLoad
from armload_drivers.servos import JointFeedback
from armload_drivers.simulation.drives.drives_on_bus import SimulatedDrives
from armload_drivers.simulation.lockstep_bus import LockstepBus, LockstepWire
from armload_drivers.simulation.lockstep_sync import LockstepSync
from armload_drivers.simulation.mujoco_plant import PlantSample
from armload_drivers.simulation.plant_interface import EncoderFault
from armload_drivers.simulation.virtual_clock import VirtualClock
from armload_identification.excitation.fourier import Excitation
from benchmarks.arms.setups import Twin, twin_spec
from benchmarks.arms.trials import workers
from benchmarks.canopen_runs.broken_loops import (
    LEGS,
    ROBOTS,
    TimedServos,
    TrackedPlant,
    arm_and_path,
    loaded_spec,
    moved,
)
from benchmarks.canopen_runs.false_alarms import Motion, judge
from benchmarks.canopen_runs.false_alarms import moved as moved_half

NONE = "none"
POSITION_FAULTS = {
    NONE: EncoderFault(),
    "position +5 mrad": EncoderFault(jump_rad=0.005),
    "drift 5 mrad/s": EncoderFault(drift_rad_s=0.005),
    "drift 20 mrad/s": EncoderFault(drift_rad_s=0.020),
}
PLACES = ("on the bus", "inside the loop")
TORQUE_FAULTS = {
    "torque x 0.33": (0.33, 0.0),
    "torque x 3": (3.0, 0.0),
    "torque reversed": (-1.0, 0.0),
    "zero off by a fifth of the limit": (1.0, 0.2),
}
AT_S = 4.0
"""The positions are wrong from this time on."""


class LyingPlant(TrackedPlant):
    """A plant whose reported position can be wrong, while its loops use the right one."""

    lie: tuple[int, EncoderFault, float] | None = None

    def sample(self, cycle_s: float) -> PlantSample:
        """Measure, and falsify."""
        sample = super().sample(cycle_s)
        if self.lie is None:
            return sample
        axis, fault, begun_s = self.lie
        position = sample.axis_position_rad.copy()
        position[axis] += fault.jump_rad + fault.drift_rad_s * (self.time_s - begun_s)
        return replace(sample, axis_position_rad=position)


@dataclass(frozen=True)
class Case:
    """A fault of a position.

    Attributes:
        robot: Name of a shipped robot.
        fault: One of `POSITION_FAULTS`.
        place: One of `PLACES`.
        joint: Index of the axis.
    """

    robot: str
    fault: str
    place: str
    joint: int


class Occurrence:
    """Plug-in that lets a fault occur, and measures how far the axis is from its target from then on."""

    name = "occurrence"

    def __init__(self, case: Case, plant: LyingPlant, drives: SimulatedDrives) -> None:
        self._case, self._plant, self._drives = case, plant, drives
        settings = arm_and_path(case.robot)[0].drives.settings
        self._to_axis = np.linalg.inv(settings.coupling)[case.joint]
        self._node_id = settings.drives[case.joint].node_id
        self.at_s = math.inf
        self.apart_rad = 0.0

    def on_cycle(self, step: CycleStep) -> None:
        """Wait for the time, then measure."""
        case, plant = self._case, self._plant
        if self.at_s < math.inf:
            apart = plant.true_rad()[case.joint] - self._to_axis @ step.command.position_rad
            self.apart_rad = max(self.apart_rad, abs(float(apart)))
        elif step.reference.state.phase_s >= AT_S:
            self.at_s = plant.time_s
            if case.place == PLACES[0]:
                plant.lie = case.joint, POSITION_FAULTS[case.fault], self.at_s
            else:
                self._drives.fail_encoder(self._node_id, POSITION_FAULTS[case.fault])


def run() -> None:
    """Print the page."""
    faults = [(NONE, PLACES[0]), *product(list(POSITION_FAULTS)[1:], PLACES)]
    cases = [Case(robot, *fault, joint) for robot, fault, joint in product(ROBOTS, faults, range(6))]
    with workers() as pool:
        torques = [pool.submit(torque_faults, robot, load) for robot, load in product(ROBOTS, SessionLoad)]
        found = dict(zip(cases, pool.map(position_fault, cases), strict=True))
        print(_HEAD)
        for robot in ROBOTS:
            path = arm_and_path(robot)[1]
            left_s = path.excitation.trajectory.period_s - AT_S
            print(f"### {robot}\n\nA fault is watched for {left_s:.0f} s, until the end of the period.\n")
            _print_table(
                [
                    (
                        NONE if fault == NONE else f"{fault}, {place}",
                        [found[Case(robot, fault, place, j)] for j in range(6)],
                    )
                    for fault, place in faults
                ]
            )
        print(_TORQUES)
        for (robot, load), job in zip(product(ROBOTS, SessionLoad), torques, strict=True):
            print(f"### {robot}, {load}\n")
            _print_table(job.result())


def _print_table(rows: list[tuple[str, list[str]]]) -> None:
    """A table with a column per joint."""
    print("| fault | " + " | ".join(f"joint {joint + 1}" for joint in range(6)) + " |")
    print("|---|" + "---|" * 6)
    for name, cells in rows:
        print(f"| {name} | " + " | ".join(cells) + " |")
    print()


def position_fault(case: Case) -> str:
    """When it was found, and how far the axis was from its target."""
    robot, path = arm_and_path(case.robot)
    with ExitStack() as stack:
        plant = LyingPlant(loaded_spec(robot, path))
        clock, wire = VirtualClock(), LockstepWire()
        bus, drives_bus = (stack.enter_context(LockstepBus(wire)) for _ in range(2))
        drives = stack.enter_context(SimulatedDrives(robot.drives.settings, plant, drives_bus, clock))
        servos = TimedServos(robot.drives.settings, bus, LockstepSync(clock))
        occurrence = Occurrence(case, plant, drives)
        message = moved(robot, path, LEGS[1], servos, [occurrence])
    apart = f"{occurrence.apart_rad * 1e3:.0f} mrad"
    return f"{servos.stopped_s - occurrence.at_s:.2f} s, {apart}" if message else f"no, {apart}"


def torque_faults(name: str, load: SessionLoad) -> list[tuple[str, list[str]]]:
    """A row per fault of a torque, a cell per joint."""
    robot = load_robot(name)
    payload = robot.simulation.plant_spec(robot.simulation.payload_name).payload if load is SessionLoad.LOADED else None
    one = {"identification": Excitation(robot.excitations["identification"].trajectory, 1)}
    (motion,), _, stops = moved_half(robot, load, twin_spec(robot, Twin.NORMATIVE, payload), one)
    if stops:
        raise RuntimeError(f"a fault-free run was stopped: {stops}")
    return [
        (fault, [_torque_fault(robot, load, motion, joint, *change) for joint in range(6)])
        for fault, change in TORQUE_FAULTS.items()
    ]


def _torque_fault(robot: Robot, load: SessionLoad, motion: Motion, joint: int, factor: float, zero: float) -> str:
    """What the monitors say of a falsified torque."""

    def falsified(feedback: JointFeedback) -> JointFeedback:
        factors, zeros_nm = np.ones(6), np.zeros(6)
        factors[joint], zeros_nm[joint] = factor, zero * robot.limits.torque_max_nm[joint]
        torque = measured_torque(feedback, robot.drives.transmission) * factors + zeros_nm
        if feedback.torque_nm is not None:
            return feedback._replace(torque_nm=torque)
        current = robot.drives.transmission.coupling.T @ torque / robot.drives.transmission.gain_nm_a
        return feedback._replace(current_a=current)

    try:
        judge(robot, load, motion, [falsified(step.feedback) for step in motion.steps])
    except TorqueError:
        return "stop: torque window"
    except (TorqueReversed, TorqueMissing):
        return "stop after the slow round"
    except ControlError as doubt:
        named = robot.joint_names[joint] in str(doubt).split(". Check")[0]
        return "asked" if named else "asked, another named"
    return "no"


_HEAD = """# What is found, and what is not

Made by `python -m benchmarks.canopen_runs.small_faults` on the simulated arms, loaded where nothing else is said. Large
faults (reversed, frozen, a motor turn) and how far they get are in `benchmarks/canopen_runs/broken_loops.py`.

## Positions

The position of one axis is wrong from a moment at full speed on: as reported on the bus, or inside the drive's own
loops. Each cell states when the arm was stopped, and the greatest distance of the axis from its target until then.
"no": the motion was completed; the distance is the greatest until its end. It includes the tracking error, which the
first row shows alone. A drift that is found at the end of the period looks like an axis that moves against its brake.
Nothing that compares positions with setpoints can see a drift inside the loop, because the drive follows what it
reads: a second encoder, or a mark on the joint, can. A position that is wrong on the bus only moves nothing.
"""
_TORQUES = """## Torques

The torque of one joint is wrong throughout a session, as a wrong torque constant, sign or zero makes it. "asked": after
the slow round the operator is warned and asked, before full speed. "no": nothing is noticed; gravity does not load the
joint enough to show it, as on vertical axes. A wrong scale then shows in the gains of a calibration with a weighed
payload.
"""


if __name__ == "__main__":
    run()
