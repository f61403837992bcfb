"""The gains file: drive gains that were calibrated with a known payload, as TOML."""

from __future__ import annotations

from pathlib import Path

from scipy.stats import norm

from armload_core.arrays import FloatArray
from armload_identification.calibration.drive_gains import GainCalibration
from armload_identification.estimation.uncertainty import CONFIDENCE
from armload_identification.files.provenance_table import ProvenanceTable, provenance_lines
from armload_identification.identification_errors import GainsFileError, ModelError
from armload_identification.recording.recording import hashes_by_name
from armload_identification.signals.joint_torque import Transmission
from armload_identification.storage import toml_text
from armload_identification.storage.strict_toml import (
    BadValue,
    NumberList,
    Table,
    parse,
    read_text,
    require_shape,
    write_text,
)


class _GainsTable(Table):
    """Axis torque per ampere of motor current, per joint."""

    gain_nm_a: NumberList
    half_width_95_nm_a: NumberList
    told: NumberList
    nominal_nm_a: NumberList


class _GainsFile(Table):
    """The whole file."""

    gains: _GainsTable
    provenance: ProvenanceTable


def format_gains(result: GainCalibration, armload_version: str, configuration_sha256: str) -> str:
    """The text of a gains file.

    Args:
        result: What was calibrated.
        armload_version: Version of the program.
        configuration_sha256: Hash of the robot's configuration.
    """
    lines = [
        "# Axis torque per ampere of motor current. Where told is 0 the gain is nominal: the payload pulls too little.",
        "[gains]",
        f"gain_nm_a = {toml_text.array(result.gain_nm_a)}",
        f"half_width_95_nm_a = {toml_text.array(result.half_width_95)}",
        f"told = {toml_text.array(result.determined.astype(float))}",
        f"nominal_nm_a = {toml_text.array(result.nominal_nm_a)}",
        "",
        *provenance_lines(armload_version, configuration_sha256, hashes_by_name(result.sources)),
    ]
    return "\n".join(lines) + "\n"


def write_gains(path: Path, result: GainCalibration, armload_version: str, configuration_sha256: str) -> None:
    """Write a gains file.

    Args:
        path: Where to; an existing file is replaced.
        result: What was calibrated.
        armload_version: Version of the program.
        configuration_sha256: Hash of the robot's configuration.

    Raises:
        GainsFileError: the file cannot be written.
    """
    write_text(path, format_gains(result, armload_version, configuration_sha256), GainsFileError)


def read_gains(path: Path, coupling: FloatArray) -> Transmission:
    """Read a gains file.

    Args:
        path: TOML as `format_gains` writes it.
        coupling: (n, n) C of the robot's motors.

    Returns:
        The transmission, with what is uncertain in its gains.

    Raises:
        GainsFileError: not readable, incomplete or of another robot, naming file, key and value.
    """
    return parse_gains(read_text(path, GainsFileError), coupling, str(path))


def parse_gains(content: str, coupling: FloatArray, source: str = "gains") -> Transmission:
    """A transmission from the text of a gains file.

    Args:
        content: TOML.
        coupling: (n, n) C of the robot's motors.
        source: What messages call it.

    Raises:
        GainsFileError: naming source, key, value and what was expected.
    """
    gains = parse(content, source, _GainsFile, GainsFileError).gains
    gain, calibrated = gains.gain_nm_a, gains.told > 0.5
    try:
        for name in _GainsTable.model_fields:
            require_shape(f"gains.{name}", getattr(gains, name), coupling.shape[:1])
        if (gain <= 0.0).any():
            raise BadValue("gains.gain_nm_a", gain.tolist(), "expected numbers above 0")
        deviation = gains.half_width_95_nm_a / float(norm.ppf(0.5 + CONFIDENCE / 2.0)) / gain
        return Transmission(gain, coupling, calibrated, deviation)
    except BadValue as problem:
        raise GainsFileError(source, problem.key, problem.found, problem.expected) from problem
    except ModelError as problem:
        raise GainsFileError(source, "gains", {}, str(problem)) from problem
