"""The body file: an arm's own torque as TOML, read strictly."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from armload_core.arrays import FloatArray
from armload_identification import strict_toml
from armload_identification.calibration.body_identification import BodyResult
from armload_identification.identification_errors import BodyFileError, ModelError
from armload_identification.model.body_model import BodyModel
from armload_identification.model.payload import Provenance
from armload_identification.model.regressor import PARAMETERS

_PER_JOINT = (
    "rotor_inertia_kg_m2",
    "coulomb_nm",
    "viscous_nm_s_rad",
    "offset_nm",
    "stribeck_nm",
    "stribeck_velocity_rad_s",
    "load_friction",
    "reversal_speed_rad_s",
)


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
        f"links = {strict_toml.array(model.links)}",
        f"base = {strict_toml.array(model.base.astype(float))}",
        *(f"{name} = {strict_toml.array(getattr(model, name))}" for name in _PER_JOINT),
        f"torque_delay_s = {strict_toml.number(model.torque_delay_s)}",
        "",
        "# Currents were turned into torque with these gains; the body belongs to them.",
        "[transmission]",
        f"gain_nm_a = {strict_toml.array(result.gain_nm_a)}",
        f"coupling = {strict_toml.array(model.coupling)}",
        "",
        "[residual]",
        f"rms_nm = {strict_toml.array(result.residual_rms_nm)}",
        f"torque_rms_nm = {strict_toml.array(result.torque_rms_nm)}",
        f"noise_nm = {strict_toml.array(result.noise_nm)}",
        "",
        *strict_toml.provenance_lines(
            provenance.armload_version, provenance.configuration_sha256, provenance.recordings_sha256
        ),
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
    try:
        path.write_text(format_body(result), encoding="utf-8")
    except OSError as problem:
        raise BodyFileError(f"{path}: cannot be written: {problem}") from problem


def read_body(path: Path) -> BodyResult:
    """Read a body file.

    Args:
        path: TOML as `format_body` writes it.

    Raises:
        BodyFileError: not readable, incomplete or contradictory, naming file, key and value.
    """
    try:
        content = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as problem:
        raise BodyFileError(f"{path}: cannot be read: {problem}") from problem
    return parse_body(content, str(path))


def parse_body(content: str, source: str = "body") -> BodyResult:
    """A body from the text of its file.

    Args:
        content: TOML.
        source: What messages call it.

    Raises:
        BodyFileError: naming source, key, value and what was expected.
    """
    root = strict_toml.parse(content, source, BodyFileError)
    gears = root.table("transmission")
    gain = gears.array("gain_nm_a", None)
    n = gain.size
    coupling = gears.array("coupling", (n, n))
    gears.close()
    body = root.table("body")
    links = body.array("links", (n, PARAMETERS))
    base = body.array("base", (n, PARAMETERS)) > 0.5
    if (links[~base] != 0.0).any():
        raise body.refuse("base", "1 for every parameter that is not zero")
    values: dict[str, FloatArray] = {name: body.array(name, (n,)) for name in _PER_JOINT}
    delay_s = body.number("torque_delay_s")
    body.close()
    try:
        model = BodyModel(links=links, base=np.asarray(base), coupling=coupling, torque_delay_s=delay_s, **values)
    except ModelError as problem:
        raise BodyFileError(f"{source}: {problem}") from problem
    residual = root.table("residual")
    rms, torque, noise = (residual.array(name, (n,)) for name in ("rms_nm", "torque_rms_nm", "noise_nm"))
    residual.close()
    origin = Provenance(*strict_toml.read_provenance(root))
    root.close()
    return BodyResult(model, gain, rms, torque, noise, origin)
