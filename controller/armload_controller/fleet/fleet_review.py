"""Which of many arms are suspicious, and why.

Every quantity of every arm has a control chart about the level of its first runs (`verdict.control_limits`). Suspicious
are

- a change: the level of a quantity is different from some run on;
- an outlier: one run deviates from the neighbouring ones;
- a stranger: the latest level of a quantity deviates from the arm's twins by more than these differ from each other;
- silence: the latest recordings gave no result.

An arm without a recent recording was removed, or its recordings no longer arrive: it is listed, but neither assessed
nor compared. Recent is relative to the fleet's date, which the latest results of a quarter of the arms have reached, so
that no single wrong clock, and no file that was copied today, makes the other arms old; results that state their own
date count before those dated by their file. Recordings dated much later than that are listed as odd.

All charts of a fleet together have a false alarm in one report of a hundred, and so have all comparisons with twins.
Suspicions are ranked by the number of standard deviations of a normal variable that is equally improbable.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime, timedelta
from enum import StrEnum
from itertools import pairwise, takewhile
from typing import Final

import numpy as np
from scipy.stats import norm, t

from armload_controller.fleet.arm_runs import IN_FUTURE, PER_PAYLOAD, UNITS, ArmRun, Quantity
from armload_identification.float_array import FloatArray
from armload_identification.recording.run_start import STATED_BY
from armload_identification.result_table import PrintedResult, ResultTable
from armload_identification.signals.robust_scale import deviation_by_median
from armload_identification.verdict.control_limits import ControlChart, control_chart
from armload_identification.verdict.decision_levels import FalseAlarms

FIRST_RUNS: Final = 7
"""Runs whose median is the centre of a chart."""
MOST_RUNS: Final = 100
"""Most runs in a chart; older ones are omitted."""
FEWEST_STEPS: Final = 50
"""Pairs of successive runs, of all arms of a model, from which their scatter replaces a greater stated deviation."""
LATEST_RUNS: Final = 5
"""Number of runs whose median is compared with the twins'."""
TWINS_LEAST: Final = 3
"""Least number of twins for a comparison."""
ABSENT: Final = timedelta(days=30)
"""An arm's latest recording is not recent if it is older than the fleet's date by more than this, ..."""
_FEWEST_FOR_QUARTER: Final = 4
"""Number of arms from which the fleet's date is what a quarter, at least two, have reached; with fewer, the latest."""
ABSENT_INTERVALS: Final = 2
"""... and by more than this number of the arm's longest interval between recordings: some are recorded each quarter."""
SILENT: Final = 3.0
"""Deviations added by each of the latest recordings without a result."""
_MEDIAN_OVER_MEAN: Final = float(np.sqrt(np.pi / 2.0))
"""Ratio of a median's standard deviation to a mean's."""
_FREEDOM_PER_TWIN: Final = 0.37
"""Degrees of freedom of a spread from the median deviation, per twin minus one: its efficiency for normal values. With
these, no more than the stated share of normal arms is named (simulated for 3 to 60 twins)."""
_LEAST_SPREAD: Final = 1e-9
_MOST_DEVIATIONS: Final = 99.0

ArmKey = tuple[str, str]
"""Name of an arm, and its model."""


class Anomaly(StrEnum):
    """Kind of anomaly that makes an arm suspicious."""

    CHANGE = "change"
    OUTLIER = "outlier"
    STRANGER = "differs from its twins"
    SILENCE = "no result"


@dataclass(frozen=True, eq=False)
class FigureReview:
    """One quantity of one arm over its runs.

    Attributes:
        recorded: Date and time of each run.
        values: (r,) SI units.
        center: The level of the first runs.
        chart: Control chart of the values minus `center`.
        twins: The level of its twins; None if there are too few.
    """

    quantity: Quantity
    recorded: tuple[datetime, ...]
    values: FloatArray
    center: float
    chart: ControlChart
    twins: float | None


@dataclass(frozen=True)
class Suspicion:
    """One reason to inspect an arm.

    Attributes:
        cause: Its kind.
        quantity: The quantity; None for silence.
        deviations: Number of standard deviations of a normal variable that is equally improbable.
        text: A sentence for the report.
    """

    cause: Anomaly
    quantity: Quantity | None
    deviations: float
    text: str

    @property
    def sentence(self) -> str:
        """The text with its improbability; a recording without a result has none."""
        return self.text if self.quantity is None else f"{self.text} ({self.deviations:.0f} standard deviations)"


