"""Recommended next steps: use the result, examine it further, or measure again."""

from __future__ import annotations

from armload_identification.model.payload import PayloadResult
from armload_identification.pipeline.payload_validation import Validation
from armload_identification.verdict.agreement import Outcome

_MEASURE_AGAIN = (
    "Measure again with more motion: use an excitation from armload design, more of its periods, a faster motion, and "
    "move the wrist so that the direction of gravity in the payload changes."
)


def next_steps(payload: PayloadResult, validation: Validation | None) -> tuple[str, ...]:
    """One to three sentences, in the order of the steps.

    Args:
        validation: Its validation with other runs; None without one.
    """
    outcome = None if validation is None else validation.outcome
    if outcome is Outcome.WRONG:
        return (
            "Do not use this payload.",
            "Was the same tool mounted, in the same way, in all loaded runs? Then record and identify again.",
            "If the same joints disagree again, calibrate the arm with a weighed payload: armload calibrate.",
        )
    if not payload.feedforward_ready:
        return ("Do not use this payload yet: mass or centre of mass is not determined.", _MEASURE_AGAIN)
    use = (
        "Enter it at the robot's controller (armload export), or add it in your own control loop (PayloadFeedforward)."
    )
    if outcome is Outcome.RIGHT:
        return (use,)
    if outcome is Outcome.CANNOT_TELL:
        return ("Use it with care: it is neither contradicted nor confirmed.", _MEASURE_AGAIN)
    return (
        "Before relying on it, record another motion with and without the payload and give both recordings with "
        "--validation.",
        use,
    )
