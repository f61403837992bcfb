"""One simulated drive without a bus: what it answers to NMT, PDOs, SYNC, heartbeats and its own timers."""

from __future__ import annotations

import struct

import numpy as np
import pytest

from armload_drivers.cia402 import object_dictionary as od
from armload_drivers.cia402.object_dictionary import NmtCommand, NmtState, PdoDirection
from armload_drivers.cia402.state_machine import State
from armload_drivers.simulation.drives.drive_dictionary import DriveTraits
from armload_drivers.simulation.drives.simulated_drive import SimulatedDrive
from armload_drivers.simulation.plant_interface import PlantAxis
from tests.ideal_plant import IdealPlant

SILENCE, HEARTBEAT_LOST, PDO_TOO_SHORT, RPDO_OVERDUE, SYNC_LENGTH = 0, 0x8130, 0x8210, 0x8250, 0x8240

pytestmark = pytest.mark.pure

NODE, MASTER = 2, 0x7F
EMERGENCY, HEARTBEAT, TPDO_1, RPDO_1, SDO = 0x080 + NODE, 0x700 + NODE, 0x180 + NODE, 0x200 + NODE, 0x580 + NODE
SHUTDOWN, SWITCH_ON, ENABLE = 0x06, 0x07, 0x0F
REMOTE = 0x0200


class Slave:
    """A drive of a small arm that notes what it sends."""

    def __init__(self, settings, **traits):
        self.sent = []
        self.rerouted = 0
        self.drive = SimulatedDrive(
            settings,
            PlantAxis(IdealPlant(np.zeros(1)), 0),
            cycle_s=0.01,
            traits=DriveTraits(**traits),
            send=lambda cob_id, data: self.sent.append((cob_id, bytes(data))),
            rerouted=self._count,
        )
        self.values = self.drive.dictionary.values

    def _count(self):
        self.rerouted += 1

    def frames(self, cob_id=None):
        """What was sent since the last call, of one identifier or of all."""
        sent, self.sent = self.sent, []
        return [data for sender, data in sent if cob_id in {None, sender}]

    def booted(self, now_s=0.0):
        self.drive.switch_on(now_s)
        self.values = self.drive.dictionary.values
        return self

    def operational(self, now_s=0.0):
        self.booted(now_s).drive.command(NmtCommand.START, now_s)
        self.frames()
        return self

    def enabled(self, now_s=0.0):
        """In operation, by controlwords that act at once: RPDO 1 is event-driven after a reset."""
        self.operational(now_s)
        for word in (SHUTDOWN, SWITCH_ON, ENABLE):
            self.control(word, now_s)
        assert self.drive.power.machine.state is State.OPERATION_ENABLED
        self.frames()
        return self

    def control(self, word, now_s=0.0):
        self.drive.setpoints(self.drive.rpdos[0], struct.pack("<H", word), now_s)

    def write(self, entry, value):
        self.drive.set_object(entry, value)

    def configure(self, direction, type_=255, timer_ms=0, number=0):
        """Give a PDO its transmission type and timer."""
        self.write(direction.type_entry(number), type_)
        self.write(direction.timer_entry(number), timer_ms)


@pytest.fixture
def slave(arm_settings):
    def slave(**traits):
        return Slave(arm_settings().drives[0], **traits)

    return slave


def code_of(frame):
    return struct.unpack_from("<HB", frame)


def test_a_drive_boots_with_its_message_into_pre_operational(slave):
    new = slave()
    assert new.drive.state is None
    new.booted()
    assert new.frames() == [b"\x00"]
    assert new.drive.state is NmtState.PRE_OPERATIONAL
    assert new.rerouted == 1
    assert new.drive.power.machine.state is State.SWITCH_ON_DISABLED
    assert slave(boot_message=False).booted().frames() == []


def test_nmt_commands_lead_to_their_states_and_bit_9_tells_operational(slave):
    drive = slave().booted()
    for command, state in (
        (NmtCommand.START, NmtState.OPERATIONAL),
        (NmtCommand.STOP, NmtState.STOPPED),
        (NmtCommand.PRE_OPERATIONAL, NmtState.PRE_OPERATIONAL),
    ):
        drive.drive.command(command, 0.0)
        assert drive.drive.state is state
        assert bool(drive.values[od.STATUSWORD.key] & REMOTE) is (state is NmtState.OPERATIONAL)


