"""An export format: a data sheet of the payload as text, for the cell's binder.

`armload export er50 payload.toml --format sheet`
"""

from __future__ import annotations

from collections.abc import Mapping

import armload

NAMES = ("mass", "x", "y", "z")
UNITS = ("kg", "mm", "mm", "mm")


def export_sheet(subject: armload.ExportSubject) -> Mapping[str, str]:
    """One text in ASCII, by its file name; armload writes it, and never over a different file."""
    payload = subject.payload
    values = payload.values[:4] * (1.0, 1e3, 1e3, 1e3)
    lines = [
        f"Payload of {subject.robot}, by armload {subject.armload_version}",
        f"{subject.payload_file}, sha256 {subject.payload_sha256}",
        "",
        *(f"{name:4s} {value:10.3f} {unit}" for name, value, unit in zip(NAMES, values, UNITS, strict=True)),
    ]
    text = "\n".join(lines) + "\n"
    return {f"{subject.identifier}_sheet.txt": text.encode("ascii", "replace").decode("ascii")}
