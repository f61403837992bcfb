"""The gains file: drive gains that were calibrated with a known payload, as TOML, read strictly."""

from __future__ import annotations

from pathlib import Path

from scipy.stats import norm

from armload_core.arrays import FloatArray
from armload_identification import strict_toml
from armload_identification.calibration.drive_gains import GainCalibration
from armload_identification.estimation.uncertainty import CONFIDENCE
from armload_identification.identification_errors import GainsFileError, ModelError
from armload_identification.recording.recording import hashes_by_name
from armload_identification.signals.joint_torque import Transmission


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
        f"gain_nm_a = {strict_toml.array(result.gain_nm_a)}",
        f"half_width_95_nm_a = {strict_toml.array(result.half_width_95)}",
        f"told = {strict_toml.array(result.told.astype(float))}",
        f"nominal_nm_a = {strict_toml.array(result.nominal_nm_a)}",
        "",
        *strict_toml.provenance_lines(armload_version, configuration_sha256, hashes_by_name(result.sources)),
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
    try:
        path.write_text(format_gains(result, armload_version, configuration_sha256), encoding="utf-8")
    except OSError as problem:
        raise GainsFileError(f"{path}: cannot be written: {problem}") from problem


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
    try:
        content = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as problem:
        raise GainsFileError(f"{path}: cannot be read: {problem}") from problem
    return parse_gains(content, coupling, str(path))


def parse_gains(content: str, coupling: FloatArray, source: str = "gains") -> Transmission:
    """A transmission from the text of a gains file.

    Args:
        content: TOML.
        coupling: (n, n) C of the robot's motors.
        source: What messages call it.

    Raises:
        GainsFileError: naming source, key, value and what was expected.
    """
    root = strict_toml.parse(content, source, GainsFileError)
    table = root.table("gains")
    shape = (coupling.shape[0],)
    gain, width, told, _ = (
        table.array(key, shape) for key in ("gain_nm_a", "half_width_95_nm_a", "told", "nominal_nm_a")
    )
    table.close()
    strict_toml.read_provenance(root)
    root.close()
    if (gain <= 0.0).any():
        raise table.refuse("gain_nm_a", "numbers above 0")
    try:
        return Transmission(gain, coupling, told > 0.5, width / float(norm.ppf(0.5 + CONFIDENCE / 2.0)) / gain)
    except ModelError as problem:
        raise GainsFileError(f"{source}: {problem}") from problem