@pytest.mark.parametrize("command", [NmtCommand.RESET_NODE, NmtCommand.RESET_COMMUNICATION])
def test_a_reset_forgets_what_was_written_and_removes_the_torque(slave, command):
    drive = slave().enabled()
    drive.write(od.TARGET_POSITION, 77)
    drive.drive.command(command, 1.0)
    assert drive.frames(HEARTBEAT) == [b"\x00"]
    assert drive.drive.dictionary.values[od.TARGET_POSITION.key] == 0
    assert drive.drive.power.machine.state is State.SWITCH_ON_DISABLED


def test_without_supply_it_is_silent_and_deaf(slave):
    drive = slave().enabled()
    drive.drive.switch_off()
    drive.drive.command(NmtCommand.START, 0.0)
    drive.drive.fail(0x3210, 0.0)
    drive.drive.tick(9.0)
    drive.drive.request(b"\x40\x41\x60\x00" + bytes(4), 9.0)
    assert drive.drive.state is None
    assert drive.frames() == []


def test_leaving_operational_under_torque_is_the_loss_of_the_master(slave):
    drive = slave().enabled()
    drive.drive.command(NmtCommand.START, 0.0)
    assert drive.frames() == [], "already there"
    drive.drive.command(NmtCommand.STOP, 0.0)
    assert drive.drive.power.machine.state is State.FAULT_REACTION_ACTIVE
    assert code_of(drive.frames(EMERGENCY)[0]) == (HEARTBEAT_LOST, 0x21)


def test_requests_are_answered_before_and_in_operation_but_not_when_stopped(slave):
    drive = slave().booted()
    drive.frames()
    request = b"\x40\x41\x60\x00" + bytes(4)
    for command, answers in ((None, 1), (NmtCommand.START, 1), (NmtCommand.STOP, 0)):
        if command:
            drive.drive.command(command, 0.0)
            drive.frames()
        drive.drive.request(request, 0.0)
        answered = drive.frames(SDO)
        assert len(answered) == answers
        if answered:
            assert answered[0][:4] == b"\x4b\x41\x60\x00"


def test_traits_decide_what_a_request_gets(slave):
    for verdict, answer in ((SILENCE, []), (0x0504_0000, [b"\x80\x41\x60\x00" + struct.pack("<I", 0x0504_0000)])):
        drive = slave(on_request=lambda request, verdict=verdict: verdict).booted()
        drive.frames()
        drive.drive.request(b"\x40\x41\x60\x00" + bytes(4), 0.0)
        assert drive.frames() == answer


def test_a_frame_acts_at_once_or_with_the_next_sync_by_its_transmission_type(slave):
    drive = slave().operational()
    drive.control(SHUTDOWN)
    assert drive.drive.power.machine.state is State.READY_TO_SWITCH_ON
    drive.configure(PdoDirection.RECEIVE, 1)
    drive.control(SWITCH_ON)
    assert drive.drive.power.machine.state is State.READY_TO_SWITCH_ON
    drive.drive.sync(0.01)
    assert drive.drive.power.machine.state is State.SWITCHED_ON
    drive.write(od.CONTROLWORD, SHUTDOWN)
    drive.drive.sync(0.02)
    assert drive.drive.power.machine.state is State.READY_TO_SWITCH_ON, "a frame is latched once"


def test_setpoints_outside_operational_are_ignored_and_short_ones_announced(slave):
    drive = slave().booted()
    drive.control(SHUTDOWN)
    assert drive.drive.power.machine.state is State.SWITCH_ON_DISABLED
    drive.operational()
    drive.drive.setpoints(drive.drive.rpdos[0], b"\x06", 0.0)
    assert drive.drive.power.machine.state is State.SWITCH_ON_DISABLED
    assert [code_of(frame) for frame in drive.frames(EMERGENCY)] == [(PDO_TOO_SHORT, 0x11)]
    drive.drive.setpoints(drive.drive.rpdos[0], b"\x06\x00\xff", 0.0)
    assert drive.drive.power.machine.state is State.READY_TO_SWITCH_ON, "a longer one is taken"


