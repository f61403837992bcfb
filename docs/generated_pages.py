"""Pages that are made from tables of the code; tests compare them.

`python docs/generated_pages.py` writes `controller/STOPS.md` and `drivers/SAFETY.md`, and prints the state machine's
table of `drivers/README.md`.
"""

from __future__ import annotations

import sys
from pathlib import Path

from armload_controller.cycle.stop_decisions import Cause, StopCategory
from armload_drivers.cia402.drive_safety import Safety
from armload_drivers.cia402.state_machine import FAULT_RESET_BIT, POWERED, TRANSITIONS, Command, State, Transition

_STOPS = """\
# What stops an arm, and how

Generated from [stop_decisions.py](armload_controller/cycle/stop_decisions.py) by
`python docs/generated_pages.py`; do not edit. `python -m benchmarks.canopen_runs.stops` measures
every stop on the simulated arm.

Whatever the cause, the arm is disabled with its brakes engaged before the error is reported, and it is never re-enabled
automatically. If a step fails, the next one still follows; the last, removal of torque, is read back from every drive,
or the message names the drives of which it could not be.

**A quick stop leaves the path**, as each axis slows down on its own: er50's by up to 62 mrad.

Torque is removed at standstill, with one exception. A quick stop needs the drive's own loop: with an encoder that has
failed, it accelerates the axis. So every stop escalates. An axis that leaves its
[predicted course](../drivers/armload_drivers/cia402/axis_course.py), because it does not slow down, goes the wrong way,
or its commanded and reported motion contradict each other, loses its torque in the next cycle, and its brake engages;
the others come to rest on their ramps. If more than one axis is affected, or one does not come to rest in time, all
lose their torque. **An axis without a brake falls.** The operator reads "emergency stop", and what to check.
`python -m benchmarks.canopen_runs.broken_loops` measures it, `ordinary_stops` that no sound arm is affected.

"""


def stop_page() -> str:
    """The page, Markdown."""
    stops = _rows(
        ("Stop", "Steps, in this order"),
        [(category.title, "; ".join(step.value for step in category.sequence)) for category in StopCategory],
    )
    errors = {cause: [f"`{kind.__name__}`" for kind in cause.errors] for cause in Cause}
    errors[Cause.PROGRAM].append("any other")
    causes = _rows(
        ("Cause", "Error", "Stop", "What the operator can do"),
        [(cause.words, ", ".join(errors[cause]), cause.category.title, cause.advice) for cause in Cause],
    )
    return f"{_STOPS}{stops}\n{causes}"


def _rows(head: tuple[str, ...], rows: list[tuple[str, ...]]) -> str:
    """A Markdown table."""
    lines = [head, tuple("---" for _ in head), *rows]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


_SAFETY = """\
# Safety properties of a drive

Generated from [drive_safety.py](armload_drivers/cia402/drive_safety.py) by
`python docs/generated_pages.py`; do not edit.

There are several ways in which a drive can provide each property; the first one that is met is used. A way is met if
its condition holds and every object reads back the required value. An object that cannot be written but already has the
required value counts as set. A drive that provides a property in none of these ways is refused, unless its
`accept_missing` names the property. `armload drives check ROBOT` prints this table for each joint, with what was found
there.

"""


def safety_page() -> str:
    """The page, Markdown."""
    return _SAFETY + "\n".join(_section(of) for of in Safety)


def _section(of: Safety) -> str:
    """One property."""
    rows = "".join(
        f"| {number} | {way.text} | {'both' if way.fieldbus is None else way.fieldbus.value} | {way.verified} |\n"
        for number, way in enumerate(of.ways, start=1)
    )
    remedy = f"Before accepting this as missing: {of.remedy}.\n" if of.remedy else ""
    return f"""\
## `{of.key}`: the drive {of.title}

Consequence if missing: {of.lost}.
{remedy}
| | way | bus | verified |
|---|---|---|---|
{rows}"""


def state_table() -> str:
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


if __name__ == "__main__":
    checkout = Path(__file__).resolve().parents[1]
    (checkout / "controller" / "STOPS.md").write_text(stop_page(), "utf-8")
    (checkout / "drivers" / "SAFETY.md").write_text(safety_page(), "utf-8")
    sys.stdout.write(state_table() + "\n")
