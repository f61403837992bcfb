"""The calibration file: an arm as identified from its runs, with its uncertainty, as TOML."""

from __future__ import annotations

from os import PathLike
from pathlib import Path
from typing import Final

import numpy as np
from msgspec import field
from msgspec.structs import asdict

from armload_identification.calibration.calibration_result import ArmCalibration, CalibratedPayload, CalibratedRun
from armload_identification.estimation.arm_terms import TILT, places_of
from armload_identification.files.covariance_table import require_covariance
from armload_identification.files.provenance_table import ProvenanceTable, provenance_lines
from armload_identification.float_array import FloatArray
from armload_identification.identification_errors import CalibrationFileError, ModelError
from armload_identification.model.body_model import BodyModel
from armload_identification.model.regressor import PARAMETERS
from armload_identification.recording.reading_options import Effort
from armload_identification.storage import toml_text
from armload_identification.storage.strict_toml import (
    BadValue,
    NumberList,
    NumberRows,
    SymmetricRows,
    Table,
    Text,
    parse_toml,
    read_toml,
    require_array_shapes,
    toml_values,
    write_text,
)

_WIDTH_TOLERANCE: Final = 1e-6
_DRIFT: Final = ("coulomb_drift_nm", "viscous_drift_nm_s_rad", "offset_drift_nm")


class _ArmTable(Table):
    """Which arm."""

    robot: Text
    kinematics_sha256: Text
    effort: Text
    days: list[str]
    warnings: list[str]


class _GainsTable(Table):
    """Axis torque per ampere, or per N m reported."""

    gain: NumberList
    half_width_95: NumberList
    nominal: NumberList


class _FrictionTable(Table):
    """Friction of the joints, and its standard deviation between runs."""

    coulomb_nm: NumberList
    viscous_nm_s_rad: NumberList
    root_nm: NumberList
    load_friction: NumberList
    reversal_speed_rad_s: NumberList
    coulomb_drift_nm: NumberList
    viscous_drift_nm_s_rad: NumberList
    offset_drift_nm: NumberList


class _BodyTable(Table):
    """Links, rotors, delay, and tilt of the base."""

    links: NumberRows
    base: NumberRows
    rotor_inertia_kg_m2: NumberList
    torque_delay_s: float
    tilt_rad: NumberList
    coupling: NumberRows


class _FitTable(Table):
    """Residual, its correlation time, and RMS torque, per axis with nominal gains."""

    residual_nm: NumberList
    correlation_s: NumberList
    effort_nm: NumberList


class _LeftOutTable(Table):
    """A run that was not used."""

    name: Text
    reason: Text


class _UncertaintyTable(Table):
    """Covariance of all unknowns."""

    covariance: SymmetricRows


class _CalibrationFile(Table):
    """The file."""

    content = "an arm's calibration"

    arm: _ArmTable
    gains: _GainsTable
    friction: _FrictionTable
    body: _BodyTable
    fit: _FitTable
    payloads: tuple[CalibratedPayload, ...] = ()
    runs: tuple[CalibratedRun, ...]
    left_out: list[_LeftOutTable] = field(default_factory=list)
    uncertainty: _UncertaintyTable
    provenance: ProvenanceTable

    def __post_init__(self) -> None:
        self._one_entry_per_joint()
        self._makes_sense()

    def _one_entry_per_joint(self) -> None:
        n = len(self.gains.gain)
        for name in ("gains", "friction", "fit"):
            table: Table = getattr(self, name)
            require_array_shapes(name, table, dict.fromkeys(table.__struct_fields__, (n,)))
        base, size = (n, PARAMETERS), places_of(self.body.base != 0.0)[TILT].stop
        body = {"links": base, "base": base, "rotor_inertia_kg_m2": (n,), "coupling": (n, n), "tilt_rad": (2,)}
        require_array_shapes("body", self.body, body)
        require_array_shapes("uncertainty", self.uncertainty, {"covariance": (size, size)})
        for index, payload in enumerate(self.payloads, 1):
            require_array_shapes(f"payloads[{index}]", payload, {"theta": (PARAMETERS,), "deviation": (PARAMETERS,)})
        for index, run in enumerate(self.runs, 1):
            shapes = {"residual_rms_nm": (n,), "influence": (n,), "friction_changes": (3, n)}
            require_array_shapes(f"runs[{index}]", run, shapes)

    def _makes_sense(self) -> None:
        if self.arm.effort not in tuple(Effort):
            raise BadValue("arm.effort", self.arm.effort, f"expected {' or '.join(Effort)}")
        if (self.fit.correlation_s <= 0.0).any():
            raise BadValue("fit.correlation_s", self.fit.correlation_s.tolist(), "expected times above 0")
        for key in ("gain", "nominal"):
            if (getattr(self.gains, key) <= 0.0).any():
                raise BadValue(f"gains.{key}", getattr(self.gains, key).tolist(), "expected numbers above 0")
        if (self.body.links[self.body.base <= 0.5] != 0.0).any():
            raise BadValue("body.base", self.body.base.tolist(), "expected 1 for every parameter that is not zero")
        require_covariance("uncertainty.covariance", self.uncertainty.covariance)


