"""Drives that differ from the configuration, in lockstep: what bring-up refuses, and its messages."""

import struct
from dataclasses import replace

import can
import numpy as np
import pytest

from armload_drivers.bus.bus_link import BusLink
from armload_drivers.canopen.canopen_servos import CanopenServos
from armload_drivers.canopen.safe_reset import reset_drives
from armload_drivers.cia402 import object_dictionary as od
from armload_drivers.cia402.arm_settings import SIMULATION_IDENTITY, Identity, OperationMode
from armload_drivers.cia402.drive_safety import Safety
from armload_drivers.cia402.state_machine import State, state_in
from armload_drivers.cia402.timeouts import Timeouts
from armload_drivers.driver_errors import (
    BusOverload,
    MissingSafety,
    SdoRefused,
    ServoTimeout,
    StateError,
    WrongDevice,
)
from armload_drivers.servos import JointCommand
from armload_drivers.simulation.drives.drive_dictionary import DriveTraits
from armload_drivers.simulation.lockstep_bus import LockstepBus
from armload_drivers.simulation.lockstep_sync import LockstepSync
from tests.bounded import overheard
from tests.even_motion import ZERO, enabled, move
from tests.scripted_drives import ScriptedBus

QUICK = Timeouts(probe_s=0.02, scan_s=0.01, boot_s=0.05, sdo_s=0.05, mode_s=0.05)
"""For tests in which a node does not answer."""


@pytest.mark.parametrize(
    ("identity", "what"),
    [
        (Identity(0x0000_00AB, SIMULATION_IDENTITY.product_code), "vendor id"),
        (Identity(SIMULATION_IDENTITY.vendor_id, 0x1234), "product code"),
    ],
)
def test_a_wrong_identity_is_refused_before_anything_is_changed(virtual_arm, identity, what):
    arm = virtual_arm(traits={3: DriveTraits(identity=identity)})
    # Discard the drives' own boot-up.
    overheard(arm.monitor, 0.05)
    with pytest.raises(WrongDevice, match=what) as raised:
        arm.servos.connect()
    assert raised.value.node_id == 3
    frames = overheard(arm.monitor)
    assert not [m for m in frames if m.arbitration_id == 0], "no NMT command"
    writes = [m for m in frames if 0x600 < m.arbitration_id < 0x680 and m.data[0] >> 5 == 1]
    assert not writes
    assert not any(arm.plant.powered)


def test_a_node_that_answers_only_after_the_reset_is_identified_before_anything_is_written(virtual_arm, arm_settings):
    """One that is switched on meanwhile, and is another device."""
    arm = other_device(virtual_arm, arm_settings)
    arm.drives.switch_off(3)
    with LockstepBus(arm.bus.wire) as switch:
        switch.listen(lambda message: message.data[:1] == b"\x81" and arm.drives.switch_on(3))
        with pytest.raises(WrongDevice, match="product code") as raised:
            arm.servos.connect()
    assert raised.value.node_id == 3
    assert not written(overheard(arm.monitor))


def test_a_node_that_nmt_has_stopped_is_identified_before_any_reset(virtual_arm, arm_settings):
    """It answers no SDO until it is PRE-OPERATIONAL again."""
    arm = other_device(virtual_arm, arm_settings)
    arm.monitor.send(can.Message(arbitration_id=0x000, data=[0x02, 3], is_extended_id=False))
    arm.frames(0)
    with pytest.raises(WrongDevice, match="product code") as raised:
        arm.servos.connect()
    assert raised.value.node_id == 3
    frames = overheard(arm.monitor)
    assert [bytes(m.data) for m in frames if m.arbitration_id == 0] == [b"\x80\x03"]
    assert not written(frames)


def other_device(virtual_arm, arm_settings):
    """An arm whose drive 3 is another product."""
    right, wrong = Identity(0x0000_00AB, 0x1234), Identity(0x0000_00AB, 0x5678)
    traits = {node: DriveTraits(identity=wrong if node == 3 else right) for node in (2, 3, 5)}
    return virtual_arm(arm_settings(identity=right), traits=traits)


def written(frames):
    """SDO downloads."""
    return [m for m in frames if 0x600 < m.arbitration_id < 0x680 and m.data[0] >> 5 == 1]