@dataclass(frozen=True, eq=False)
class ArmReview:
    """One arm.

    Attributes:
        arm: Its name.
        runs: Number of recordings.
        without_result: Number of recordings without a result.
        latest: When the last one was made.
        figures: Its monitored quantities; none of an arm that is not assessed.
        suspicions: The most severe first; empty if nothing is suspicious.
    """

    arm: str
    model: str
    runs: int
    without_result: int
    latest: datetime
    figures: Mapping[Quantity, FigureReview] = field(default_factory=dict)
    suspicions: tuple[Suspicion, ...] = ()

    @property
    def deviations(self) -> float:
        """Those of the most severe suspicion; 0 without one."""
        return self.suspicions[0].deviations if self.suspicions else 0.0


@dataclass(frozen=True, eq=False, repr=False)
class FleetReview(PrintedResult):
    """Many arms; prints as a table.

    Attributes:
        arms: Arms with a recent recording, the most suspicious first, equal ones by name.
        absent: Arms without one, the last to be recorded first.
        problems: Recordings of `arms` without a result, the latest first.
        odd: Results whose own date is in the future or much later than the fleet's, the latest first.
    """

    arms: tuple[ArmReview, ...]
    absent: tuple[ArmReview, ...]
    problems: tuple[ArmRun, ...]
    odd: tuple[ArmRun, ...] = ()

    def table(self) -> ResultTable:
        """The arms, with their most severe suspicion; those without a recent recording below."""
        worst = [next((found.sentence for found in arm.suspicions), "") for arm in self.arms]
        rows = [
            (arm.arm, arm.model, str(arm.runs), f"{arm.latest:%Y-%m-%d}", sentence)
            for arm, sentence in zip(self.arms, worst, strict=True)
        ]
        gone = tuple(f"{arm.arm}: no recent recording, the latest is of {arm.latest:%Y-%m-%d}" for arm in self.absent)
        headings = ("arm", "model", "runs", "latest", "suspicion")
        return ResultTable("", headings, rows, (0, 1, 3, 4), gone)


@dataclass(frozen=True, eq=False)
class _Series:
    """Runs with a value of one quantity, in the order of time.

    Attributes:
        recorded: When each was made.
        values: (r,) values.
        noise: (r,) their standard deviation by what the runs state, corrected for what the model's arms show of it.
        usual: Standard deviation between runs of the model's arms, beyond that.
    """

    recorded: tuple[datetime, ...]
    values: FloatArray
    noise: FloatArray
    usual: float = 0.0

    @classmethod
    def of(cls, runs: Sequence[ArmRun], quantity: Quantity) -> _Series:
        shown = [run for run in runs if quantity in run.figures][-MOST_RUNS:]
        values, noise = np.array([run.figures[quantity] for run in shown]).T
        return cls(tuple(run.recorded for run in shown), values, noise)

    def level(self, part: slice) -> tuple[float, float, int]:
        """Median of some runs, a median's standard deviation in one run by noise and usual spread, and their number."""
        width = float(np.median(np.hypot(self.noise[part], self.usual)))
        return float(np.median(self.values[part])), _MEDIAN_OVER_MEAN * width, self.values[part].size


def review_fleet(runs: Sequence[ArmRun]) -> FleetReview:
    """Review the arms of a fleet.

    Args:
        runs: The runs of all arms, each recording once.
    """
    ordered = sorted(runs, key=lambda run: run.recorded)
    of_all: defaultdict[ArmKey, list[ArmRun]] = defaultdict(list)
    for run in ordered:
        of_all[run.arm, run.model].append(run)
    latest = _fleet_date(of_all)
    absent = {
        arm: _review(arm, of_arm, {}, [])
        for arm, of_arm in of_all.items()
        if latest is not None and _is_absent(of_arm, latest)
    }
    by_arm = {arm: of_arm for arm, of_arm in of_all.items() if arm not in absent}
    series = {
        (arm, quantity): _Series.of(of_arm, quantity)
        for arm, of_arm in by_arm.items()
        for quantity in sorted({quantity for run in of_arm for quantity in run.figures})
    }
    usual = _usual_spread(series)
    for (arm, quantity), one in series.items():
        beyond, share = usual[arm[1], quantity]
        series[arm, quantity] = replace(one, noise=share * one.noise, usual=beyond)
    compared = _against_twins(series)
    figures: defaultdict[ArmKey, dict[Quantity, FigureReview]] = defaultdict(dict)
    found = {arm: _silence(of_arm) for arm, of_arm in by_arm.items()}
    for (arm, quantity), one in series.items():
        twins, strange = compared.get((arm, quantity), (None, []))
        figure = _reviewed_figure(quantity, one, len(series), twins)
        figures[arm][quantity] = figure
        found[arm] += [*_changes_and_outliers(figure), *strange]
    arms = [_review(arm, of_arm, figures[arm], found[arm]) for arm, of_arm in by_arm.items()]
    arms.sort(key=lambda review: (-review.deviations, review.arm))
    return FleetReview(
        tuple(arms),
        tuple(sorted(absent.values(), key=lambda arm: arm.latest, reverse=True)),
        tuple(run for run in reversed(ordered) if run.problem and (run.arm, run.model) in by_arm),
        tuple(
            run
            for run in reversed(ordered)
            if not run.problem
            and (run.dated_by == IN_FUTURE or (latest is not None and run.recorded > latest + ABSENT))
        ),
    )


