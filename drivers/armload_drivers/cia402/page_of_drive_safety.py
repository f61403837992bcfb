"""What safety rests on as a page: `python -m armload_drivers.cia402.page_of_drive_safety > drivers/SAFETY.md`."""

from __future__ import annotations

import sys

from armload_drivers.cia402.drive_safety import Safety

_HEAD = """\
# What safety rests on in a drive

Generated from [drive_safety.py](armload_drivers/cia402/drive_safety.py) by
`python -m armload_drivers.cia402.page_of_drive_safety`; do not edit.

A drive has a property by the first of its ways that is met: the way's condition holds, and every object reads back as
wanted. An object that cannot be written and has the wanted value already counts as set. A property without a way is
refused, unless the drive's `accept_missing` names it. `armload drives check ROBOT` prints this table for each joint,
with what was found there.

"""


def safety_page() -> str:
    """The page, Markdown."""
    return _HEAD + "\n".join(_section(of) for of in Safety)


def _section(of: Safety) -> str:
    """One property."""
    rows = "".join(f"| {number} | {way.text} | {way.verified} |\n" for number, way in enumerate(of.value.ways, start=1))
    remedy = f"What a person must do before accepting that: {of.value.remedy}.\n" if of.value.remedy else ""
    return f"""\
## `{of.key}`: the drive {of.value.title}

Lost without it: {of.value.lost}.
{remedy}
| | way | verified |
|---|---|---|
{rows}"""


if __name__ == "__main__":
    sys.stdout.write(safety_page())
