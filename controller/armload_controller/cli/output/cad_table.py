"""Tables of bodies, gains and comparisons."""

from __future__ import annotations

from collections.abc import Sequence

from rich.table import Table

from armload_core.arrays import FloatArray
from armload_identification.calibration.drive_gains import GainCalibration
from armload_identification.results.payload_text import NOT_DETERMINED
from armload_identification.verdict.cad_comparison import Comparison

PAPERS_NAMES = ("m", "c_x", "c_y", "c_z", "I_xx", "I_yy", "I_zz", "I_xy", "I_xz", "I_yz")
PAPERS_UNITS = ("kg", "m", "m", "m", *["kg m2"] * 6)


def body_table(
    title: str, joint_names: Sequence[str], torque_nm: FloatArray, left_nm: FloatArray, noise_nm: FloatArray
) -> Table:
    """Torque of the empty arm, and what the body leaves of it, per joint."""
    table = Table(title=title, title_justify="left")
    table.add_column("joint")
    for column in ("torque N m", "error N m", "share", "noise N m"):
        table.add_column(column, justify="right")
    for name, torque, left, noise in zip(joint_names, torque_nm, left_nm, noise_nm, strict=True):
        share = f"{left / torque:.1%}" if torque > 0.0 else ""
        table.add_row(name, f"{torque:.3f}", f"{left:.3f}", share, f"{noise:.3f}")
    return table


def gains_table(result: GainCalibration, joint_names: Sequence[str]) -> Table:
    """Calibrated beside nominal gains."""
    table = Table(title="Torque per ampere of motor current, behind the gear", title_justify="left")
    table.add_column("joint")
    for column in ("nominal N m/A", "calibrated N m/A", "95 % +-", "change"):
        table.add_column(column, justify="right")
    rows = zip(joint_names, result.nominal_nm_a, result.gain_nm_a, result.half_width_95, result.determined, strict=True)
    for name, nominal, gain, width, known in rows:
        if known:
            table.add_row(name, f"{nominal:.3f}", f"{gain:.3f}", f"{width:.3f}", f"{gain / nominal - 1:+.2%}")
        else:
            table.add_row(name, f"{nominal:.3f}", "not determined", "", "")
    return table


def comparison_table(result: Comparison) -> Table:
    """The paper's Table 2 for one payload."""
    table = Table(title=f"Payload in the {result.frame} frame against CAD, as Chen 2016, Table 2", title_justify="left")
    table.add_column("parameter")
    for column in ("CAD", "estimate", "error"):
        table.add_column(column, justify="right")
    table.add_column("unit")
    rows = zip(PAPERS_NAMES, PAPERS_UNITS, result.truth, result.estimate, result.error, result.determined, strict=True)
    for name, unit, truth, estimate, error, determined in rows:
        if determined:
            table.add_row(name, f"{truth:.4f}", f"{estimate:.4f}", f"{error:.2%}", unit)
        else:
            table.add_row(name, f"{truth:.4f}", NOT_DETERMINED, "", unit)
    return table
