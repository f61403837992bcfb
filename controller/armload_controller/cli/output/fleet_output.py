"""Output of `armload fleet`: counts and rate of a run, and the suspicious arms."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from armload_controller.fleet.arm_runs import IN_FUTURE
from armload_controller.fleet.attention import Acknowledgement, Attention
from armload_controller.fleet.fleet_review import ArmReview, FleetReview, Suspicion
from armload_controller.fleet.fleet_run import FleetTally
from armload_controller.fleet.recording_row import RowOutcome
from armload_identification.numerals import counted
from armload_identification.results.json_document import json_document

_MOST_LINES = 10
_MOST_REASONS = 5


def problem_lines(tally: FleetTally, output: Path) -> list[str]:
    """Why recordings were refused or failed, the first ones, and where the others are listed.

    Args:
        tally: The counts of the run.
        output: Folder of the rows.
    """
    lines = [
        f"  {problem.outcome}: {problem.arm}: "
        + (problem.error if problem.loaded in problem.error else f"{problem.loaded}: {problem.error}")
        for problem in tally.problems[:_MOST_REASONS]
    ]
    if more := len(tally.problems) - len(lines):
        lines.append(f"  and {more} more: `armload fleet report {output}` lists them")
    if any(problem.outcome is RowOutcome.FAILED for problem in tally.problems):
        lines.append("  what failed is tried again by the next run; what was refused, once its files change")
    return lines


def suspicion_lines(review: FleetReview, attention: Attention) -> list[str]:
    """The most suspicious arms, one line each; then what is acknowledged, absent, oddly dated, and without a result."""
    present = {arm.arm for arm in review.arms}
    suspicious = [arm for arm in attention.arms if arm in present]
    count = len(suspicious) or "none"
    lines = [f"to be inspected: {count} of {counted(len(review.arms), 'arm')}"]
    for number, arm in enumerate(suspicious[:_MOST_LINES], 1):
        lines.append(f"{number:3}. {arm}: {attention.of(arm)[0].text}")
    if more := len(suspicious) - _MOST_LINES:
        lines += [f"     and {more} more: see the report"] if more > 0 else []
    lines += [
        f"{known.arm}: {found.text}; acknowledged until {known.until}: {known.why}"
        for found, known in attention.acknowledged
    ]
    lines += _absent_lines(review)
    lines += [
        f"odd date: {run.arm}: {run.recording} is dated {run.recorded:%Y-%m-%d} ({run.dated_by})"
        f"{'' if run.dated_by == IN_FUTURE else ', long after the others'}"
        for run in review.odd[:_MOST_LINES]
    ]
    if review.problems:
        arms = len({run.arm for run in review.problems})
        lines.append(f"without a result: {counted(len(review.problems), 'recording')} of {counted(arms, 'arm')}")
    return lines


def _absent_lines(review: FleetReview) -> list[str]:
    """The arms without a recent recording, if there are any, in one line."""
    if not review.absent:
        return []
    named = [f"{arm.arm} ({arm.latest:%Y-%m-%d})" for arm in review.absent[:_MOST_LINES]]
    more = [f"{len(review.absent) - len(named)} more"] if len(review.absent) > len(named) else []
    listed = ", ".join([*named, *more])
    return [f"no recent recording, not assessed: {listed}; removed, or their recordings no longer arrive"]


def fleet_report_document(review: FleetReview, attention: Attention) -> dict[str, Any]:
    """All arms for `--json`, the most suspicious first."""

    def identity(arm: ArmReview) -> dict[str, Any]:
        return {"name": arm.arm, "model": arm.model, "runs": arm.runs, "latest": arm.latest.isoformat()}

    def suspicion(found: Suspicion) -> dict[str, Any]:
        of = found.quantity
        figure = {"figure": None if of is None else of.kind.value, "of": None if of is None else of.of}
        return {"cause": found.cause.value, **figure, "deviations": found.deviations, "text": found.text}

    arms = [
        identity(arm)
        | {"without_result": arm.without_result, "suspicions": [suspicion(found) for found in arm.suspicions]}
        for arm in review.arms
    ]
    odd = [
        {"name": run.arm, "recording": run.recording, "dated": run.recorded.isoformat(), "dated_by": run.dated_by}
        for run in review.odd
    ]
    acknowledged = [
        {"name": known.arm, "text": found.text, "until": known.until, "why": known.why}
        for found, known in attention.acknowledged
    ]
    lists = {"arms": arms, "absent": [identity(arm) for arm in review.absent], "odd": odd}
    return json_document("fleet-report", lists | {"attention": list(attention.arms), "acknowledged": acknowledged})


def arm_document(arm: ArmReview) -> dict[str, Any]:
    """One arm over its recordings for `--json`."""
    figures = [
        {
            "figure": figure.quantity.kind.value,
            "of": figure.quantity.of,
            "dates": [moment.isoformat() for moment in figure.recorded],
            "values": figure.values.tolist(),
            "level": figure.center,
        }
        for figure in arm.figures.values()
    ]
    return json_document("fleet-history", {"name": arm.arm, "model": arm.model, "figures": figures})


def acknowledged_document(made: Acknowledgement) -> dict[str, Any]:
    """An acknowledgement for `--json`."""
    listed = {"name": made.arm, "until": made.until, "why": made.why, "findings": list(made.findings)}
    return json_document("fleet-acknowledged", listed)
