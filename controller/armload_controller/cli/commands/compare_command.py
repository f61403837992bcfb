"""`armload compare`: a payload against CAD: the verdict, and the errors in the paper's convention."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from armload_controller.cli.output.json_output import JsonOption
from armload_controller.cli.output.verdict_output import (
    TOLERANCE,
    ToleranceOption,
    exit_status,
    show_verdict,
)
from armload_identification.verdict.tolerance import Tolerance


def compare_with_cad(
    payload: Annotated[Path, typer.Argument(metavar="PAYLOAD", help="Payload file that was identified (TOML).")],
    cad: Annotated[Path, typer.Argument(metavar="CAD", help="Payload file with the true values (TOML).")],
    calibration: Annotated[
        Path | None,
        typer.Option("--calibration", help="Calibration file of the arm; its gains are applied to the payload."),
    ] = None,
    tolerance: ToleranceOption = TOLERANCE,
    as_json: JsonOption = False,
) -> None:
    """Compare a payload with CAD: the verdict, and relative errors. Exit status 3: wrong; 4: cannot tell.

    The verdict covers mass and centre of mass; with a calibration, as they are with its gains. The errors follow the
    paper's convention.
    """
    from armload_controller.cli.output.cad_table import comparison_table
    from armload_controller.cli.output.result_documents import comparison_document
    from armload_controller.cli.screen import Screen
    from armload_identification.files.calibration_file import read_calibration
    from armload_identification.files.payload_file import read_payload
    from armload_identification.identification_errors import PayloadFileError
    from armload_identification.verdict.agreement import compare_known
    from armload_identification.verdict.cad_comparison import compare
    from armload_identification.verdict.payload_verdict import known_payload, with_gains
    from armload_identification.verdict.verdict_text import agreement_sentences

    allowed = Tolerance(*tolerance)
    estimate, truth = read_payload(payload), read_payload(cad)
    judged, corrected = known_payload(estimate), ""
    if calibration is not None:
        arm = read_calibration(calibration)
        robot = estimate.provenance.robot
        if robot and robot != arm.robot:
            raise PayloadFileError(
                str(payload), "provenance.robot", robot, f"expected {arm.robot!r}, the arm of {calibration}"
            )
        judged = with_gains(judged, arm.gain_nm_a, arm.covariance[: arm.n, : arm.n])
        center = " ".join(f"{value:.4f}" for value in judged.parameters.center_of_mass_m)
        corrected = f"with the gains of {calibration.name}: {judged.parameters.mass_kg:.4f} kg at {center} m"
    result = compare(estimate, truth)
    screen = Screen(as_json=as_json)
    screen.table(comparison_table(result))
    screen.result("inertia about the frame's origin, products as in the paper: ixy = +int xy dm")
    if corrected:
        screen.result(corrected)
    agreement = compare_known(judged, known_payload(truth), allowed)
    show_verdict(screen, agreement.outcome, agreement_sentences(agreement, "CAD gives"))
    screen.document(partial(comparison_document, result, agreement))
    raise typer.Exit(exit_status(agreement.outcome))
