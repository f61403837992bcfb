"""The table of a calibrated arm, on the console and in its report: gain and friction of every joint."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from armload_identification.calibration.calibration_result import ArmCalibration
from armload_identification.estimation.payload_intervals import NORMAL_HALF_WIDTH
from armload_identification.recording.reading_options import Effort
from armload_identification.result_table import ResultTable


def gain_table(calibration: ArmCalibration, names: Sequence[str]) -> ResultTable:
    """Gain, its change from the nominal one, friction, and residual, with half widths of 95 % intervals.

    Args:
        names: Names of the joints.
    """
    current = calibration.effort is Effort.CURRENT
    title = "Torque per ampere of motor current" if current else "Torque per N m that the drive reports"
    title = f"{title}, output side of the gear; friction without load, and per transmitted torque (mu)"
    nominal = "nominal N m/A" if current else "nominal"
    friction = ("friction N m", "95 % +-", "at rad/s", "mu", "95 % +-")
    gain, width = calibration.gain_nm_a, calibration.gain_half_width_95
    friction_nm, speed_rad_s = calibration.friction_nm, calibration.middle_speed_rad_s
    wide_nm = NORMAL_HALF_WIDTH * calibration.friction_deviation_nm
    load = NORMAL_HALF_WIDTH * calibration.deviation("load")
    left = calibration.noise_nm / np.maximum(calibration.level_nm, np.finfo(float).tiny)
    rows = [
        (
            name,
            f"{calibration.nominal[j]:.4g}",
            f"{gain[j]:.4g}" if calibration.determined[j] else f"({gain[j]:.4g})",
            f"{100.0 * width[j] / gain[j]:.2f} %",
            f"{100.0 * (gain[j] / calibration.nominal[j] - 1.0):+z.2f} %",
            f"{friction_nm[j]:z.3f}",
            f"{wide_nm[j]:.3f}",
            f"{speed_rad_s[j]:.2f}",
            f"{calibration.body.load_friction[j]:z.3f}",
            f"{load[j]:z.3f}",
            f"{100.0 * left[j]:.1f} %",
        )
        for j, name in enumerate(names)
    ]
    doubtful = () if calibration.determined.all() else ("In brackets: not determined, or hardly better than assumed.",)
    headings = ("joint", nominal, "calibrated", "95 % +-", "change", *friction, "unexplained")
    return ResultTable(title, headings, rows, (0,), doubtful)
