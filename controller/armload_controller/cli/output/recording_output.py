"""Output of `armload recordings show`: facts as text, a table of the joints, and a document."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from armload_identification.numerals import counted
from armload_identification.pipeline.recording_survey import RecordingSurvey
from armload_identification.result_table import ResultTable
from armload_identification.results.findings_document import json_numbers
from armload_identification.results.json_document import json_document

_RUN_KEYS = ("robot", "load", "role", "created")
_SOURCE_KEYS = ("sha256", "truncated", "rows_read", "rows_dropped")
_SURVEY_KEYS = (
    *("duration_s", "rate_hz", "holes", "longest_hole_s"),
    *("moving_s", "period_s", "periods", "interruptions"),
)


def survey_text(facts: RecordingSurvey) -> str:
    """Facts of a recording, one line each."""
    run, source = facts.recording, facts.recording.source
    described = source.run()
    said = ", ".join(f"{key} {described[key]}" for key in _RUN_KEYS if described.get(key))
    dropped = ", ".join(f"{count} {reason}" for reason, count in source.reasons.items())
    lines = [
        f"{source.path}",
        f"  format       {source.kind}{', cut short' if source.truncated else ''}{': ' + said if said else ''}",
        f"  rows         {source.rows_read}{f', {source.rows_dropped} left out ({dropped})' if dropped else ''}",
        f"  time         {facts.duration_s:.4g} s, {facts.rate_hz:.4g} rows per second{_holes(facts)}",
        f"  joints       {run.n}{': ' + ', '.join(run.joint_names) if run.joint_names else ', not named'}",
        f"  effort       {facts.effort_kind or 'none'}",
        f"  motion       {_motion(facts)}",
    ]
    return "\n".join(lines + [f"  missing      {sentence}" for sentence in facts.missing])


def joint_table(facts: RecordingSurvey) -> ResultTable:
    """A row for each joint."""
    names = facts.recording.joint_names or [str(joint + 1) for joint in range(facts.recording.n)]
    columns = [
        names,
        [f"{low:z.3f} to {high:z.3f}" for low, high in facts.position_rad],
        [f"{speed:.3f}" for speed in facts.speed_rad_s],
    ]
    headings = ["joint", "position, rad", "speed to, rad/s"]
    if facts.effort is not None:
        columns.append([f"{low:.3g} to {high:.3g}" for low, high in facts.effort])
        headings.append(f"{facts.effort_kind}, {'N m' if facts.effort_kind == 'joint torque' else 'A'}")
    return ResultTable("", headings, list(zip(*columns, strict=True)), (0,))


def pair_text(surveys: Sequence[RecordingSurvey], problem: str | None) -> str:
    """Whether two recordings fit, or what one of them lacks."""
    if len(surveys) > 1:
        return f"not a pair: {problem}" if problem else "both are of the same motion: identify can use them as a pair"
    if surveys[0].missing:
        return "not sufficient to identify a payload, see above"
    return (
        "identifying a payload requires a second run of the same motion, one with and one without the payload, or a "
        "calibrated arm (armload calibrate)"
    )


def recording_document(surveys: Sequence[RecordingSurvey], problem: str | None) -> dict[str, Any]:
    """The same for `--json`; controller/JSON.md describes it."""
    pair = None if len(surveys) == 1 else {"fits": problem is None, "problem": problem}
    return json_document("recordings", {"recordings": [_fields(facts) for facts in surveys], "pair": pair})


def _fields(facts: RecordingSurvey) -> dict[str, Any]:
    """One recording."""
    run, source = facts.recording, facts.recording.source
    described = source.run()
    names = run.joint_names or (None,) * run.n
    effort = [[None, None]] * run.n if facts.effort is None else facts.effort
    return {
        "file": str(source.path),
        "format": source.kind,
        **{key: getattr(source, key) for key in _SOURCE_KEYS},
        **{key: described.get(key) for key in _RUN_KEYS},
        **{key: getattr(facts, key) for key in _SURVEY_KEYS},
        "effort": facts.effort_kind,
        "joints": [
            {
                "name": names[joint],
                "position_rad": json_numbers(facts.position_rad[joint]),
                "speed_rad_s": float(facts.speed_rad_s[joint]),
                "effort": [None if value is None else float(value) for value in effort[joint]],
            }
            for joint in range(run.n)
        ],
        "missing": list(facts.missing),
    }


def _holes(facts: RecordingSurvey) -> str:
    if not facts.holes:
        return ", no gaps"
    return f", {counted(facts.holes, 'gap')}, the longest {facts.longest_hole_s:.3g} s"


def _motion(facts: RecordingSurvey) -> str:
    """When the arm moves, and whether the motion is periodic."""
    if facts.moving_s is None:
        return "none"
    text = f"from {facts.moving_s[0]:.4g} to {facts.moving_s[1]:.4g} s"
    if facts.period_s is None:
        return f"{text}, not periodic"
    known = "of a known excitation" if facts.recording.excitation is not None else "found in the motion"
    count = facts.interruptions
    interrupted = f", interrupted {'once' if count == 1 else f'{count} times'}" if count else ""
    return f"{text}, {facts.periods} whole periods of {facts.period_s:.5g} s, {known}{interrupted}"
