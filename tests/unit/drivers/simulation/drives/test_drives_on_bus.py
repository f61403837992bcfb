"""The simulated drives of an arm on one bus: who gets a frame, faults from outside, and how they end."""

import struct

import can
import numpy as np
import pytest

from armload_drivers.bus.joined_bus import BusRole
from armload_drivers.cia402 import object_dictionary as od
from armload_drivers.cia402.object_dictionary import NmtCommand, NmtState
from armload_drivers.driver_errors import BusError, SimulationError, StateError
from armload_drivers.simulation.drives import drives_on_bus
from armload_drivers.simulation.drives.drives_on_bus import SimulatedDrives
from armload_drivers.simulation.lockstep_bus import lockstep_bus, lockstep_wires
from armload_drivers.simulation.plant_interface import EncoderFault
from armload_drivers.simulation.virtual_clock import VirtualClock
from tests.ideal_plant import IdealPlant

LONGEST_GAP_S = 0.05

READ_TYPE = struct.pack("<BHB4x", 0x40, 0x1000, 0)


class Bus:
    """A bus that is no lockstep bus: a queue."""

    def __init__(self):
        self.queue, self.sent, self.fails = [], [], False

    def send(self, message):
        if self.fails:
            raise can.CanOperationError("full")
        self.sent.append((message.arbitration_id, bytes(message.data), message.dlc))

    def recv(self, timeout):
        return self.queue.pop(0) if self.queue else None


class Rig:
    def __init__(self, arm, clock=None):
        self.bus, self.clock = Bus(), clock or (lambda: 0.0)
        self.plant = IdealPlant(np.array([0.1, -0.2, 0.3]), np.array([20.0, -40.0, 60.0]))
        self.drives = SimulatedDrives(arm, self.plant, self.bus, self.clock)
        for drive in self.drives._drives.values():
            drive.switch_on(0.0)
        self.bus.sent.clear()

    def hear(self, cob_id, data=b"", **kind):
        kind.setdefault("is_extended_id", False)
        self.drives._receive(can.Message(arbitration_id=cob_id, data=data, **kind))

    def answered(self):
        sent, self.bus.sent = self.bus.sent, []
        return [cob_id for cob_id, _, _ in sent]

    def states(self):
        return [drive.state for drive in self.drives._drives.values()]


@pytest.fixture
def rig(arm_settings):
    return Rig(arm_settings())


def test_a_request_is_answered_by_the_node_that_it_names(rig):
    rig.hear(0x603, READ_TYPE)
    assert rig.answered() == [0x583]
    rig.hear(0x604, READ_TYPE)
    rig.hear(0x583, READ_TYPE)
    assert rig.answered() == []


@pytest.mark.parametrize("kind", ["is_error_frame", "is_remote_frame", "is_extended_id"])
def test_frames_of_other_kinds_are_for_nobody(rig, kind):
    rig.hear(0x603, b"" if kind == "is_remote_frame" else READ_TYPE, **{kind: True})
    assert rig.answered() == []


@pytest.mark.parametrize(
    ("data", "started"),
    [
        (bytes([1, 0]), [True, True, True]),
        (bytes([1, 3]), [False, True, False]),
        (bytes([1, 4]), [False, False, False]),
        (bytes([1]), [False, False, False]),
        (bytes([1, 3, 0]), [False, False, False]),
        (bytes([99, 3]), [False, False, False]),
    ],
)
def test_nmt_is_for_one_node_or_for_all(rig, data, started):
    assert NmtCommand.START.value == 1
    rig.hear(0x000, data)
    assert [state is NmtState.OPERATIONAL for state in rig.states()] == started


def test_setpoints_go_where_the_drive_listens_at_present(rig):
    rig.hear(0x000, bytes([1, 0]))
    taken = []
    drive = rig.drives._drives[3]
    drive.setpoints = lambda pdo, data, now_s: taken.append(pdo.cob_id)
    rig.hear(0x203, bytes(8))
    assert taken == [0x203]
    pdo = drive.rpdos[0]
    moved = struct.pack("<BHBI", 0x23, 0x1400, 1, 0x80000203), struct.pack("<BHBI", 0x23, 0x1400, 1, 0x0299)
    for request in moved:
        rig.hear(0x603, request)
    assert pdo.cob_id == 0x299
    rig.hear(0x203, bytes(8))
    rig.hear(0x299, bytes(8))
    assert taken == [0x203, 0x299]


def test_heartbeats_of_others_are_heard_by_all(rig):
    heard = []
    for drive in rig.drives._drives.values():
        drive.heard = lambda node_id, now_s: heard.append(node_id)
    rig.hear(0x77F, b"\x05")
    assert heard == [127] * 3


def test_a_frame_that_cannot_be_sent_is_counted_and_lost(rig):
    rig.bus.fails = True
    rig.hear(0x603, READ_TYPE)
    rig.hear(0x603, READ_TYPE)
    assert rig.drives.frames_lost == 2
    rig.bus.fails = False
    rig.hear(0x603, READ_TYPE)
    (sent,) = rig.bus.sent
    assert sent == (0x583, struct.pack("<BHBI", 0x43, 0x1000, 0, 0x0002_0192), 8)


