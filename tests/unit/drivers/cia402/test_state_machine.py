"""The state machine itself, and its two sides connected."""

from collections import Counter
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from armload_drivers.cia402.state_machine import (
    POWERED,
    ROUTES,
    TRANSITIONS,
    Command,
    DriveMachine,
    MasterMachine,
    State,
    state_in,
)
from armload_drivers.driver_errors import StatuswordError, TransitionError

FAULT_RESET_BIT = 0x80

pytestmark = pytest.mark.pure


STATUS = {
    State.NOT_READY_TO_SWITCH_ON: "x0xx0000", State.SWITCH_ON_DISABLED: "x1xx0000",
    State.READY_TO_SWITCH_ON: "x01x0001", State.SWITCHED_ON: "x01x0011", State.OPERATION_ENABLED: "x01x0111",
    State.QUICK_STOP_ACTIVE: "x00x0111", State.FAULT_REACTION_ACTIVE: "x0xx1111", State.FAULT: "x0xx1000",
}  # fmt: skip
"""CiA 402-2, table "state coding": the low byte; the high one has no part."""
COMMANDS = {
    Command.SHUTDOWN: "0xxxx110", Command.SWITCH_ON: "0xxx0111", Command.ENABLE_OPERATION: "0xxx1111",
    Command.DISABLE_VOLTAGE: "0xxxxx0x", Command.QUICK_STOP: "0xxxx01x",
}  # fmt: skip
"""CiA 402-2, table "command coding", likewise."""
MADE = {
    State.SWITCH_ON_DISABLED: {0x06: (2,), 0x07: (), 0x0F: (), 0x00: (), 0x02: ()},
    State.READY_TO_SWITCH_ON: {0x06: (), 0x07: (3,), 0x0F: (3, 4), 0x00: (7,), 0x02: (7,)},
    State.SWITCHED_ON: {0x06: (6,), 0x07: (), 0x0F: (4,), 0x00: (10,), 0x02: (10,)},
    State.OPERATION_ENABLED: {0x06: (8,), 0x07: (5,), 0x0F: (), 0x00: (9,), 0x02: (11,)},
    State.QUICK_STOP_ACTIVE: {0x06: (), 0x07: (), 0x0F: (16,), 0x00: (12,), 0x02: ()},
    State.FAULT_REACTION_ACTIVE: {0x06: (), 0x07: (), 0x0F: (), 0x00: (), 0x02: ()},
    State.FAULT: {0x06: (), 0x07: (), 0x0F: (), 0x00: (), 0x02: (), 0x80: (15,)},
}
"""CiA 402-2, figure of the finite state automaton: transitions by word."""
INTO = {
    2: State.READY_TO_SWITCH_ON, 3: State.SWITCHED_ON, 4: State.OPERATION_ENABLED, 5: State.SWITCHED_ON,
    6: State.READY_TO_SWITCH_ON, 7: State.SWITCH_ON_DISABLED, 8: State.READY_TO_SWITCH_ON, 9: State.SWITCH_ON_DISABLED,
    10: State.SWITCH_ON_DISABLED, 11: State.QUICK_STOP_ACTIVE, 12: State.SWITCH_ON_DISABLED,
    15: State.SWITCH_ON_DISABLED, 16: State.OPERATION_ENABLED,
}  # fmt: skip


def fits(word, pattern):
    return all(bit in {"x", of} for bit, of in zip(pattern, f"{word & 0xFF:08b}", strict=True))


def test_every_word_is_read_as_the_standards_tables_say():
    for word in range(1 << 8):
        states = [state for state, pattern in STATUS.items() if fits(word, pattern)]
        assert [decoded(word), decoded(word | 0xFF00)] == (2 * states or [None, None])
        assert {command for command in Command if command.matches(word)} == {
            command for command, pattern in COMMANDS.items() if fits(word, pattern)
        }


@pytest.mark.parametrize("state", MADE)
def test_a_drive_makes_the_standards_transitions_and_no_other(state):
    for word, made in MADE[state].items():
        drive = DriveMachine()
        drive.state = state
        assert drive.receive(word) == made, f"{word:02X}"
        assert drive.state is (INTO[made[-1]] if made else state)
    drive = DriveMachine()
    drive.state = state
    drive.fault()
    assert drive.state is (state if state is State.FAULT else State.FAULT_REACTION_ACTIVE)