class SlowSlave:
    """A foreign node with slow SDO answers: a real drive on the same bus as a simulation.

    Args:
        wire: The bus.
        node_id: Its node id.
        answer: Called with each answer.
    """

    def __init__(self, wire, node_id, answer):
        self._node_id, self._answer = node_id, answer
        LockstepBus(wire).listen(self._act)

    def _act(self, message):
        values = {0x1000: 0x0002_0192, 0x1018: 0x0000_02DC}
        if message.arbitration_id == 0x600 + self._node_id and message.data[0] == 0x40:
            index = int.from_bytes(message.data[1:3], "little")
            data = struct.pack("<B3sI", 0x43, bytes(message.data[1:4]), values.get(index, 0))
            self._answer(can.Message(arbitration_id=0x580 + self._node_id, data=data, is_extended_id=False))


class WaitingBus(LockstepBus):
    """The master's end of a bus on which some frames arrive late.

    Args:
        wire: The bus.
        delay_s: Their delay.
    """

    def __init__(self, wire, delay_s):
        super().__init__(wire)
        self._delay_s, self._waited_s, self._late = delay_s, 0.0, []

    def later(self, message):
        self._late.append((self._waited_s + self._delay_s, message))

    def recv(self, timeout=None):
        message = super().recv(timeout)
        if message is not None:
            return message
        end_s = self._waited_s + timeout
        if self._late and self._late[0][0] <= end_s:
            self._waited_s, message = self._late.pop(0)
            return message
        self._waited_s = end_s
        return None


@pytest.mark.parametrize(("delay_s", "kind"), [(0.1, WrongDevice), (1.5, ServoTimeout)])
def test_a_slow_foreign_node_is_not_reset_where_only_simulations_are_allowed(virtual_arm, arm_settings, delay_s, kind):
    """Node 5 is not simulated, and answers after the first check, or after the SDO timeout."""
    settings = arm_settings()
    arm = virtual_arm(settings, drives_arm=replace(settings, drives=settings.drives[:2], coupling=np.eye(2)))
    with WaitingBus(arm.bus.wire, delay_s) as bus:
        SlowSlave(arm.bus.wire, 5, bus.later)
        servos = CanopenServos(settings, bus, LockstepSync(arm.clock), Timeouts(probe_s=0.05, sdo_s=1.0))
        arm.frames(0)
        with pytest.raises(kind) as raised:
            servos.connect()
    assert raised.value.node_id == 5
    frames = overheard(arm.monitor)
    assert frames
    assert not [m for m in frames if m.arbitration_id == 0], "no NMT command to anybody"
    assert not [m for m in frames if 0x600 < m.arbitration_id < 0x680 and m.data[0] >> 5 == 1], "nothing is written"


def test_a_device_of_another_kind_is_refused(virtual_arm):
    arm = virtual_arm(traits={3: DriveTraits(device_type=0x0004_0191)})
    with pytest.raises(WrongDevice, match="401"):
        arm.servos.connect()


def test_an_arm_that_is_not_simulated_says_so(virtual_arm, arm_settings):
    real = Identity(0x0000_00AB, 0x1234)
    arm = virtual_arm(arm_settings(identity=real), traits={node: DriveTraits(identity=real) for node in (2, 3, 5)})
    arm.servos.connect()
    assert not arm.servos.simulated


@pytest.mark.parametrize("node_id", [2, 3, 5])
@pytest.mark.parametrize(
    "identity",
    [
        Identity(0x0000_00AB, 0x1234),
        Identity(SIMULATION_IDENTITY.vendor_id, 0x1234),
        Identity(0x0000_00AB, SIMULATION_IDENTITY.product_code),
    ],
    ids=["another", "the same vendor", "the same product code"],
)
def test_one_drive_that_is_not_simulated_makes_the_arm_real(virtual_arm, arm_settings, node_id, identity):
    """Otherwise a real drive would be moved without its operator's consent."""
    real = DriveTraits(identity=identity)
    arm = virtual_arm(arm_settings(identity=Identity(None, None)), traits={node_id: real})
    arm.servos.connect()
    assert not arm.servos.simulated


def test_a_missing_node_is_named(virtual_arm, arm_settings):
    settings = arm_settings()
    fewer = replace(settings, drives=settings.drives[:2], coupling=np.eye(2))
    arm = virtual_arm(settings, drives_arm=fewer, timeouts=QUICK)
    with pytest.raises(ServoTimeout) as raised:
        arm.servos.connect()
    assert (raised.value.node_id, raised.value.joint) == (5, "joint_5")
    assert "connected, with this node id" in str(raised.value)


