"""The power state machine as a table in Markdown, from the tables that both sides run on.

`drivers/README.md` shows it, and a test compares the two.
"""

from __future__ import annotations

from armload_drivers.cia402.state_machine import FAULT_RESET_BIT, POWERED, TRANSITIONS, Command, State, Transition


def table() -> str:
    """Every state with its statusword, whether it carries torque, and every transition from it with its trigger."""
    lines = ["| state | 6041 | torque | transitions |", "|---|---|---|---|"]
    for state in State:
        out = "<br>".join(f"{_label(t)}: {t.target.title}" for t in TRANSITIONS if t.source is state)
        word = f"`& 0x{state.mask:02X} = 0x{state.bits:02X}`"
        lines.append(f"| {state.title} | {word} | {'yes' if state in POWERED else ''} | {out} |")
    return "\n".join(lines)


def _label(transition: Transition) -> str:
    """Number and trigger of a transition."""
    # The same word in the standard's table, and one member here: "switch on" upwards, "disable operation" downwards.
    down = transition.source is State.OPERATION_ENABLED
    names = ["DISABLE_OPERATION" if down and c is Command.SWITCH_ON else c.name for c in transition.commands]
    trigger = " or ".join(name.lower().replace("_", " ") for name in names)
    if not trigger:
        trigger = f"bit {FAULT_RESET_BIT.bit_length() - 1} rises" if transition.by_name else "by itself"
    return f"{transition.number} {trigger}" + (" (only by name)" if transition.by_name else "")
