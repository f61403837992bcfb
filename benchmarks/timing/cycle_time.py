"""Time of one cycle of six joints, part by part, compared with the same cycle with canopen's PDO objects.

Master and simulated drives share a process and a bus in lockstep. CPU time is the master's own: the time that the
drives take to process its frames is measured at their end of the bus and subtracted, with what that measuring takes: on
some machines the clock of a thread's CPU time needs 0.7 us, a dozen times a cycle. Wall time includes it, with an
ideal plant. The last row is a complete simulated cycle, drives and MuJoCo included, as in `armload commission`.
"""

from __future__ import annotations

import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from statistics import median

import can
import canopen
import numpy as np
from canopen.objectdictionary import ODRecord, ODVariable, datatypes

from armload_controller.config.robot import load_robot
from armload_controller.cycle.realtime import SWITCH_INTERVAL_S
from armload_controller.cycle.run_recorder import Recorder
from armload_controller.motion.joint_limits import check_setpoints
from armload_controller.motion.phase import Segment
from armload_controller.motion.setpoints import RuckigFollower
from armload_controller.session.arm_access import simulated_arm
from armload_controller.session.session_load import SessionLoad
from armload_drivers.canopen.canopen_servos import CanopenServos
from armload_drivers.servos import JointCommand
from armload_drivers.simulation.drives.drives_on_bus import SimulatedDrives
from armload_drivers.simulation.lockstep_bus import Listener, LockstepBus, LockstepWire
from armload_drivers.simulation.lockstep_sync import LockstepSync
from armload_drivers.simulation.virtual_clock import VirtualClock
from tests.ideal_plant import IdealPlant

ROBOT = "er50"
QUIET_CYCLES, BUSY_CYCLES, WARM_UP = 1500, 300, 50
PARTS = ("Ruckig", "limits", "servos", "recorder")
LIMIT_US = 400


def run() -> None:
    """Print the table, without and with a busy second thread."""
    print(f"One cycle of six joints ({ROBOT}) in lockstep, medians in us; at most {LIMIT_US} us of own CPU time")
    print(f"{'':<34}{'CPU':>7}{'wall':>9}   " + "".join(f"{part:>10}" for part in PARTS))
    for label, busy, cycles in (("alone", False, QUIET_CYCLES), ("beside a busy thread", True, BUSY_CYCLES)):
        with _company() if busy else ExitStack():
            rows = _ours(cycles)
            cpu, wall = rows[:, :-1].sum(axis=1), rows[:, -1]
            parts = "".join(f"{median(column):10.0f}" for column in rows[:, :-1].T)
            print(f"{'armload, ' + label:<34}{median(cpu):7.0f}{median(wall):9.0f}   {parts}")
            cpu, wall = _theirs(cycles).T
            print(f"{'canopen PDO objects, ' + label:<34}{median(cpu):7.0f}{median(wall):9.0f}   (PDOs and SYNC alone)")
    print(f"{'simulated arm with drives and MuJoCo':<38}{median(_simulated(QUIET_CYCLES)):9.0f}   (CPU of the process)")
    print(
        f"Switch interval beside the busy thread: {SWITCH_INTERVAL_S * 1e3:g} ms, as the program sets it for its cycle."
    )


@contextmanager
def _company() -> Iterator[None]:
    """A second Python thread that is always busy."""
    stop = threading.Event()

    def spin() -> None:
        count = 0
        while not stop.is_set():
            count += 1

    before = sys.getswitchinterval()
    sys.setswitchinterval(SWITCH_INTERVAL_S)
    thread = threading.Thread(target=spin)
    thread.start()
    try:
        yield
    finally:
        stop.set()
        thread.join()
        sys.setswitchinterval(before)


def _clock_ns(readings: int = 1000) -> int:
    """Time that one reading of the thread's clock takes."""
    begun = time.thread_time_ns()
    for _ in range(readings):
        time.thread_time_ns()
    return (time.thread_time_ns() - begun) // (readings + 1)


class _TimedBus(LockstepBus):
    """The drives' end of a bus, which measures their processing time."""

    def __init__(self, wire: LockstepWire) -> None:
        self._spent_ns, self._clock_ns = 0, _clock_ns()
        super().__init__(wire)

    def listen(self, listener: Listener | None) -> None:
        """As `LockstepBus`, with measurement of time."""
        if listener is None:
            super().listen(None)
            return

        def timed(message: can.Message) -> None:
            begun = time.thread_time_ns()
            listener(message)
            # of both readings together, as long as one takes is outside
            self._spent_ns += time.thread_time_ns() - begun + self._clock_ns

        super().listen(timed)

    def take_spent_ns(self) -> int:
        """Time spent since the last call."""
        spent, self._spent_ns = self._spent_ns, 0
        return spent


def _simulated(cycles: int) -> np.ndarray:
    """(cycles,) CPU time of complete cycles with the simulated arm, us."""
    robot = load_robot(ROBOT)
    zero, rows = np.zeros(robot.n), np.zeros(cycles)
    with simulated_arm(robot, SessionLoad.LOADED) as servos:
        servos.connect()
        start = servos.enable().position_rad
        for cycle in range(-WARM_UP, cycles):
            begun = time.process_time_ns()
            servos.exchange(JointCommand(start + 0.05 * np.sin(0.01 * (cycle + WARM_UP)), zero, zero))
            if cycle >= 0:
                rows[cycle] = time.process_time_ns() - begun
    return rows * 1e-3