def test_a_node_that_neither_boots_nor_answers_is_missed_at_that_step(virtual_arm, arm_settings):
    real = Identity(0x0000_00AB, 0x1234)
    traits = dict.fromkeys((2, 3, 5), DriveTraits(identity=real))
    arm = virtual_arm(arm_settings(identity=real), traits=traits, timeouts=QUICK)
    arm.drives.switch_off(3)
    with pytest.raises(ServoTimeout, match=r"joint_3 \(node 3\), booting: no boot-up message within 0.05 s"):
        arm.servos.connect()


OTHERS_ANSWER = bytes.fromhex("4318100107000000")
"""Vendor id 7."""


def test_answers_to_another_master_are_not_taken_for_answers_to_this_one(virtual_arm):
    arm = virtual_arm()
    for cob_id in (0x582, 0x583, 0x585):
        arm.monitor.send(can.Message(arbitration_id=cob_id, data=OTHERS_ANSWER, is_extended_id=False))
    arm.servos.connect()


def test_nodes_that_are_up_and_send_no_boot_up_message_are_asked(virtual_arm):
    silent = DriveTraits(boot_message=False)
    arm = virtual_arm(traits=dict.fromkeys((2, 3, 5), silent), timeouts=QUICK)
    arm.servos.connect()
    arm.servos.enable()
    assert all(arm.plant.powered)


def test_an_sdo_abort_names_the_object_and_the_code(virtual_arm):
    arm = virtual_arm(traits={3: DriveTraits(on_request=lambda data: 0x0800_0021 if data[1:3] == b"\0\x1a" else None)})
    with pytest.raises(SdoRefused) as raised:
        arm.servos.connect()
    assert raised.value.node_id == 3
    assert raised.value.abort_code == 0x0800_0021
    assert "1A00:0" in str(raised.value)
    assert "mapping" in raised.value.step


def accepting(settings, *names):
    """The same settings, accepting drives without these properties."""
    return replace(settings, drives=tuple(replace(d, accept_missing=frozenset(names)) for d in settings.drives))


def test_what_a_drive_lacks_is_reported(virtual_arm, arm_settings):
    lacks = frozenset({0x1029, 0x6007, 0x605A, 0x6076, 0x607E, 0x608F})
    arm = virtual_arm(accepting(arm_settings(), "master_lost", "quick_stop"), traits={3: DriveTraits(absent=lacks)})
    arm.servos.connect()
    setups = {setup.settings.node_id: setup for setup in arm.servos.setups}
    assert {entry.index for entry in setups[3].objects.missing} == lacks
    assert {finding.of for finding in setups[3].safety if finding.way is None} == {
        Safety.MASTER_LOST,
        Safety.QUICK_STOP,
    }
    assert setups[2].objects.missing == []
    assert all(finding.way is not None for finding in setups[2].safety)


WITHOUT = {
    Safety.TORQUE_LIMIT: {0x6072},
    Safety.MASTER_LOST: {0x6007, 0x1029},
    Safety.SETPOINTS_LOST: {0x1006},
    Safety.QUICK_STOP: {0x605A},
    Safety.FAULT_REACTION: {0x605E},
    Safety.FOLLOWING_ERROR: {0x6065},
    Safety.POSITION_LIMITS: {0x607D},
    Safety.DRIVE_LOST: {0x1017},
}
"""Objects without which a simulated drive has no way to a property; the RPDO's timer is removed too."""


def no_timer(request):
    """A drive without event timers of RPDOs."""
    return 0x0609_0011 if request[1:4] == b"\x00\x14\x05" else None


@pytest.mark.parametrize(("of", "watched"), [(Safety.DRIVE_LOST, False), (Safety.QUICK_STOP, True)])
def test_only_a_drive_without_a_heartbeat_is_not_missed_by_it(virtual_arm, arm_settings, of, watched):
    arm = virtual_arm(accepting(arm_settings(), of.key), traits=lacking(of))
    move(arm, enabled(arm), 3)
    if watched:
        arm.drives.set_object(3, od.HEARTBEAT_PRODUCER_MS, 0)
        with pytest.raises(ServoTimeout, match=r"joint_3.*no heartbeat"):
            move(arm, arm.servos._cycle.units.joint_position_rad([n.target_counts for n in arm.servos._nodes]), 60, 0.0)
    else:
        move(arm, arm.servos._cycle.units.joint_position_rad([n.target_counts for n in arm.servos._nodes]), 60, 0.0)


