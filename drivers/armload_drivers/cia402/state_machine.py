"""The power state machine of CiA 402, without input or output.

Rules of this file:
- Every state, command and transition of the standard is defined here once; both sides use the same tables.
- No bus, thread or clock is used. Time is the argument `now_s`, from any monotonic clock.
- A statusword that matches no state is an error with that word; it never counts as the previous state.
- Nothing is restored automatically: a drive that leaves its reached state stays where it is until the next request.
- Some transitions are never part of a route. QUICK STOP ACTIVE to OPERATION ENABLED (16) and the fault reset (15) would
  move an arm that had stopped for a reason; the master never makes the first, and the second only by
  `request_fault_reset`. Removing torque in motion (8, 9) drops an arm; operation is left through "disable operation"
  (5), in which the drive engages its brake first. Only `drop` makes transition 9.

Theory of operation: the master feeds every statusword to `receive`, sets a goal with `request`, and sends
what `controlword` returns in each cycle. The drive feeds every controlword to `DriveMachine.receive`, reports
its own events (`initialised`, `fault`, `fault_reaction_done`, `quick_stop_done`) and sends `status_bits`.

References:
    CiA 402-2 (IEC 61800-7-201), tables "state coding" and "command coding", figure "power drive system
    finite state automaton".
"""

from __future__ import annotations

from collections import deque
from enum import Enum
from types import MappingProxyType

from msgspec import Struct

from armload_drivers.driver_errors import StatuswordError, TransitionError


class State(Enum):
    """States of the power drive system, as the statusword encodes them.

    Attributes:
        mask: Bits of the statusword that encode this state.
        bits: Value of these bits.
        title: The state as the standard spells it.
    """

    NOT_READY_TO_SWITCH_ON = (0x4F, 0x00)
    SWITCH_ON_DISABLED = (0x4F, 0x40)
    READY_TO_SWITCH_ON = (0x6F, 0x21)
    SWITCHED_ON = (0x6F, 0x23)
    OPERATION_ENABLED = (0x6F, 0x27)
    QUICK_STOP_ACTIVE = (0x6F, 0x07)
    FAULT_REACTION_ACTIVE = (0x4F, 0x0F)
    FAULT = (0x4F, 0x08)

    def __init__(self, mask: int, bits: int) -> None:
        self.mask = mask
        self.bits = bits
        self.title = self.name.replace("_", " ")

    # Hash by identity: the enumeration's own hash is written in Python, and each cycle looks states up a hundred times.
    __hash__ = object.__hash__


POWERED = frozenset({State.OPERATION_ENABLED, State.QUICK_STOP_ACTIVE, State.FAULT_REACTION_ACTIVE})
"""States in which the motor carries torque."""


class Command(Enum):
    """Commands of the controlword: (mask, value).

    SWITCH_ON and DISABLE_OPERATION are the same word, and therefore one member, as in the standard's table.
    """

    SHUTDOWN = (0x87, 0x06)
    SWITCH_ON = (0x8F, 0x07)
    ENABLE_OPERATION = (0x8F, 0x0F)
    DISABLE_OPERATION = (0x8F, 0x07)
    DISABLE_VOLTAGE = (0x82, 0x00)
    QUICK_STOP = (0x86, 0x02)

    def matches(self, controlword: int) -> bool:
        """Whether `controlword` gives this command."""
        mask, value = self.value
        return bool(controlword & mask == value)


FAULT_RESET_BIT = 0x80
"""Acts only on its rising edge."""
RESET_EDGES = 3
"""Greatest number of rising edges of bit 7 in a fault reset."""
RESET_HOLD_S = 0.1
"""Least time for which bit 7 stays high, and low in between."""


class Transition(Struct, frozen=True):
    """One transition of the state machine.

    Attributes:
        number: The standard's number.
        source: State before it.
        target: State after it.
        commands: Commands that trigger it; empty if the drive itself or a fault reset does.
        by_name: Whether it is never part of a route; see the rules of this file.
    """

    number: int
    source: State
    target: State
    commands: tuple[Command, ...] = ()
    by_name: bool = False


