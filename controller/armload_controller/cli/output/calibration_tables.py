"""A calibration as tables: gains and friction per joint, and the fit of each run."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from rich.table import Table

from armload_controller.cli.console_text import right
from armload_identification.calibration.calibration_result import ArmCalibration
from armload_identification.estimation.uncertainty import NORMAL_HALF_WIDTH
from armload_identification.recording.reading_options import Effort


def gains_table(result: ArmCalibration, joint_names: Sequence[str]) -> Table:
    """Gain and load-dependent friction of every joint, with 95 % intervals."""
    current = result.effort is Effort.CURRENT
    title = "Torque per ampere of motor current" if current else "Torque per N m that the drive reports"
    unit = "N m/A" if current else ""
    headings = (f"nominal {unit}".strip(), "calibrated", "95 % +-", "change", "mu", "95 % +-", "unexplained")
    title = f"{title}, output side of the gear, and friction per transmitted torque (mu)"
    table = Table("joint", *right(*headings), title=title, title_justify="left")
    width = NORMAL_HALF_WIDTH
    load = width * result.deviation("load")
    left = result.noise_nm / np.maximum(result.level_nm, np.finfo(float).tiny)
    for j, name in enumerate(joint_names):
        gain = f"{result.gain_nm_a[j]:.4g}" if result.determined[j] else f"({result.gain_nm_a[j]:.4g})"
        table.add_row(
            name,
            f"{result.nominal[j]:.4g}",
            gain,
            f"{100.0 * result.gain_half_width_95[j] / result.gain_nm_a[j]:.2f} %",
            f"{100.0 * (result.gain_nm_a[j] / result.nominal[j] - 1.0):+z.2f} %",
            f"{result.body.load_friction[j]:z.3f}",
            f"{load[j]:z.3f}",
            f"{100.0 * left[j]:.1f} %",
        )
    if not result.determined.all():
        table.caption = "in brackets: not determined, or hardly better than assumed"
        table.caption_justify = "left"
    return table


def runs_table(result: ArmCalibration) -> Table:
    """Fit of every run."""
    title = "Runs used; off: residual relative to that of all runs, 1 is usual"
    headings = right("off", "worst joint", "greatest influence", "impacts left out")
    table = Table("run", "carried", *headings, title=title, title_justify="left")
    found = {payload.mounting: payload for payload in result.payloads}
    for run in result.runs:
        ratio = run.residual_rms_nm / np.maximum(result.noise_nm, np.finfo(float).tiny)
        joint = int(np.argmax(run.influence))
        carried = "nothing"
        if run.mounting:
            payload = found[run.mounting]
            interval = f" +- {NORMAL_HALF_WIDTH * payload.deviation[0]:.3f}"
            known = ", weighed" if np.isfinite(payload.weighed_kg) else interval
            carried = f"{run.mounting}: {payload.theta[0]:z.3f} kg{known}"
        table.add_row(
            run.name,
            carried,
            f"{run.off:.2f}",
            f"{int(np.argmax(ratio)) + 1}: {ratio.max():.1f}",
            f"{run.influence[joint]:.1f} sd of gain {joint + 1}",
            str(run.struck) if run.struck else "",
        )
    return table
