"""Results as tables on the console."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from armload_identification.model.payload import CONFIDENCE, PARAMETER_NAMES, InertialParameters, PayloadResult
from armload_identification.pipeline.payload_validation import Validation
from armload_identification.result_table import ResultTable


def payload_table(payload: PayloadResult, truth: InertialParameters | None) -> ResultTable:
    """The table of a payload; in simulation also truth and error, and how many true values are in their intervals."""
    shown = payload.table()
    if truth is None:
        return shown
    errors = [
        _error(i, value, true) if known else ""
        for i, (value, true, known) in enumerate(zip(payload.values, truth.values, payload.determined, strict=True))
    ]
    rows = [
        (*cells, f"{true:z.4f}", error) for cells, true, error in zip(shown.rows, truth.values, errors, strict=True)
    ]
    headings = (*shown.headings, "truth", "error")
    return replace(shown, headings=headings, rows=rows, sentences=(_held(payload, truth),))


def validation_table(validation: Validation, joint_names: Sequence[str]) -> ResultTable:
    """Residual in the motion's band, and ratio of measured to predicted torque, per joint."""
    scales = validation.verdict.of_payload
    measured_nm, left_nm = validation.torque_in_band_nm, validation.left_in_band_nm
    rows = [
        (
            name,
            f"{measured_nm[i]:.3f}",
            f"{left_nm[i]:.3f}",
            f"{100.0 * left_nm[i] / measured_nm[i]:.1f} %" if measured_nm[i] > 0.0 else "",
            f"{scales.scale[i]:.3f} +- {scales.half_width_95[i]:.3f}" if scales.determined[i] else "",
        )
        for i, name in enumerate(joint_names)
    ]
    title = "The payload's torque (RMS, low-pass filtered), friction predicted"
    meaning = "share: what the prediction leaves; measured / predicted: 1 where payload and gain are right"
    headings = ("joint", "measured N m", "residual N m", "share", "measured / predicted")
    return ResultTable(title, headings, rows, (0,), (meaning,))


def _held(payload: PayloadResult, truth: InertialParameters) -> str:
    """How many true values lie in their intervals, and how many are expected to."""
    low, high = payload.interval_95[payload.determined].T
    true_values = truth.values[payload.determined]
    held = np.count_nonzero((low <= true_values) & (true_values <= high))
    return f"true values in their intervals: {held} of {len(low)}; expected on average: {CONFIDENCE * len(low):.1f}"


def _error(index: int, value: float, truth: float) -> str:
    """Per cent for the mass, mm for the centre of mass, kg m2 for the inertia."""
    if index == 0:
        return f"{(value / truth - 1) * 100:+z.2f} %"
    if PARAMETER_NAMES[index].startswith("c"):
        return f"{(value - truth) * 1e3:+z.1f} mm"
    return f"{value - truth:+z.4f}"