def format_calibration(result: ArmCalibration) -> str:
    """The text of a calibration file; `parse_calibration` gives back the same numbers."""
    table = toml_text.table
    unit = "N m per A of motor current" if result.effort is Effort.CURRENT else "N m per N m that a drive reports"
    gains = {"gain": result.gain_nm_a, "half_width_95": result.gain_half_width_95, "nominal": result.nominal}
    drift = dict(zip(_DRIFT, result.drift, strict=True))
    fit = {"residual_nm": result.noise_nm, "correlation_s": result.correlation_s, "effort_nm": result.level_nm}
    lines = [
        f"# Axis torque on the output side of the gear: {unit}. Residual and effort are in N m, with the nominal "
        "gains.",
        *table("arm", _entries(_ArmTable, result)),
        *table("gains", gains),
        "# The drift is the standard deviation of friction between runs.",
        *table("friction", _entries(_FrictionTable, result.body) | drift),
        "# Base parameters: together they give the arm's torque; single numbers are not the mass or inertia of a link.",
        "# Per link in its joint frame: m, m cx, m cy, m cz, Ixx, Iyy, Izz, Ixy, Ixz, Iyz about the origin.",
        *table("body", _entries(_BodyTable, result.body, result)),
        *table("fit", fit),
    ]
    for payload in result.payloads:
        lines += table("[payloads]", _entries(CalibratedPayload, payload))
    for run in result.runs:
        lines += table("[runs]", _entries(CalibratedRun, run))
    for name, reason in result.left_out:
        lines += table("[left_out]", {"name": name, "reason": reason})
    lines += [
        "# Of ln gain, base parameters, rotors, load, Coulomb, viscous and root friction, delay (s), tilt (rad);",
        "# it is symmetric, and each row ends at the diagonal.",
        *table("uncertainty", {"covariance": [row[:end] for end, row in enumerate(result.covariance, 1)]}),
        *provenance_lines(result.provenance),
    ]
    return "\n".join(lines)


def _entries(table: type[Table], *holders: object) -> dict[str, object]:
    """The entries of a table that these objects have; a number that is not known is none."""
    found = {key: getattr(holder, key) for key in table.__struct_fields__ for holder in holders if hasattr(holder, key)}
    return {key: value for key, value in found.items() if not (isinstance(value, float) and np.isnan(value))}


def write_calibration(path: Path, result: ArmCalibration) -> None:
    """Write a calibration file.

    Args:
        path: The file; an existing one is replaced.
        result: What to write.

    Raises:
        CalibrationFileError: the file cannot be written.
    """
    write_text(path, format_calibration(result), CalibrationFileError)


def read_calibration(path: str | PathLike[str]) -> ArmCalibration:
    """Read a calibration file.

    Args:
        path: TOML as `format_calibration` writes it.

    Raises:
        CalibrationFileError: not readable, incomplete or contradictory, naming file, key and value.

    Examples:
        >>> import armload
        >>> armload.read_calibration("runs/today/arm.calibration.toml").robot
        'er50'
    """
    return parse_calibration(read_toml(path, CalibrationFileError), str(path))


def is_calibration(path: str | PathLike[str]) -> bool:
    """Whether a file is a calibration, complete or not; False for any other file, also one that is not TOML."""
    try:
        found = toml_values(read_toml(path, CalibrationFileError), str(path), CalibrationFileError)
    except CalibrationFileError:
        return False
    return {"arm", "gains"} <= found.keys()


def parse_calibration(content: str, source: str = "calibration") -> ArmCalibration:
    """A calibration from the text of its file.

    Raises:
        CalibrationFileError: naming source, key, value and what was expected.
    """
    tables = parse_toml(content, source, _CalibrationFile, CalibrationFileError)
    body, friction = asdict(tables.body), asdict(tables.friction)
    drift = np.stack([friction.pop(key) for key in _DRIFT])
    tilt_rad, base = body.pop("tilt_rad"), body.pop("base") > 0.5
    try:
        model = BodyModel(**body, **friction, base=base, offset_nm=np.zeros(len(base)))
    except ModelError as problem:
        raise CalibrationFileError(source, "body", {}, str(problem)) from problem
    result = ArmCalibration(
        robot=tables.arm.robot,
        effort=Effort(tables.arm.effort),
        gain_nm_a=tables.gains.gain,
        nominal=tables.gains.nominal,
        body=model,
        tilt_rad=tilt_rad,
        covariance=tables.uncertainty.covariance,
        drift=drift,
        noise_nm=tables.fit.residual_nm,
        correlation_s=tables.fit.correlation_s,
        level_nm=tables.fit.effort_nm,
        payloads=tables.payloads,
        runs=tables.runs,
        left_out=tuple((entry.name, entry.reason) for entry in tables.left_out),
        warnings=tuple(tables.arm.warnings),
        kinematics_sha256=tables.arm.kinematics_sha256,
        provenance=tables.provenance.provenance(),
    )
    _require_width(source, tables.gains.half_width_95, result.gain_half_width_95)
    return result


def _require_width(source: str, written: FloatArray, wanted: FloatArray) -> None:
    """Raise if the intervals do not agree with the covariance."""
    if not np.allclose(written, wanted, rtol=_WIDTH_TOLERANCE, atol=0.0):
        instead = f"the value from [uncertainty], {wanted.round(6).tolist()}; calibrate again instead of editing"
        raise CalibrationFileError(source, "gains.half_width_95", written.tolist(), f"expected {instead}")
