"""The body file: an arm's own torque as TOML."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from pydantic import model_validator

from armload_identification.calibration.body_identification import BodyResult
from armload_identification.files.provenance_table import ProvenanceTable, provenance_lines
from armload_identification.identification_errors import BodyFileError, ModelError
from armload_identification.model.body_model import BodyModel
from armload_identification.model.regressor import PARAMETERS
from armload_identification.storage import toml_text
from armload_identification.storage.strict_toml import (
    BadValue,
    NumberList,
    NumberRows,
    Table,
    parse,
    read_text,
    require_shape,
    write_text,
)

_PER_JOINT = (
    "rotor_inertia_kg_m2",
    "coulomb_nm",
    "viscous_nm_s_rad",
    "root_nm",
    "offset_nm",
    "stribeck_nm",
    "stribeck_velocity_rad_s",
    "load_friction",
    "reversal_speed_rad_s",
)


class _BodyTable(Table):
    """The model of the arm, per joint."""

    links: NumberRows
    base: NumberRows
    rotor_inertia_kg_m2: NumberList
    coulomb_nm: NumberList
    viscous_nm_s_rad: NumberList
    root_nm: NumberList
    offset_nm: NumberList
    stribeck_nm: NumberList
    stribeck_velocity_rad_s: NumberList
    load_friction: NumberList
    reversal_speed_rad_s: NumberList
    torque_delay_s: float


class _TransmissionTable(Table):
    """How currents were turned into torque."""

    gain_nm_a: NumberList
    coupling: NumberRows


class _ResidualTable(Table):
    """What the model leaves unexplained, per joint."""

    rms_nm: NumberList
    torque_rms_nm: NumberList
    noise_nm: NumberList


class _BodyFile(Table):
    """The whole file."""

    transmission: _TransmissionTable
    body: _BodyTable
    residual: _ResidualTable
    provenance: ProvenanceTable

    @model_validator(mode="after")
    def _one_entry_per_joint(self) -> _BodyFile:
        n = len(self.transmission.gain_nm_a)
        require_shape("transmission.coupling", self.transmission.coupling, (n, n))
        require_shape("body.links", self.body.links, (n, PARAMETERS))
        require_shape("body.base", self.body.base, (n, PARAMETERS))
        for name in _PER_JOINT:
            require_shape(f"body.{name}", getattr(self.body, name), (n,))
        for name in _ResidualTable.model_fields:
            require_shape(f"residual.{name}", getattr(self.residual, name), (n,))
        return self

    @model_validator(mode="after")
    def _only_base_parameters(self) -> _BodyFile:
        if (self.body.links[self.body.base <= 0.5] != 0.0).any():
            raise BadValue("body.base", self.body.base.tolist(), "expected 1 for every parameter that is not zero")
        return self


def format_body(result: BodyResult) -> str:
    """The text of a body file; `parse_body` gives back the same numbers.

    Args:
        result: What to write.
    """
    model, provenance = result.model, result.provenance
    lines = [
        "# Base parameters: their sum is the arm's torque, the single numbers are no link's mass or inertia.",
        "# Per link in its joint frame: m, m cx, m cy, m cz, Ixx, Iyy, Izz, Ixy, Ixz, Iyz about the origin.",
        "[body]",
        f"links = {toml_text.array(model.links)}",
        f"base = {toml_text.array(model.base.astype(float))}",
        *(f"{name} = {toml_text.array(getattr(model, name))}" for name in _PER_JOINT),
        f"torque_delay_s = {toml_text.number(model.torque_delay_s)}",
        "",
        "# Currents were turned into torque with these gains; the body belongs to them.",
        "[transmission]",
        f"gain_nm_a = {toml_text.array(result.gain_nm_a)}",
        f"coupling = {toml_text.array(model.coupling)}",
        "",
        "[residual]",
        f"rms_nm = {toml_text.array(result.residual_rms_nm)}",
        f"torque_rms_nm = {toml_text.array(result.torque_rms_nm)}",
        f"noise_nm = {toml_text.array(result.noise_nm)}",
        "",
        *provenance_lines(provenance.armload_version, provenance.configuration_sha256, provenance.recordings_sha256),
    ]
    return "\n".join(lines) + "\n"


def write_body(path: Path, result: BodyResult) -> None:
    """Write a body file.

    Args:
        path: Where to; an existing file is replaced.
        result: What to write.

    Raises:
        BodyFileError: the file cannot be written.
    """
    write_text(path, format_body(result), BodyFileError)


def read_body(path: Path) -> BodyResult:
    """Read a body file.

    Args:
        path: TOML as `format_body` writes it.

    Raises:
        BodyFileError: not readable, incomplete or contradictory, naming file, key and value.
    """
    return parse_body(read_text(path, BodyFileError), str(path))


def parse_body(content: str, source: str = "body") -> BodyResult:
    """A body from the text of its file.

    Args:
        content: TOML.
        source: What messages call it.

    Raises:
        BodyFileError: naming source, key, value and what was expected.
    """
    tables = parse(content, source, _BodyFile, BodyFileError)
    body, gears, residual = tables.body, tables.transmission, tables.residual
    try:
        model = BodyModel(
            links=body.links,
            base=np.asarray(body.base > 0.5),
            coupling=gears.coupling,
            torque_delay_s=body.torque_delay_s,
            **{name: getattr(body, name) for name in _PER_JOINT},
        )
    except ModelError as problem:
        raise BodyFileError(source, "body", {}, str(problem)) from problem
    return BodyResult(
        model,
        gears.gain_nm_a,
        residual.rms_nm,
        residual.torque_rms_nm,
        residual.noise_nm,
        tables.provenance.provenance(),
    )