def lacking(of):
    return {3: DriveTraits(absent=frozenset(WITHOUT[of]), on_request=no_timer if of is Safety.SETPOINTS_LOST else None)}


@pytest.mark.parametrize("of", WITHOUT, ids=[of.key for of in WITHOUT])
def test_a_drive_without_what_safety_rests_on_is_refused_unless_accepted_by_name(virtual_arm, arm_settings, of):
    arm = virtual_arm(accepting(arm_settings(), "disable_reaction"), traits=lacking(of))
    with pytest.raises(MissingSafety) as raised:
        arm.servos.connect()
    assert (raised.value.node_id, raised.value.joint) == (3, "joint_3")
    assert of.lost in str(raised.value)
    assert of.remedy in str(raised.value)
    names = ", ".join(f'"{name}"' for name in sorted(["disable_reaction", of.key]))
    assert f"accept_missing = [{names}]" in str(raised.value), "what was accepted before is kept"
    assert not any(arm.plant.powered)

    accepted = virtual_arm(accepting(arm_settings(), of.key), traits=lacking(of))
    move(accepted, enabled(accepted), 60)
    accepted.servos.close()


def test_only_the_reaction_to_disabling_has_a_way_that_needs_nothing_of_the_drive(virtual_arm):
    assert set(Safety) - set(WITHOUT) == {Safety.DISABLE_REACTION}
    arm = virtual_arm(traits={3: DriveTraits(absent=frozenset({0x605B, 0x605C}))})
    arm.servos.connect()
    (finding,) = (found for found in arm.servos.setups[1].safety if found.of is Safety.DISABLE_REACTION)
    assert finding.found == "this master removes torque at standstill only"
    assert [reason for _, reason in finding.obstacles] == ["no 605B"]


def test_a_drive_that_is_held_by_its_brake_after_a_quick_stop_needs_one(virtual_arm, arm_settings):
    """605A accepts 2, but not 6."""

    def not_six(request):
        return 0x0609_0030 if request[:6] == b"\x2b\x5a\x60\x00\x06\x00" else None

    arm = virtual_arm(traits={3: DriveTraits(on_request=not_six)})
    arm.servos.connect()
    (finding,) = (found for found in arm.servos.setups[1].safety if found.of is Safety.QUICK_STOP)
    assert finding.found == "605A = 2 (ramp, then held by the brake)"
    without_brake = virtual_arm(arm_settings(has_brake=False), traits={3: DriveTraits(on_request=not_six)})
    with pytest.raises(MissingSafety, match="the axis has no brake"):
        without_brake.servos.connect()


def test_an_object_that_does_not_keep_what_is_written_is_no_way(virtual_arm):
    """A drive that confirms writes but keeps the old value: the first way does not count, the second does."""
    arm = virtual_arm(traits={3: DriveTraits(forgets=frozenset({0x6007, 0x6072}))})
    arm.servos.connect()
    found = {finding.of: finding for finding in arm.servos.setups[1].safety}
    assert found[Safety.MASTER_LOST].found.startswith("1029 = 0")
    assert found[Safety.MASTER_LOST].obstacles[0][1] == "6007 reads 1 after 3 was written"
    assert found[Safety.TORQUE_LIMIT].found == "6072 = max_torque_permille", "it has the value already"
    arm = virtual_arm(traits={3: DriveTraits(forgets=frozenset({0x607D}))})
    with pytest.raises(MissingSafety, match=r"position_limits: .*607D:1 reads -2147483648 after -?\d+ was written"):
        arm.servos.connect()


@pytest.mark.parametrize(
    ("code", "words"),
    [
        (0x0601_0002, r"6065 is \d+, cannot be written, and must be \d+"),
        (0x0800_0022, r"6065 is \d+, and \d+ was refused \(0x08000022\)"),
    ],
)
def test_why_an_object_is_no_way_is_said(virtual_arm, arm_settings, code, words):
    def refused(request):
        return code if request[:3] == b"\x23\x65\x60" else None

    drives_arm = arm_settings(following_error_rad=0.4)
    arm = virtual_arm(traits={3: DriveTraits(on_request=refused)}, drives_arm=drives_arm)
    with pytest.raises(MissingSafety, match=words):
        arm.servos.connect()


