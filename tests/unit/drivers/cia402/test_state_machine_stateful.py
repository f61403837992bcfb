"""Master and drive connected: in any sequence of events, the properties of the state machine hold."""

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule

from armload_drivers.cia402.state_machine import (
    POWERED,
    TRANSITIONS,
    DriveMachine,
    MasterMachine,
    State,
    state_in,
)
from armload_drivers.driver_errors import StatuswordError, TransitionError

pytestmark = pytest.mark.pure

CYCLE_S = 0.01
LONGEST_ROUTE = 6
GOALS = [
    State.SWITCH_ON_DISABLED,
    State.READY_TO_SWITCH_ON,
    State.SWITCHED_ON,
    State.OPERATION_ENABLED,
    State.QUICK_STOP_ACTIVE,
]
NOISE = st.integers(0, 0xFFFF).map(lambda word: word & ~0x6F)
"""Bits of the statusword that encode no state."""


class Conversation(RuleBasedStateMachine):
    """Cycles with requests of the operator and events of the drive."""

    def __init__(self):
        super().__init__()
        self.master = MasterMachine(reset_hold_s=2 * CYCLE_S)
        self.drive = DriveMachine()
        self.now_s = 0.0
        self.asked_to_enable = False
        self.asked_to_reset = False
        self.edges = 0
        self.word = 0

    def hear(self, noise=0):
        self.master.receive(self.drive.status_bits | noise, self.now_s)

    def forget_if_reached(self):
        """A goal that was reached is done, even if it was left again; one never reached is still requested."""
        if self.master.reached:
            self.asked_to_enable = False

    @rule(noise=NOISE)
    def cycle(self, noise):
        self.now_s += CYCLE_S
        before = self.drive.state
        word = self.master.controlword(self.now_s)
        if word & ~self.word & 0x80:
            self.edges += 1
        self.word = word
        made = self.drive.receive(word)
        if State.OPERATION_ENABLED in {self.drive.state} and before is not State.OPERATION_ENABLED:
            assert self.asked_to_enable, "nothing is enabled that was not asked for"
        if 15 in made:
            assert self.asked_to_reset, "no fault is reset that was not asked for"
        if 9 in made or 8 in made:
            raise AssertionError("torque was removed in motion")
        self.hear(noise)

    @rule()
    def lost_cycle(self):
        """The frame of a cycle is lost: the drive keeps the last controlword, the master the last statusword."""
        self.now_s += CYCLE_S
        self.master.controlword(self.now_s)

    @rule(goal=st.sampled_from(GOALS))
    def request(self, goal):
        before = (self.master.state, self.master.statusword, self.master.goal)
        try:
            self.master.request(goal)
        except TransitionError:
            assert (self.master.state, self.master.statusword, self.master.goal) == before
            return
        self.asked_to_reset = False
        self.asked_to_enable = goal is State.OPERATION_ENABLED

    @rule()
    def request_reset(self):
        if self.master.state is State.FAULT:
            self.master.request_fault_reset()
            self.asked_to_reset, self.asked_to_enable, self.edges = True, False, 0
        else:
            with pytest.raises(TransitionError):
                self.master.request_fault_reset()

    @rule(word=st.integers(0, 0xFFFF))
    def garbage(self, word):
        """A statusword that matches no state changes nothing."""
        try:
            state_in(word)
        except StatuswordError:
            before = (self.master.state, self.master.statusword, self.master.goal)
            with pytest.raises(StatuswordError):
                self.master.receive(word, self.now_s)
            assert (self.master.state, self.master.statusword, self.master.goal) == before

    @rule()
    def drive_fails(self):
        self.drive.fault()
        self.forget_if_reached()

    @precondition(lambda self: self.drive.state is State.FAULT_REACTION_ACTIVE)
    @rule()
    def drive_has_reacted(self):
        self.drive.fault_reaction_done()

    @precondition(lambda self: self.drive.state is State.QUICK_STOP_ACTIVE)
    @rule()
    def drive_has_stopped(self):
        self.drive.quick_stop_done()

    @rule()
    def drive_boots(self):
        self.drive = DriveMachine()
        self.drive.initialised()
        self.forget_if_reached()
        self.word = 0

    @rule()
    def drive_initialises(self):
        self.drive.initialised()

    @precondition(lambda self: self.master.goal is not None)
    @rule()
    def leave_them_alone(self):
        """Without disturbance, a goal is reached in a few cycles or needs an explicit request."""
        for _ in range(LONGEST_ROUTE):
            if self.master.reached and self.drive.state is self.master.goal:
                return
            self.cycle(0)
        goal, state = self.master.goal, self.drive.state
        blocked = {State.FAULT, State.FAULT_REACTION_ACTIVE, State.NOT_READY_TO_SWITCH_ON}
        if goal is State.QUICK_STOP_ACTIVE:
            blocked |= set(State) - {State.OPERATION_ENABLED}
        if goal is State.OPERATION_ENABLED:
            blocked.add(State.QUICK_STOP_ACTIVE)
        assert goal is None or state is goal or state in blocked

    @invariant()
    def resets_are_bounded(self):
        assert self.edges <= 3

    @invariant()
    def both_sides_know_the_states(self):
        assert state_in(self.drive.status_bits) is self.drive.state
        assert self.drive.state in POWERED or self.drive.state not in {State.OPERATION_ENABLED}
        assert all(step.source is not step.target for step in TRANSITIONS)


Conversation.TestCase.settings = settings(max_examples=60, stateful_step_count=40, deadline=None)
TestConversation = Conversation.TestCase
