"""The answer to what an arm carries, if its runs prove that it carries nothing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from os import PathLike
from pathlib import Path
from typing import Any

from armload_identification.extras import Extra, require_extra
from armload_identification.identification_errors import NothingMounted
from armload_identification.recording.recording import RecordingSource
from armload_identification.report.reported_payload import ArmDescription
from armload_identification.results.json_document import json_document


@dataclass(frozen=True, eq=False)
class ArmWithoutPayload:
    """An arm that carries nothing.

    Attributes:
        found: The mass and its interval.
        sources: Sources of its runs.
    """

    arm: ArmDescription
    found: NothingMounted
    sources: Sequence[RecordingSource]

    def to_dict(self) -> dict[str, Any]:
        """Everything as numbers, texts, lists and dictionaries: the schema `armload/nothing-mounted/1`."""
        fields = {
            "robot": self.arm.name,
            "mass_kg": self.found.mass_kg,
            "half_width_95_kg": self.found.half_width_kg,
            "text": self.found.statement,
            "recordings": [{"file": str(source.path), "sha256": source.sha256} for source in self.sources],
        }
        return json_document("nothing-mounted", fields)

    def report(self, path: str | PathLike[str]) -> None:
        """Write the report as one HTML file; an existing file is replaced.

        Raises:
            ReportError: the file cannot be written.
            ExtraMissing: the libraries for reports are not installed.
        """
        require_extra(Extra.REPORT, "a report")
        from armload_identification.report.page import rendered, write_page

        page = rendered(
            "nothing_mounted.html.j2",
            arm=self.arm,
            statement=self.found.statement,
            fitted=self.sources,
            validating=(),
            named=(),
            created=f"{datetime.now(UTC):%Y-%m-%d %H:%M} UTC",
        )
        write_page(Path(path), page)
