"""Which arms of a fleet need attention: findings of the review that nobody has acknowledged.

    fleet/acknowledged.jsonl      one JSON object per line: arm, until, why, findings, at_utc; lines are only added

An acknowledgement covers the findings that the arm has when it is made, by kind and quantity, until a date. A finding
of another kind or quantity needs attention although the arm is acknowledged. What is acknowledged is still listed,
counted and exported in every report.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from datetime import date, datetime
from pathlib import Path

from armload_controller.control_errors import ConfigurationError, FleetError
from armload_controller.fleet.fleet_review import FleetReview
from armload_identification.storage.replace_file import replace_file

_FILE = "acknowledged.jsonl"


@dataclass(frozen=True)
class Finding:
    """One reason to look after an arm.

    Attributes:
        arm: Name of the arm.
        kind: Kind and quantity, the same from report to report: "change, mass of gripper".
        text: A sentence.
    """

    arm: str
    model: str
    kind: str
    text: str


@dataclass(frozen=True)
class Acknowledgement:
    """A person's word that an arm's findings are known.

    Attributes:
        arm: Name of the arm.
        until: Last day on which they need no attention, ISO 8601.
        why: The reason.
        findings: Kinds of the findings.
        at_utc: When it was made, ISO 8601.
    """

    arm: str
    until: str
    why: str
    findings: tuple[str, ...]
    at_utc: str

    def covers(self, finding: Finding, today: date) -> bool:
        """Whether a finding needs no attention today."""
        return finding.arm == self.arm and finding.kind in self.findings and today <= date.fromisoformat(self.until)


@dataclass(frozen=True)
class Attention:
    """The findings of a review.

    Attributes:
        needed: Those that need attention, the most severe arm first.
        acknowledged: The others, each with its acknowledgement.
    """

    needed: tuple[Finding, ...]
    acknowledged: tuple[tuple[Finding, Acknowledgement], ...]

    @property
    def arms(self) -> tuple[str, ...]:
        """Names of the arms that need attention."""
        return tuple(dict.fromkeys(finding.arm for finding in self.needed))

    def of(self, arm: str) -> tuple[Finding, ...]:
        """The findings of an arm that need attention."""
        return tuple(finding for finding in self.needed if finding.arm == arm)

    @property
    def words(self) -> dict[str, str]:
        """What was said of acknowledged findings, by arm."""
        said: dict[str, set[str]] = {}
        for finding, known in self.acknowledged:
            said.setdefault(finding.arm, set()).add(f"acknowledged until {known.until}: {known.why}")
        return {arm: "; ".join(sorted(words)) for arm, words in said.items()}


def attention_of(review: FleetReview, folder: Path, today: date) -> Attention:
    """The findings of a fleet, with the acknowledgements in its folder.

    Raises:
        FleetError: the acknowledgements cannot be read.
    """
    known = acknowledgements(folder)
    needed, acknowledged = [], []
    for finding in findings_of(review):
        covering = next((each for each in reversed(known) if each.covers(finding, today)), None)
        if covering is None:
            needed.append(finding)
        else:
            acknowledged.append((finding, covering))
    return Attention(tuple(needed), tuple(acknowledged))


def findings_of(review: FleetReview) -> Iterator[Finding]:
    """All findings: suspicions, and arms without a recent recording."""
    for arm in review.arms:
        for found in arm.suspicions:
            kind = found.cause.value if found.quantity is None else f"{found.cause.value}, {found.quantity}"
            yield Finding(arm.arm, arm.model, kind, found.sentence)
    for gone in review.absent:
        text = f"no recent recording, the latest is of {gone.latest:%Y-%m-%d}"
        yield Finding(gone.arm, gone.model, "no recent recording", text)


def acknowledgements(folder: Path) -> list[Acknowledgement]:
    """All acknowledgements of a fleet, in the order in which they were made.

    Raises:
        FleetError: the file cannot be read.
    """
    path = folder / _FILE
    found: list[Acknowledgement] = []
    try:
        lines = path.read_text("utf-8").splitlines() if path.exists() else []
        for line in lines:
            values = json.loads(line)
            date.fromisoformat(values["until"])
            found.append(Acknowledgement(**values | {"findings": tuple(values["findings"])}))
    except OSError as problem:
        raise FleetError(f"{path}: cannot be read: {problem.strerror}") from problem
    except (ValueError, TypeError, KeyError) as problem:
        raise FleetError(
            f"{path}, line {len(found) + 1}: no acknowledgement ({problem}); correct or remove that line"
        ) from problem
    return found


def acknowledge(folder: Path, review: FleetReview, arm: str, until: str, why: str, now: datetime) -> Acknowledgement:
    """Acknowledge what an arm has now.

    Args:
        folder: Folder of the rows.
        arm: Name of the arm.
        until: Last day, ISO 8601.
        why: The reason.
        now: The present time, UTC.

    Raises:
        ConfigurationError: no such arm, nothing to acknowledge, no reason, or a day that is none or over.
        FleetError: the file cannot be written.
    """
    names = sorted({*(each.arm for each in review.arms), *(each.arm for each in review.absent)})
    findings = tuple(finding.kind for finding in findings_of(review) if finding.arm == arm)
    if not findings:
        expected = "nothing to acknowledge: it needs no attention" if arm in names else f"expected {', '.join(names)}"
        raise ConfigurationError("command line", "ARM", arm, expected)
    try:
        over = date.fromisoformat(until) < now.date()
    except ValueError as problem:
        raise ConfigurationError("command line", "--until", until, "expected a day, such as 2026-12-31") from problem
    if over:
        raise ConfigurationError("command line", "--until", until, f"expected a day from {now:%Y-%m-%d} on")
    if not why.strip():
        raise ConfigurationError("command line", "--why", why, "expected a reason for who reads the next report")
    made = Acknowledgement(arm, until, why, findings, now.isoformat(timespec="seconds"))
    path = folder / _FILE
    try:
        before = path.read_bytes() if path.exists() else b""
        replace_file(path, before + json.dumps(asdict(made)).encode() + b"\n")
    except OSError as problem:
        raise FleetError(f"{path}: cannot be written: {problem.strerror}") from problem
    return made