def test_a_drive_makes_its_own_transitions_in_their_states_only():
    for state in State:
        for event, source, target in (
            (DriveMachine.initialised, State.NOT_READY_TO_SWITCH_ON, State.SWITCH_ON_DISABLED),
            (DriveMachine.fault_reaction_done, State.FAULT_REACTION_ACTIVE, State.FAULT),
            (DriveMachine.quick_stop_done, State.QUICK_STOP_ACTIVE, State.SWITCH_ON_DISABLED),
        ):
            drive = DriveMachine()
            drive.state = state
            event(drive)
            assert drive.state is (target if state is source else state)


def test_without_a_goal_every_state_is_kept_by_its_word():
    words = []
    for state in State:
        master = MasterMachine()
        master.receive(state.bits, 0.0)
        words.append(master.controlword(0.0))
        assert master.goal is None
    assert words == [0x00, 0x00, 0x06, 0x07, 0x0F, 0x02, 0x00, 0x00]


def decoded(word):
    try:
        return state_in(word)
    except StatuswordError:
        return None


def ready_drive():
    drive = DriveMachine()
    drive.initialised()
    return drive


def talk(master, drive, cycles, start_s=0.0, cycle_s=0.01):
    """Run cycles of controlword and statusword; returns the controlwords."""
    words = []
    for cycle in range(cycles):
        now_s = start_s + cycle * cycle_s
        words.append(master.controlword(now_s))
        drive.receive(words[-1])
        master.receive(drive.status_bits, now_s)
    return words


def enabled_pair():
    master, drive = MasterMachine(), ready_drive()
    talk(master, drive, 1)
    master.request(State.OPERATION_ENABLED)
    talk(master, drive, 5)
    assert drive.state is State.OPERATION_ENABLED
    return master, drive


def test_every_statusword_encodes_one_state_or_is_an_error():
    matches = Counter(sum(word & state.mask == state.bits for state in State) for word in range(1 << 16))
    assert matches == {1: 12_288, 0: 53_248}

    words = Counter(decoded(word) for word in range(1 << 16))
    assert words[None] == 53_248
    assert set(words) == set(State) | {None}


def test_an_undefined_statusword_leaves_the_machine_as_it_was():
    master, _ = enabled_pair()
    before = (master.state, master.statusword, master.goal)
    with pytest.raises(StatuswordError, match="0xFFFF"):
        master.receive(0xFFFF, 1.0)
    assert (master.state, master.statusword, master.goal) == before


def test_the_standards_transitions_are_all_there():
    numbers = [transition.number for transition in TRANSITIONS]
    assert sorted(numbers) == [1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 14, 15, 16]
    by_name = {transition.number for transition in TRANSITIONS if transition.by_name}
    assert by_name == {8, 9, 15, 16}


def test_no_route_contains_what_has_to_be_asked_for_by_name():
    for goal, steps in ROUTES.items():
        for state, step in steps.items():
            assert not step.by_name, (goal, state)
    assert State.QUICK_STOP_ACTIVE not in ROUTES[State.OPERATION_ENABLED]
    assert State.FAULT not in ROUTES[State.SWITCH_ON_DISABLED]


def test_a_quick_stop_never_enables_a_drive_first():
    assert set(ROUTES[State.QUICK_STOP_ACTIVE]) == {State.OPERATION_ENABLED}
    master, drive = MasterMachine(), ready_drive()
    talk(master, drive, 1)
    master.request(State.QUICK_STOP_ACTIVE)
    talk(master, drive, 10)
    assert drive.state is State.SWITCH_ON_DISABLED


def test_enabling_goes_through_every_state_in_order():
    master, drive = MasterMachine(), ready_drive()
    seen = []
    talk(master, drive, 1)
    master.request(State.OPERATION_ENABLED)
    for _ in range(4):
        talk(master, drive, 1)
        seen.append(drive.state)
    assert seen == [
        State.READY_TO_SWITCH_ON,
        State.SWITCHED_ON,
        State.OPERATION_ENABLED,
        State.OPERATION_ENABLED,
    ]
    assert master.reached


