"""Compare a payload with CAD."""

from __future__ import annotations

from os import PathLike
from pathlib import Path

from armload_controller.analysis.arm_in_use import Calibration, calibration_from
from armload_controller.config.objects_or_paths import PayloadSource, payload_from
from armload_identification.argument_types import require_type
from armload_identification.identification_errors import PayloadFileError
from armload_identification.results.payload_comparison import PayloadComparison
from armload_identification.verdict import cad_comparison
from armload_identification.verdict.agreement import compare_known
from armload_identification.verdict.payload_verdict import known_payload, with_gains
from armload_identification.verdict.tolerance import Tolerance


def compare(
    payload: PayloadSource,
    cad: PayloadSource,
    *,
    calibration: Calibration | None = None,
    tolerance: Tolerance | None = None,
) -> PayloadComparison:
    """Compare a payload with CAD: the verdict on mass and centre of mass, and relative errors.

    Args:
        payload: The payload that was identified, or its file.
        cad: The true values, or their file.
        calibration: Calibration of the arm, or its file; its gains are applied to the payload.
        tolerance: Permitted error of the payload; 2 % of its mass and 10 mm if not given.

    Raises:
        PayloadFileError: a file cannot be read, the frames differ, or the calibration is of another arm.

    Examples:
        >>> import armload
        >>> payload = armload.read_payload("runs/today/payload.toml")
        >>> armload.compare(payload, "runs/today/payload.toml").outcome.value
        'right'
    """
    require_type("tolerance", tolerance, Tolerance)
    estimate, truth = payload_from(payload, "payload"), payload_from(cad, "cad")
    judged, corrected = known_payload(estimate), None
    if calibration is not None:
        arm, robot = calibration_from(calibration), estimate.provenance.robot
        name = Path(calibration).name if isinstance(calibration, str | PathLike) else "the calibration"
        if robot and robot != arm.robot:
            source = str(payload) if isinstance(payload, str | PathLike) else "payload"
            raise PayloadFileError(source, "provenance.robot", robot, f"expected {arm.robot!r}, the arm of {name}")
        judged = with_gains(judged, arm.gain_nm_a, arm.covariance[: arm.n, : arm.n])
        corrected = judged, name
    errors = cad_comparison.compare_with_cad(estimate, truth)
    agreement = compare_known(judged, known_payload(truth), tolerance or Tolerance())
    return PayloadComparison(errors, agreement, corrected)
