"""An arm as calibrated from its runs: tables to print, the calibration file, a report and a document."""

from __future__ import annotations

from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from armload_identification.calibration.calibration_result import ArmCalibration, CalibratedPayload, CalibratedRun
from armload_identification.estimation.payload_intervals import NORMAL_HALF_WIDTH
from armload_identification.extras import Extra, require_extra
from armload_identification.files.calibration_file import write_calibration
from armload_identification.recording.reading_options import Effort
from armload_identification.report.gain_table import gain_table
from armload_identification.result_table import PrintedResult, ResultTable
from armload_identification.results.findings_document import json_number
from armload_identification.results.json_document import json_document


@dataclass(frozen=True, eq=False, repr=False)
class CalibratedArm(PrintedResult):
    """An arm as calibrated from its runs; printed as a table of gains and friction.

    `calibration=` of the other functions takes it, or the file that `save` writes.

    Attributes:
        description: Description of the arm, in one line.
        calibration: Gains, body and friction with their uncertainty: the content of the calibration file.
    """

    description: str
    joint_names: tuple[str, ...]
    calibration: ArmCalibration

    def save(self, path: str | PathLike[str]) -> None:
        """Write the calibration file; an existing file is replaced.

        Raises:
            CalibrationFileError: the file cannot be written.
        """
        write_calibration(Path(path), self.calibration)

    def report(self, path: str | PathLike[str]) -> None:
        """Write the report (HTML); an existing file is replaced.

        Raises:
            ReportError: the file cannot be written.
            ExtraMissing: the libraries for reports are not installed.
        """
        require_extra(Extra.REPORT, "the report of a calibration")
        from armload_identification.report.calibration_report import render_calibration_report
        from armload_identification.report.page import write_page

        write_page(Path(path), render_calibration_report(self.calibration, self.description, self.joint_names))

    def table(self) -> ResultTable:
        """Gain and load-dependent friction of every joint, with 95 % intervals."""
        return gain_table(self.calibration, self.joint_names)

    def runs_table(self) -> ResultTable:
        """Fit of every run, and what it carried as identified with the calibrated gains, with its 95 % interval."""
        title = "Runs used, and what they carried; off: residual compared with that of all runs, usually 1"
        headings = ("run", "carried", "off", "worst joint", "greatest influence", "impacts left out")
        found = {payload.mounting: payload for payload in self.calibration.payloads}
        rows = [self._run_cells(run, found.get(run.mounting)) for run in self.calibration.runs]
        return ResultTable(title, headings, rows, (0, 1))

    def _run_cells(self, run: CalibratedRun, payload: CalibratedPayload | None) -> tuple[str, ...]:
        """One run."""
        ratio = run.residual_rms_nm / np.maximum(self.calibration.noise_nm, np.finfo(float).tiny)
        joint = int(np.argmax(run.influence))
        carried = "nothing"
        if payload is not None:
            weighed = ", weighed" if np.isfinite(payload.weighed_kg) else ""
            width = NORMAL_HALF_WIDTH * payload.deviation[0]
            carried = f"{run.mounting}: {payload.theta[0]:z.3f} +- {width:.3f} kg{weighed}"
        return (
            run.name,
            carried,
            f"{run.off:.2f}",
            f"{int(np.argmax(ratio)) + 1}: {ratio.max():.1f}",
            f"{run.influence[joint]:.1f} sd of gain {joint + 1}",
            str(run.struck) if run.struck else "",
        )

    def to_dict(self) -> dict[str, Any]:
        """Everything as numbers, texts, lists and dictionaries: the schema `armload/calibration/1`."""
        result = self.calibration
        joints = [
            {
                "name": name,
                "nominal": json_number(result.nominal[j]),
                "gain": json_number(result.gain_nm_a[j]) if result.determined[j] else None,
                "half_width_95": json_number(result.gain_half_width_95[j]) if result.determined[j] else None,
                "load_friction": json_number(result.body.load_friction[j]),
                "determined": bool(result.determined[j]),
            }
            for j, name in enumerate(self.joint_names)
        ]
        fields = {
            "robot": result.robot,
            "gain_unit": "N m/A" if result.effort is Effort.CURRENT else "N m/(N m)",
            "joints": joints,
            "runs": [{"name": run.name, "mounting": run.mounting or None, "off": run.off} for run in result.runs],
            "left_out": [{"name": name, "reason": reason} for name, reason in result.left_out],
            "warnings": list(result.warnings),
        }
        return json_document("calibration", fields)
