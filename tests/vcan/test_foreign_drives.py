"""Against drives on another CANopen stack, with another's state machine: Lely's and ros2_canopen's fake slave.

Their encoders fail inside their own loops, on order; see `tests/foreign_drives.py`.
"""

import shutil
import time
from contextlib import suppress
from importlib import resources

import can
import numpy as np
import pytest

from armload_controller.config.robot import load_robot
from armload_drivers.bus.kernel_sync import BcmSync, BroadcastManager
from armload_drivers.canopen.canopen_servos import CanopenServos
from armload_drivers.driver_errors import DriverError, LoopLost
from armload_drivers.servos import JointCommand
from tests.foreign_drives import DRIVES, ForeignDrives

SPEED_RAD_S = 0.15
RUNAWAY_RAD_S2 = 300.0
"""Acceleration of the drives' motor with three times its rated torque."""
NODE = 4
COUNTS_PER_TURN = 1048576

pytestmark = [
    pytest.mark.vcan,
    pytest.mark.skipif(not DRIVES.is_file(), reason="canopen-drives is not beside this checkout"),
]


class ForeignArm(ForeignDrives):
    """Six foreign drives on vcan0, and this master."""

    def __init__(self, folder, bus):
        for role in ("identification", "validation"):
            name = f"prbt_{role}.toml"
            (folder / name).write_text((resources.files("armload_configs") / name).read_text("utf-8"))
        shutil.copy(DRIVES.parent / "canopen" / "drive.eds", folder)
        shutil.copy(DRIVES.parent / "canopen" / "example-robot.toml", folder / "arm.toml")
        robot = load_robot(folder / "arm.toml")
        self.settings = robot.drives.settings
        self.servos = CanopenServos(self.settings, bus, BcmSync(BroadcastManager("vcan0")))
        rated = [f"{d.node_id}:6076:0={round(d.rated_torque_nm * 1e3)}" for d in self.settings.drives]
        super().__init__(folder, "3-8", rated)

    def move(self, seconds):
        """Move all joints at constant speed."""
        for _ in range(round(seconds / self.settings.cycle_s)):
            self.target_rad = self.target_rad + self.settings.cycle_s * SPEED_RAD_S
            self.servos.exchange(JointCommand(self.target_rad, np.zeros(6), np.zeros(6)))


@pytest.fixture
def arm(tmp_path):
    with can.Bus(interface="socketcan", channel="vcan0") as bus:
        made = ForeignArm(tmp_path, bus)
        try:
            made.servos.connect()
            made.target_rad = made.servos.enable().position_rad
            yield made
        finally:
            with suppress(DriverError):
                made.servos.close()
            made.close()


@pytest.mark.parametrize("order", ["reverse", "freeze"])
def test_a_foreign_drive_whose_loop_is_lost_carries_no_torque_at_exit(arm, order):
    arm.move(1.0)
    began_s = time.monotonic()
    before = arm.stats()[NODE]["position"]
    arm.order(f"{order} {NODE} on")
    with pytest.raises(LoopLost, match=f"node {NODE}"):
        arm.move(3.0)
    arm.servos.stop()
    assert set(arm.powered()) == {3, 5, 6, 7, 8}, f"node {NODE} has none; the others hold with torque"
    turns = (arm.stats()[NODE]["position"] - before) / COUNTS_PER_TURN
    # Less than 0.09 rad within less than 0.1 s; while a busy machine delays this program, the axis runs away further.
    late_s = max(time.monotonic() - began_s - 0.1, 0.0)
    assert abs(turns) * 2.0 * np.pi < 0.1 + SPEED_RAD_S * late_s + 0.5 * RUNAWAY_RAD_S2 * late_s**2
    arm.servos.disable()
    assert arm.powered() == []


def test_a_foreign_drive_that_runs_away_in_its_fault_reaction_is_reset(arm):
    """It accepts no controlword in FAULT REACTION ACTIVE, and with its encoder reversed never stands."""
    arm.move(1.0)
    arm.order(f"fault {NODE} 2310")
    arm.order(f"reverse {NODE} on")
    with pytest.raises(DriverError, match=f"node {NODE}"):
        arm.move(3.0)
    with suppress(DriverError):
        arm.servos.stop()
    arm.servos.disable()
    assert arm.powered() == []
