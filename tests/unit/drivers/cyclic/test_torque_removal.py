"""Whom the removal of torque asks, in what way, and whom it leaves alone: with drives of which a test decides all."""

from contextlib import nullcontext
from dataclasses import replace

import pytest

from armload_drivers.bring_up.sdo_requests import SdoRequests
from armload_drivers.cia402.object_dictionary import NmtState
from armload_drivers.cia402.state_machine import POWERED, DriveMachine, State
from armload_drivers.cia402.timeouts import Timeouts
from armload_drivers.cyclic.torque_removal import TorqueRemoval, torque_remains
from armload_drivers.driver_errors import AxisMoves, LoopLost, ServoError, ServoTimeout, TorqueRemains
from tests.scripted_drives import ENABLED, ScriptedArm

OBEYS_CYCLES = 2

LIMITS = Timeouts(stop_s=0.5, disable_s=0.5, boot_s=0.01, torque_off_s=0.01)
RESET, PRE_OPERATIONAL = 0x81, 0x80
STAYS_ENABLED = 0x0F
CREEPS = 300
"""Counts per cycle: too fast for a standstill, too slow to be off its course at once."""


class Setup:
    """SDO access to one drive.

    Args:
        drive: The drive.
    """

    def __init__(self, drive):
        self.drive = drive
        self.requests = 0

    def remove_torque(self, limit_s):
        self.requests += 1
        if not self.drive.obeys_sdo:
            raise ServoError(3, "joint_3", "removing torque by SDO", "the drive keeps its torque", "")
        if self.drive.state in POWERED and self.drive.state is not State.FAULT_REACTION_ACTIVE:
            self.drive.machine.state = State.SWITCH_ON_DISABLED

    def ask_position(self):
        self.drive.looks += 1

    def answered_position(self):
        return self.drive.counts


class Drive:
    """What one drive does.

    Attributes:
        obeys: Whether it obeys its controlword.
        obeys_sdo: Whether torque is removed by SDO.
        answers: Whether it sends feedback.
        speed: Counts per cycle while it has torque or `falls`.
        looks: Number of times that its position was read by SDO.
    """

    def __init__(self):
        self.machine = DriveMachine()
        self.machine.initialised()
        self.obeys = self.obeys_sdo = self.answers = True
        self.falls = False
        self.speed = self.counts = self.looks = 0

    @property
    def state(self):
        return self.machine.state

    def act(self, controlword):
        if self.obeys:
            self.machine.receive(controlword)
        if self.state in POWERED or self.falls:
            self.counts += self.speed


class Rig(ScriptedArm):
    """An enabled arm at rest, and the removal of its torque."""

    def __init__(self, arm):
        super().__init__(arm)
        self.drives = {node_id: Drive() for node_id in (2, 3, 5)}
        self.setups = [Setup(drive) for drive in self.drives.values()]
        self.removal = TorqueRemoval(self.cycle, self.nodes, self.setups, LIMITS)
        self.cycle.begin()
        self.run()
        self.cycle.ask(State.OPERATION_ENABLED, "enabling", lambda node: True)
        self.run(10)
        assert [node.state for node in self.nodes] == [State.OPERATION_ENABLED] * 3
        self.bus.sent.clear()

    def _answer(self):
        for (node_id, drive), node in zip(self.drives.items(), self.nodes, strict=True):
            drive.act(int.from_bytes(node.message.data[:2], "little"))
            self.words[node_id] = [drive.machine.status_bits] if drive.answers else []
            self.counts[node_id] = drive.counts
        super()._answer()

    def commands(self, command):
        """Nodes to which an NMT command was sent."""
        return [data[1] for cob_id, data in self.bus.sent if cob_id == 0 and data[0] == command]

    def stop(self):
        self.cycle.ask(State.QUICK_STOP_ACTIVE, "quick stop", lambda node: not node.course.lost)
        self.removal.slow_down()

    @property
    def powered(self):
        return [drive.state in POWERED for drive in self.drives.values()]

    @property
    def asked(self):
        """Number of requests by SDO per drive."""
        return [setup.requests for setup in self.setups]