TRANSITIONS = (
    Transition(1, State.NOT_READY_TO_SWITCH_ON, State.SWITCH_ON_DISABLED),
    Transition(2, State.SWITCH_ON_DISABLED, State.READY_TO_SWITCH_ON, (Command.SHUTDOWN,)),
    Transition(3, State.READY_TO_SWITCH_ON, State.SWITCHED_ON, (Command.SWITCH_ON, Command.ENABLE_OPERATION)),
    Transition(4, State.SWITCHED_ON, State.OPERATION_ENABLED, (Command.ENABLE_OPERATION,)),
    Transition(5, State.OPERATION_ENABLED, State.SWITCHED_ON, (Command.DISABLE_OPERATION,)),
    Transition(6, State.SWITCHED_ON, State.READY_TO_SWITCH_ON, (Command.SHUTDOWN,)),
    Transition(7, State.READY_TO_SWITCH_ON, State.SWITCH_ON_DISABLED, (Command.DISABLE_VOLTAGE, Command.QUICK_STOP)),
    Transition(8, State.OPERATION_ENABLED, State.READY_TO_SWITCH_ON, (Command.SHUTDOWN,), by_name=True),
    Transition(9, State.OPERATION_ENABLED, State.SWITCH_ON_DISABLED, (Command.DISABLE_VOLTAGE,), by_name=True),
    Transition(10, State.SWITCHED_ON, State.SWITCH_ON_DISABLED, (Command.DISABLE_VOLTAGE, Command.QUICK_STOP)),
    Transition(11, State.OPERATION_ENABLED, State.QUICK_STOP_ACTIVE, (Command.QUICK_STOP,)),
    Transition(12, State.QUICK_STOP_ACTIVE, State.SWITCH_ON_DISABLED, (Command.DISABLE_VOLTAGE,)),
    Transition(14, State.FAULT_REACTION_ACTIVE, State.FAULT),
    Transition(15, State.FAULT, State.SWITCH_ON_DISABLED, by_name=True),
    Transition(16, State.QUICK_STOP_ACTIVE, State.OPERATION_ENABLED, (Command.ENABLE_OPERATION,), by_name=True),
)
"""Transitions 0 (power-on) and 13 (from every state to FAULT REACTION ACTIVE) are made by the drive and not listed."""


def state_in(statusword: int) -> State:
    """State that a statusword encodes.

    Args:
        statusword: Object 6041, 0 to 0xFFFF.

    Raises:
        StatuswordError: no state matches, as for 53,248 of the 65,536 words.
    """
    for state in State:
        if statusword & state.mask == state.bits:
            return state
    raise StatuswordError(statusword)


def _first_steps(goal: State) -> dict[State, Transition]:
    """For every state with a route to `goal`, the first transition of the shortest route.

    QUICK STOP ACTIVE is reached only from OPERATION ENABLED: a drive is never enabled in order to stop it. And no route
    leads from there to OPERATION ENABLED, not even through SWITCH ON DISABLED.
    """
    if goal is State.QUICK_STOP_ACTIVE:
        return {step.source: step for step in TRANSITIONS if step.target is goal}
    steps: dict[State, Transition] = {}
    frontier: deque[State] = deque([goal])
    while frontier:
        reached = frontier.popleft()
        for transition in TRANSITIONS:
            source = transition.source
            if transition.target is reached and transition.commands and not transition.by_name:
                resumes = goal is State.OPERATION_ENABLED and source is State.QUICK_STOP_ACTIVE
                if source is goal or source in steps or resumes:
                    continue
                steps[source] = transition
                frontier.append(source)
    return steps


ROUTES = MappingProxyType({goal: MappingProxyType(_first_steps(goal)) for goal in State})
"""ROUTES[goal][state]: the next transition; without an entry, no route leads to the goal."""

# The controlword that keeps a drive in a state.
_STAY: dict[State, int] = {
    State.NOT_READY_TO_SWITCH_ON: 0x00,
    State.SWITCH_ON_DISABLED: 0x00,
    State.READY_TO_SWITCH_ON: Command.SHUTDOWN.value[1],
    State.SWITCHED_ON: Command.SWITCH_ON.value[1],
    State.OPERATION_ENABLED: Command.ENABLE_OPERATION.value[1],
    State.QUICK_STOP_ACTIVE: Command.QUICK_STOP.value[1],
    State.FAULT_REACTION_ACTIVE: 0x00,
    State.FAULT: 0x00,
}
_ENABLED, _STAY_ENABLED = State.OPERATION_ENABLED, _STAY[State.OPERATION_ENABLED]
"""That of nearly every cycle: Python 3.11 takes 0.3 us to hash a member of an enumeration."""


