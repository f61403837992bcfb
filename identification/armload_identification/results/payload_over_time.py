"""Payload of an arm over time: one line per window of a run, to print and to draw."""

from __future__ import annotations

from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

from armload_identification.extras import Extra, require_extra
from armload_identification.pipeline.any_motion import Window
from armload_identification.recording.recording import RecordingSource
from armload_identification.result_table import PrintedResult, ResultTable
from armload_identification.results.json_document import json_document


@dataclass(frozen=True, eq=False, repr=False)
class PayloadOverTime(PrintedResult):
    """Payload by window of one run; printed as a table.

    Attributes:
        robot: Name of the arm.
        windows: Windows in the order of time.
        source: Source of the recording.
        notes: Notes to the operator.
    """

    robot: str
    windows: tuple[Window, ...]
    source: RecordingSource
    notes: tuple[str, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """Everything as numbers, texts, lists and dictionaries: the schema `armload/windows/1`."""
        windows = [_window(window) for window in self.windows]
        about = {"robot": self.robot, "recording": str(self.source.path)}
        return json_document("windows", about | {"windows": windows, "notes": list(self.notes)})

    def picture(self, path: str | PathLike[str]) -> None:
        """Draw mass and its 95 % interval over time, .png, .svg or .pdf; an existing file is replaced.

        Raises:
            ReportError: the file cannot be written.
            ExtraMissing: the libraries for pictures are not installed.
        """
        require_extra(Extra.REPORT, "the picture of a payload over time")
        from armload_identification.report.figures.figure_file import write_figure
        from armload_identification.report.figures.mass_figure import mass_figure

        marks = [
            (0.5 * (w.start_s + w.end_s), w.found.parameters.mass_kg, float(w.found.uncertainty.half_width_95[0]))
            for w in self.windows
            if w.found is not None
        ]
        gaps = [(window.start_s, window.end_s) for window in self.windows if window.found is None]
        write_figure(Path(path), mass_figure(marks, gaps, f"{self.robot}: {self.source.path.name}"))

    def table(self) -> ResultTable:
        """Per window its time, mass, determined coordinates of the centre of mass, and a remark."""
        rows = []
        for window in self.windows:
            when = f"{window.start_s:.1f} to {window.end_s:.1f}"
            if window.found is None:
                rows.append((when, "", "", window.refusal))
                continue
            known = window.found.uncertainty
            center = window.found.parameters.center_of_mass_m
            listed = [f"{1e3 * c:z.0f}" if sure else "?" for c, sure in zip(center, known.determined[1:4], strict=True)]
            mass = f"{window.found.parameters.mass_kg:z.3f} +- {known.half_width_95[0]:.3f}"
            rows.append((when, mass, ", ".join(listed), ""))
        title = f"What {self.robot} carried, 95 % intervals, flange frame"
        notes = [f"note: {note}" for note in self.notes]
        return ResultTable(title, ("time s", "mass kg", "centre of mass mm", "remark"), rows, (0, 3), notes)


def _window(window: Window) -> dict[str, Any]:
    """One window; None for values that are not determined."""
    entry: dict[str, Any] = {"start_s": window.start_s, "end_s": window.end_s}
    if window.found is None:
        return entry | {"mass_kg": None, "half_width_95_kg": None, "center_of_mass_m": None, "refusal": window.refusal}
    known = window.found.uncertainty
    center = zip(window.found.parameters.center_of_mass_m, known.determined[1:4], strict=True)
    return entry | {
        "mass_kg": float(window.found.parameters.mass_kg),
        "half_width_95_kg": float(known.half_width_95[0]),
        "center_of_mass_m": [float(value) if sure else None for value, sure in center],
        "refusal": None,
    }