def test_disabling_closes_the_brake_before_the_voltage_goes():
    master, drive = enabled_pair()
    master.request(State.SWITCH_ON_DISABLED)
    states = [drive.state]
    for _ in range(3):
        talk(master, drive, 1)
        states.append(drive.state)
    assert states == [
        State.OPERATION_ENABLED,
        State.SWITCHED_ON,
        State.SWITCH_ON_DISABLED,
        State.SWITCH_ON_DISABLED,
    ]


@pytest.mark.parametrize("fallen", [State.SWITCH_ON_DISABLED, State.SWITCHED_ON, State.QUICK_STOP_ACTIVE])
def test_a_drive_that_leaves_operation_is_not_brought_back(fallen):
    master, drive = enabled_pair()
    drive.state = fallen
    master.receive(drive.status_bits, 1.0)
    talk(master, drive, 20, 1.0)
    assert drive.state is not State.OPERATION_ENABLED
    assert not master.reached


def test_an_arm_is_not_enabled_out_of_a_quick_stop():
    master, drive = enabled_pair()
    master.request(State.QUICK_STOP_ACTIVE)
    talk(master, drive, 3)
    assert drive.state is State.QUICK_STOP_ACTIVE
    with pytest.raises(TransitionError, match="requires the torque to be removed first"):
        master.request(State.OPERATION_ENABLED)
    talk(master, drive, 5)
    assert drive.state is State.QUICK_STOP_ACTIVE
    master.request(State.SWITCH_ON_DISABLED)
    talk(master, drive, 5)
    master.request(State.OPERATION_ENABLED)
    talk(master, drive, 5)
    assert drive.state is State.OPERATION_ENABLED


def test_a_fault_is_reset_by_name_only_and_on_a_rising_edge():
    master, drive = enabled_pair()
    drive.fault()
    drive.fault_reaction_done()
    words = talk(master, drive, 20, 1.0)
    assert drive.state is State.FAULT
    assert not any(word & 0x80 for word in words)
    with pytest.raises(TransitionError, match="fault reset"):
        master.request(State.OPERATION_ENABLED)

    master.request_fault_reset()
    words = talk(master, drive, 5, 2.0)
    assert words[:2] == [0x00, 0x80]
    assert drive.state is State.SWITCH_ON_DISABLED
    assert master.reached
    assert words[2:] == [0x00] * 3


def test_a_fault_that_stays_gets_a_bounded_number_of_edges():
    master = MasterMachine(reset_hold_s=0.05)
    master.receive(State.FAULT.bits, 0.0)
    master.request_fault_reset()
    high = []
    for cycle in range(200):
        high.append(bool(master.controlword(0.01 * cycle) & 0x80))
        master.receive(State.FAULT.bits, 0.01 * cycle)
    edges = [k for k in range(1, 200) if high[k] and not high[k - 1]]
    assert len(edges) == 3
    assert not high[0]
    # Each level lasts at least hold_s (five cycles here), and bit 7 ends low.
    levels = [k for k in range(1, 200) if high[k] != high[k - 1]]
    assert all(after - before >= 5 for before, after in pairwise(levels))
    assert not high[-1]


def test_bit_7_is_high_for_a_tenth_of_a_second_unless_told_otherwise():
    master = MasterMachine()
    master.receive(State.FAULT.bits, 0.0)
    master.request_fault_reset()
    high = [bool(master.controlword(cycle / 128.0)) for cycle in range(27)]
    assert high == [False] + 13 * [True] + 13 * [False], "13 of 7.8 ms: the first level after 0.1 s"


def test_a_reset_without_a_fault_is_refused():
    master, _ = enabled_pair()
    with pytest.raises(TransitionError, match="only FAULT"):
        master.request_fault_reset()


def test_nothing_is_commanded_before_the_first_statusword():
    master = MasterMachine()
    master.request(State.OPERATION_ENABLED)
    assert master.controlword(0.0) == 0


