"""`[provenance]`, the last section of every file of results."""

from __future__ import annotations

from collections.abc import Mapping

from pydantic import Field

from armload_identification.model.payload import Provenance
from armload_identification.storage import toml_text
from armload_identification.storage.strict_toml import Table, Text


class ProvenanceTable(Table):
    """What a result was made from."""

    armload_version: Text
    robot: Text = ""
    kinematics_sha256: Text = ""
    configuration_sha256: Text
    calibration_sha256: dict[str, Text] = Field(default={})
    recordings_sha256: dict[str, Text]
    validation_sha256: dict[str, Text] = Field(default={})

    def provenance(self) -> Provenance:
        """As in a result."""
        return Provenance(
            self.armload_version,
            self.configuration_sha256,
            self.recordings_sha256,
            self.calibration_sha256,
            self.robot,
            self.kinematics_sha256,
            self.validation_sha256,
        )


def provenance_lines(provenance: Provenance) -> list[str]:
    """The lines of `[provenance]`.

    Args:
        provenance: What the result was made from.
    """
    lines = [
        "[provenance]",
        f"armload_version = {toml_text.text(provenance.armload_version)}",
        *(
            f"{key} = {toml_text.text(value)}"
            for key, value in (("robot", provenance.robot), ("kinematics_sha256", provenance.kinematics_sha256))
            if value
        ),
        f"configuration_sha256 = {toml_text.text(provenance.configuration_sha256)}",
    ]
    if provenance.calibration_sha256:
        lines += ["", "[provenance.calibration_sha256]", *_hashes(provenance.calibration_sha256)]
    lines += ["", "[provenance.recordings_sha256]", *_hashes(provenance.recordings_sha256)]
    if provenance.validation_sha256:
        lines += ["", "[provenance.validation_sha256]", *_hashes(provenance.validation_sha256)]
    return lines


def _hashes(files: Mapping[str, str]) -> list[str]:
    """A line per file."""
    return [f"{toml_text.text(name)} = {toml_text.text(value)}" for name, value in files.items()]
