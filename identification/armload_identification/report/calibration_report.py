"""The report of a calibration: gains and friction, residual and influence of every run, drift, in one HTML file."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np
from markupsafe import Markup

from armload_identification.calibration.calibration_result import ArmCalibration
from armload_identification.estimation.payload_intervals import NORMAL_HALF_WIDTH
from armload_identification.identification_errors import ReportError
from armload_identification.numerals import NO_BREAK, decimals_for, numeral
from armload_identification.recording.run_start import stated_starts
from armload_identification.report.figures.calibration_figures import drift_figure, gains_figure
from armload_identification.report.figures.control_chart_axes import run_places
from armload_identification.report.gain_table import gain_table
from armload_identification.report.page import rendered

_BOLD_RESIDUAL: Final = 1.5
"""Ratio of a run's residual to that of all runs from which it is printed in bold."""
_BOLD_INFLUENCE: Final = 1.0
"""Influence of a run on a gain, in standard deviations, from which it is printed in bold."""


def render_calibration_report(calibration: ArmCalibration, description: str, names: Sequence[str]) -> str:
    """The report of a calibration.

    Args:
        description: Description of the arm, in one line.
        names: Names of its joints.

    Returns:
        HTML.

    Raises:
        ReportError: the names do not fit the joints.
    """
    if len(names) != calibration.n:
        raise ReportError(f"{len(names)} joint names for {calibration.n} joints; give one name per joint")
    change = calibration.gain_nm_a / calibration.nominal - 1.0
    width = calibration.gain_half_width_95 / calibration.nominal
    title = f"Calibrated over nominal gain of {calibration.n} joints with 95 % intervals."
    tilt_deg = float(np.degrees(np.sqrt(np.sum(calibration.tilt_rad**2))))
    tilt_width_deg = float(np.degrees(NORMAL_HALF_WIDTH * calibration.deviation("tilt").max()))
    width_ms = 1e3 * NORMAL_HALF_WIDTH * float(calibration.deviation("delay")[0])
    tilted = f"tilted by {numeral(tilt_deg, 2)} ± {numeral(tilt_width_deg, 2)}°"
    noise = np.maximum(calibration.noise_nm, np.finfo(float).tiny)
    return rendered(
        "calibration.html.j2",
        calibration=calibration,
        description=description,
        joints=gain_table(calibration, names),
        gains=Markup(gains_figure(change, width, calibration.determined.tolist(), title)),
        payloads=list(_payload_rows(calibration)),
        runs=[(run, run.residual_rms_nm / noise) for run in calibration.runs],
        loud=_BOLD_RESIDUAL,
        strong=_BOLD_INFLUENCE,
        drift=list(_drift(calibration, names)),
        delay=f"{numeral(1e3 * calibration.body.torque_delay_s, 1)} ± {numeral(width_ms, 1)}{NO_BREAK}ms",
        tilt=tilted if tilt_deg > tilt_width_deg else f"level within {numeral(tilt_width_deg, 2)}°",
    )


def _payload_rows(calibration: ArmCalibration) -> Iterator[tuple[str, str, str, str]]:
    """Name, weighed mass, mass and centre of mass of every mounting."""
    for payload in calibration.payloads:
        mass, half_width = payload.theta[0], NORMAL_HALF_WIDTH * payload.deviation[0]
        decimals = decimals_for(half_width, mass)
        center = payload.theta[1:4] / mass if mass > 0.0 else np.full(3, np.nan)
        yield (
            payload.mounting,
            f"{payload.weighed_kg:g}" if np.isfinite(payload.weighed_kg) else "not weighed",
            f"{numeral(mass, decimals)}{NO_BREAK}±{NO_BREAK}{numeral(half_width, decimals)}",
            ", ".join(numeral(1e3 * value, 1) for value in center),
        )


def _drift(calibration: ArmCalibration, names: Sequence[str]) -> Iterator[tuple[str, Markup]]:
    """Name of every joint and the figure of its friction, by date if all runs state theirs, else in their order."""
    runs = calibration.runs
    place, dated = run_places(stated_starts([run.recorded for run in runs]), len(runs))
    changes = np.array([calibration.friction_change_nm(run) for run in runs]).T
    for joint, (name, change, usual) in enumerate(zip(names, changes, calibration.usual_change_nm, strict=True)):
        title = (
            f"Change of the friction of joint {joint + 1} ({name}) over the runs: "
            f"{numeral(change.min(), 2)} to {numeral(change.max(), 2)} N m."
        )
        yield name, Markup(drift_figure(place, change, float(usual), joint, title, dated=dated))