@pytest.fixture
def rig(arm_settings):
    return Rig(arm_settings())


def lose(rig, number):
    """An axis has left its course."""
    rig.nodes[number].course.leave("it flew")


def at_reset(rig, act):
    """Something happens when a reset is sent."""
    send = rig.bus.send

    def sends(message):
        send(message)
        if message.arbitration_id == 0 and message.data[0] == RESET:
            act()

    rig.bus.send = sends


# In motion -------------------------------------------------------------------------------------------------------


def test_a_drive_that_obeys_is_not_asked_a_second_time(rig):
    lose(rig, 1)
    rig.stop()
    for _ in range(10):
        rig.run()
        rig.removal._insist()
    assert rig.powered == [True, False, True]
    assert rig.asked == [0, 0, 0]
    assert rig.commands(RESET) == rig.commands(PRE_OPERATIONAL) == []


def test_a_drive_that_does_not_obey_is_asked_by_sdo_once_and_not_reset(rig):
    lose(rig, 1)
    rig.drives[3].obeys = False
    rig.stop()
    rig.run(10)
    assert rig.powered == [True, False, True]
    assert rig.asked == [0, 1, 0]
    assert rig.commands(PRE_OPERATIONAL) == [3]
    assert rig.commands(RESET) == []


def test_a_drive_that_does_not_obey_by_sdo_either_is_reset_once(rig):
    lose(rig, 1)
    rig.drives[3].obeys = rig.drives[3].obeys_sdo = False
    rig.stop()
    for _ in range(10):
        rig.run()
        rig.removal._insist()
    assert rig.asked == [0, 1, 0]
    assert rig.commands(RESET) == [3]


def test_a_drive_has_some_cycles_to_obey(rig):
    lose(rig, 1)
    rig.drives[3].obeys = False
    rig.removal._drop_astray()
    for _ in range(OBEYS_CYCLES):
        rig.run()
        rig.removal._insist()
    assert rig.asked == [0, 0, 0]
    rig.run()
    rig.removal._insist()
    assert rig.asked == [0, 1, 0]


def test_a_fault_reaction_is_ended_by_a_reset_at_once_whatever_sdo_says(rig):
    lose(rig, 1)
    rig.drives[3].machine.fault()
    rig.run()
    rig.removal._drop_astray()
    rig.removal._insist()
    assert rig.commands(RESET) == [3]


def test_a_drive_that_falls_silent_after_it_reported_no_torque_is_asked(rig):
    """Its last word is old."""
    lose(rig, 1)
    rig.stop()
    assert rig.asked == [0, 0, 0]
    rig.drives[3].answers = False
    for _ in range(OBEYS_CYCLES + 1):
        rig.run()
        rig.removal._insist()
    assert rig.asked == [0, 1, 0]


def test_an_axis_that_is_not_at_rest_in_time_costs_all_their_torque(rig):
    rig.drives[3].speed = CREEPS
    with pytest.raises(LoopLost, match=r"joint_3.*did not come to rest within 0.5 s"):
        rig.stop()
    assert rig.powered == [False, False, False]


@pytest.mark.parametrize("also_lost", [False, True])
def test_a_drive_that_only_stops_answering_costs_no_other_its_torque(rig, also_lost):
    """The others stand on their ramps' ends, and hold; an axis without torque may still be coasting."""
    rig.drives[5].answers = False
    if also_lost:
        lose(rig, 0)
        rig.drives[2].falls, rig.drives[2].speed = True, CREEPS
    begun = rig.cycle.number
    with pytest.raises(ServoTimeout, match="joint_5"):
        rig.stop()
    assert rig.powered == [not also_lost, True, True]
    assert rig.cycle.number - begun < rig.cycle.count(LIMITS.stop_s), "nor is it waited for"