def test_one_word_may_take_a_drive_through_two_transitions():
    drive = ready_drive()
    drive.receive(0x06)
    assert drive.receive(0x0F) == (3, 4)
    assert drive.state is State.OPERATION_ENABLED


def test_a_held_reset_bit_does_not_reset_the_next_fault():
    drive = ready_drive()
    drive.receive(0x80)
    drive.fault()
    drive.fault_reaction_done()
    assert drive.receive(0x80) == ()
    assert drive.receive(0x00) == ()
    assert drive.receive(0x80) == (15,)


def test_since_is_when_the_present_state_began():
    master = MasterMachine()
    for now_s, state in ((1.0, State.SWITCH_ON_DISABLED), (2.0, State.SWITCH_ON_DISABLED), (3.0, State.FAULT)):
        master.receive(state.bits, now_s)
    assert master.since_s == 3.0


@pytest.mark.parametrize("state", list(State))
def test_a_drives_status_bits_encode_its_state(state):
    drive = DriveMachine()
    drive.state = state
    assert state_in(drive.status_bits) is state


def test_a_quick_stop_may_end_without_torque():
    master, drive = enabled_pair()
    master.request(State.QUICK_STOP_ACTIVE)
    talk(master, drive, 1)
    drive.quick_stop_done()
    talk(master, drive, 5)
    assert drive.state is State.SWITCH_ON_DISABLED


def test_commands_match_their_own_words():
    assert [command for command in Command if command.matches(0x0F)] == [Command.ENABLE_OPERATION]
    assert Command.DISABLE_OPERATION is Command.SWITCH_ON
    assert Command.DISABLE_VOLTAGE.matches(0x00)
    assert not Command.SHUTDOWN.matches(0x86), "a fault reset is no shutdown"


EVENTS = st.sampled_from(["cycle", "fault", "reaction", "enable", "disable", "stop"])


@given(st.lists(EVENTS, max_size=60))
def test_power_comes_back_only_after_a_request(events):
    """In any sequence of events, only a request brings a drive to OPERATION ENABLED."""
    master, drive = MasterMachine(), ready_drive()
    goals = {
        "enable": State.OPERATION_ENABLED,
        "disable": State.SWITCH_ON_DISABLED,
        "stop": State.QUICK_STOP_ACTIVE,
    }
    wanted = False
    now_s = 0.0
    for event in events:
        powered = drive.state in POWERED
        if event in goals:
            try:
                master.request(goals[event])
            except TransitionError:
                continue
            wanted = event == "enable"
        elif event == "fault":
            drive.fault()
        elif event == "reaction":
            drive.fault_reaction_done()
        else:
            talk(master, drive, 1, now_s)
            now_s += 0.01
            if not powered and drive.state is State.OPERATION_ENABLED:
                assert wanted
        assert master.state is None or state_in(master.statusword) is master.state


def test_a_machine_that_knows_nothing_has_reached_nothing():
    assert not MasterMachine().reached


def test_a_drive_in_fault_may_be_asked_to_stay_there_and_to_go_nowhere_else():
    master = MasterMachine()
    master.receive(State.FAULT.bits, 0.0)
    master.request(State.FAULT)
    assert master.reached
    with pytest.raises(TransitionError, match="requires a fault reset"):
        master.request(State.SWITCH_ON_DISABLED)


def test_a_fault_reset_sends_no_bit_to_a_drive_that_has_left_the_fault_another_way():
    master = MasterMachine()
    master.receive(State.FAULT.bits, 0.0)
    master.request_fault_reset()
    assert [master.controlword(0.1 * cycle) for cycle in range(2)] == [0x00, FAULT_RESET_BIT]
    master.receive(State.READY_TO_SWITCH_ON.bits, 0.2)
    assert all(not master.controlword(0.1 * cycle) & FAULT_RESET_BIT for cycle in range(3, 10))


def test_the_bit_of_a_fault_reset_is_no_command_without_a_fault():
    _, drive = enabled_pair()
    assert drive.receive(0x0F | FAULT_RESET_BIT) == ()
    assert drive.state is State.OPERATION_ENABLED
