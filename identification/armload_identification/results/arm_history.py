"""An arm's health over its runs: a table to print, a picture, a report and a document."""

from __future__ import annotations

from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any, Final

import numpy as np

from armload_identification.extras import Extra, require_extra
from armload_identification.float_array import FloatArray
from armload_identification.numerals import counted
from armload_identification.pipeline.arm_drift import Monitored
from armload_identification.report.compared_runs import ComparedRuns
from armload_identification.result_table import PrintedResult, ResultTable
from armload_identification.results.findings_document import json_numbers
from armload_identification.results.json_document import json_document

_COLD_S: Final = 60.0


@dataclass(frozen=True, eq=False, repr=False)
class ArmHistory(PrintedResult, ComparedRuns):
    """An arm over its runs; printed as a table with the changes."""

    def _row(self, joint: int, name: str) -> tuple[str, ...]:
        """Present levels of a joint; empty if the runs do not determine one."""
        friction, gain, residual = (_last_known(self.drift.charts[quantity][joint].level) for quantity in Monitored)
        warming = self._warming_nm(joint)
        return (
            f"{joint + 1} {name}",
            f"{self.drift.friction_nm[joint]:.2f}",
            "" if friction is None else f"{friction:+z.2f}",
            "" if gain is None else f"{100.0 * gain:+z.2f} %",
            "" if residual is None else f"{np.exp(residual):.2f}",
            "" if warming is None else f"{warming:+z.2f}",
        )

    def _warming_nm(self, joint: int) -> float | None:
        """Change of friction from the first minute to an hour of work, N m; None if unknown."""
        warming = self.drift.warming
        if warming is None or warming.slope_nm[joint] == 0.0:
            return None
        return -float(warming.curve_nm(np.array([_COLD_S]))[0, joint])

    def to_dict(self) -> dict[str, Any]:
        """Everything as numbers, texts, lists and dictionaries: the schema `armload/drift/1`."""
        drift = self.drift
        fields = {
            "robot": self.robot,
            "calibration": self.calibration_name,
            "out_of_date": drift.out_of_date,
            "advice": self.advice,
            "runs": [
                {
                    "name": run.name,
                    "began": drift.began[number].isoformat() if drift.began else None,
                    "length_s": run.length_s,
                    "carried": run.carried,
                }
                for number, run in enumerate(drift.runs)
            ],
            "joints": [
                {
                    "name": name,
                    "friction_nm": float(drift.friction_nm[joint]),
                    "warm_up_nm": self._warming_nm(joint),
                    "charts": {quantity.value: self._chart(quantity, joint) for quantity in Monitored},
                }
                for joint, name in enumerate(self.joint_names)
            ],
            "findings": [
                {
                    "joint": self.joint_names[found.joint],
                    "figure": found.quantity.value,
                    "run": drift.runs[found.run].name,
                    "alone": found.alone,
                    "before": float(_linear(found.quantity, found.before)),
                    "after": float(_linear(found.quantity, found.after)),
                    "text": found.text,
                }
                for found in drift.findings
            ],
            "left_out": [{"name": name, "reason": reason} for name, reason in self.left_out],
        }
        return json_document("drift", fields)

    def _chart(self, quantity: Monitored, joint: int) -> dict[str, Any]:
        """A chart; None for unknown values."""
        chart = self.drift.charts[quantity][joint]
        lines = {"values": chart.values, "lower_limit": -chart.limit, "upper_limit": chart.limit, "level": chart.level}
        drawn = {name: json_numbers(_linear(quantity, line)) for name, line in lines.items()}
        return {**drawn, "outside": chart.outside.tolist()}

    def picture(self, path: str | PathLike[str]) -> None:
        """Draw the control charts, .png, .svg or .pdf; an existing file is replaced.

        Raises:
            ReportError: the file cannot be written.
            ExtraMissing: the libraries for pictures are not installed.
        """
        require_extra(Extra.REPORT, "the picture of an arm over its runs")
        from armload_identification.report.figures.drift_figures import charts_drawing
        from armload_identification.report.figures.figure_file import write_figure

        write_figure(Path(path), charts_drawing(self.drift, self.joint_names))

    def report(self, path: str | PathLike[str]) -> None:
        """Write the report (HTML); an existing file is replaced.

        Raises:
            ReportError: the file cannot be written.
            ExtraMissing: the libraries for reports are not installed.
        """
        require_extra(Extra.REPORT, "the report of an arm over its runs")
        from armload_identification.report.drift_report import write_drift_report

        write_drift_report(Path(path), self)

    def table(self) -> ResultTable:
        """Present levels, the changes, and the recommended action."""
        runs = counted(len(self.drift.runs), "run")
        title = f"{self.robot}: {runs} against {self.calibration_name}, present levels"
        headings = ("joint", "friction N m", "minus the calibration's", "gain", "unexplained", "warming up N m")
        sentences = (*(found.text for found in self.drift.findings), self.advice)
        rows = [self._row(joint, name) for joint, name in enumerate(self.joint_names)]
        return ResultTable(title, headings, rows, (0,), sentences)


def _last_known(level: FloatArray) -> float | None:
    """The last known level."""
    known = level[np.isfinite(level)]
    return float(known[-1]) if known.size else None


def _linear(quantity: Monitored, values: FloatArray | float) -> FloatArray:
    """Residuals as ratios, other values unchanged."""
    return np.asarray(np.exp(values) if quantity is Monitored.RESIDUAL else values)
