"""EtherCAT drives of `../shared/tools/with-ethercat`, and a plant in the master's thread: deterministic in any load.

Tests with these drives run below that program: `with-ethercat --drives N ... -- python -m pytest -m ethercat`.
"""

import json
import os
import select
import socket
import sys
import time
from pathlib import Path

import numpy as np

from armload_drivers.cia402.axis_brakes import STANDSTILL_RAD_S
from armload_drivers.ethercat.ethercat_line import EthercatLine

TOOLS = Path(__file__).resolve().parents[2] / "shared" / "tools"
UNDER_IT = "WITH_ETHERCAT" in os.environ
WHY = "no drives of with-ethercat on an interface: see .ci/run"
PATIENCE_S = 1.0
QUICK_STOP_S = 0.1
SURELY_S = 0.02
DEFAULT_US = 2000
PATIENT_US = 200_000, 400_000, 400_000


def interface():
    """The interface behind which the drives are."""
    return os.environ["WITH_ETHERCAT"]


def order(text):
    """Give the drives an order, see `with-ethercat --help`; returns the answer."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as control:
        control.connect(os.environ["WITH_ETHERCAT_CONTROL"])
        control.send(text.encode())
        answer = control.recv(65536).decode()
    assert not answer.startswith("error"), answer
    return answer


def drive_states():
    """What the drives know about themselves."""
    return json.loads(order("stats"))["drives"]


def plant_link():
    """The plant's end of the link, which the tool provides."""
    sys.path.insert(0, str(TOOLS / "ethercat"))
    try:
        from drive_plant import PlantLink
    finally:
        sys.path.pop(0)
    return PlantLink()


class PlantBehindDrives:
    """A plant that moves as the drives command.

    Args:
        plant: The plant.
        arm: Scales of the drives.
        cycle_s: Time of a cycle.
    """

    def __init__(self, plant, arm, cycle_s):
        self.plant, self.cycle_s = plant, cycle_s
        self.counts = np.array([drive.counts_per_rad for drive in arm.drives])
        self.rated_nm = np.array([drive.rated_torque_nm for drive in arm.drives])
        self.powered, self.stopping = [False] * len(self.counts), [False] * len(self.counts)
        self.time_s = 0.0

    def __call__(self, record):
        plant = self.plant
        # Only frames count: the drives' own clock also runs while this process is not scheduled.
        self.time_s += 0.0 if record.tick else self.cycle_s
        plant.advance(self.time_s)
        sample = plant.sample(self.cycle_s)
        for axis, drive in enumerate(record.drives[: len(self.counts)]):
            on, stopping = bool(record.powered[axis]), bool(record.quick_stop[axis])
            if on and not self.powered[axis]:
                plant.set_powered(axis, True)
            elif self.powered[axis] and not on:
                self._switch_off(axis, abs(sample.axis_velocity_rad_s[axis]) < STANDSTILL_RAD_S)
            if stopping and not self.stopping[axis]:
                plant.slow_down(axis, QUICK_STOP_S)
            elif on and not stopping:
                plant.set_target(axis, float(drive["target_position"]) / self.counts[axis], self.cycle_s)
            plant.set_torque_offset(axis, float(drive["torque_offset"]) / 1000 * self.rated_nm[axis])
            self.powered[axis], self.stopping[axis] = on, stopping
        values = np.zeros((3, len(record.drives)))
        values[:, : len(self.counts)] = (
            sample.axis_position_rad * self.counts,
            sample.axis_velocity_rad_s * self.counts,
            1000 * sample.axis_torque_nm / self.rated_nm,
        )
        return tuple(values)

    def _switch_off(self, axis, at_rest):
        """As drives do: at rest the brake engages before the torque goes."""
        if at_rest:
            self.plant.hold_by_brake(axis)
        else:
            self.plant.set_powered(axis, False)


class LockstepLine(EthercatLine):
    """A line whose plant answers after every frame, in this thread.

    Args:
        plant: Called with what the drives command.
        patience_s: Longest wait for a frame.
    """

    def __init__(self, plant, patience_s=PATIENCE_S):
        super().__init__(interface())
        waits = self._soem.settings.timeouts
        waits.ret, waits.safe, waits.tx_mailbox = PATIENT_US  # a busy machine may not schedule the drives for a while
        self.patience_s, self.link, self.plant = patience_s, plant_link(), plant
        self.link.reply(*plant(self.link.receive()))

    def hurry(self):
        """Wait for frames no longer than by default: with an unplugged cable all waits are in vain."""
        self._soem.settings.timeouts.ret = DEFAULT_US

    def exchange(self, limit_s):
        counter = super().exchange(self.patience_s)
        # A frame that was lost on its way back has reached the drives, and they wait for the plant; one that was lost
        # before has not.
        self._answer(PATIENCE_S if counter >= 0 else SURELY_S)
        return counter

    def _answer(self, limit_s):
        """Answer the record of the last frame, and all others: ticks, and records of frames that came late."""
        end_s, answered = time.monotonic() + limit_s, False
        while select.select([self.link._socket], [], [], 0.0 if answered else max(0.0, end_s - time.monotonic()))[0]:
            record = self.link.receive()
            if record is None:
                break
            self.link.reply(*self.plant(record))
            # Ticks follow in real time, without an end.
            answered = answered or not record.tick or time.monotonic() > end_s

    def close(self):
        super().close()
        self.link._socket.close()


class VirtualFrames:
    """Frames are due at once, and virtual time advances by a cycle."""

    def __init__(self) -> None:
        self.time_s, self.cycle_s = 0.0, 0.0

    def now_s(self) -> float:
        return self.time_s

    def begin(self, cycle_s: float) -> None:
        self.cycle_s = cycle_s

    def next(self) -> tuple[float, int]:
        self.time_s += self.cycle_s
        return self.time_s, 0
