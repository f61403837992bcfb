"""`armload compare`: a payload against CAD: the verdict, and the errors as the paper counts them."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from armload_controller.cli.output.json_output import JsonOption, print_document
from armload_controller.cli.output.verdict_output import TOLERANCE, ToleranceOption, show_verdict, tolerance_of


def compare(
    payload: Annotated[Path, typer.Argument(metavar="PAYLOAD", help="Payload file that was identified (TOML).")],
    cad: Annotated[Path, typer.Argument(metavar="CAD", help="Payload file with the true values (TOML).")],
    tolerance: ToleranceOption = TOLERANCE,
    as_json: JsonOption = False,
) -> None:
    """Compare a payload with CAD: the verdict, and relative errors in the paper's convention."""
    from armload_controller.cli.output.cad_table import comparison_table
    from armload_controller.cli.output.result_documents import comparison_document
    from armload_controller.cli.screen import Screen
    from armload_identification.files.payload_file import read_payload
    from armload_identification.verdict.agreement import compare_known
    from armload_identification.verdict.cad_comparison import compare as compare_payloads
    from armload_identification.verdict.payload_verdict import known_payload
    from armload_identification.verdict.verdict_text import agreement_sentences

    allowed = tolerance_of(tolerance)
    estimate, truth = read_payload(payload), read_payload(cad)
    result = compare_payloads(estimate, truth)
    screen = Screen(as_json=as_json)
    screen.table(comparison_table(result))
    screen.result("inertia about the frame's origin, products as the paper has them: ixy = +int xy dm")
    agreement = compare_known(known_payload(estimate), known_payload(truth), allowed)
    show_verdict(screen, agreement.outcome, agreement_sentences(agreement, "CAD gives"))
    if as_json:
        print_document(comparison_document(result, agreement))
