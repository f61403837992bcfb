"""A process that only runs the loop: feed-forward, estimator of a calibrated arm, and six drives enabled on a bus.

The drives are simulated in this process, on the other end of a socket; the process that is measured contains none of
them. Its start is its CPU time until the drives are enabled, beside that of a process that imports NumPy; its memory is
the greatest until it ends. Then the same loop runs for an hour of virtual time, and memory must not grow.

    python -m benchmarks.timing.loop_process [HOURS]
"""

from __future__ import annotations

import json
import select
import socket
import struct
import subprocess
import sys
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path
from statistics import median

import can
import numpy as np

from armload_controller.config.robot import Robot, load_robot
from armload_controller.feedforward.payload_feedforward import NOTHING, PayloadFeedforward
from armload_drivers.bus.sync_sources import SyncSource, TimerSync
from armload_drivers.canopen.canopen_servos import CanopenServos
from armload_drivers.servos import JointCommand
from armload_identification.files.calibration_file import read_calibration
from armload_identification.pipeline.payload_estimator import PayloadEstimator
from benchmarks.timing.peak_memory import peak_bytes, resident_bytes

ROBOT = "er50"
ROUNDS, CYCLES = 7, 250
MOST_MB, MOST_START = 70.0, 3.0
HOURS = 1.0
_FRAME = struct.Struct("=IB?8s")
_PART_OF = 12
"""Memory after one twelfth of the hour is compared with that at its end."""


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


def loop(robot: Robot, calibration: Path, bus: can.BusABC, sync: SyncSource, cycles: int) -> tuple[float, list[int]]:
    """Run the loop.

    Returns:
        CPU time of this process until the drives were enabled, and its memory in bytes after each twelfth.
    """
    feedforward = PayloadFeedforward(robot.chain, NOTHING)
    estimator = PayloadEstimator(read_calibration(calibration), robot.chain, robot.drives.transmission)
    servos = CanopenServos(robot.drives.settings, bus, sync)
    try:
        servos.connect()
        start_rad = servos.enable().position_rad
        started_s, memory = time.process_time(), []
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
            if (cycle + 1) % max(1, cycles // _PART_OF) == 0:
                memory.append(resident_bytes())
        return started_s, memory
    finally:
        servos.close()


def only_the_loop(calibration: Path, descriptor: int) -> None:
    """What the measured process does; prints its CPU time at start and its greatest memory."""
    with SocketBus(socket.socket(fileno=descriptor)) as bus:
        started_s, _ = loop(load_robot(ROBOT), calibration, bus, TimerSync(), CYCLES)
        print(json.dumps([started_s, peak_bytes()]))


def run(hours: float = HOURS) -> None:
    """Print start and memory of the process, and what grows in an hour of virtual time."""
    # What simulates is imported here, because the measured process imports this file.
    from armload_drivers.simulation.drives.drives_on_bus import SimulatedDrives  # noqa: PLC0415
    from armload_drivers.simulation.lockstep_bus import LockstepBus, LockstepWire  # noqa: PLC0415
    from armload_drivers.simulation.lockstep_sync import LockstepSync  # noqa: PLC0415
    from armload_drivers.simulation.plant_interface import IdealPlant  # noqa: PLC0415
    from armload_drivers.simulation.virtual_clock import VirtualClock  # noqa: PLC0415
    from armload_identification.files.calibration_file import write_calibration  # noqa: PLC0415
    from benchmarks.accuracy.simulated_motion import calibration_of  # noqa: PLC0415
    from benchmarks.arms.setups import Twin  # noqa: PLC0415
    from benchmarks.timing.startup import PYTHON, REFERENCE, cpu_s  # noqa: PLC0415

    robot = load_robot(ROBOT)
    with tempfile.TemporaryDirectory() as folder:
        calibration = Path(folder) / "arm.calibration.toml"
        write_calibration(calibration, calibration_of(robot, Twin.NORMATIVE, np.random.default_rng(5), np.zeros(6)))
        measured, numpy_s = [], []
        for _ in range(ROUNDS + 1):  # the first fills the caches
            numpy_s.append(cpu_s((*PYTHON, REFERENCE)))
            ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
            plant = IdealPlant(np.zeros(robot.n))
            with ours, SocketBus(ours) as bus, SimulatedDrives(robot.drives.settings, plant, bus, time.monotonic):
                command = [*PYTHON, f"from {__spec__.name} import *; from pathlib import Path; "
                           f"only_the_loop(Path({str(calibration)!r}), {theirs.fileno()})"]  # fmt: skip
                done = subprocess.run(command, check=True, capture_output=True, text=True, pass_fds=[theirs.fileno()])
            theirs.close()
            measured.append(json.loads(done.stdout))
        start_s, numpy_s_median = median(row[0] for row in measured[1:]), median(numpy_s[1:])
        print(f"A process that only runs the loop of {ROBOT}, six drives enabled, median of {ROUNDS}:")
        print(
            f"  start {1e3 * start_s:.0f} ms of CPU, {start_s / numpy_s_median:.2f} x `{REFERENCE}` "
            f"(at most {MOST_START:g}); memory {max(row[1] for row in measured[1:]) / 1e6:.1f} MB (at most {MOST_MB:g})"
        )
        clock, wire = VirtualClock(), LockstepWire()
        with ExitStack() as stack:
            bus, drives_bus = stack.enter_context(LockstepBus(wire)), stack.enter_context(LockstepBus(wire))
            stack.enter_context(
                SimulatedDrives(robot.drives.settings, IdealPlant(np.zeros(robot.n)), drives_bus, clock)
            )
            cycles = round(hours * 3600.0 * robot.bus.cycle_hz)
            _, memory = loop(robot, calibration, bus, LockstepSync(clock), cycles)
        print(
            f"  {hours:g} h of virtual time, {cycles} cycles: memory {memory[0] / 1e6:.1f} MB after a twelfth, "
            f"{memory[-1] / 1e6:.1f} MB at the end, {(memory[-1] - memory[0]) / 1024:.0f} KiB more"
        )


if __name__ == "__main__":
    run(*map(float, sys.argv[1:]))
