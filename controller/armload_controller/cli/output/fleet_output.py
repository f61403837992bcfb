"""Output of `armload fleet`: counts and rate of a run, and the suspicious arms."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from armload_controller.cli.output.json_output import json_document
from armload_controller.fleet.fleet_run import FleetTally
from armload_controller.fleet.recording_row import RowOutcome
from armload_identification.many_arms.fleet_review import AbsentArm, ArmReview, FleetReview, Suspicion
from armload_identification.report.numerals import counted

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


def fleet_document(tally: FleetTally) -> dict[str, Any]:
    """The same for `--json`."""
    return json_document("fleet", tally.to_dict())


def suspicion_lines(review: FleetReview) -> list[str]:
    """The most suspicious arms, one line each, and the arms without a recent recording in one."""
    suspicious = [arm for arm in review.arms if arm.suspicions]
    if not suspicious:
        return [f"to be inspected: none of {counted(len(review.arms), 'arm')}", *_absent_lines(review)]
    shown = [
        f"{number:3}. {arm.arm}: {arm.suspicions[0].text} ({arm.deviations:.0f} standard deviations)"
        for number, arm in enumerate(suspicious[:_MOST_LINES], 1)
    ]
    return [f"to be inspected: {len(suspicious)} of {counted(len(review.arms), 'arm')}", *shown, *_absent_lines(review)]


def _absent_lines(review: FleetReview) -> list[str]:
    """The arms without a recent recording, if there are any, in one line."""
    if not review.absent:
        return []
    named = [f"{arm.arm} ({arm.latest:%Y-%m-%d})" for arm in review.absent[:_MOST_LINES]]
    more = [f"{len(review.absent) - len(named)} more"] if len(review.absent) > len(named) else []
    listed = ", ".join([*named, *more])
    return [f"no recent recording, not assessed: {listed}; removed, or their recordings no longer arrive"]


def fleet_report_document(review: FleetReview) -> dict[str, Any]:
    """All arms for `--json`, the most suspicious first."""

    def identity(arm: ArmReview | AbsentArm) -> dict[str, Any]:
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
    return json_document("fleet-report", {"arms": arms, "absent": [identity(arm) for arm in review.absent]})