@pytest.mark.parametrize(("type_", "answered"), [(1, [1, 2, 3, 4]), (2, [2, 4]), (3, [3])])
def test_feedback_comes_with_every_sync_or_every_nth(slave, type_, answered):
    drive = slave().operational()
    drive.configure(PdoDirection.TRANSMIT, type_)
    drive.frames()
    came = []
    for count in range(1, 5):
        drive.drive.sync(0.01 * count)
        came += [count] * len(drive.frames(TPDO_1))
    assert came == answered


def test_feedback_reflects_the_controlword_latched_by_the_same_sync(slave):
    drive = slave().operational()
    drive.configure(PdoDirection.RECEIVE, 1)
    drive.configure(PdoDirection.TRANSMIT, 1)
    drive.frames()
    drive.control(SHUTDOWN)
    drive.drive.sync(0.01)
    ((word,),) = [struct.unpack("<H", frame) for frame in drive.frames(TPDO_1)]
    assert word & 0x6F == 0x21, "ready to switch on"
    assert word & REMOTE


def test_feedback_that_is_dropped_returns_after_as_many_syncs(slave):
    drive = slave().operational()
    drive.configure(PdoDirection.TRANSMIT, 1)
    drive.frames()
    drive.drive.dropped_feedback = 2
    came = []
    for count in range(4):
        drive.drive.sync(0.01 * count)
        came.append(len(drive.frames(TPDO_1)))
    assert came == [0, 0, 1, 1]


def test_a_sync_of_the_wrong_length_is_announced_and_ignored(slave):
    drive = slave().operational()
    drive.configure(PdoDirection.TRANSMIT, 1)
    drive.frames()
    drive.drive.sync(0.0, 1)
    assert [code_of(frame) for frame in drive.frames()] == [(SYNC_LENGTH, 0x11)]
    drive.write(od.SYNC_COUNTER_OVERFLOW, 10)
    drive.drive.sync(0.0, 1)
    assert len(drive.frames(TPDO_1)) == 1
    drive.drive.sync(0.0, 0)
    assert drive.frames(TPDO_1) == []


def test_event_driven_feedback_comes_with_a_new_statusword_and_with_its_timer(slave):
    drive = slave().operational()
    drive.configure(PdoDirection.TRANSMIT, 255, timer_ms=50)
    drive.drive.tick(0.0)
    assert len(drive.frames(TPDO_1)) == 1
    drive.control(SHUTDOWN, 0.01)
    assert len(drive.frames(TPDO_1)) == 1
    for now_s, count in ((0.02, 0), (0.059, 0), (0.061, 1), (0.11, 0), (0.112, 1)):
        drive.drive.tick(now_s)
        assert len(drive.frames(TPDO_1)) == count, now_s


def test_a_heartbeat_is_sent_in_its_period_with_the_state(slave):
    drive = slave().booted()
    drive.frames()
    drive.write(od.HEARTBEAT_PRODUCER_MS, 100)
    sent = []
    for step in range(1, 31):
        drive.drive.tick(0.01 * step + 1e-6)
        sent += [(step, frame) for frame in drive.frames(HEARTBEAT)]
    assert sent == [(10, b"\x7f"), (20, b"\x7f"), (30, b"\x7f")]
    drive.write(od.HEARTBEAT_PRODUCER_MS, 0)
    drive.drive.tick(9.0)
    assert drive.frames() == []


def test_a_late_heartbeat_is_not_made_up_for(slave):
    drive = slave().booted()
    drive.write(od.HEARTBEAT_PRODUCER_MS, 100)
    drive.frames()
    drive.drive.tick(1.0)
    drive.drive.tick(1.0)
    drive.drive.tick(1.05)
    assert len(drive.frames()) == 2, "the next one is due at once, but no more of the nine that were missed"


