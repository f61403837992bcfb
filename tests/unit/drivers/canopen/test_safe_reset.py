"""No reset is sent to a drive whose torque must stay: who is asked, who is listened to, and what is refused."""

from dataclasses import replace

import pytest

from armload_drivers.bring_up.powered_drive import judged
from armload_drivers.bus.bus_link import BusLink
from armload_drivers.canopen.safe_reset import answering_drives, powered_on_bus, reset_drives
from armload_drivers.cia402.object_dictionary import NmtCommand, NmtState
from armload_drivers.cia402.state_machine import State
from armload_drivers.driver_errors import ServoError
from tests.scripted_drives import ScriptedBus

STANDSTILL_RAD_S = 0.005

ENABLED, QUICK_STOP = State.OPERATION_ENABLED, State.QUICK_STOP_ACTIVE
COUNTS_PER_RAD = 1e5


class Setup:
    """A drive of which a test decides what it answers.

    Attributes:
        answers: Whether it answers, at each time that it is asked.
    """

    def __init__(self, settings, answers=(True,)):
        self.settings, self.answers, self.asked = settings, list(answers), 0
        self.state, self.counts = None, [0, 0]

    def identify_before_reset(self):
        self.asked += 1
        return self.answers.pop(0) if len(self.answers) > 1 else self.answers[0]

    def read_powered_state(self):
        return self.state

    def read_position(self):
        return self.counts.pop(0)

    def read_units(self):
        return self

    counts_per_rad = -COUNTS_PER_RAD


class Bus(ScriptedBus):
    """Frames that arrive while the master listens."""

    def __init__(self):
        super().__init__()
        self.later = []

    def commands(self):
        return [tuple(data) for cob_id, data in self.sent if cob_id == 0]


@pytest.fixture
def line(arm_settings):
    """The settings, a bus, its link, and the three drives."""
    arm = replace(arm_settings(), heartbeat_s=0.01)
    bus = Bus()
    return arm, bus, BusLink(bus), [Setup(drive) for drive in arm.drives]


# Silent nodes ----------------------------------------------------------------------------------------------------


def test_drives_that_answer_are_asked_once_and_nothing_is_sent(line):
    arm, bus, link, setups = line
    assert answering_drives(setups, arm, link) == setups
    assert [setup.asked for setup in setups] == [1, 1, 1]
    assert bus.sent == []


def test_a_node_that_stays_silent_is_set_to_pre_operational_and_asked_again(line):
    arm, bus, link, setups = line
    setups[1].answers = [False, False, True]
    setups[2].answers = [False]
    assert answering_drives(setups, arm, link) == setups[:2]
    assert bus.commands() == [(NmtCommand.PRE_OPERATIONAL.value, 3), (NmtCommand.PRE_OPERATIONAL.value, 5)]
    assert [setup.asked for setup in setups] == [1, 3, 3]


def test_a_node_that_was_only_slow_is_left_alone(line):
    arm, bus, link, setups = line
    setups[1].answers = [False, True]
    assert set(answering_drives(setups, arm, link)) == set(setups)
    assert bus.commands() == []


@pytest.mark.parametrize(
    ("state", "refused"), [(NmtState.OPERATIONAL, True), (NmtState.STOPPED, False), (NmtState.PRE_OPERATIONAL, False)]
)
@pytest.mark.parametrize("toggle", [0, 0x80])
def test_nothing_is_sent_to_a_silent_node_that_is_heard_in_operational(line, state, refused, toggle):
    arm, bus, link, setups = line
    setups[1].answers = [False]
    bus.add(0x703, bytes([state.value | toggle]))
    bus.add(0x703, b"")
    if refused:
        with pytest.raises(ServoError, match=r"joint_3.*its heartbeat shows that it is in OPERATIONAL"):
            answering_drives(setups, arm, link)
        assert bus.sent == []
    else:
        answering_drives(setups, arm, link)
        assert bus.commands() == [(NmtCommand.PRE_OPERATIONAL.value, 3)]


def test_another_nodes_heartbeat_says_nothing_about_it(line):
    arm, bus, link, setups = line
    setups[1].answers = [False]
    bus.add(0x702, bytes([NmtState.OPERATIONAL.value]))
    answering_drives(setups, arm, link)
    assert bus.commands() == [(NmtCommand.PRE_OPERATIONAL.value, 3)]


def test_nothing_is_sent_to_a_silent_node_while_a_master_is_heard(line):
    arm, bus, link, setups = line
    setups[1].answers = [False]
    bus.add(0x080, b"")
    with pytest.raises(ServoError, match=r"joint_3.*does not answer, and another node also produces SYNC"):
        answering_drives(setups, arm, link)
    assert bus.sent == []


def test_nothing_is_sent_to_a_silent_node_while_another_drive_is_enabled(line):
    arm, bus, link, setups = line
    setups[1].answers = [False]
    setups[2].state = ENABLED
    with pytest.raises(ServoError, match=r"joint_5.*carries torque in OPERATION ENABLED"):
        answering_drives(setups, arm, link)
    assert bus.sent == []


# Drives with torque ----------------------------------------------------------------------------------------------


def test_without_torque_nobody_is_listened_to(line):
    arm, bus, link, setups = line
    bus.add(0x080, b"")
    assert powered_on_bus(setups, arm, link) == []
    assert len(bus.received) == 1


@pytest.mark.parametrize(("share", "abandoned"), [(0.9, True), (1.1, False)])
def test_the_speed_is_the_way_over_the_time_of_listening(line, share, abandoned):
    arm, _, link, setups = line
    listened_s = 2.5 * arm.heartbeat_s
    setups[1].state = QUICK_STOP
    way = round(share * STANDSTILL_RAD_S * COUNTS_PER_RAD * listened_s)
    setups[1].counts = [-1000, -1000 - way]
    (drive,) = powered_on_bus(setups, arm, link)
    assert drive.setup is setups[1]
    assert drive.abandoned is abandoned


def test_a_master_that_is_heard_is_what_is_wrong(line):
    arm, bus, link, setups = line
    setups[1].state = QUICK_STOP
    bus.add(0x000, bytes([NmtCommand.START.value, 3]))
    (drive,) = powered_on_bus(setups, arm, link)
    assert not drive.abandoned
    assert "NMT" in drive.what


# The reset -------------------------------------------------------------------------------------------------------


def test_a_drive_that_must_keep_its_torque_prevents_every_reset(line):
    _, bus, link, setups = line
    powered = [judged(setups[0], QUICK_STOP, "", 0.0), judged(setups[1], ENABLED, "", 0.0)]
    with pytest.raises(ServoError, match="joint_3"):
        reset_drives(setups, powered, link, 0.01)
    assert bus.sent == []


def test_all_are_reset_and_those_that_send_no_boot_up_message_are_returned(line):
    _, bus, link, setups = line
    for cob_id, data in (
        (0x702, b"\0"),
        (0x702, b"\0"),
        (0x703, b"\x7f"),
        (0x703, b"\x80"),
        (0x703, b""),
        (0x705, b"\0"),
    ):
        bus.add(cob_id, data)
    assert reset_drives(setups, [judged(setups[0], QUICK_STOP, "", 0.0)], link, 0.01) == [setups[1]]
    assert bus.commands() == [(NmtCommand.RESET_NODE.value, node) for node in (2, 3, 5)]
