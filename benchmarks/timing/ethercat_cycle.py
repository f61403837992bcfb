"""CPU time of one cycle of six drives over EtherCAT, beside CANopen's in the same run.

    python -m tests.ethercat_drives er50 .venv/bin/python -m benchmarks.timing.ethercat_cycle

Both are paced alike, and the time of the whole process is counted from one cycle to the next. EtherCAT's frame passes
through the kernel to the drives of with-ethercat and back. CANopen's frames stay in this process, where the time of its
drives is subtracted; what they would cost in the kernel is measured on a pair of Unix sockets in place of CAN: six
setpoints and a renewal of SYNC are sent, SYNC and six answers received. Nothing of python-can's own time is counted.
"""

from __future__ import annotations

import os
import select
import socket
import tempfile
import time
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from statistics import median

import can
import numpy as np
from can.interfaces.socketcan.socketcan import RECEIVED_ANCILLARY_BUFFER_SIZE, build_can_frame

from armload_controller.config.robot import load_robot
from armload_drivers.canopen.canopen_servos import CanopenServos
from armload_drivers.ethercat.ethercat_line import EthercatLine
from armload_drivers.ethercat.ethercat_servos import EthercatServos
from armload_drivers.servos import JointCommand, JointServos
from armload_drivers.simulation.drives.drives_on_bus import SimulatedDrives
from armload_drivers.simulation.lockstep_bus import LockstepBus, LockstepWire
from armload_drivers.simulation.lockstep_sync import LockstepSync
from armload_drivers.simulation.plant_interface import IdealPlant
from armload_drivers.simulation.virtual_clock import VirtualClock
from benchmarks.timing.cycle_time import _TimedBus
from tests.ethercat_plant import write_robot
from tests.lockstep_line import VirtualFrames

CYCLES, WARM_UP, DRIVES, CYCLE_S = 3000, 100, 6, 0.004
CAN_FRAME_BYTES = 72


def run() -> None:
    """Print both, and whether EtherCAT takes at most CANopen's time."""
    sockets_us, canopen_us, ethercat_us = can_frames(CYCLES), over_canopen(), over_ethercat()
    print(f"CPU of a cycle of six drives, {CYCLES} cycles of {1e3 * CYCLE_S:g} ms, us       median      mean")
    for what, times_us in (
        ("CANopen, frames within the process", canopen_us),
        ("CANopen, frames through sockets besides", canopen_us + sockets_us),
        ("EtherCAT, its mailbox thread included", ethercat_us),
    ):
        print(f"{what:<60}{median(times_us):8.0f}{times_us.mean():10.0f}")
    met = ethercat_us.mean() <= (canopen_us + sockets_us).mean()
    print("at most CANopen's with its frames through sockets: " + ("met" if met else "not met"))


def can_frames(cycles: int) -> np.ndarray:
    """(cycles,) CPU time that the frames of one cycle take in python-can and in the kernel, us."""
    message = can.Message(arbitration_id=0x201, data=bytes(8), is_extended_id=False)
    spent = np.zeros(cycles)
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
    with ours, theirs:
        for cycle in range(cycles):
            begun = time.thread_time_ns()
            for _ in range(DRIVES + 1):
                ours.send(build_can_frame(message))
            for _ in range(DRIVES + 1):
                select.select([theirs], [], [], 0)
                theirs.recvmsg(CAN_FRAME_BYTES, RECEIVED_ANCILLARY_BUFFER_SIZE)
            spent[cycle] = time.thread_time_ns() - begun
    return spent * 1e-3


def over_canopen() -> np.ndarray:
    """(CYCLES,) CPU time of the process without the drives, us."""
    arm, clock, wire = load_robot("er50").drives.settings, VirtualClock(), LockstepWire()
    with (
        LockstepBus(wire) as bus,
        _TimedBus(wire) as drives_bus,
        SimulatedDrives(arm, IdealPlant(np.zeros(DRIVES)), drives_bus, clock),
        closing(CanopenServos(arm, bus, LockstepSync(clock))) as servos,
    ):
        return _paced(servos, drives_bus.take_spent_ns)


def over_ethercat() -> np.ndarray:
    """(CYCLES,) CPU time of the process, us."""
    with tempfile.TemporaryDirectory() as folder:
        arm = load_robot(str(write_robot(Path(folder)))).drives.settings
    with (
        EthercatLine(os.environ["WITH_ETHERCAT"]) as line,
        closing(EthercatServos(arm, line, VirtualFrames())) as servos,
    ):
        return _paced(servos, lambda: 0)


def _paced(servos: JointServos, not_ours_ns: Callable[[], int]) -> np.ndarray:
    """CPU time of the process from one cycle to the next, us."""
    spent, zero = np.zeros(CYCLES), np.zeros(DRIVES)
    servos.connect()
    start = servos.enable().position_rad
    due_s, begun = time.monotonic(), time.process_time_ns()
    for cycle in range(-WARM_UP, CYCLES):
        due_s += CYCLE_S
        time.sleep(max(0.0, due_s - time.monotonic()))
        target = start + 0.05 * (1 - np.cos((cycle + WARM_UP) * CYCLE_S))
        servos.exchange(JointCommand(target, zero, zero))
        now = time.process_time_ns()
        if cycle >= 0:
            spent[cycle] = 1e-3 * (now - begun - not_ours_ns())
        else:
            not_ours_ns()
        begun = now
    for remark in servos.take_remarks():
        print(remark)
    return spent


if __name__ == "__main__":
    run()