class MasterMachine:
    """The master's view of one drive.

    Args:
        reset_hold_s: Least time for which bit 7 stays high in a fault reset, and low in between; at least one cycle.

    Attributes:
        state: Last state reported by the drive; None before the first statusword.
        statusword: The word that reported it.
        goal: The requested state; None before the first request, and after the drive has left that state by itself.
        since_s: When the present state was first reported.
    """

    def __init__(self, reset_hold_s: float = RESET_HOLD_S) -> None:
        self.state: State | None = None
        self.statusword: int | None = None
        self.goal: State | None = None
        self.since_s = 0.0
        self._reset_hold_s = reset_hold_s
        self._edges_left = 0
        self._bit_high = False
        self._bit_since_s: float | None = None
        self._dropping = False

    @property
    def reached(self) -> bool:
        """Whether the drive is in the requested state."""
        return self.goal is not None and self.state is self.goal

    def receive(self, statusword: int, now_s: float) -> State:
        """Process a statusword.

        Args:
            statusword: Object 6041.
            now_s: Time of its arrival.

        Returns:
            The state it encodes.

        Raises:
            StatuswordError: it encodes none; the machine is unchanged.
        """
        state = state_in(statusword)
        if state is not self.state:
            if self.reached:
                self.goal = None
            self.since_s = now_s
        self.state, self.statusword = state, statusword
        if state is self.goal:
            self._end_fault_reset()
        return state

    def _end_fault_reset(self) -> None:
        """End a fault reset, because it succeeded or was replaced."""
        self._edges_left = 0
        self._bit_high = False

    def request(self, goal: State) -> None:
        """Request a state, to be reached by the standard's shortest safe route.

        Args:
            goal: The state. The caller limits the wait.

        Raises:
            TransitionError: no route leads from the present state to the goal; nothing is changed.
        """
        blocked = {State.FAULT: "a fault reset", State.FAULT_REACTION_ACTIVE: "a fault reset"}
        if goal is State.OPERATION_ENABLED:
            blocked[State.QUICK_STOP_ACTIVE] = "the torque to be removed first"
        if self.state in blocked and goal is not self.state:
            raise TransitionError(
                f"{goal.title} from {self.state.title} requires {blocked[self.state]}", self.statusword
            )
        self.goal = goal
        self._dropping = False
        self._end_fault_reset()

    def drop(self) -> None:
        """Request that torque is removed at once, from any state and also in motion, by "disable voltage".

        A drive in FAULT REACTION ACTIVE does not react to it.
        """
        self.goal = State.SWITCH_ON_DISABLED
        self._dropping = True
        self._end_fault_reset()

    def request_fault_reset(self) -> None:
        """Request transition 15, FAULT to SWITCH ON DISABLED, by a bounded number of rising edges of bit 7.

        Raises:
            TransitionError: the drive is not in FAULT.
        """
        if self.state is not State.FAULT:
            title = "an unknown state" if self.state is None else self.state.title
            raise TransitionError(f"only FAULT can be reset, the drive is in {title}", self.statusword)
        self.goal = State.SWITCH_ON_DISABLED
        self._dropping = False
        self._edges_left = RESET_EDGES
        self._bit_high = False
        self._bit_since_s = None

    def controlword(self, now_s: float) -> int:
        """Word to send in this cycle. Mode-specific bits (4 to 6, 8) are zero; the caller adds them.

        Args:
            now_s: Time of sending; paces the edges of a fault reset.
        """
        state = self.state
        if state is _ENABLED is self.goal:
            return _STAY_ENABLED
        if state is None or self._dropping:
            return Command.DISABLE_VOLTAGE.value[1]
        if (self._edges_left or self._bit_high) and state is State.FAULT:
            return self._reset_bit(now_s)
        if self.goal is None or state is self.goal:
            return _STAY[state]
        step = ROUTES[self.goal].get(state)
        return _STAY[state] if step is None else step.commands[0].value[1]

    def _reset_bit(self, now_s: float) -> int:
        """Bit 7 for this cycle: first a cycle low, then high, each at least `reset_hold_s`."""
        if self._bit_since_s is None:
            self._bit_since_s = now_s - self._reset_hold_s
            return 0x00
        if now_s - self._bit_since_s >= self._reset_hold_s:
            self._bit_since_s = now_s
            if self._bit_high:
                self._bit_high = False
            else:
                self._bit_high = True
                self._edges_left -= 1
        return FAULT_RESET_BIT if self._bit_high else 0x00


class DriveMachine:
    """The drive's side.

    Attributes:
        state: The present state.
    """

    def __init__(self) -> None:
        self.state = State.NOT_READY_TO_SWITCH_ON
        self._controlword = 0

    @property
    def status_bits(self) -> int:
        """Bits of the statusword that encode the state; bit 5 (quick stop, active low) is high if not determined."""
        return self.state.bits | (0x20 if self.state is State.SWITCH_ON_DISABLED else 0x00)

    def initialised(self) -> None:
        """The self-test is complete: transition 1."""
        self._begin_transition(1)

    def receive(self, controlword: int) -> tuple[int, ...]:
        """Process a controlword.

        Args:
            controlword: Object 6040.

        Returns:
            Numbers of the transitions made, in order; at most two (3 and 4 in one word).
        """
        rising = controlword & ~self._controlword & FAULT_RESET_BIT
        self._controlword = controlword
        if self.state is State.FAULT and rising:
            self._begin_transition(15)
            return (15,)
        made: list[int] = []
        while len(made) < 2:
            step = next(
                (
                    transition
                    for transition in TRANSITIONS
                    if transition.source is self.state
                    and any(command.matches(controlword) for command in transition.commands)
                ),
                None,
            )
            if step is None or (made and step.number != 4):
                break
            self.state = step.target
            made.append(step.number)
        return tuple(made)

    def fault(self) -> None:
        """A fault occurred: transition 13, from every state except the two fault states."""
        if self.state not in {State.FAULT, State.FAULT_REACTION_ACTIVE}:
            self.state = State.FAULT_REACTION_ACTIVE

    def fault_reaction_done(self) -> None:
        """The fault reaction is complete: transition 14."""
        self._begin_transition(14)

    def quick_stop_done(self) -> None:
        """The quick stop is complete, and 605A requires switching off: transition 12."""
        self._begin_transition(12)

    def _begin_transition(self, number: int) -> None:
        """Make one of the drive's own transitions if the state allows it."""
        for transition in TRANSITIONS:
            if transition.number == number and transition.source is self.state:
                self.state = transition.target
