"""`[provenance]`, the last section of every file of results."""

from __future__ import annotations

import msgspec
from msgspec import field

from armload_identification.model.payload import Provenance
from armload_identification.storage import toml_text
from armload_identification.storage.strict_toml import Table, Text


class ProvenanceTable(Table):
    """What a result was made from."""

    armload_version: Text
    robot: Text = ""
    kinematics_sha256: Text = ""
    configuration_sha256: Text
    calibration_sha256: dict[str, Text] = field(default_factory=dict)
    recordings_sha256: dict[str, Text]
    validation_sha256: dict[str, Text] = field(default_factory=dict)

    def provenance(self) -> Provenance:
        """As in a result."""
        return Provenance(**msgspec.structs.asdict(self))


def provenance_lines(provenance: Provenance) -> list[str]:
    """The lines of `[provenance]`."""
    arm = {key: value for key in ("robot", "kinematics_sha256") if (value := getattr(provenance, key))}
    texts = {"armload_version": provenance.armload_version, **arm}
    lines = toml_text.table("provenance", texts | {"configuration_sha256": provenance.configuration_sha256})
    for key in ("calibration_sha256", "recordings_sha256", "validation_sha256"):
        hashes = getattr(provenance, key)
        if hashes or key == "recordings_sha256":
            quoted = {toml_text.value(name): sha256 for name, sha256 in hashes.items()}
            lines += toml_text.table(f"provenance.{key}", quoted)
    return lines
