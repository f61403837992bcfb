"""Stops of a sound arm: none may be taken for an axis that has lost its loop.

Each stop is of a random category, at a random phase of the slow round or of the path at full speed, loaded, over
CANopen in lockstep with all monitors: on the normative and the harsh plant, and with motors that have hardly more
torque than the path requires (`SPARE`), the drives' limit set accordingly.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace
from functools import cache
from itertools import product

import numpy as np

from armload_controller.control_errors import ControlError
from armload_controller.cycle.plugins import CycleStep
from armload_drivers.canopen.canopen_servos import CanopenServos
from armload_drivers.cia402.arm_settings import ArmSettings
from armload_drivers.driver_errors import BusError
from armload_drivers.simulation.drives.drives_on_bus import SimulatedDrives
from armload_drivers.simulation.lockstep_bus import LockstepBus, LockstepWire
from armload_drivers.simulation.lockstep_sync import LockstepSync
from armload_drivers.simulation.mujoco_plant import ArmPlant
from armload_drivers.simulation.plant_spec import PlantSpec
from armload_drivers.simulation.virtual_clock import VirtualClock
from armload_identification.float_array import FloatArray
from benchmarks.arms.setups import Twin, twin_spec
from benchmarks.arms.trials import workers
from benchmarks.canopen_runs.broken_loops import LEGS, ROBOTS, arm_and_path, moved

STOPS = 500
WAYS = ("along the path", "quick stop", "drive fault", "torque off")
LONGEST_S = 15.0
"""Greatest time from the begin of a leg to the stop."""
SPARE = 1.1
"""Torque of a torque-limited plant, as a share of what the path requires of the normative one."""


@dataclass(frozen=True)
class Stop:
    """One stop.

    Attributes:
        robot: Name of a shipped robot.
        twin: Its plant.
        limited: Whether its motors have hardly enough torque.
        leg: One of `LEGS`.
        way: One of `WAYS`.
        at: Share of the leg, or of `LONGEST_S`, at which the arm is stopped.
    """

    robot: str
    twin: Twin
    limited: bool
    leg: str
    way: str
    at: float


class Stopper:
    """Plug-in that stops the arm in a cycle."""

    name = "stopper"

    def __init__(self, stop: Stop, cycle: int, drives: SimulatedDrives, node_id: int) -> None:
        self._stop, self._left, self._drives, self._node_id = stop, cycle, drives, node_id

    def on_cycle(self, step: CycleStep) -> None:
        """Count, and stop the arm.

        Raises:
            OperatorStop: along the path.
            KeyboardInterrupt: quick stop.
            BusError: torque off.
        """
        self._left -= 1
        if self._left != 0:
            return
        if self._stop.way == "along the path":
            step.ask_to_stop("a light barrier")
        elif self._stop.way == "drive fault":
            self._drives.fail(self._node_id, 0x2310)
        elif self._stop.way == "torque off":
            raise OffBus
        else:
            raise KeyboardInterrupt


class OffBus(ControlError, BusError):
    """A bus error from a plug-in; the bus itself works."""


class PeakTorque:
    """Plug-in that keeps the greatest measured efforts."""

    name = "peak torque"

    def __init__(self, n: int) -> None:
        self.peak = np.zeros(n)

    def on_cycle(self, step: CycleStep) -> None:
        """Keep the greatest."""
        for effort in (step.feedback.current_a, step.feedback.torque_nm):
            if effort is not None:
                np.maximum(self.peak, np.abs(effort), out=self.peak)


def run(stops: int = STOPS) -> None:
    """Print the number of stops, and of those that escalated."""
    kinds = list(product(ROBOTS, (Twin.NORMATIVE, Twin.HARSH), (False, True), LEGS, WAYS))
    random = np.random.default_rng(0)
    cases = [Stop(*kinds[k % len(kinds)], at=float(random.random())) for k in range(stops)]
    print(f"{stops} stops of a sound arm at random phases")
    with workers() as pool:
        messages = list(pool.map(message_of, cases, chunksize=4))
    count: Counter[tuple[str, str]] = Counter()
    for case, message in zip(cases, messages, strict=True):
        escalated = "emergency stop" in message
        count[case.way, "escalated" if escalated else "ordinary" if "Motion stopped" in message else "ended"] += 1
        if escalated:
            print(f"  {case}: {message}")
    for (way, what), number in sorted(count.items()):
        print(f"  {way:16s} {what:10s} {number}")


def message_of(stop: Stop) -> str:
    """Stop the arm; the operator's message."""
    robot, path = arm_and_path(stop.robot)
    spec, settings = _limited(stop) if stop.limited else (_spec(stop), robot.drives.settings)
    leg = path.slow if stop.leg == LEGS[0] else path.measured
    lasts_s = min(LONGEST_S, (leg.leg.end_s - leg.leg.start_s) / leg.leg.rate)
    wire, clock = LockstepWire(), VirtualClock()
    with (
        LockstepBus(wire) as bus,
        LockstepBus(wire) as drives_bus,
        SimulatedDrives(settings, ArmPlant(spec), drives_bus, clock) as drives,
    ):
        cycle = 1 + round(stop.at * lasts_s / path.cycle_s)
        stopper = Stopper(stop, cycle, drives, settings.drives[cycle % robot.n].node_id)
        return moved(robot, path, stop.leg, CanopenServos(settings, bus, LockstepSync(clock)), [stopper])


def _spec(stop: Stop) -> PlantSpec:
    """The plant of a stop, loaded, at the start of the path."""
    robot, path = arm_and_path(stop.robot)
    spec = twin_spec(robot, stop.twin, robot.simulation.plant_spec(robot.simulation.payload_name).payload)
    return replace(spec, start_position_rad=path.start_rad)


def _limited(stop: Stop) -> tuple[PlantSpec, ArmSettings]:
    """The plant of a stop with motors that have hardly enough torque, and drives that limit it to that."""
    robot, _ = arm_and_path(stop.robot)
    spec, settings, share = _spec(stop), robot.drives.settings, _share_required(stop.robot)
    joints = tuple(replace(j, max_torque_nm=s * j.max_torque_nm) for j, s in zip(spec.joints, share, strict=True))
    drives = tuple(
        replace(d, max_torque_permille=round(s * d.max_torque_permille))
        for d, s in zip(settings.drives, share, strict=True)
    )
    return replace(spec, joints=joints), replace(settings, drives=drives)


@cache
def _share_required(name: str) -> FloatArray:
    """(n,) share of each motor's torque that the path at full speed requires, times `SPARE`, at most 1."""
    robot, path = arm_and_path(name)
    peak = PeakTorque(robot.n)
    wire, clock, settings = LockstepWire(), VirtualClock(), robot.drives.settings
    plant = ArmPlant(_spec(Stop(name, Twin.NORMATIVE, False, LEGS[1], WAYS[0], 1.0)))
    with LockstepBus(wire) as bus, LockstepBus(wire) as drives_bus, SimulatedDrives(settings, plant, drives_bus, clock):
        moved(robot, path, LEGS[1], CanopenServos(settings, bus, LockstepSync(clock)), [peak])
    rated = [drive.rated_current_a or drive.rated_torque_nm or 1.0 for drive in settings.drives]
    limit = np.array([r * d.max_torque_permille / 1000.0 for r, d in zip(rated, settings.drives, strict=True)])
    return np.asarray(np.minimum(SPARE * peak.peak / limit, 1.0))


if __name__ == "__main__":
    run()
