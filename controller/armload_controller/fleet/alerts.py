"""What other programs are told of a fleet: a Prometheus text file, and a webhook for new findings.

- The text file is for the node exporter's textfile collector, which reads it at any time: it is replaced at once.
- The webhook gets one POST with a JSON document if there are findings that no earlier one contained. What was sent is
  kept in `fleet/notified.json`; a finding that ended and comes back is new. If the webhook does not answer, nothing is
  kept, so the next report sends it again.

References:
    Prometheus, exposition formats, text-based format: names, types, escapes of label values.
"""

from __future__ import annotations

import json
import urllib.error
import urllib.request
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict
from datetime import datetime
from pathlib import Path
from typing import Final
from urllib.parse import urlsplit

from armload_controller.control_errors import ConfigurationError, FleetError
from armload_controller.fleet.attention import Attention, Finding
from armload_controller.fleet.fleet_review import FleetReview
from armload_identification.storage.replace_file import replace_file

_NOTIFIED: Final = "notified.json"
_PATIENCE_S: Final = 10.0
_METRICS: Final = (
    ("attention", "Findings of the arm that need attention."),
    ("acknowledged", "Findings of the arm that are acknowledged."),
    ("deviations", "The most severe suspicion, in standard deviations."),
    ("recordings", "Recordings of the arm."),
    ("recordings_without_result", "Recordings of the arm that were refused or failed."),
    ("latest_recording_timestamp_seconds", "Time of the arm's latest recording."),
)


def metrics_text(review: FleetReview, attention: Attention, now: datetime) -> str:
    """The fleet in Prometheus' text format.

    Args:
        attention: Its findings.
        now: Time of the report, UTC.
    """
    rows: list[tuple[str, str, tuple[float, ...]]] = []
    known = Counter(finding.arm for finding, _ in attention.acknowledged)
    for arm in (*review.arms, *review.absent):
        recordings = (arm.runs, arm.without_result, arm.latest.timestamp())
        rows.append((arm.arm, arm.model, (len(attention.of(arm.arm)), known[arm.arm], arm.deviations, *recordings)))
    lines = []
    for place, (name, meaning) in enumerate(_METRICS):
        metric = f"armload_arm_{name}"
        lines += [f"# HELP {metric} {meaning}", f"# TYPE {metric} gauge"]
        lines += [
            f'{metric}{{arm="{_label(arm)}",model="{_label(model)}"}} {values[place]:.10g}'
            for arm, model, values in rows
        ]
    metric = "armload_fleet_report_timestamp_seconds"
    lines += [f"# HELP {metric} Time of the report.", f"# TYPE {metric} gauge", f"{metric} {now.timestamp():.10g}"]
    return "\n".join(lines) + "\n"


def write_metrics(path: Path, text: str) -> None:
    """Write the text file at once.

    Raises:
        FleetError: it cannot be written.
    """
    try:
        replace_file(path, text.encode("utf-8"))
    except OSError as problem:
        raise FleetError(f"{path}: cannot be written: {problem.strerror}") from problem


def notify(url: str, folder: Path, attention: Attention, armload_version: str) -> tuple[Finding, ...]:
    """Send the findings that are new since the last time.

    Args:
        url: http or https.
        folder: Folder of the rows.
        attention: The findings.
        armload_version: Version of the program.

    Returns:
        What was sent; nothing is sent without a new finding.

    Raises:
        ConfigurationError: the URL is not of http or https.
        FleetError: the webhook does not accept the findings, or the folder cannot be written.
    """
    if urlsplit(url).scheme not in {"http", "https"} or not urlsplit(url).hostname:
        raise ConfigurationError("command line", "--webhook", url, "expected a URL of http or https")
    path = folder / _NOTIFIED
    before = _notified(path)
    new = tuple(finding for finding in attention.needed if [finding.arm, finding.kind] not in before)
    if new:
        _post(url, new, armload_version)
    now = [[finding.arm, finding.kind] for finding in attention.needed]
    write_metrics(path, json.dumps(now) + "\n")
    return new


def _notified(path: Path) -> list[list[str]]:
    """Arm and kind of what was sent before; nothing if that cannot be read, so that all is sent again."""
    try:
        found: list[list[str]] = json.loads(path.read_text("utf-8"))
    except (OSError, ValueError):
        return []
    return found


def _post(url: str, findings: Sequence[Finding], armload_version: str) -> None:
    """One POST; redirects are not followed, as they would turn it into a GET."""
    document = {
        "schema": "armload/fleet-findings/1",
        "armload_version": armload_version,
        "findings": [asdict(finding) for finding in findings],
    }
    request = urllib.request.Request(
        url,
        json.dumps(document).encode(),
        {"Content-Type": "application/json", "User-Agent": f"armload/{armload_version}"},
    )
    where = f"{urlsplit(url).scheme}://{urlsplit(url).hostname}"  # the rest may contain a token
    try:
        with urllib.request.build_opener(_NoRedirect).open(request, timeout=_PATIENCE_S):
            pass
    except urllib.error.HTTPError as problem:
        problem.close()
        raise FleetError(f"the webhook at {where} refused the findings: HTTP {problem.code}") from problem
    except OSError as problem:
        raise FleetError(f"the webhook at {where} does not answer: {problem}; the next report tries again") from problem


class _NoRedirect(urllib.request.HTTPRedirectHandler):
    """Reports a redirect as an error."""

    def redirect_request(self, *_request: object) -> None:
        """Follow nothing."""


def _label(text: str) -> str:
    """A label's value with its escapes."""
    return text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n")