def test_a_drive_that_was_dropped_is_given_no_gentler_command(rig):
    """It obeys nothing so far; if it does at last, then the request to remove torque at once."""
    lose(rig, 1)
    rig.drives[3].obeys = rig.drives[3].obeys_sdo = False
    rig.stop()
    words = set()

    def noted():
        words.add(bytes(rig.nodes[1].message.data[:2]))
        rig._answer()

    rig.bus.at_sync = noted
    with pytest.raises(TorqueRemains):
        rig.removal.run()
    assert words == {b"\0\0"}


@pytest.mark.parametrize("stopped", [True, False])
def test_a_drive_that_is_lost_in_motion_keeps_its_torque_until_it_rests(rig, stopped):
    """It obeys, but does not show it; its position is read by SDO."""
    drive = rig.drives[3]
    drive.speed = CREEPS
    rig.run(5)
    drive.answers = False
    if stopped:
        with pytest.raises(ServoTimeout, match="joint_3"):
            rig.stop()
    moved_without_torque, begun = [], rig.cycle.number

    def comes_to_rest():
        if rig.cycle.number - begun > 60:
            drive.speed = 0
        rig._answer()
        moved_without_torque.append(drive.speed > 0 and drive.state not in POWERED)

    rig.bus.at_sync = comes_to_rest
    with nullcontext() if stopped else pytest.raises(ServoTimeout, match="joint_3"):
        rig.removal.run()
    assert not any(moved_without_torque)
    assert rig.powered == [False, False, False]


def test_a_drive_that_comes_back_late_is_still_named(rig):
    """Once its feedback was missing for too long it counts as lost for this stop."""
    rig.drives[5].answers = False
    rig.drives[3].speed = CREEPS
    runs = []

    def comes_back():
        runs.append(None)
        if len(runs) == 10:
            rig.drives[5].answers = True
        if len(runs) == 20:
            rig.drives[3].speed = 0
        rig._answer()

    rig.bus.at_sync = comes_back
    with pytest.raises(ServoTimeout, match=r"joint_5.*no feedback"):
        rig.stop()
    assert rig.powered == [True, True, True]


# At standstill ---------------------------------------------------------------------------------------------------


def test_all_drives_that_obey_are_switched_off_and_nobody_is_asked(rig):
    rig.removal.run()
    assert rig.powered == [False, False, False]
    assert rig.asked == [0, 0, 0]
    assert rig.commands(RESET) == []


def test_the_end_of_a_fault_reaction_is_awaited(rig):
    rig.drives[3].machine.fault()
    cycles = []

    def reacts():
        cycles.append(None)
        if len(cycles) == 40:
            rig.drives[3].machine.fault_reaction_done()
        rig._answer()

    rig.bus.at_sync = reacts
    rig.removal.run()
    assert [drive.state for drive in rig.drives.values()] == [
        State.SWITCH_ON_DISABLED,
        State.FAULT,
        State.SWITCH_ON_DISABLED,
    ]
    assert rig.asked == [0, 0, 0]


def test_a_drive_in_fault_is_not_waited_for(rig):
    rig.drives[3].machine.fault()
    rig.drives[3].machine.fault_reaction_done()
    begun = rig.cycle.number
    rig.removal.run()
    assert rig.cycle.number - begun < rig.cycle.count(LIMITS.disable_s)


def test_axes_without_a_brake_keep_their_torque_until_the_others_are_switched_off(arm_settings):
    settings = arm_settings()
    drives = tuple(replace(drive, has_brake=drive.node_id != 3) for drive in settings.drives)
    rig = Rig(replace(settings, drives=drives))
    states = []

    def noted():
        rig._answer()
        if rig.nodes[1].message.data[0] == STAYS_ENABLED:
            states.append([rig.drives[node_id].state for node_id in (2, 5)])

    rig.bus.at_sync = noted
    begun = rig.cycle.number
    rig.removal.run()
    assert states[-1] == [State.SWITCH_ON_DISABLED] * 2
    assert rig.powered == [False, False, False]
    assert rig.asked == [0, 0, 0]
    assert rig.cycle.number - begun < rig.cycle.count(LIMITS.disable_s), "nobody was waited for in vain"


