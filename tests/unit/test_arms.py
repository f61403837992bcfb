"""Opening an arm: what is on a bus is asked before anything is written to it."""

import time
import uuid

import can
import pytest

from armload_controller.arms import arm_on_bus, require_safe_bus
from armload_controller.config import load_robot
from armload_controller.errors import UnsafeBus
from armload_drivers.arm import Identity
from armload_drivers.errors import WrongDevice
from armload_drivers.simulated_dictionary import DriveTraits
from armload_drivers.simulated_drives import SimulatedDrives
from armload_drivers.simulated_plant import IdealPlant

SDO_WRITES = {0x2F, 0x2B, 0x27, 0x23, 0x22, 0x21, 0x20}
"""First bytes of SDO download requests."""


@pytest.fixture
def bench():
    """prbt's drives on a virtual bus, one of them somebody else's, and a listener."""
    robot = load_robot("prbt").with_bus(channel=uuid.uuid4().hex)
    arm = robot.arm_settings()
    opened = [can.Bus(interface="virtual", channel=robot.bus.channel) for _ in range(2)]
    traits = {6: DriveTraits(identity=Identity(0x0000_02DC, 0x1234_5678))}
    plant = IdealPlant(robot.plant_spec(None).start_position_rad, robot.torque_max_nm())
    with SimulatedDrives(arm, plant, opened[0], time.monotonic, traits):
        yield robot, opened[1]
    for bus in opened:
        bus.shutdown()


def test_a_foreign_drive_is_refused_before_anything_is_written(bench):
    robot, listener = bench
    with arm_on_bus(robot, print) as servos, pytest.raises(WrongDevice, match="node 6"):
        servos.connect()
    while (message := listener.recv(0.0)) is not None:
        assert message.arbitration_id != 0, f"NMT command {message}"
        if 0x600 < message.arbitration_id < 0x680:
            assert message.data[0] not in SDO_WRITES, f"SDO write {message}"


@pytest.mark.parametrize("interface", ["socketcan", "pcan", "slcan"])
def test_only_the_virtual_bus_needs_no_word_for_it(interface):
    robot = load_robot("er50").with_bus(interface=interface, channel="can0")
    with pytest.raises(UnsafeBus, match="--simulated-drives"):
        require_safe_bus(robot, simulated_drives=False)
    require_safe_bus(robot, simulated_drives=True)
    require_safe_bus(load_robot("er50"), simulated_drives=False)
