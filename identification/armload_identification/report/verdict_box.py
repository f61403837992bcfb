"""The verdict as shown at the top of the report."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from armload_identification.pipeline.payload_validation import Validation
from armload_identification.verdict.agreement import Outcome
from armload_identification.verdict.verdict_text import sentences, title

_KINDS: Final = {Outcome.RIGHT: "passed", Outcome.WRONG: "failed", Outcome.CANNOT_TELL: "missing"}


@dataclass(frozen=True)
class VerdictBox:
    """Result of the validation in words.

    Attributes:
        kind: "passed", "failed" or "missing", which determines the colour.
        title: A few words.
        text: A few sentences.
    """

    kind: str
    title: str
    text: str


def verdict_box(validation: Validation | None, names: Sequence[str]) -> VerdictBox:
    """The verdict in words.

    Args:
        validation: The validation; None without one.
        names: Names of the joints.
    """
    if validation is None:
        text = "No second pair of runs was given, so it is unknown how well this payload predicts another motion."
        return VerdictBox("missing", "Not validated", text)
    verdict = validation.verdict
    text = " ".join(sentences(verdict, names)).replace("+-", "±")
    return VerdictBox(_KINDS[verdict.outcome], title(verdict), text)
