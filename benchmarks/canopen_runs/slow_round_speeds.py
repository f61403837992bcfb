"""Commissionings on fakes in virtual time: the speed of slow rounds and approaches.

Speeds are those of the setpoints as sent and of the measured positions, from differences of the tool centre point's
positions by forward kinematics.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

import numpy as np

from armload_controller.config.robot import Robot, load_robot
from armload_controller.cycle.plugins import CycleStep
from armload_controller.motion.checked_path import CheckedPath, check_path
from armload_controller.motion.phase import Segment
from armload_controller.session.run_session import ServosFactory, no_operator, run_session
from armload_controller.session.session_load import SessionLoad
from armload_drivers.servos import JointServos
from armload_drivers.simulation.mujoco_plant import ArmPlant
from armload_drivers.simulation.plant_spec import PlantSpec
from armload_identification.excitation.fourier import Excitation
from armload_identification.excitation.geometry.cartesian_speed import ArmPoints
from armload_identification.float_array import FloatArray
from benchmarks.arms.setups import Twin, twin_spec
from tests.fake_servos import FakeServos

ROBOTS = ("er50", "prbt")
TOOLS_M = (0.0, 0.2)
REDUCED_M_S = 0.25
MEASURED_OVER_S = 0.04
"""Measured speeds are averages over this time, as encoders have noise."""


class Places:
    """Plug-in that records commanded and measured positions by segment."""

    name = "places"

    def __init__(self) -> None:
        self.sent: dict[Segment, list[FloatArray]] = {Segment.APPROACH: [], Segment.SLOW: []}
        self.measured: dict[Segment, list[FloatArray]] = {Segment.APPROACH: [], Segment.SLOW: []}

    def on_cycle(self, step: CycleStep) -> None:
        """Record one cycle."""
        reference = step.sent_reference
        if step.sent is not None and reference is not None and reference.segment in self.sent:
            self.sent[reference.segment].append(step.sent.position_rad)
            self.measured[reference.segment].append(step.feedback.position_rad)


def run() -> None:
    """Print speeds."""
    print(
        "Highest speed of the tool centre point, m/s: sent and measured; 0.25 is the limit (one period at full speed)"
    )
    print(f"  {'arm':6s} {'tool':>6s} {'path':>15s} {'approach':>17s} {'slow round':>17s} {'slow round lasts':>17s}")
    for name in ROBOTS:
        for tool_m in TOOLS_M:
            _print_speeds(load_robot(name), tool_m)


def _print_speeds(robot: Robot, tool_m: float) -> None:
    """The speeds of one arm with one tool."""
    points = replace(robot.controlled_points, tool_m=np.array([0.0, 0.0, tool_m]))
    cycle_s = 1 / robot.bus.cycle_hz
    for role in robot.excitations:
        path = _path(robot, role, points)
        places = Places()
        spec = twin_spec(robot, Twin.NORMATIVE, robot.simulation.plant_spec(robot.simulation.payload_name).payload)
        with run_session(robot, SessionLoad.LOADED, _opener(robot, spec), no_operator()) as session:
            session.run(path, role, plugins=[places])
        over = round(MEASURED_OVER_S / cycle_s)
        sent, measured = (
            [_fastest(robot, tool_m, kept[segment], cycle_s, apart) for segment in (Segment.APPROACH, Segment.SLOW)]
            for kept, apart in ((places.sent, 1), (places.measured, over))
        )
        judged = "" if max(sent) <= REDUCED_M_S else "  TOO FAST"
        print(
            f"  {robot.name:6s} {tool_m:4.1f} m {role:>15s} {sent[0]:8.3f} {measured[0]:8.3f} {sent[1]:8.3f} "
            f"{measured[1]:8.3f} {path.slow_round_s:15.1f} s{judged}"
        )


def _path(robot: Robot, role: str, points: ArmPoints) -> CheckedPath:
    """One period of an excitation, checked."""
    excitation = Excitation(robot.excitations[role].trajectory, 1)
    constraints = replace(robot.motion_constraints, points=points)
    return check_path(excitation, constraints, 1 / robot.bus.cycle_hz, file=robot.file, key=f"excitation.{role}")


def _opener(robot: Robot, spec: PlantSpec) -> ServosFactory:
    """Opens fakes on a plant."""

    @contextmanager
    def opened(load: SessionLoad) -> Iterator[JointServos]:
        servos = FakeServos(robot.drives.settings, ArmPlant(spec))
        try:
            yield servos
        finally:
            servos.close()

    return opened


def _fastest(robot: Robot, tool_m: float, positions: list[FloatArray], cycle_s: float, apart: int) -> float:
    """Greatest speed of the tool centre point between positions `apart` cycles apart."""
    poses = [robot.chain.forward(position)[-1] for position in positions]
    places = np.array([pose[:3, :3] @ [0.0, 0.0, tool_m] + pose[:3, 3] for pose in poses])
    moved = np.linalg.norm(places[apart:] - places[:-apart], axis=1)
    return float(moved.max() / (apart * cycle_s))


if __name__ == "__main__":
    run()
