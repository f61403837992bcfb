"""CPU time of one cycle of six drives over EtherCAT, beside CANopen's in the same run.

    python -m tests.ethercat_drives er50 .venv/bin/python -m benchmarks.timing.ethercat_cycle

Both run in real time, and the time of the whole process is counted from one cycle to the next, with the library of the
bus and the kernel's part: EtherCAT's frame passes through the kernel to the drives of with-ethercat and back; CANopen's
frames pass through python-can's SocketCAN bus, on a Unix socket in place of one of CAN, to simulated drives in a
process of their own. Both are measured in turn, `ROUNDS` times.
"""

from __future__ import annotations

import os
import socket
import tempfile
import time
from contextlib import closing
from dataclasses import replace
from multiprocessing import get_context
from multiprocessing.synchronize import Event
from pathlib import Path

import can
import numpy as np
from can.interfaces.socketcan.constants import SO_TIMESTAMPNS
from can.interfaces.socketcan.socketcan import SocketcanBus

from armload_controller.config.robot import load_robot
from armload_drivers.bus.sync_sources import TimerSync
from armload_drivers.canopen.canopen_servos import CanopenServos
from armload_drivers.deadline_clock import DeadlineClock
from armload_drivers.ethercat.ethercat_line import EthercatLine
from armload_drivers.ethercat.ethercat_servos import EthercatServos
from armload_drivers.servos import JointCommand, JointServos
from armload_drivers.simulation.drives.drives_on_bus import SimulatedDrives
from tests.ethercat_plant import write_robot
from tests.ideal_plant import IdealPlant

ROUNDS, CYCLES, WARM_UP, DRIVES, CYCLE_S = 5, 1000, 100, 6, 0.004
PATIENCE = 50
"""Cycles without feedback that a busy computer may cause."""
_SNDBUFFORCE = 32


def run() -> None:
    """Print both, and whether EtherCAT takes at most CANopen's time."""
    print(f"CPU of a cycle of six drives, {ROUNDS} x {CYCLES} cycles of {1e3 * CYCLE_S:g} ms, us      median      mean")
    spent_us = np.array([(over_canopen(), over_ethercat()) for _ in range(ROUNDS)]).swapaxes(0, 1).reshape(2, -1)
    medians, means = np.median(spent_us, axis=1), spent_us.mean(axis=1)
    for what, middle, mean in zip(("CANopen", "EtherCAT"), medians, means, strict=True):
        print(f"{what:<56}{middle:10.0f}{mean:10.0f}")
    met = medians[1] <= medians[0] and means[1] <= means[0]
    print("EtherCAT at most CANopen: " + ("met" if met else "not met"))


class UnixCan(SocketcanBus):
    """python-can's SocketCAN bus with a Unix socket."""

    def __init__(self, end: socket.socket) -> None:
        self.socket, self.channel, self._bcm_sockets = end, "unix", {}
        end.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)
        end.setsockopt(socket.SOL_SOCKET, _SNDBUFFORCE, 1 << 20)  # the search for drives sends 127 requests
        can.BusABC.__init__(self, channel="unix")

    def _apply_filters(self, filters: object) -> None:
        """A Unix socket has no filter to set: everything passes, as with SocketCAN's default."""
        self._is_filtered = True


def _drives(end: socket.socket, ready: Event) -> None:
    """Six simulated drives at the other end, until this process is ended."""
    arm = load_robot("er50").drives.settings
    with UnixCan(end) as bus, SimulatedDrives(arm, IdealPlant(np.zeros(DRIVES)), bus, time.monotonic):
        ready.set()
        time.sleep(1e6)


def over_canopen() -> np.ndarray:
    """(CYCLES,) CPU time of the process, us."""
    processes = get_context("spawn")
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
    ready = processes.Event()
    drives = processes.Process(target=_drives, args=(theirs, ready), daemon=True)
    drives.start()
    try:
        ready.wait()
        arm = replace(load_robot("er50").drives.settings, max_missing_cycles=PATIENCE)
        with theirs, UnixCan(ours) as bus, closing(CanopenServos(arm, bus, TimerSync())) as servos:
            return _spent_us(servos)
    finally:
        drives.terminate()
        drives.join()


def over_ethercat() -> np.ndarray:
    """(CYCLES,) CPU time of the process, its mailbox thread included, us."""
    with tempfile.TemporaryDirectory() as folder:
        arm = load_robot(str(write_robot(Path(folder), max_missing_cycles=PATIENCE))).drives.settings
    with (
        closing(EthercatLine(os.environ["WITH_ETHERCAT"])) as line,
        closing(EthercatServos(arm, line, DeadlineClock())) as servos,
    ):
        return _spent_us(servos)


def _spent_us(servos: JointServos) -> np.ndarray:
    """CPU time of the process from one cycle to the next, us."""
    spent, zero = np.zeros(CYCLES), np.zeros(DRIVES)
    servos.connect()
    start = servos.enable().position_rad
    begun = time.process_time_ns()
    for cycle in range(-WARM_UP, CYCLES):
        target = start + 0.05 * (1 - np.cos((cycle + WARM_UP) * CYCLE_S))
        servos.exchange(JointCommand(target, zero, zero))
        now = time.process_time_ns()
        if cycle >= 0:
            spent[cycle] = 1e-3 * (now - begun)
        begun = now
    for remark in servos.take_remarks():
        print(remark)
    return spent


if __name__ == "__main__":
    run()