def test_an_axis_that_creeps_loses_its_torque_when_the_wait_is_over(rig):
    rig.drives[3].speed = CREEPS
    with pytest.raises(LoopLost, match=r"joint_3.*did not come to rest within 0.5 s"):
        rig.removal.run()
    assert rig.powered == [False, False, False]


def test_a_drive_that_keeps_its_torque_is_asked_by_sdo_and_if_that_fails_named(rig):
    rig.drives[3].obeys = rig.drives[3].obeys_sdo = False
    with pytest.raises(TorqueRemains, match=r"joint_3 \(node 3\)") as raised:
        rig.removal.run()
    assert any("not reached within" in note for note in raised.value.__notes__)
    assert rig.powered == [False, True, False]
    assert rig.commands(RESET) == [3]


@pytest.mark.parametrize("moment", ["before", "while it is switched off"])
def test_a_drive_that_stops_answering_is_asked_by_sdo_and_reported(rig, moment):
    drive = rig.drives[3]
    if moment == "before":
        drive.answers = False
    else:
        drive.machine.receive = lambda word: setattr(drive, "answers", drive.answers and word == STAYS_ENABLED)
    with pytest.raises(ServoTimeout, match=r"joint_3.*no feedback"):
        rig.removal.run()
    assert rig.powered == [False, False, False]
    assert rig.asked == [0, 1, 0]


def test_removal_by_sdo_that_was_read_back_is_all_that_is_needed(rig):
    rig.drives[3].obeys = False
    with pytest.raises(ServoTimeout, match="joint_3"):
        rig.removal.run()
    assert rig.powered == [False, False, False]
    assert rig.commands(RESET) == []


def test_rest_is_awaited_no_longer_than_a_quick_stop_takes(rig):
    rig.drives[3].obeys = False
    rig.removal._asked_by_sdo.append(rig.nodes[1])
    rig.drives[3].speed = CREEPS
    rig.run()
    cycles = rig.cycle.number
    rig.removal._await_rest([rig.nodes[1]])
    assert rig.cycle.number - cycles == pytest.approx(rig.cycle.count(LIMITS.stop_s), abs=1)


def test_a_boot_up_message_alone_is_no_proof(rig):
    rig.drives[3].obeys_sdo = False
    left = [rig.nodes[1]]
    at_reset(rig, lambda: rig.bus.add(0x703, bytes([NmtState.BOOT_UP.value])))
    rig.removal.without_cycle(left)
    assert left == [rig.nodes[1]]


def test_a_drive_that_answers_only_after_the_reset_is_asked_again(rig):
    rig.drives[3].obeys_sdo = False
    left = [rig.nodes[1]]
    at_reset(rig, lambda: setattr(rig.drives[3], "obeys_sdo", True))
    rig.removal.without_cycle(left)
    assert left == []
    assert rig.asked == [0, 2, 0]


def test_an_axis_that_moves_without_torque_is_reported(rig):
    rig.drives[3].falls = True
    rig.cycle.ask(State.SWITCH_ON_DISABLED, "", lambda node: True)
    rig.run(5)
    assert rig.removal._moving() is None
    rig.drives[3].speed = CREEPS
    assert isinstance(rig.removal._moving(), AxisMoves)
    rig.drives[3].answers = False
    rig.run(10)
    assert rig.removal._moving() is None, "its position is unknown"


def test_errors_name_all_drives_that_may_keep_their_torque(rig):
    assert torque_remains([]) is None
    assert "joint_2 (node 2)" in str(torque_remains(rig.nodes[:1]))
    assert "and likewise joint_3 (node 3), joint_5 (node 5)" in str(torque_remains(rig.nodes))


def test_the_stub_has_the_methods_of_the_original():
    assert all(hasattr(SdoRequests, name) for name in ("remove_torque", "read_position"))
    assert State.OPERATION_ENABLED.bits == ENABLED & State.OPERATION_ENABLED.mask
