"""Node id and bit rate by layer setting services, with an independent slave."""

import can
import pytest

from armload_drivers.canopen.lss_master import BIT_TIMINGS, LssAddress
from armload_drivers.canopen.node_assignment import assign_node
from armload_drivers.cia402.timeouts import Timeouts
from armload_drivers.driver_errors import LssRefused
from armload_drivers.servos import JointCommand
from armload_drivers.simulation.lockstep_bus import LockstepBus, LockstepWire
from tests.lss_slave import LssSlave

IDENTITY = (0x0000_02DC, 0xFFFF_FFFF, 0x0001_0000, 0x8000_0001)
LIMITS = Timeouts(scan_s=0.3)


@pytest.fixture
def wire():
    """Makes a bus with slaves on it; gives the master's end."""
    opened = []

    def make(*slaves, wire=None):
        wire = wire or LockstepWire()
        for slave in slaves:
            end = LockstepBus(wire)
            opened.append(end)

            def act(message, slave=slave, end=end):
                answer = slave.receive(message.arbitration_id, message.data)
                if answer is not None:
                    end.send(can.Message(arbitration_id=answer[0], data=answer[1], is_extended_id=False))

            end.listen(act)
        opened.append(LockstepBus(wire))
        return opened[-1]

    yield make
    for bus in opened:
        bus.shutdown()


def agreed(question):
    return True


@pytest.mark.parametrize("identity", [IDENTITY, (1, 0, 0, 0), (0xFFFF_FFFF,) * 4])
def test_the_node_without_an_id_is_found_by_its_identity(wire, identity):
    other, slave = LssSlave((5, 6, 7, 8), node_id=9, device_type=0x191), LssSlave(identity)
    asked = []
    found = assign_node(wire(other, slave), 12, 500_000, None, lambda question: not asked.append(question), LIMITS)
    assert found == LssAddress(*identity)
    assert (slave.node_id, slave.stored) == (12, (12, bytes([0, BIT_TIMINGS[500_000]])))
    assert "node id 12, and 500000 bit/s" in asked[0]
    assert (other.node_id, other.stored, other.configuring, slave.configuring) == (9, None, False, False)


def test_a_node_with_an_id_is_addressed_by_its_identity(wire):
    slaves = LssSlave((5, 6, 7, 8), node_id=9, device_type=0x191), LssSlave(IDENTITY, node_id=3, device_type=0x191)
    assert assign_node(wire(*slaves), 4, None, LssAddress(*IDENTITY), agreed, LIMITS) == LssAddress(*IDENTITY)
    assert [slave.stored for slave in slaves] == [None, (4, None)]
    with pytest.raises(LssRefused, match="no node with identity 0x00000001:0x0000"):
        assign_node(wire(*slaves), 8, None, LssAddress(1, 2, 3, 4), agreed, LIMITS)


def test_without_consent_nothing_is_set(wire):
    slave = LssSlave(IDENTITY)
    assert assign_node(wire(slave), 12, None, None, lambda question: False, LIMITS) is None
    assert (slave.node_id, slave.stored, slave.configuring) == (None, None, False)


@pytest.mark.parametrize(
    ("refuses", "said"), [(0x11, "this node id"), (0x13, "this bit rate"), (0x17, "cannot store its settings")]
)
def test_what_a_node_refuses_is_said(wire, refuses, said):
    slave = LssSlave(IDENTITY, refuses=refuses)
    with pytest.raises(LssRefused, match=said):
        assign_node(wire(slave), 12, 125_000, None, agreed, LIMITS)
    assert not slave.configuring, "whatever ends, it waits again"


@pytest.mark.parametrize(
    ("fault", "said"),
    [({"confuses": 0x17}, "does not answer to a setting"), ({"forgets": 2}, "inconsistently at word 3")],
)
def test_a_node_that_does_not_keep_to_the_services_is_named(wire, fault, said):
    slave = LssSlave(IDENTITY, **fault)
    with pytest.raises(LssRefused, match=said):
        assign_node(wire(slave), 12, None, None, agreed, LIMITS)
    assert slave.stored is None


def test_an_id_that_is_in_use_is_refused(wire):
    slave = LssSlave(IDENTITY)
    with pytest.raises(LssRefused, match="node id 9 is in use"):
        assign_node(wire(LssSlave((5, 6, 7, 8), node_id=9), slave), 9, None, None, agreed, LIMITS)
    assert slave.stored is None


def test_where_every_node_has_an_id_the_other_ways_are_named(wire):
    with pytest.raises(LssRefused, match="addressed by its identity"):
        assign_node(wire(LssSlave(IDENTITY, node_id=9, device_type=0x191)), 12, None, None, agreed, LIMITS)


def test_nothing_is_set_while_a_drive_on_the_bus_carries_torque(wire, virtual_arm):
    arm, slave = virtual_arm(), LssSlave(IDENTITY)
    arm.servos.connect()
    here = arm.servos.enable().position_rad
    arm.servos.exchange(JointCommand(here, 0.0 * here, 0.0 * here))
    with pytest.raises(LssRefused, match="node 2 carries torque"):
        assign_node(wire(slave, wire=arm.wires[0]), 12, None, None, agreed, LIMITS)
    assert slave.stored is None


@pytest.mark.parametrize(
    ("bitrate", "index"),
    [
        (1_000_000, 0), (800_000, 1), (500_000, 2), (250_000, 3), (125_000, 4), (50_000, 6), (20_000, 7), (10_000, 8),
    ],
)  # fmt: skip
def test_a_bit_rate_is_set_by_its_index_in_the_standards_table(wire, bitrate, index):
    """CiA 305, bit timing table; 5 is reserved."""
    slave = LssSlave(IDENTITY)
    assign_node(wire(slave), 12, bitrate, None, agreed, LIMITS)
    assert slave.stored == (12, bytes([0, index]))


@pytest.mark.parametrize(
    ("command", "error", "said"),
    [
        (0x11, 1, "it does not take this node id"), (0x13, 1, "it does not support this bit rate"),
        (0x17, 1, "it cannot store its settings"), (0x17, 2, "it could not access its memory"),
        (0x11, 255, "error 255, 9 of its manufacturer"), (0x13, 2, "error 2, 9 of its manufacturer"),
    ],
)  # fmt: skip
def test_a_refusal_is_told_by_its_code(wire, command, error, said):
    """CiA 305: specific errors of the manufacturer follow 255."""

    class Refusing(LssSlave):
        def _service(self, data):
            answer = super()._service(data)
            return bytes([command, error, 9]) if data[0] == command else answer

    with pytest.raises(LssRefused, match=said):
        assign_node(wire(Refusing(IDENTITY)), 12, 500_000, None, agreed, LIMITS)


def test_the_services_have_the_identifiers_of_the_standard(wire):
    heard = []
    slave = LssSlave(IDENTITY)

    def service(data, whole=slave._service):
        heard.append(data[0])
        return whole(data)

    slave._service = service
    assign_node(wire(slave), 12, 500_000, None, agreed, LIMITS)
    assert [command for command in heard if command != 0x51] == [0x04, 0x11, 0x13, 0x17, 0x04]
    assert heard.count(0x51) == 1 + 4 * 33, "one for whether there is one, then 32 bits and a word's end, four times"
