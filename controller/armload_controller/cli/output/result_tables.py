"""Results as tables on the console."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from rich.table import Table

from armload_controller.cli.console_text import right
from armload_identification.estimation.uncertainty import CONFIDENCE
from armload_identification.model.payload import PARAMETER_NAMES, InertialParameters, PayloadResult
from armload_identification.pipeline.payload_validation import Validation


def payload_table(payload: PayloadResult, truth: InertialParameters | None) -> Table:
    """Per parameter the estimate, its interval, whether it is determined, and in simulation truth and error.

    For a parameter that is not determined, the table states this instead of a number. Below, in simulation, how many
    true values lie in their intervals, and how many are expected to.
    """
    values = payload.table()
    table = Table(
        "parameter",
        *right("estimate", "95 % interval"),
        "unit",
        *(() if truth is None else right("truth", "error")),
        title=values.title,
        title_justify="left",
        caption=None if truth is None else _held(payload, truth),
        caption_justify="left",
    )
    true_values = None if truth is None else truth.values
    for i, cells in enumerate(values.rows):
        row = list(cells)
        if true_values is not None:
            error = _error(i, payload.values[i], true_values[i]) if payload.determined[i] else ""
            row += [f"{true_values[i]:z.4f}", error]
        table.add_row(*row)
    return table


def validation_table(validation: Validation, joint_names: Sequence[str]) -> Table:
    """Residual in the motion's band, and ratio of measured to predicted torque, per joint."""
    headings = right("measured N m", "residual N m", "share", "measured / predicted")
    table = Table(
        "joint",
        *headings,
        title="The payload's torque (RMS, low-pass filtered), friction predicted",
        title_justify="left",
        caption="share: what the prediction leaves; measured / predicted: 1 where payload and gain are right",
        caption_justify="left",
    )
    scales = validation.verdict.of_payload
    for i, name in enumerate(joint_names):
        measured, left = validation.torque_in_band_nm[i], validation.left_in_band_nm[i]
        table.add_row(
            name,
            f"{measured:.3f}",
            f"{left:.3f}",
            f"{100.0 * left / measured:.1f} %" if measured > 0.0 else "",
            f"{scales.scale[i]:.3f} +- {scales.half_width_95[i]:.3f}" if scales.determined[i] else "",
        )
    return table


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
