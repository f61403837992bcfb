"""A payload against CAD: the verdict, and the errors in the paper's convention; a table and a document."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

from armload_identification.model.payload import NOT_DETERMINED, PARAMETER_NAMES, UNITS
from armload_identification.result_table import PrintedResult, ResultTable
from armload_identification.results.findings_document import agreement_fields, json_numbers
from armload_identification.results.json_document import json_document
from armload_identification.verdict.agreement import Agreement, KnownMassCenter, Outcome
from armload_identification.verdict.cad_comparison import RelativeErrors
from armload_identification.verdict.verdict_text import TITLES, agreement_sentences

_PAPERS_NAMES: Final = ("m", "c_x", "c_y", "c_z", "I_xx", "I_yy", "I_zz", "I_xy", "I_xz", "I_yz")


@dataclass(frozen=True, eq=False, repr=False)
class PayloadComparison(PrintedResult):
    """A payload against CAD; printed as the paper's table with the verdict.

    Attributes:
        errors: Relative errors in the paper's convention.
        agreement: The verdict on mass and centre of mass.
        corrected: The payload with the gains of a calibration, and the calibration's name; None without one.
    """

    errors: RelativeErrors
    agreement: Agreement
    corrected: tuple[KnownMassCenter, str] | None

    @property
    def outcome(self) -> Outcome:
        """Right, wrong, or cannot tell."""
        return self.agreement.outcome

    def table(self) -> ResultTable:
        """The paper's Table 2 for one payload, and the verdict."""
        result = self.errors
        title = f"Payload in the {result.frame} frame against CAD, as Chen 2016, Table 2"
        values = zip(_PAPERS_NAMES, result.truth, result.estimate, result.error, result.determined, UNITS, strict=True)
        rows = [
            (name, f"{truth:.4f}", f"{estimate:z.4f}", f"{100.0 * error:z.2f} %", unit)
            if known
            else (name, f"{truth:.4f}", NOT_DETERMINED, "", unit)
            for name, truth, estimate, error, known, unit in values
        ]
        sentences = ["inertia about the frame's origin, products as in the paper: ixy = +int xy dm"]
        if self.corrected is not None:
            known, name = self.corrected
            center = " ".join(f"{value:.4f}" for value in known.parameters.center_of_mass_m)
            sentences.append(f"with the gains of {name}: {known.parameters.mass_kg:.4f} kg at {center} m")
        title_of = TITLES[self.outcome]
        sentences.append(f"verdict: {title_of if self.outcome is Outcome.RIGHT else title_of.upper()}")
        sentences += [f"  {sentence}" for sentence in agreement_sentences(self.agreement, "CAD gives")]
        return ResultTable(title, ("parameter", "CAD", "estimate", "error", "unit"), rows, (0, 4), sentences)

    def to_dict(self) -> dict[str, Any]:
        """Everything as numbers, texts, lists and dictionaries: the schema `armload/comparison/1`."""
        values = (json_numbers(each) for each in (self.errors.truth, self.errors.estimate, self.errors.error))
        rows = zip(PARAMETER_NAMES, *values, self.errors.determined.tolist(), strict=True)
        parameters = {
            name: {"cad": cad, "estimate": estimate if known else None, "error": error if known else None}
            for name, cad, estimate, error, known in rows
        }
        fields = {"frame": self.errors.frame, "parameters": parameters, **agreement_fields(self.agreement)}
        return json_document("comparison", fields)