@pytest.mark.parametrize(
    ("behaviour", "state"), [(0, NmtState.PRE_OPERATIONAL), (1, NmtState.OPERATIONAL), (2, NmtState.STOPPED)]
)
def test_a_master_that_falls_silent_is_lost_once_and_1029_decides_the_state(slave, behaviour, state):
    drive = slave().enabled()
    drive.write(od.COMMUNICATION_ERROR_BEHAVIOUR, behaviour)
    drive.write(od.HEARTBEAT_CONSUMER, MASTER << 16 | 200)
    drive.drive.tick(5.0)
    assert drive.frames(EMERGENCY) == [], "it is watched from its first heartbeat on"
    drive.drive.heard(MASTER, 5.0)
    drive.drive.heard(MASTER - 1, 5.1)
    drive.drive.tick(5.2)
    assert drive.frames(EMERGENCY) == []
    drive.drive.tick(5.201)
    assert [code_of(frame)[0] for frame in drive.frames(EMERGENCY)] == [HEARTBEAT_LOST]
    assert drive.drive.state is state
    assert drive.drive.power.machine.state is State.FAULT_REACTION_ACTIVE
    drive.drive.tick(6.0)
    assert drive.frames(EMERGENCY) == []


def test_a_consumer_without_a_time_watches_nobody(slave):
    drive = slave().operational()
    drive.write(od.HEARTBEAT_CONSUMER, MASTER << 16)
    drive.drive.heard(MASTER, 0.0)
    drive.drive.tick(9.0)
    assert drive.frames(EMERGENCY) == []
    drive.write(od.HEARTBEAT_CONSUMER, MASTER << 16 | 200)
    drive.drive.heard(MASTER, 9.0)
    drive.write(od.HEARTBEAT_CONSUMER, MASTER << 16 | 200)
    drive.drive.tick(10.0)
    assert drive.frames(EMERGENCY) == [], "written anew, it begins with the next heartbeat"


def test_an_overdue_setpoint_is_announced_once(slave):
    drive = slave().operational()
    drive.configure(PdoDirection.RECEIVE, 255, timer_ms=30)
    drive.drive.tick(1.0)
    assert drive.frames(EMERGENCY) == [], "none was received yet"
    drive.control(SHUTDOWN, 1.0)
    drive.drive.tick(1.03)
    assert drive.frames(EMERGENCY) == []
    drive.drive.tick(1.031)
    drive.drive.tick(1.1)
    assert [code_of(frame) for frame in drive.frames(EMERGENCY)] == [(RPDO_OVERDUE, 0x11)]


def test_faults_are_kept_newest_first_and_a_reset_clears_code_and_register_only(slave):
    drive = slave().operational()
    for code in (0x3210, 0x4310):
        drive.drive.fail(code, 0.0)
        drive.control(0x00)
        drive.control(0x80)
    values = drive.values
    assert [values[entry.key] for entry in od.ERROR_HISTORY][:3] == [0x4310, 0x3210, 0]
    assert values[od.ERROR_COUNT.key] == 2
    assert (values[od.ERROR_CODE.key], values[od.ERROR_REGISTER.key]) == (0, 0)
    codes = [code_of(frame) for frame in drive.frames(EMERGENCY)]
    assert codes == [(0x3210, 0x21), (0, 0), (0x4310, 0x21), (0, 0)]
    for code in range(0x5000, 0x5000 + len(od.ERROR_HISTORY) + 3):
        drive.drive.fail(code, 0.0)
        assert values[od.ERROR_CODE.key] == code
        drive.control(0x00)
        drive.control(0x80)
    assert values[od.ERROR_COUNT.key] == len(od.ERROR_HISTORY)


def test_a_stopped_drive_sends_no_emergency_but_keeps_the_code(slave):
    drive = slave().operational()
    drive.drive.command(NmtCommand.STOP, 0.0)
    drive.frames()
    drive.drive.fail(0x3210, 0.0)
    assert drive.frames() == []
    assert drive.values[od.ERROR_CODE.key] == 0x3210


def test_a_pdo_that_gets_an_identifier_is_used_and_the_router_is_told(slave):
    drive = slave().operational()
    assert [pdo.cob_id for pdo in drive.drive.rpdos[:2]] == [RPDO_1, None]
    told = drive.rerouted
    drive.write(PdoDirection.TRANSMIT.cob_id_entry(1), 0x2A5)
    drive.configure(PdoDirection.TRANSMIT, 1, number=1)
    assert drive.rerouted == told + 1
    drive.frames()
    drive.drive.sync(0.0)
    assert len(drive.frames(0x2A5)) == 1
    drive.write(PdoDirection.TRANSMIT.cob_id_entry(1), 0x2A5 | od.PDO_DISABLED)
    drive.drive.sync(0.01)
    assert drive.frames(0x2A5) == []
