"""A process that only runs the loop: feed-forward, estimator of a calibrated arm, and six drives enabled on a bus.

The drives are simulated in this process, on the other end of a socket; the process that is measured contains none of
them. Its start is its CPU time until the drives are enabled, beside that of a process that imports NumPy. It begins
without garbage collection, which takes a sixth of the time of importing, and which a loop does not want. Its memory is
the greatest until it ends. Then the same loop runs for an hour of virtual time, and memory must not grow.

    python -m benchmarks.timing.loop_process [HOURS]
"""

from __future__ import annotations

import socket
import subprocess
import sys
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path
from statistics import median

import numpy as np

from armload_controller.config.robot import load_robot
from armload_drivers.simulation.drives.drives_on_bus import SimulatedDrives
from armload_drivers.simulation.lockstep_bus import LockstepBus, LockstepWire
from armload_drivers.simulation.lockstep_sync import LockstepSync
from armload_drivers.simulation.virtual_clock import VirtualClock
from armload_identification.files.calibration_file import write_calibration
from benchmarks.accuracy.simulated_motion import calibration_of
from benchmarks.arms.setups import Twin
from benchmarks.timing.loop_probe import PARTS, ROBOT, SocketBus, loop
from benchmarks.timing.startup import INSTALLED, PYTHON, REFERENCE, cpu_s
from tests.ideal_plant import IdealPlant

ROUNDS = 7
MOST_MB, MOST_START = 70.0, 3.0
HOURS = 1.0


def run(hours: float = HOURS) -> None:
    """Print start and memory of the process, and what grows in an hour of virtual time."""
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
                arguments = f"Path({str(calibration)!r}), {theirs.fileno()}"
                program = f"from benchmarks.timing.loop_probe import *; only_the_loop({arguments})"
                command = [*PYTHON, f"import gc; gc.disable(); {program}"]
                done = subprocess.run(
                    command, check=True, capture_output=True, text=True, pass_fds=[theirs.fileno()], env=INSTALLED
                )
            theirs.close()
            measured.append([float(number) for number in done.stdout.split()])
        constructed, enabled, peak = np.median(np.array(measured[1:]), axis=0)
        imported_s = median(numpy_s[1:])
        print(f"A process that only runs the loop of {ROBOT}, six drives enabled, median of {ROUNDS}:")
        print(
            f"  start: {1e3 * constructed:.0f} ms of CPU until all is constructed, {constructed / imported_s:.2f} x "
            f"`{REFERENCE}`, {1e3 * enabled:.0f} ms and {enabled / imported_s:.2f} x until the drives are enabled (at "
            f"most {MOST_START:g}); memory {peak / 1e6:.1f} MB (at most {MOST_MB:g})"
        )
        clock, wire = VirtualClock(), LockstepWire()
        with ExitStack() as stack:
            master_bus, drives_bus = (stack.enter_context(LockstepBus(wire)) for _ in range(2))
            stack.enter_context(
                SimulatedDrives(robot.drives.settings, IdealPlant(np.zeros(robot.n)), drives_bus, clock)
            )
            cycles = round(hours * 3600.0 * robot.bus.cycle_hz)
            _, memory = loop(robot, calibration, master_bus, LockstepSync(clock), cycles)
        print(
            f"  {hours:g} h of virtual time, {cycles} cycles: memory {memory[0] / 1e6:.1f} MB after 1/{PARTS}, "
            f"{memory[-1] / 1e6:.1f} MB at the end, {(memory[-1] - memory[0]) / 1024:.0f} KiB more"
        )


if __name__ == "__main__":
    run(*map(float, sys.argv[1:]))