def _ours(cycles: int) -> np.ndarray:
    """(cycles, 5) CPU time of each part and wall time of the cycle, us."""
    robot = load_robot(ROBOT)
    arm, limits, clock = robot.drives.settings, robot.limits.motion, VirtualClock()
    plant, wire = IdealPlant(np.zeros(robot.n)), LockstepWire()
    zero, rows = np.zeros(robot.n), np.zeros((cycles, len(PARTS) + 1))
    with ExitStack() as stack:
        bus, drives_bus = stack.enter_context(LockstepBus(wire)), stack.enter_context(_TimedBus(wire))
        stack.enter_context(SimulatedDrives(arm, plant, drives_bus, clock))
        recorder = Recorder(Path(stack.enter_context(tempfile.TemporaryDirectory())) / "cycle.mcap", {})
        stack.enter_context(recorder)
        servos = CanopenServos(arm, bus, LockstepSync(clock))
        servos.connect()
        start = servos.enable().position_rad
        follower = RuckigFollower(start, limits, servos.cycle_s)
        now = time.thread_time_ns
        for cycle in range(-WARM_UP, cycles):
            phase = (cycle + WARM_UP) * servos.cycle_s
            target = start + 0.05 * (1 - np.cos(phase))
            velocity, acceleration = np.full(robot.n, 0.05 * np.sin(phase)), np.full(robot.n, 0.05 * np.cos(phase))
            begun = time.perf_counter_ns()
            t0 = now()
            position, speed, change = follower.follow(target, velocity, acceleration)
            t1 = now()
            check_setpoints(position, speed, change, limits)
            t2 = now()
            command = JointCommand(position, speed, zero)
            feedback = servos.exchange(command)
            t3 = now()
            drives = drives_bus.take_spent_ns()
            recorder.write(feedback, command, Segment.PERIODS, phase)
            t4 = now()
            if cycle >= 0:
                rows[cycle] = (t1 - t0, t2 - t1, t3 - t2 - drives, t4 - t3, time.perf_counter_ns() - begun)
        servos.close()
    return rows * 1e-3


def _description() -> canopen.ObjectDictionary:
    """The part of a device description that canopen requires."""
    od = canopen.ObjectDictionary()

    def variable(index: int, subindex: int, kind: int) -> ODVariable:
        entry = ODVariable(f"{index:04X}:{subindex}", index, subindex)
        entry.data_type, entry.access_type, entry.pdo_mappable = kind, "rw", index >= 0x6000
        return entry

    signed, word, byte, double = datatypes.INTEGER16, datatypes.UNSIGNED16, datatypes.UNSIGNED8, datatypes.UNSIGNED32
    for index, kind in (
        (0x6040, word), (0x6041, word), (0x6060, datatypes.INTEGER8), (0x6064, datatypes.INTEGER32),
        (0x6078, signed), (0x607A, datatypes.INTEGER32), (0x60B2, signed),
    ):  # fmt: skip
        od.add_object(variable(index, 0, kind))
    for base in (0x1400, 0x1800, 0x1600, 0x1A00):
        entry = ODRecord(f"{base:04X}", base)
        kinds = {0: byte, 1: double, 2: byte, 3: word, 5: word} if base & 0x200 == 0 else {0: byte}
        kinds |= dict.fromkeys(range(1, 9), double) if base & 0x200 else {}
        for subindex, kind in kinds.items():
            entry.add_member(variable(base, subindex, kind))
        od.add_object(entry)
    return od


def _theirs(cycles: int) -> np.ndarray:
    """(cycles, 2) canopen's CPU time and wall time, us: setpoints set and sent, SYNC, feedback decoded."""
    robot = load_robot(ROBOT)
    arm, clock = robot.drives.settings, VirtualClock()
    plant, wire = IdealPlant(np.zeros(robot.n)), LockstepWire()
    rows = np.zeros((cycles, 2))
    with ExitStack() as stack:
        bus, drives_bus = stack.enter_context(LockstepBus(wire)), stack.enter_context(_TimedBus(wire))
        stack.enter_context(SimulatedDrives(arm, plant, drives_bus, clock))
        network = canopen.Network(bus)
        bus.listen(lambda message: network.notify(message.arbitration_id, message.data, message.timestamp))
        nodes = [network.add_node(drive.node_id, _description()) for drive in arm.drives]
        pairs = [_mapped(node) for node in nodes]
        for node in nodes:
            node.nmt.send_command(1)
        for cycle in range(-WARM_UP, cycles):
            begun, used = time.perf_counter_ns(), time.thread_time_ns()
            for setpoints, _ in pairs:
                setpoints[0x6040].raw = 0x06
                setpoints[0x607A].raw = cycle
                setpoints[0x60B2].raw = 0
                setpoints.transmit()
            clock.advance(arm.cycle_s)
            network.sync.transmit()
            for _, feedback in pairs:
                _ = feedback[0x6041].raw, feedback[0x6064].raw, feedback[0x6078].raw
            if cycle >= 0:
                rows[cycle] = (
                    time.thread_time_ns() - used - drives_bus.take_spent_ns(),
                    time.perf_counter_ns() - begun,
                )
            else:
                drives_bus.take_spent_ns()
    return rows * 1e-3


def _mapped(node: canopen.RemoteNode) -> tuple[canopen.pdo.PdoMap, canopen.pdo.PdoMap]:
    """RPDO and TPDO of a node, mapped as armload maps them."""
    node.tpdo.read()
    node.rpdo.read()
    setpoints, feedback = node.rpdo[1], node.tpdo[1]
    for pdo, objects in ((setpoints, (0x6040, 0x607A, 0x60B2)), (feedback, (0x6041, 0x6064, 0x6078))):
        pdo.clear()
        for index in objects:
            pdo.add_variable(index)
        pdo.trans_type, pdo.enabled = 1, True
        pdo.save()
    return setpoints, feedback


if __name__ == "__main__":
    run()
