"""The drift of an arm: gains, friction and residual over its runs, and their changes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from enum import StrEnum
from typing import Final

import numpy as np

from armload_identification.calibration.calibration_result import ArmCalibration
from armload_identification.calibration.run_health import RunHealth
from armload_identification.float_array import FloatArray
from armload_identification.pipeline.warm_up import WarmUp, warm_up
from armload_identification.recording.run_start import stated_starts
from armload_identification.verdict.control_limits import ControlChart, control_chart


class Monitored(StrEnum):
    """Monitored quantity of a joint, by its name in `RunHealth`."""

    FRICTION = "friction"
    GAIN = "gain"
    RESIDUAL = "residual"


USUAL_GAIN: Final = 0.005
USUAL_RESIDUAL: Final = 0.2
"""Expected standard deviations between runs, of the gain and of the logarithm of the residual. Between the UR10e's runs
of ten days they were 0.1 to 0.4 % (joints 1 to 4) and 0.15."""


@dataclass(frozen=True)
class DriftFinding:
    """A change, or a single outlying run.

    Attributes:
        joint: Joint, from 0.
        run: Index, from 0, of the first run after the change, or of the outlying run.
        alone: Whether it is a single outlying run.
        before: Value before it, relative to the calibration: N m, relative, or the logarithm of the residual.
        after: Value after it.
        text: A sentence for the report.
    """

    joint: int
    quantity: Monitored
    run: int
    alone: bool
    before: float
    after: float
    text: str


@dataclass(frozen=True, eq=False)
class ArmDrift:
    """An arm of n joints over its runs.

    Attributes:
        runs: In the order of time; in the given order if one does not state its time.
        began: Start of each; empty if one does not state it.
        friction_nm: (n,) the calibrated friction at half the joint's greatest speed.
        charts: By quantity, one chart per joint. Friction is in N m, after an hour of work if the arm warms up; gains
            are relative; the residual is the logarithm of its ratio to the calibration's.
        warming: Friction over time in operation; None if the runs do not show it.
        findings: Changes and outlying runs.
    """

    runs: tuple[RunHealth, ...]
    began: tuple[datetime, ...]
    friction_nm: FloatArray
    charts: dict[Monitored, tuple[ControlChart, ...]]
    warming: WarmUp | None
    findings: tuple[DriftFinding, ...]

    @property
    def out_of_date(self) -> bool:
        """Whether the calibration no longer describes the arm: a gain or the residual has changed."""
        return any(found.quantity is not Monitored.FRICTION and not found.alone for found in self.findings)

    def when(self, run: int) -> str:
        """Date and time of a run; its number and name if the runs do not state their times.

        Args:
            run: Index of the run, from 0.
        """
        if self.began:
            return f"{self.began[run]:%Y-%m-%d %H:%M}"
        return f"run {run + 1} ({self.runs[run].name})"


def arm_drift(calibration: ArmCalibration, runs: Sequence[RunHealth]) -> ArmDrift:
    """Combine the runs of an arm.

    Args:
        calibration: The calibration with which the runs were compared.
        runs: One or more runs.
    """
    dated = stated_starts([run.recorded for run in runs])
    if dated:
        order = sorted(range(len(runs)), key=lambda index: dated[index])
        runs, dated = [runs[index] for index in order], tuple(dated[index] for index in order)
    warming = warm_up(runs, dated)
    n = calibration.n
    usual = {
        Monitored.FRICTION: calibration.usual_change_nm,
        Monitored.GAIN: np.full(n, USUAL_GAIN),
        Monitored.RESIDUAL: np.full(n, USUAL_RESIDUAL),
    }
    charts = {}
    for quantity, spread in usual.items():
        value, noise, doubt = map(np.stack, zip(*(getattr(run, quantity) for run in runs), strict=True))
        if warming is not None and quantity is Monitored.FRICTION:
            value = value - warming.of_runs_nm
        parts = zip(value.T, noise.T, doubt.T, spread.tolist(), strict=True)
        charts[quantity] = tuple(control_chart(*part, len(usual) * n) for part in parts)
    drift = ArmDrift(tuple(runs), dated, calibration.friction_nm, charts, warming, ())
    findings = sorted(_findings(drift), key=lambda one: (one.alone, one.run, one.joint))
    return replace(drift, findings=tuple(findings))


def _findings(drift: ArmDrift) -> Iterator[DriftFinding]:
    """Changes and outlying runs, chart by chart."""
    for quantity, charts in drift.charts.items():
        for joint, chart in enumerate(charts):
            for change in chart.changes:
                said = _change_in_words(drift, quantity, joint, change.after - change.before)
                known = np.isfinite(chart.values[: change.index]).any()
                where = f"since {drift.when(change.index)}" if known else "in all runs than in the calibration"
                text = f"joint {joint + 1}: {said} {where}"
                yield DriftFinding(joint, quantity, change.index, False, change.before, change.after, text)
            for run in np.flatnonzero(chart.alone):
                level, off = float(np.nan_to_num(chart.level[run])), float(chart.values[run])
                said = _change_in_words(drift, quantity, joint, off - level)
                text = f"joint {joint + 1}: {said} than in the neighbouring runs, in {drift.when(int(run))} alone"
                yield DriftFinding(joint, quantity, int(run), True, level, off, text)


def _change_in_words(drift: ArmDrift, quantity: Monitored, joint: int, change: float) -> str:
    """A change in words, to be followed by 'since' or 'than'."""
    word = "higher" if change > 0.0 else "lower"
    if quantity is Monitored.FRICTION:
        share = abs(change) / max(float(drift.friction_nm[joint]), np.finfo(float).tiny)
        return f"friction is {abs(change):.3g} N m ({100.0 * share:.0f} %) {word}"
    if quantity is Monitored.GAIN:
        return f"the gain is {100.0 * abs(change):.2f} % {word}"
    return f"the residual is {np.exp(abs(change)):.2g} times {word}"
