"""The simulated drives under an independent master: plain canopen in its own thread, in real time."""

import time

import pytest
from canopen.sdo import SdoAbortedError

from armload_drivers.cia402.arm_settings import SIMULATION_IDENTITY
from tests.ideal_plant import IdealPlant
from tests.independent_master import description, network_with_drives


@pytest.fixture
def bench(arm_settings, tmp_path):
    """A network with one of the drives as its remote node, and the plant."""
    arm = arm_settings()
    plant = IdealPlant([0.1, -0.2, 0.3])
    with network_with_drives(arm, plant) as network:
        yield network, network.add_node(3, description(tmp_path / "drive.eds")), plant


def test_boot_and_identity(bench):
    _, node, _ = bench
    assert node.sdo[0x1000].raw & 0xFFFF == 402, "it is up; its own boot-up message lies behind it"
    seen = []
    node.nmt.add_heartbeat_callback(seen.append)
    node.nmt.state = "RESET"
    deadline_s = time.monotonic() + 2.0
    while not seen and time.monotonic() < deadline_s:
        time.sleep(0.005)
    assert seen == [0]
    assert node.sdo[0x1018][1].raw == SIMULATION_IDENTITY.vendor_id
    assert node.sdo[0x1018][2].raw == SIMULATION_IDENTITY.product_code
    assert node.sdo[0x1008].raw == "armload simulated drive, joint_3", "a segmented transfer"
    with pytest.raises(SdoAbortedError) as refusal:
        node.sdo.upload(0x5FFF, 0)
    assert refusal.value.code == 0x0602_0000


def test_heartbeat(bench):
    _, node, _ = bench
    node.sdo[0x1017].raw = 10
    assert node.nmt.wait_for_heartbeat(2.0) == "PRE-OPERATIONAL"
    node.nmt.state = "OPERATIONAL"
    node.nmt.wait_for_heartbeat(2.0)
    assert node.nmt.wait_for_heartbeat(2.0) == "OPERATIONAL"


def configure(node):
    node.tpdo.read()
    node.rpdo.read()
    feedback, setpoints = node.tpdo[1], node.rpdo[1]
    feedback.clear()
    feedback.add_variable(0x6041)
    feedback.add_variable(0x6064)
    setpoints.clear()
    setpoints.add_variable(0x6040)
    setpoints.add_variable(0x607A)
    for pdo in (feedback, setpoints):
        pdo.trans_type = 1
        pdo.enabled = True
        pdo.save()


def test_pdos_mapped_and_driven_by_another_library(bench):
    network, node, plant = bench
    configure(node)
    node.sdo[0x6060].raw = 8
    assert node.sdo[0x6061].raw == 8
    actual = node.sdo[0x6064].raw
    feedback, setpoints = node.tpdo[1], node.rpdo[1]
    node.nmt.state = "OPERATIONAL"
    setpoints[0x607A].raw = actual
    for controlword, state in ((0x06, 0x21), (0x07, 0x23), (0x0F, 0x27)):
        setpoints[0x6040].raw = controlword
        setpoints.transmit()
        network.sync.transmit()
        assert feedback.wait_for_reception(2.0) is not None
        assert feedback[0x6041].raw & 0x6F == state
        assert feedback[0x6064].raw == actual
    assert plant.powered == [False, True, False]

    setpoints[0x607A].raw = actual + 5000
    setpoints.transmit()
    network.sync.transmit()
    assert feedback.wait_for_reception(2.0) is not None
    # The axis arrives in time, without any further frame.
    deadline_s = time.monotonic() + 2.0
    while node.sdo[0x6064].raw != actual + 5000 and time.monotonic() < deadline_s:
        pass
    assert node.sdo[0x6064].raw == actual + 5000


def test_an_event_driven_drive_by_default(bench):
    """By default RPDO1 and TPDO1 carry control and status word and are event-driven."""
    _, node, _ = bench
    node.tpdo.read()
    node.rpdo.read()
    feedback, setpoints = node.tpdo[1], node.rpdo[1]
    node.nmt.state = "OPERATIONAL"
    assert feedback.wait_for_reception(2.0) is not None
    setpoints[0x6040].raw = 0x06
    setpoints.transmit()
    deadline_s = time.monotonic() + 2.0
    while feedback[0x6041].raw & 0x6F != 0x21 and time.monotonic() < deadline_s:
        feedback.wait_for_reception(0.1)
    assert feedback[0x6041].raw & 0x6F == 0x21
