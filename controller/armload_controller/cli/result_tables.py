"""Results as tables on the console."""

from __future__ import annotations

import math
from collections.abc import Sequence

from rich.table import Table

from armload_identification.model.payload import PARAMETER_NAMES, InertialParameters, PayloadResult
from armload_identification.pipeline.payload_identification import Identification
from armload_identification.pipeline.payload_validation import Validation

UNITS = ("kg", "m", "m", "m", "kg m2", "kg m2", "kg m2", "kg m2", "kg m2", "kg m2")
NOT_DETERMINED = "not determined"


def payload_table(payload: PayloadResult, truth: InertialParameters | None) -> Table:
    """Per parameter the estimate, its interval, whether it is determined, and in simulation truth and error.

    What is not determined is said to be so and not printed as a number.
    """
    table = Table(title=f"Payload in the {payload.frame} frame, inertia about its centre of mass", title_justify="left")
    table.add_column("parameter", no_wrap=True)
    for column in ("estimate", "95 % interval"):
        table.add_column(column, justify="right", no_wrap=True)
    table.add_column("unit")
    if truth is not None:
        for column in ("truth", "error"):
            table.add_column(column, justify="right")
    true_values = None if truth is None else truth.values
    for i, name in enumerate(PARAMETER_NAMES):
        low, high = payload.interval_95[i]
        value = payload.values[i]
        if payload.determined[i]:
            digits = decimals((high - low) / 2)
            row = [name, f"{value:.{digits}f}", f"{low:.{digits}f} to {high:.{digits}f}", UNITS[i]]
        else:
            row = [name, NOT_DETERMINED, "", UNITS[i]]
        if true_values is not None:
            error = _error(i, value, true_values[i]) if payload.determined[i] else ""
            row += [f"{true_values[i]:.4f}", error]
        table.add_row(*row)
    return table


def validation_table(validation: Validation, joint_names: Sequence[str]) -> Table:
    """What the payload leaves in the motion's band, and measured over predicted torque, per joint."""
    table = Table(title="The payload's torque in the motion's band, friction predicted", title_justify="left")
    table.add_column("joint")
    for column in ("measured N m", "residual N m", "share", "measured / predicted"):
        table.add_column(column, justify="right")
    scales = validation.verdict.of_payload
    for i, name in enumerate(joint_names):
        measured, left = validation.torque_in_band_nm[i], validation.left_in_band_nm[i]
        table.add_row(
            name,
            f"{measured:.3f}",
            f"{left:.3f}",
            f"{left / measured:.1%}" if measured > 0.0 else "",
            f"{scales.scale[i]:.3f} +- {scales.half_width_95[i]:.3f}" if scales.told[i] else "",
        )
    return table


def possibility(identification: Identification) -> str:
    """Whether the plain estimate was a possible body, and what is reported in its place."""
    if identification.physical.changed:
        plain = identification.plain_parameters
        return (
            f"plain estimate: {plain.mass_kg:.4g} kg, physically impossible; "
            f"reported: the nearest possible body, {identification.parameters.mass_kg:.4g} kg"
        )
    return "the estimate is physically possible as it is"


def decimals(half_width: float) -> int:
    """Decimals that show two significant digits of an interval's half width."""
    if not (math.isfinite(half_width) and half_width > 0):
        return 4
    return max(0, 1 - math.floor(math.log10(half_width)))


def _error(index: int, value: float, truth: float) -> str:
    """Per cent for the mass, mm for the centre of mass, kg m2 for the inertia."""
    if index == 0:
        return f"{(value / truth - 1) * 100:+.2f} %"
    if PARAMETER_NAMES[index].startswith("c"):
        return f"{(value - truth) * 1e3:+.1f} mm"
    return f"{value - truth:+.4f}"