@pytest.mark.parametrize("index", [0x6502, 0x60C2, 0x6091])
def test_an_object_that_not_every_drive_has_is_only_reported(virtual_arm, index):
    arm = virtual_arm(traits={3: DriveTraits(absent=frozenset({index}))})
    arm.servos.connect()
    assert {entry.index for entry in arm.servos.setups[1].objects.missing} == {index}


@pytest.mark.parametrize("subindex", [1, 2])
def test_half_an_interpolation_time_is_none(virtual_arm, subindex):
    def missing(request):
        return 0x0609_0011 if request[1:4] == bytes([0xC2, 0x60, subindex]) else None

    arm = virtual_arm(traits={3: DriveTraits(on_request=missing)})
    arm.servos.connect()
    assert [str(entry)[:6] for entry in arm.servos.setups[1].objects.missing] == [f"60C2:{subindex}"]


@pytest.mark.parametrize("part", [b"\x91\x60\x01", b"\x91\x60\x02"], ids=["numerator", "denominator"])
@pytest.mark.parametrize("value", [0, None])
def test_half_a_gear_ratio_is_none(virtual_arm, part, value):
    """The configuration's scale counts then; zero is no ratio either."""

    def missing(request):
        return 0x0609_0011 if value is None and request[1:4] == part else None

    arm = virtual_arm(traits={3: DriveTraits(on_request=missing)})
    receive = arm.bus.recv

    def recv(timeout=None):
        message = receive(timeout)
        if value is not None and message is not None and message.arbitration_id == 0x583 and message.data[1:4] == part:
            message.data[4:8] = value.to_bytes(4, "little")
        return message

    arm.bus.recv = recv
    arm.servos.connect()
    assert arm.servos.setups[1].settings.counts_per_rad == arm.arm.drives[1].counts_per_rad


def test_a_missing_target_is_not_replaced_by_another_torque(virtual_arm):
    arm = virtual_arm(traits={3: DriveTraits(absent=frozenset({0x607A}))})
    with pytest.raises(WrongDevice, match=r"no 607A:0.*cyclic synchronous position, 607A.*another drive"):
        arm.servos.connect()


def test_a_drive_that_stops_without_605a_ends_without_torque(virtual_arm, arm_settings):
    arm = virtual_arm(accepting(arm_settings(), "quick_stop"), traits={3: DriveTraits(absent=frozenset({0x605A}))})
    start = enabled(arm)
    move(arm, start, 20)
    arm.servos.stop()
    assert arm.plant.powered == [True, False, True], "605A is 2 where it cannot be written"
    assert arm.plant.velocity_rad_s == pytest.approx(ZERO)
    arm.servos.disable()


def test_a_mode_that_is_not_offered_is_refused(virtual_arm):
    traits = DriveTraits(modes=frozenset({int(OperationMode.INTERPOLATED_POSITION)}))
    arm = virtual_arm(traits={3: traits})
    with pytest.raises(WrongDevice, match=r"mode 8.*only 7"):
        arm.servos.connect()


def test_a_mode_that_is_not_taken_is_an_error(virtual_arm):
    arm = virtual_arm(traits={3: DriveTraits(takes_mode=False)})
    with pytest.raises(ServoTimeout, match="6061"):
        arm.servos.connect()


@pytest.mark.parametrize(
    ("change", "what"),
    [({"counts_per_rad": 1e5}, "position units"), ({"rated_torque_nm": 250.0}, "rated torque"),
     ({"rated_current_a": 11.0}, "rated current")],
)  # fmt: skip
def test_a_scale_that_contradicts_the_drive_is_refused(virtual_arm, arm_settings, change, what):
    arm = virtual_arm(arm_settings(**change), drives_arm=arm_settings())
    with pytest.raises(WrongDevice, match=what):
        arm.servos.connect()


