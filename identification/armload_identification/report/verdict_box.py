"""The verdict as the report's first screen shows it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from armload_identification.pipeline.payload_validation import Validation
from armload_identification.verdict.agreement import Outcome
from armload_identification.verdict.verdict_text import TITLES, sentences

_KINDS: Final = {Outcome.RIGHT: "passed", Outcome.WRONG: "failed", Outcome.CANNOT_TELL: "missing"}


@dataclass(frozen=True)
class VerdictBox:
    """What the validation says.

    Attributes:
        kind: "passed", "failed" or "missing", which gives its colour.
        title: In three words.
        text: In a few sentences.
    """

    kind: str
    title: str
    text: str


def verdict_box(validation: Validation | None, names: Sequence[str]) -> VerdictBox:
    """The verdict in words.

    Args:
        validation: None where there was none.
        names: Of the joints.
    """
    if validation is None:
        return VerdictBox(
            "missing",
            "Not validated",
            "No second pair of runs was given, so it is unknown how well this payload predicts another motion.",
        )
    outcome = validation.outcome
    return VerdictBox(
        _KINDS[outcome], TITLES[outcome], " ".join(sentences(validation.verdict, names)).replace("+-", "±")
    )
