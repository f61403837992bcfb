"""Format of numbers and comments in exported texts."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from armload_controller.export.exported_payload import ExportSubject
from armload_controller.export.inertia import WrittenInertia
from armload_controller.export.load_data.makers_flange import outward_axis

WIDTH = 100
SIGNIFICANT_DIGITS = 9
"""More than the single precision in which robot controllers store load data."""


def exact(value: float) -> str:
    """The shortest text that reads back as the same double."""
    return repr(float(value) + 0.0)


def exact_numbers(values: Iterable[float]) -> str:
    """The same of several."""
    return " ".join(map(exact, values))


def positional(value: float) -> str:
    """A number without an exponent, which not every controller's language accepts; rounded to `SIGNIFICANT_DIGITS`."""
    return np.format_float_positional(
        float(value) + 0.0, precision=SIGNIFICANT_DIGITS, unique=True, fractional=False, trim="0"
    )


def bracketed(values: Iterable[float]) -> str:
    """[a, b, c] of positional numbers."""
    return "[" + ", ".join(positional(value) for value in values) + "]"


def provenance(subject: ExportSubject) -> str:
    """Robot, program version and source file of the payload."""
    file = Path(subject.payload_file).name
    return (
        f"Payload of {subject.robot}, written by armload {subject.armload_version} from {file}, "
        f"sha256 {subject.payload_sha256}."
    )


def load_data(subject: ExportSubject, inertia: WrittenInertia, **values: float) -> dict[str, str]:
    """What any controller's load data has: the comment's paragraphs about the arm and its load, and numbers by name."""
    rpy = subject.flange_rpy_rad
    turned = "" if rpy is None else f", turned by roll, pitch, yaw = {', '.join(f'{a:.6g}' for a in rpy)} rad"
    known = outward_axis(subject.chain)[1]
    out_of_flange, direction = (", out of the flange", "") if known else ("", "that z points out of the flange, ")
    paragraphs = {
        "provenance": provenance(subject),
        "frame": f"Frame: the flange of {subject.robot}'s configuration{turned}. Checked: its z is the last joint's "
        f"axis{out_of_flange}, as in the controller's flange frame. NOT CHECKED, because no kinematics state it: "
        f"{direction}that x and y agree with the controller's, and where along the axis the origin is.",
        "load": "Load: everything mounted between the empty and the loaded run. A tool that was on the flange in both "
        "runs is not included and must be added.",
        "inertia": inertia.statement,
    }
    return paragraphs | {"name": subject.identifier} | {name: positional(value) for name, value in values.items()}


def spdx(subject: ExportSubject, prefix: str) -> str:
    """The comment line that states the licence of generated source code."""
    return f"{prefix} SPDX-License-Identifier: {subject.licence}"


def comment(paragraphs: Iterable[str], prefix: str) -> list[str]:
    """Paragraphs as comment lines with a prefix.

    They contain names from files, so every paragraph is made safe first: see `printable`. A backslash would continue a
    comment of C++ in the next line.
    """
    lines = []
    for paragraph in paragraphs:
        wrapped = textwrap.wrap(
            ascii_line(paragraph).replace("\\", "/"), WIDTH - len(prefix) - 1, break_on_hyphens=False
        )
        lines += [f"{prefix} {line}" for line in wrapped]
    return lines


def c_heading(subject: ExportSubject, paragraphs: Iterable[str]) -> str:
    """The inside of a file's first C comment, which no name can end: its licence, and paragraphs."""
    lines = comment([paragraph.replace("*/", "* /") for paragraph in paragraphs], " *")
    return "\n".join([spdx(subject, " *"), *lines])


def xml_comment(paragraphs: Iterable[str]) -> list[str]:
    """Paragraphs as one XML comment."""
    # two hyphens, of which "---" has two pairs, would end the comment
    return ["<!--", *(re.sub("-(?=-)", "- ", line) for line in comment(paragraphs, " ")), "-->"]


def ascii_line(text: str) -> str:
    """The text with a question mark for every character that is not printable ASCII, so that no name ends a line."""
    return "".join(c if c.isascii() and c.isprintable() else "?" for c in text)
