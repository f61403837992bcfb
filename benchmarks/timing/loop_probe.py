"""What a process that only runs the loop does, for `loop_process`; it imports only what a loop needs."""

from __future__ import annotations

import select
import socket
import struct
import time
from dataclasses import replace
from pathlib import Path

import can
import numpy as np

from armload_controller.config.robot import Robot, load_robot
from armload_controller.feedforward.payload_feedforward import NOTHING, PayloadFeedforward
from armload_drivers.bus.sync_sources import SyncSource, TimerSync
from armload_drivers.canopen.canopen_servos import CanopenServos
from armload_drivers.servos import JointCommand
from armload_identification.files.calibration_file import read_calibration
from armload_identification.pipeline.recursive_estimator import PayloadEstimator
from benchmarks.timing.peak_memory import peak_bytes, resident_bytes

ROBOT = "er50"
CYCLES = 250
MISSING_CYCLES = 50
PARTS = 12
"""Memory is read after each of these parts of the loop."""
_FRAME = struct.Struct("=IB?8s")


class SocketBus(can.BusABC):
    """CAN frames over a connected socket that keeps their boundaries."""

    def __init__(self, end: socket.socket) -> None:
        super().__init__(channel="socket")
        self._end = end

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Send a frame."""
        self._end.send(_FRAME.pack(msg.arbitration_id, msg.dlc, msg.is_remote_frame, bytes(msg.data)))

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        if not select.select([self._end], [], [], timeout)[0]:
            return None, False
        number, length, remote, data = _FRAME.unpack(self._end.recv(_FRAME.size))
        message = can.Message(
            arbitration_id=number, data=data[:length], is_remote_frame=remote, is_extended_id=False,
            timestamp=time.monotonic(),
        )  # fmt: skip
        return message, False


def loop(
    robot: Robot, calibration: Path, bus: can.BusABC, sync: SyncSource, cycles: int
) -> tuple[list[float], list[int]]:
    """Run the loop.

    Returns:
        CPU time of this process until everything was constructed and until the drives were enabled, in s, and its
        memory in bytes after each part.
    """
    feedforward = PayloadFeedforward(robot.chain, NOTHING)
    estimator = PayloadEstimator(read_calibration(calibration), robot.chain, robot.drives.transmission)
    # the simulated drives of another process are late while something else has the processor
    servos = CanopenServos(replace(robot.drives.settings, max_missing_cycles=MISSING_CYCLES), bus, sync)
    try:
        started_s = [time.process_time()]
        servos.connect()
        start_rad = servos.enable().position_rad
        started_s.append(time.process_time())
        memory: list[int] = []
        amplitude_rad, rate_rad_s = 0.05, 0.5
        for cycle in range(cycles):
            phase = rate_rad_s * cycle * servos.cycle_s
            position = start_rad + amplitude_rad * (1.0 - np.cos(phase))
            velocity = np.full(robot.n, amplitude_rad * rate_rad_s * np.sin(phase))
            acceleration = np.full(robot.n, amplitude_rad * rate_rad_s**2 * np.cos(phase))
            torque_nm = feedforward.torque_nm(position, velocity, acceleration)
            feedback = servos.exchange(JointCommand(position, velocity, torque_nm))
            if feedback.current_a is not None:
                estimator.update(feedback.time_s, feedback.position_rad, feedback.current_a)
            if (cycle + 1) % max(1, cycles // PARTS) == 0:
                memory.append(resident_bytes())
        return started_s, memory
    finally:
        servos.close()


def only_the_loop(calibration: Path, descriptor: int) -> None:
    """What the measured process does; prints its CPU time at start in s and its greatest memory in bytes."""
    with SocketBus(socket.socket(fileno=descriptor)) as bus:
        started_s, _ = loop(load_robot(ROBOT), calibration, bus, TimerSync(), CYCLES)
        print(*started_s, peak_bytes())
