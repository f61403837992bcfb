"""Every fault during motion of the simulated er50: time to detection, and distance to standstill.

All six joints are at half their speed limits when the fault occurs, with the normative plant; lockstep, so that every
run gives the same figures. After the error the arm is stopped as in `stop_decisions.py`: quick stop, then torque off at
standstill. For a lost master, SYNC continues from another source and only the drives themselves can stop.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, replace

import can
import numpy as np

from armload_controller.config.robot import load_robot
from armload_drivers.canopen.canopen_servos import CanopenServos
from armload_drivers.cia402 import object_dictionary as od
from armload_drivers.driver_errors import DriverError
from armload_drivers.servos import JointCommand
from armload_drivers.simulation.drives.drives_on_bus import SimulatedDrives
from armload_drivers.simulation.lockstep_bus import LockstepBus, LockstepWire
from armload_drivers.simulation.lockstep_sync import LockstepSync
from armload_drivers.simulation.mujoco_plant import ArmPlant, PlantSample
from armload_drivers.simulation.plant_spec import PlantSpec
from armload_drivers.simulation.virtual_clock import VirtualClock

ROBOT = "er50"
SPEED_SHARE = 0.5
AMPLITUDE_RAD = 0.25
STANDSTILL_RAD_S = 0.01
WATCHED_S = 1.0
WATCHED_CYCLES = 600
NODE = 3


class _Watched(ArmPlant):
    """A plant that records its joint positions at every SYNC."""

    def __init__(self, spec: PlantSpec, coupling: np.ndarray) -> None:
        super().__init__(spec)
        self._joint_from_axis = coupling
        self.track: list[tuple[float, np.ndarray, np.ndarray]] = []

    def sample(self, cycle_s: float) -> PlantSample:
        """Measure and record."""
        sample = super().sample(cycle_s)
        joints = self._joint_from_axis @ sample.axis_position_rad
        self.track.append((self.time_s, joints, self._joint_from_axis @ sample.axis_velocity_rad_s))
        return sample


class _Arm:
    """Master, drives, plant and a third party, in motion."""

    def __init__(self, stack: ExitStack) -> None:
        robot = load_robot(ROBOT)
        self.settings = replace(robot.drives.settings, cycle_s=0.004)
        self.speed_rad_s = SPEED_SHARE * robot.limits.motion.velocity_max_rad_s
        self.plant = _Watched(robot.simulation.plant_spec(robot.simulation.payload_name), self.settings.coupling)
        self.clock, wire = VirtualClock(), LockstepWire()
        bus, drives_bus, self.other = (stack.enter_context(LockstepBus(wire)) for _ in range(3))
        self.drives = stack.enter_context(SimulatedDrives(self.settings, self.plant, drives_bus, self.clock))
        self.servos = CanopenServos(self.settings, bus, LockstepSync(self.clock))
        self.servos.connect()
        self.start = self.servos.enable().position_rad
        self.cycle = 0

    def step(self) -> None:
        """One cycle of an oscillation of every joint, which is fastest after a quarter of its period."""
        self.cycle += 1
        phase = self.cycle * self.settings.cycle_s * self.speed_rad_s / AMPLITUDE_RAD
        target = self.start + AMPLITUDE_RAD * (1 - np.cos(phase))
        self.servos.exchange(JointCommand(target, np.zeros(len(target)), np.zeros(len(target))))

    def to_full_speed(self) -> None:
        """Continue until the slowest joint has its greatest speed."""
        longest_s = math.pi / 2 * AMPLITUDE_RAD / self.speed_rad_s.min()
        for _ in range(round(longest_s / self.settings.cycle_s)):
            self.step()

    def send(self, cob_id: int, data: str, **kind: bool) -> None:
        """The third party sends a frame."""
        self.other.send(can.Message(arbitration_id=cob_id, data=bytes.fromhex(data), is_extended_id=False, **kind))

    def without_master(self, seconds: float) -> None:
        """Let time pass with SYNC from another source."""
        for _ in range(round(seconds / self.settings.cycle_s)):
            self.clock.advance(self.settings.cycle_s)
            self.send(0x080, "")
            while self.other.recv(0.002) is not None:
                pass


@dataclass(frozen=True)
class _Fault:
    name: str
    inject: Callable[[_Arm], object]
    alone: bool = False
    """The drives must stop by themselves: the master is dead, or its bus controller no longer sends."""


def _reboot(arm: _Arm) -> None:
    arm.drives.switch_off(NODE)
    arm.drives.switch_on(NODE)


FAULTS = (
    _Fault("drive fault (EMCY 0x2310)", lambda arm: arm.drives.fail(NODE, 0x2310)),
    _Fault("following error (6065)", lambda arm: arm.drives.set_object(NODE, od.FOLLOWING_ERROR_WINDOW, 1)),
    _Fault("heartbeat of one drive lost", lambda arm: arm.drives.set_object(NODE, od.HEARTBEAT_PRODUCER_MS, 0)),
    _Fault("supply of one drive lost", lambda arm: arm.drives.switch_off(NODE)),
    _Fault("one drive reboots", _reboot),
    _Fault("feedback missing once", lambda arm: arm.drives.drop_feedback(NODE, 1)),
    _Fault("feedback missing three times", lambda arm: arm.drives.drop_feedback(NODE, 3)),
    _Fault("feedback missing for good", lambda arm: arm.drives.drop_feedback(NODE, 100_000)),
    _Fault("quick stop by the operator", lambda arm: arm.servos.stop()),
    _Fault("second master: NMT stop to all", lambda arm: arm.send(0x000, "0200")),
    _Fault("second master: writes 6065", lambda arm: arm.send(0x603, "2365600001000000")),
    _Fault("60C2 changed by another cable", lambda arm: arm.drives.set_object(NODE, od.INTERPOLATION_TIME, 100)),
    _Fault("second master: SYNC", lambda arm: arm.send(0x080, "")),
    _Fault("second master's heartbeat", lambda arm: arm.send(0x77F, "05")),
    _Fault("controller error passive", lambda arm: arm.send(0x04, "0020000000000000", is_error_frame=True)),
    _Fault("controller bus-off", lambda arm: arm.send(0x40, "0000000000000000", is_error_frame=True), alone=True),
    _Fault("master killed or stopped", lambda arm: None, alone=True),
)


def run() -> None:
    """Print the table."""
    print(f"Faults in motion, {ROBOT}, six joints at {SPEED_SHARE:.0%} of their speed limits, 250 Hz, with payload")
    print(f"{'fault':<34}{'noticed ms':>11}{'standstill ms':>15}{'travel deg':>12}   end state")
    for fault in FAULTS:
        with ExitStack() as stack:
            print(_row(fault, _Arm(stack)))


def _row(fault: _Fault, arm: _Arm) -> str:
    """One line of the table."""
    arm.to_full_speed()
    begun_s, at = arm.plant.track[-1][0], len(arm.plant.track) - 1
    error: DriverError | None = None
    try:
        fault.inject(arm)
        for _ in range(0 if fault.name.startswith("master") else WATCHED_CYCLES):
            arm.step()
    except DriverError as raised:
        error = raised
    noticed_s = arm.clock() - begun_s
    if error is None and not fault.alone:
        _end(arm)
        return f"{fault.name:<34}{'-':>11}{'-':>15}{'-':>9}   goes on, counted"
    if not fault.alone:
        _end(arm)
    arm.without_master(WATCHED_S)
    if fault.alone:
        _end(arm)
    standstill_s, way_rad = _stop(arm.plant.track[at:])
    noticed = "-" if fault.name.startswith(("master", "quick")) else f"{abs(noticed_s) * 1e3:.0f}"
    end = "stands, the drives hold by themselves" if fault.alone else "stands, brakes on, no torque"
    return f"{fault.name:<34}{noticed:>11}{standstill_s * 1e3:15.0f}{math.degrees(way_rad):9.2f}   {end}"


def _end(arm: _Arm) -> None:
    """The actions of `stop_decisions.py` after an error."""
    for action in (arm.servos.stop, arm.servos.disable, arm.servos.close):
        try:
            action()
        except DriverError:
            continue


def _stop(track: list[tuple[float, np.ndarray, np.ndarray]]) -> tuple[float, float]:
    """Time until all joints stand still, and the longest travel of a joint in rad."""
    times = np.array([time_s for time_s, _, _ in track])
    joints = np.array([position for _, position, _ in track])
    speeds = np.abs(np.array([velocity for _, _, velocity in track])).max(axis=1)
    moving = np.flatnonzero(speeds > STANDSTILL_RAD_S)
    last = moving[-1] if len(moving) else 0
    return float(times[last] - times[0]), float(np.abs(joints - joints[0]).max())
