"""The table of stops as a page: `python -m armload_controller.cycle.page_of_stops > controller/STOPS.md`."""

from __future__ import annotations

import sys

from armload_controller.cycle.stop_decisions import CAUSES, DECISIONS, Cause, StopCategory

_HEAD = """\
# What stops an arm, and how

Generated from [stop_decisions.py](armload_controller/cycle/stop_decisions.py) by
`python -m armload_controller.cycle.page_of_stops`; do not edit. `python -m benchmarks.canopen_runs.stops` triggers
every cause on the simulated arm and measures the stop.

Whatever the cause, the arm is disabled with its brakes engaged before the error is reported, and it is never re-enabled
automatically. If a step fails, the next one still follows; the last, removal of torque, is read back from every drive,
or the message names the drives of which it could not be.

Torque is removed at standstill, with one exception. A quick stop needs the drive's own loop: with an encoder that has
failed, it accelerates the axis. So every stop escalates. An axis that leaves its
[predicted course](../drivers/armload_drivers/cia402/axis_course.py), because it does not slow down, goes the wrong way,
or its commanded and reported motion contradict each other, loses its torque in the next cycle, and its brake engages;
the others come to rest on their ramps. If more than one axis is affected, or one does not come to rest in time, all
lose their torque. **An axis without a brake falls.** The operator reads "emergency stop", and what to check.
`python -m benchmarks.canopen_runs.broken_loops` measures it, `ordinary_stops` that no sound arm is affected.

"""


def stop_table() -> str:
    """The page, Markdown."""
    stops = _rows(
        ("Stop", "Steps, in this order"),
        [(category.value, "; ".join(step.value for step in category.sequence)) for category in StopCategory],
    )
    errors = {cause: [f"`{kind.__name__}`" for kind, found in CAUSES if found is cause] for cause in DECISIONS}
    errors[Cause.PROGRAM].append("any other")
    causes = _rows(
        ("Cause", "Error", "Stop", "What the operator can do"),
        [(cause.value, ", ".join(errors[cause]), d.category.value, d.advice) for cause, d in DECISIONS.items()],
    )
    return f"{_HEAD}{stops}\n{causes}"


def _rows(head: tuple[str, ...], rows: list[tuple[str, ...]]) -> str:
    """A Markdown table."""
    lines = [head, tuple("---" for _ in head), *rows]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


if __name__ == "__main__":
    sys.stdout.write(stop_table())
