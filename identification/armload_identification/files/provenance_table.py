"""`[provenance]`, which every file of results ends with."""

from __future__ import annotations

from collections.abc import Mapping

from armload_identification.model.payload import Provenance
from armload_identification.storage import toml_text
from armload_identification.storage.strict_toml import Table, Text


class ProvenanceTable(Table):
    """What a result was made from."""

    armload_version: Text
    configuration_sha256: Text
    recordings_sha256: dict[str, Text]

    def provenance(self) -> Provenance:
        """As results carry it."""
        return Provenance(self.armload_version, self.configuration_sha256, self.recordings_sha256)


def provenance_lines(
    armload_version: str, configuration_sha256: str, recordings_sha256: Mapping[str, str]
) -> list[str]:
    """The lines of `[provenance]`.

    Args:
        armload_version: Version of the program.
        configuration_sha256: Hash of the robot's configuration.
        recordings_sha256: Hash by name of the recording.
    """
    return [
        "[provenance]",
        f"armload_version = {toml_text.text(armload_version)}",
        f"configuration_sha256 = {toml_text.text(configuration_sha256)}",
        "",
        "[provenance.recordings_sha256]",
        *(f"{toml_text.text(name)} = {toml_text.text(value)}" for name, value in recordings_sha256.items()),
    ]
