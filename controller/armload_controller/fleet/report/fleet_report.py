"""The report of many arms: the most suspicious ones, all arms, and recordings without a result, in one HTML file."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from typing import Final

import numpy as np
from markupsafe import Markup

from armload_controller.fleet.arm_runs import UNITS, QuantityKind
from armload_controller.fleet.fleet_review import ABSENT, ArmReview, FigureReview, FleetReview
from armload_controller.fleet.report.fleet_figures import chart_figure, strip
from armload_identification.numerals import NO_BREAK, common_decimals, decimals_for, numeral
from armload_identification.report.page import rendered

MOST_SUSPICIOUS: Final = 10
"""Number of arms shown with their charts."""
_CHARTS: Final = 3
"""Number of charts of each of them."""
_MOST_PROBLEMS: Final = 50
_MOST_DIGITS: Final = 4
_SHOWN: Final = (QuantityKind.MASS, QuantityKind.GAIN, QuantityKind.FRICTION)
"""Kinds of quantity in the table of all arms."""


def render_fleet_report(
    review: FleetReview, acknowledged: Mapping[str, str], needing_attention: Collection[str]
) -> str:
    """The report of a fleet.

    Args:
        acknowledged: What was said of arms whose findings are acknowledged, by arm.
        needing_attention: Names of the arms with findings that nobody has acknowledged.

    Returns:
        HTML.
    """
    suspicious = [arm for arm in review.arms if arm.suspicions]
    return rendered(
        "fleet.html.j2",
        __package__,
        arms=len(review.arms),
        runs=sum(arm.runs for arm in review.arms),
        without_result=len(review.problems),
        latest=f"{max(arm.latest for arm in (*review.arms, *review.absent)):%Y-%m-%d}",
        suspicious=len(suspicious),
        to_inspect=sum(arm.arm in needing_attention for arm in suspicious),
        panels=[(arm, _charts(arm, number)) for number, arm in enumerate(suspicious[:MOST_SUSPICIOUS], 1)],
        rows=[(arm, [_shown(kind, _most_off(arm, kind)) for kind in _SHOWN]) for arm in review.arms],
        absent=review.absent,
        odd=review.odd[:_MOST_PROBLEMS],
        acknowledged=acknowledged,
        absent_days=ABSENT.days,
        problems=[
            (run.arm, run.recording, run.problem.removeprefix(f"{run.recording}: "))
            for run in review.problems[:_MOST_PROBLEMS]
        ],
    )


def render_arm_history(arm: ArmReview, acknowledged: str = "") -> str:
    """The page of one arm: every monitored quantity over all runs.

    Args:
        acknowledged: What was said of its findings; empty if they are not acknowledged.

    Returns:
        HTML.
    """
    kinds = list(QuantityKind)
    others = sorted(arm.figures.values(), key=lambda figure: kinds.index(figure.quantity.kind))
    charts = _drawn(arm, [*_suspicious(arm), *others])
    return rendered("arm.html.j2", __package__, arm=arm, charts=charts, acknowledged=acknowledged)


def _charts(arm: ArmReview, number: int) -> list[Markup]:
    """Charts of an arm's suspicious and other important quantities; none if no recording has a result."""
    others = (_most_off(arm, kind) for kind in _SHOWN)
    shown = [*_suspicious(arm), *(figure for figure in others if figure is not None)]
    return _drawn(arm, list(dict.fromkeys(shown))[:_CHARTS], f"{number}-")


def _suspicious(arm: ArmReview) -> list[FigureReview]:
    """The quantities that an arm's suspicions are about, the most severe first."""
    return [arm.figures[found.quantity] for found in arm.suspicions if found.quantity is not None]


def _drawn(arm: ArmReview, figures: Iterable[FigureReview], prefix: str = "") -> list[Markup]:
    """The charts of different quantities."""
    return [
        Markup(chart_figure(figure, f"chart-{prefix}{number}", f"{arm.arm}: {figure.quantity} over the runs."))
        for number, figure in enumerate(dict.fromkeys(figures), 1)
    ]


def _shown(kind: QuantityKind, figure: FigureReview | None) -> tuple[str, str, Markup]:
    """Name and latest value of a quantity, and its strip; both empty if it was never determined."""
    if figure is None:
        return kind.value, "", Markup()
    unit, scale = UNITS[kind]
    value = scale * float(figure.values[-1])
    decimals = decimals_for(scale * float(figure.chart.deviation[-1]), value)
    if kind is not QuantityKind.GAIN:
        # A single run, or copies of one, have no spread to round to.
        decimals = min(decimals, common_decimals(value, _MOST_DIGITS))
    of = f"{figure.quantity.of}: " if figure.quantity.of else ""
    number = numeral(value, decimals, signed=kind is QuantityKind.GAIN)
    return kind.value, f"{of}{number}{NO_BREAK}{unit.replace(' ', NO_BREAK)}", Markup(strip(figure))


def _most_off(arm: ArmReview, kind: QuantityKind) -> FigureReview | None:
    """The quantity of a kind whose latest value deviates most from its initial level."""
    figures = [figure for quantity, figure in arm.figures.items() if quantity.kind is kind]
    return max(figures, key=lambda f: float(np.abs(f.chart.values[-1]) / f.chart.deviation[-1]), default=None)
