"""The safety properties as a page: `python -m armload_drivers.cia402.page_of_drive_safety > drivers/SAFETY.md`."""

from __future__ import annotations

import sys

from armload_drivers.cia402.drive_safety import Safety

_HEAD = """\
# Safety properties of a drive

Generated from [drive_safety.py](armload_drivers/cia402/drive_safety.py) by
`python -m armload_drivers.cia402.page_of_drive_safety`; do not edit.

There are several ways in which a drive can provide each property; the first one that is met is used. A way is met if
its condition holds and every object reads back the required value. An object that cannot be written but already has the
required value counts as set. A drive that provides a property in none of these ways is refused, unless its
`accept_missing` names the property. `armload drives check ROBOT` prints this table for each joint, with what was found
there.

"""


def safety_page() -> str:
    """The page, Markdown."""
    return _HEAD + "\n".join(_section(of) for of in Safety)


def _section(of: Safety) -> str:
    """One property."""
    rows = "".join(
        f"| {number} | {way.text} | {'both' if way.fieldbus is None else way.fieldbus.value} | {way.verified} |\n"
        for number, way in enumerate(of.value.ways, start=1)
    )
    remedy = f"Before accepting this as missing: {of.value.remedy}.\n" if of.value.remedy else ""
    return f"""\
## `{of.key}`: the drive {of.value.title}

Consequence if missing: {of.value.lost}.
{remedy}
| | way | bus | verified |
|---|---|---|---|
{rows}"""


if __name__ == "__main__":
    sys.stdout.write(safety_page())