def test_polarity_is_read_and_honoured(virtual_arm):
    arm = virtual_arm(traits={3: DriveTraits(polarity=0x80), 5: DriveTraits(polarity=0xA0)})
    start = enabled(arm)
    assert start == pytest.approx(arm.arm.coupling @ [0.1, -0.2, 0.3], abs=1e-5)
    target = move(arm, start, 10)
    feedback = arm.servos.exchange(JointCommand(target, ZERO, np.array([0.0, 20.0, 40.0])))
    assert feedback.position_rad == pytest.approx(target, abs=1e-5)
    assert arm.arm.coupling @ arm.plant.position_rad == pytest.approx(target, abs=1e-5)
    assert arm.plant.torque_offset_nm == pytest.approx(arm.arm.coupling.T @ [0.0, 20.0, 40.0], abs=0.2)
    assert feedback.current_a == pytest.approx([1.0, -2.0, 3.0], abs=0.01)


def test_a_cycle_that_does_not_fit_is_refused_before_anything_is_sent(virtual_arm, arm_settings):
    settings = replace(arm_settings(), bitrate=20_000)
    arm = virtual_arm(settings)
    overheard(arm.monitor, 0.05)
    with pytest.raises(BusOverload):
        arm.servos.connect()
    assert arm.monitor.recv(0.0) is None


def test_targets_before_enabling_are_fresh_positions(virtual_arm):
    """From the first RPDO on, every frame carries a computed target."""
    arm = virtual_arm()
    arm.servos.connect()
    arm.frames(0)
    arm.servos.enable()
    targets = [int.from_bytes(frame[2:6], "little", signed=True) for frame in arm.frames(0x202)]
    counts = round(0.1 * arm.arm.drives[0].counts_per_rad)
    assert set(targets) == {counts}


def test_a_drive_that_produces_sync_is_told_not_to(virtual_arm):
    arm = virtual_arm()
    receive, asked = arm.bus.recv, b"\x05\x10\x00"

    def recv(timeout=None):
        message = receive(timeout)
        if message is not None and message.arbitration_id == 0x583 and bytes(message.data[:4]) == b"\x43" + asked:
            message.data[7] |= 0x40
        return message

    arm.bus.recv = recv
    arm.servos.connect()
    written = {m.arbitration_id for m in overheard(arm.monitor) if bytes(m.data) == b"\x23" + asked + b"\x80\0\0\0"}
    assert written == {0x603}


def test_a_torque_offset_of_an_earlier_program_is_not_enabled(virtual_arm):
    arm = virtual_arm()
    arm.servos.connect()
    arm.frames(0)
    arm.servos.enable()
    writes = [m for m in overheard(arm.monitor) if m.arbitration_id == 0x603 and bytes(m.data[1:4]) == b"\xb2\x60\x00"]
    assert [bytes(m.data[4:6]) for m in writes] == [b"\0\0"]


class Silent:
    """A drive of which only the settings are known."""

    def __init__(self, settings):
        self.settings = settings


def test_only_a_boot_up_message_shows_that_a_drive_was_reset(arm_settings):
    bus, drives = ScriptedBus(), [Silent(drive) for drive in arm_settings().drives]
    for cob_id, data in ((0x702, b""), (0x702, b"\x7f"), (0x703, b"\x00"), (0x703, b"\x00"), (0x709, b"\x00")):
        bus.add(cob_id, data)
    silent = reset_drives(drives, (), BusLink(bus), 0.01)
    assert [drive.settings.node_id for drive in silent] == [2, 5]


def test_nothing_is_connected_twice(virtual_arm):
    arm = virtual_arm()
    with pytest.raises(StateError, match="connect them first"):
        _ = arm.servos._cycle
    with pytest.raises(StateError, match="never enabled"):
        _ = arm.servos._begun
    arm.servos.connect()
    with pytest.raises(StateError):
        arm.servos.connect()


class InterruptedSync(LockstepSync):
    """Ctrl-C is pressed right after the SYNC that enables the drives."""

    def __init__(self, clock):
        super().__init__(clock)
        self.left = 4

    def next(self, link, on_sync):
        tick = super().next(link, on_sync)
        self.left -= 1
        if self.left == 0:
            raise KeyboardInterrupt
        return tick


def test_an_interrupt_while_enabling_leaves_no_torque_after_close(virtual_arm):
    arm = virtual_arm()
    servos = CanopenServos(arm.arm, arm.bus, InterruptedSync(arm.clock))
    servos.connect()
    with pytest.raises(KeyboardInterrupt):
        servos.enable()
    # The drives process that SYNC before any other frame.
    servos.close()
    assert not any(arm.plant.powered)
    assert [state_in(frame[0] | frame[1] << 8) for frame in arm.frames(0x182)].count(State.OPERATION_ENABLED) >= 1