def _review(
    arm: ArmKey, runs: Sequence[ArmRun], figures: Mapping[Quantity, FigureReview], found: Sequence[Suspicion]
) -> ArmReview:
    """What an arm's runs show, the gravest suspicion first."""
    gravest = tuple(sorted(found, key=lambda suspicion: -suspicion.deviations))
    return ArmReview(*arm, len(runs), sum(bool(run.problem) for run in runs), runs[-1].recorded, figures, gravest)


def _fleet_date(runs: Mapping[ArmKey, Sequence[ArmRun]]) -> datetime | None:
    """The date that the latest results of a quarter of the arms have reached; None without a result.

    Results only: a recording that is missing has the date of the attempt to read it.
    """
    results = [[run for run in of_arm if not run.problem] for of_arm in runs.values()]
    stated = [[run for run in of_arm if run.dated_by in STATED_BY] for of_arm in results]
    chosen = stated if any(stated) else results
    latest = sorted((max(run.recorded for run in of_arm) for of_arm in chosen if of_arm), reverse=True)
    if not latest:
        return None
    return latest[0 if len(latest) < _FEWEST_FOR_QUARTER else max(-(-len(latest) // 4) - 1, 1)]


def _is_absent(runs: Sequence[ArmRun], latest: datetime) -> bool:
    """Whether the last of an arm's runs is not recent, compared with the fleet's date and the arm's own history."""
    intervals = (later.recorded - run.recorded for run, later in pairwise(runs))
    return latest - runs[-1].recorded > max(ABSENT, ABSENT_INTERVALS * max(intervals, default=timedelta()))


def _usual_spread(
    series: Mapping[tuple[ArmKey, Quantity], _Series],
) -> dict[tuple[str, Quantity], tuple[float, float]]:
    """What is usual between runs of one arm, by model and quantity, from successive runs.

    Returns:
        Standard deviation beyond what the runs state, and what of the stated deviation they show, at most 1: errors
        that all runs of an arm share do not scatter.
    """
    steps: defaultdict[tuple[str, Quantity], list[FloatArray]] = defaultdict(list)
    for ((_, model), quantity), one in series.items():
        noise = np.hypot(one.noise[1:], one.noise[:-1])
        steps[model, quantity].append(np.stack([np.diff(one.values), noise]))
    usual = {}
    for place, found in steps.items():
        difference, noise = np.hstack(found)
        variance, share = 0.0, 1.0
        if difference.size:
            variance = float(deviation_by_median(difference[:, None])[0]) ** 2 - float(np.median(noise)) ** 2
        if np.count_nonzero(noise) >= FEWEST_STEPS:
            in_noise = difference[noise > 0.0] / noise[noise > 0.0]
            share = min(float(deviation_by_median(in_noise[:, None])[0]), 1.0)
        usual[place] = max(float(np.sqrt(max(0.5 * variance, 0.0))), _LEAST_SPREAD), max(share, _LEAST_SPREAD)
    return usual


def _reviewed_figure(quantity: Quantity, one: _Series, charts: int, twins: float | None) -> FigureReview:
    """The chart of a quantity."""
    center, width, count = one.level(slice(0, FIRST_RUNS))
    doubt = np.full(one.values.size, width / np.sqrt(count))
    chart = control_chart(one.values - center, one.noise, doubt, one.usual, charts)
    return FigureReview(quantity, one.recorded, one.values, center, chart, twins)


def _changes_and_outliers(figure: FigureReview) -> list[Suspicion]:
    """The last change of level, and the last outlier."""
    chart, found = figure.chart, []
    changes = [change for change in chart.changes if change.index > 0]
    if changes:
        change = changes[-1]
        before, after = _two_values(figure.quantity, figure.center + change.before, figure.center + change.after)
        size = abs(change.after - change.before) / change.deviation
        text = f"{figure.quantity} is {after} since {figure.recorded[change.index]:%Y-%m-%d}, {before} before"
        found.append(Suspicion(Anomaly.CHANGE, figure.quantity, min(size, _MOST_DEVIATIONS), text))
    alone = np.flatnonzero(chart.alone)
    if alone.size:
        run = int(alone[-1])
        others = np.delete(chart.values, run)
        usual = float(np.median(others[max(run - 2, 0) : run + 2]))
        size = float(abs(chart.values[run] - usual) / chart.deviation[run])
        off, level = _two_values(figure.quantity, figure.center + float(chart.values[run]), figure.center + usual)
        text = f"{figure.quantity} was {off} on {figure.recorded[run]:%Y-%m-%d}, {level} in the neighbouring runs"
        found.append(Suspicion(Anomaly.OUTLIER, figure.quantity, min(size, _MOST_DEVIATIONS), text))
    return found


def _against_twins(
    series: Mapping[tuple[ArmKey, Quantity], _Series],
) -> dict[tuple[ArmKey, Quantity], tuple[float, list[Suspicion]]]:
    """The level of its twins for each arm's quantities, and the suspicion if it differs from them."""
    groups: defaultdict[tuple[str, Quantity], list[tuple[str, float, float]]] = defaultdict(list)
    for ((arm, model), quantity), one in series.items():
        if quantity.of or quantity.kind not in PER_PAYLOAD:  # payloads without a name may be different ones
            level, width, count = one.level(slice(-LATEST_RUNS, None))
            ratio = 1.0 if count > 2 else 1.0 / _MEDIAN_OVER_MEAN  # of one or two values the median is the mean
            groups[model, quantity].append((arm, level, width * ratio / float(np.sqrt(count))))
    compared = {place: arms for place, arms in groups.items() if len(arms) > TWINS_LEAST}
    tests = max(sum(len(arms) for arms in compared.values()), 1)
    found: dict[tuple[ArmKey, Quantity], tuple[float, list[Suspicion]]] = {}
    for (model, quantity), arms in compared.items():
        names, levels, own = zip(*arms, strict=True)
        for i, name in enumerate(names):
            others = np.delete(levels, i)
            middle = float(np.median(others))
            spread = float(deviation_by_median((others - middle)[:, None])[0])
            expected = np.hypot(spread, own[i]) * np.sqrt(1.0 + _MEDIAN_OVER_MEAN**2 / others.size)
            freedom = _FREEDOM_PER_TWIN * (others.size - 1)
            log_chance = float(t.logsf(abs(levels[i] - middle) / expected, freedom)) + np.log(2.0)
            found[(name, model), quantity] = middle, []
            if log_chance < np.log(FalseAlarms.probability / tests):
                mine, theirs = _two_values(quantity, levels[i], middle)
                text = f"{quantity} is {mine}, that of {others.size} twins {theirs}"
                size = min(float(-norm.ppf(np.exp(log_chance) / 2.0)), _MOST_DEVIATIONS)
                found[(name, model), quantity][1].append(Suspicion(Anomaly.STRANGER, quantity, size, text))
    return found


def _silence(runs: Sequence[ArmRun]) -> list[Suspicion]:
    """The latest recordings without a result."""
    silent = sum(1 for _ in takewhile(lambda run: run.problem, reversed(runs)))
    if not silent:
        return []
    which = "the latest recording" if silent == 1 else f"the {silent} latest recordings"
    text = f"{which} gave no result: {runs[-1].problem}"
    return [Suspicion(Anomaly.SILENCE, None, min(SILENT * silent, _MOST_DEVIATIONS), text)]


def _two_values(quantity: Quantity, first: float, second: float) -> tuple[str, str]:
    """Two values of a quantity in its unit, with enough decimals to show the distance between them."""
    unit, scale = UNITS[quantity.kind]
    distance = scale * abs(first - second)
    decimals = 3 if distance <= 0.0 else int(np.clip(1 - np.floor(np.log10(distance)), 0, 6))
    return f"{scale * first:.{decimals}f} {unit}".rstrip(), f"{scale * second:.{decimals}f} {unit}".rstrip()