def test_on_a_wall_clock_a_long_gap_is_no_silence_of_the_master(arm_settings):
    now = [10.0]
    rig = Rig(arm_settings(), lambda: now[0])
    begun_s = rig.drives._now_s
    now[0] += 0.5 * LONGEST_GAP_S
    rig.drives._look_at_clock()
    assert rig.drives._now_s - begun_s == pytest.approx(0.5 * LONGEST_GAP_S)
    now[0] += 7.0
    rig.drives._look_at_clock()
    assert rig.drives._now_s - begun_s == pytest.approx(1.5 * LONGEST_GAP_S)


@pytest.mark.parametrize(("age_s", "counts"), [(0.05, True), (0.19, True), (0.3, False), (-0.1, False)])
def test_the_arm_is_where_it_was_when_sync_was_sent(arm_settings, monkeypatch, age_s, counts):
    rig = Rig(arm_settings(), lambda: 50.0)
    times = []
    rig.plant.advance = times.append
    monkeypatch.setattr(drives_on_bus.time, "time", lambda: 1000.0)
    rig.hear(0x080, b"", timestamp=1000.0 - age_s)
    assert times == pytest.approx([50.0 - age_s if counts else 50.0])


# From outside ----------------------------------------------------------------------------------------------------


def test_faults_act_before_the_next_frame_on_the_drive_that_is_meant(virtual_arm):
    arm = virtual_arm()
    arm.servos.connect()
    encoders = []
    arm.plant.fail_encoder = lambda axis, fault: encoders.append((axis, fault))
    arm.drives.fail_encoder(5, EncoderFault(scale=-1.0))
    arm.drives.set_object(3, od.MAX_TORQUE, 77)
    arm.drives.fail(2, 0x2310)
    assert encoders == []
    arm.monitor.send(can.Message(arbitration_id=0x123, is_extended_id=False))
    assert [axis for axis, _ in encoders] == [2]
    drives = arm.drives._drives
    assert drives[3].dictionary.values[od.MAX_TORQUE.key] == 77
    assert drives[2].dictionary.values[od.ERROR_CODE.key] == 0x2310
    assert drives[3].dictionary.values[od.ERROR_CODE.key] == 0


def test_drives_start_once_and_say_why_they_are_gone(virtual_arm):
    arm = virtual_arm()
    assert arm.drives.running
    with pytest.raises(StateError, match="already running"):
        arm.drives.start()
    assert arm.drives._why_ended() == ""
    arm.drives.stop()
    arm.drives.stop()
    assert not arm.drives.running
    assert arm.drives._why_ended() == "they have been stopped"
    assert not any(arm.plant.powered)


def test_an_error_ends_them_without_reaching_the_sender_and_is_raised_once(virtual_arm):
    arm = virtual_arm()
    arm.plant.advance = lambda time_s: 1 / 0
    for _ in range(2):
        arm.monitor.send(can.Message(arbitration_id=0x080, is_extended_id=False))
    assert not arm.drives.running
    assert "ended early: ZeroDivisionError" in arm.drives._why_ended()
    with pytest.raises(SimulationError, match="ended early") as raised:
        arm.drives.stop()
    assert isinstance(raised.value.__cause__, ZeroDivisionError)
    arm.drives.raise_failure()


def test_a_bus_that_fails_is_an_error_of_the_bus(rig):
    rig.drives._failure = BusError("gone")
    with pytest.raises(BusError, match="gone"):
        rig.drives.raise_failure()


def test_virtual_time_needs_a_lockstep_bus(arm_settings):
    drives = SimulatedDrives(arm_settings(), IdealPlant(np.zeros(3), np.zeros(3)), Bus(), VirtualClock())
    with pytest.raises(StateError, match="LockstepBus"):
        drives.start()
    wires = lockstep_wires(arm_settings())
    with lockstep_bus(arm_settings(), wires, BusRole.DRIVES) as bus:
        drives = SimulatedDrives(arm_settings(), IdealPlant(np.zeros(3), np.zeros(3)), bus, VirtualClock())
        with drives:
            assert drives.running
        assert not drives.running


def test_on_a_wall_clock_they_act_in_a_thread_and_by_themselves(arm_settings):
    times = iter(np.arange(0.0, 1e4, 0.01))
    rig = Rig(arm_settings(), lambda: float(next(times)))
    advanced = []
    rig.plant.advance = advanced.append
    rig.bus.queue += [can.Message(arbitration_id=0x603, data=READ_TYPE, is_extended_id=False) for _ in range(3)]
    rig.drives.start()
    while len(advanced) < 2:
        pass
    assert rig.drives.running
    rig.drives.stop()
    answers = [cob_id for cob_id, _, _ in rig.bus.sent if cob_id == 0x583]
    assert len(answers) == 3
    assert not rig.drives.running


def test_a_thread_that_was_not_scheduled_does_not_move_the_arm_past_a_sync_that_it_has_not_read(arm_settings):
    """The thread wakes up 30 ms late; a SYNC that arrived meanwhile samples the arm where it was then."""
    now, sampled = [50.0], []
    rig = Rig(arm_settings(), lambda: now[0])

    def recv(timeout):
        if not sampled and timeout:  # nothing has come; then others run
            now[0] += 0.03
            rig.bus.queue.append(can.Message(arbitration_id=0x080, is_extended_id=False))
            return None
        return rig.bus.queue.pop(0) if rig.bus.queue else None

    rig.bus.recv = recv
    rig.drives._sync = lambda *_: sampled.append(rig.plant.time_s)
    rig.drives.start()
    while rig.plant.time_s < 50.03:
        pass
    rig.drives.stop()
    assert sampled == [0.0]
