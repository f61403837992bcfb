"""The power state machine as a Mermaid diagram, drawn from the tables that both sides run on.

`drivers/README.md` shows it, and a test compares the two.
"""

from __future__ import annotations

from armload_drivers.cia402.state_machine import FAULT_RESET_BIT, POWERED, TRANSITIONS, Command, State, Transition


def mermaid() -> str:
    """The diagram: every state with its statusword, every transition with its number and trigger."""
    lines = ["stateDiagram-v2", "    classDef powered stroke-width:4px"]
    for state in State:
        lines.append(f"    {state.name} : {state.title}<br/>6041 & 0x{state.mask:02X} = 0x{state.bits:02X}")
    lines.append("    [*] --> NOT_READY_TO_SWITCH_ON : 0 power on")
    lines.append("    [*] --> FAULT_REACTION_ACTIVE : 13 fault, from any state")
    lines += [f"    {t.source.name} --> {t.target.name} : {_label(t)}" for t in TRANSITIONS]
    lines += [f"    class {state.name} powered" for state in State if state in POWERED]
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
