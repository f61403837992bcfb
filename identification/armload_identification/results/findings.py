"""A payload with everything known about it: its values, the fit, and the validation with a second pair of runs."""

from __future__ import annotations

from dataclasses import dataclass, replace
from datetime import UTC, datetime
from os import PathLike
from pathlib import Path
from typing import Any

from armload_identification.extras import Extra, require_extra
from armload_identification.files.payload_file import write_payload
from armload_identification.model.payload import PARAMETER_NAMES
from armload_identification.recording.recording import hashes_by_name
from armload_identification.report.reported_payload import ReportedPayload
from armload_identification.result_table import PrintedResult, ResultTable
from armload_identification.results.findings_document import findings_document
from armload_identification.results.json_document import json_document
from armload_identification.verdict.agreement import Outcome


@dataclass(frozen=True, eq=False, repr=False)
class Findings(PrintedResult, ReportedPayload):
    """A payload with everything known about it; printed as a table.

    Examples:
        >>> import armload
        >>> run = "runs/today/{}_identification.mcap".format
        >>> found = armload.identify("er50", run("loaded"), run("unloaded"))
        >>> isinstance(found, armload.Findings), found.verdict.title
        (True, 'Not validated')
        >>> print(str(found).splitlines()[0])
        Payload of er50 in the flange frame, inertia about its centre of mass
    """

    @property
    def intervals(self) -> dict[str, tuple[float, float] | None]:
        """95 % interval by parameter ("mass", "cx", ..., "iyz") in kg, m and kg m2; None where not determined."""
        rows = zip(PARAMETER_NAMES, self.payload.determined, self.payload.interval_95.tolist(), strict=True)
        return {name: (low, high) if known else None for name, known, (low, high) in rows}

    @property
    def outcome(self) -> Outcome | None:
        """Result of the validation: right, wrong, or cannot tell; None without a validation."""
        return None if self.validation is None else self.validation.verdict.outcome

    @property
    def notes(self) -> tuple[str, ...]:
        """Notes to the operator about the fit, one sentence each."""
        return () if self.identification is None else self.identification.notes

    def with_validation_in_provenance(self) -> Findings:
        """The same with the recordings of the validation added to the payload's provenance."""
        provenance = replace(self.payload.provenance, validation_sha256=hashes_by_name(self.sources[1]))
        return replace(self, payload=replace(self.payload, provenance=provenance))

    def save(self, path: str | PathLike[str]) -> None:
        """Write the payload file; an existing file is replaced.

        Raises:
            PayloadFileError: the model is impossible or nearly so, or the file cannot be written.
        """
        write_payload(Path(path), self.payload)

    def report(self, path: str | PathLike[str], created: datetime | None = None) -> None:
        """Write the report as one HTML file; an existing file is replaced.

        Args:
            path: The file.
            created: Date and time on the page; now if not given.

        Raises:
            ReportError: the file cannot be written.
            ExtraMissing: the libraries for reports are not installed.
        """
        require_extra(Extra.REPORT, "a report")
        from armload_identification.report.page import write_page  # matplotlib takes longer to load than a fit
        from armload_identification.report.report import render_report

        write_page(Path(path), render_report(self, f"{created or datetime.now(UTC):%Y-%m-%d %H:%M} UTC"))

    def to_dict(self) -> dict[str, Any]:
        """Everything as numbers, texts, lists and dictionaries: the schema `armload/payload/1`."""
        return json_document("payload", findings_document(self))

    def table(self) -> ResultTable:
        """Values, intervals, verdict and notes."""
        sentences = f"{self.verdict.title}. {self.verdict.text}", *(f"note: {note}" for note in self.notes)
        title = f"Payload of {self.arm.name} in the {self.payload.frame} frame, inertia about its centre of mass"
        return replace(self.payload.table(), title=title, sentences=sentences)
