"""A verdict in words, for console and report."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from armload_identification.model.payload import AXES
from armload_identification.verdict.agreement import Agreement, Outcome
from armload_identification.verdict.decision_levels import AgreementLevels, VerdictText
from armload_identification.verdict.payload_verdict import PayloadVerdict, Remedy
from armload_identification.verdict.recording_checks.joint_scales import JointScales

TITLES: Final = {
    Outcome.RIGHT: "Right within the tolerance",
    Outcome.WRONG: "Wrong",
    Outcome.CANNOT_TELL: "Cannot tell",
}
REPEATABLE: Final = "Repeatable within the tolerance"
_SCALE: Final = (
    "Both identifications share the scale of the torque, which no calibration with a weighed payload verifies: its "
    "error is the same relative error of the mass, unless this payload was weighed. Calibrate the arm with a weighed "
    "one to know whether it is right: `armload calibrate`."
)
_OWN_RUN: Final = (
    "The payload was identified from this recording, which therefore cannot confirm it. Validate it with a pair of "
    "runs of another motion."
)


def title(verdict: PayloadVerdict) -> str:
    """The outcome in a few words: what agrees with itself is right only if its scale is verified."""
    if verdict.outcome is Outcome.RIGHT and not verdict.scale_verified:
        return REPEATABLE
    return TITLES[verdict.outcome]


def sentences(verdict: PayloadVerdict, joint_names: Sequence[str]) -> list[str]:
    """Result of a validation in sentences, the outcome first; `joint_names` from the base."""
    text = agreement_sentences(verdict.agreement, "The second pair of runs gives")
    if verdict.own_run and verdict.outcome is Outcome.CANNOT_TELL:
        return [text[0], _OWN_RUN]
    match verdict.outcome:
        case Outcome.RIGHT:
            return text if verdict.scale_verified else [*text, _SCALE]
        case Outcome.WRONG:
            return [*text, *_remounting_sentences(verdict.agreement), *_joint_sentences(verdict, joint_names)]
        case Outcome.CANNOT_TELL:
            return [*text, *_remedy_sentences(verdict.remedy, verdict.agreement, joint_names)]


def agreement_sentences(agreement: Agreement, source: str) -> list[str]:
    """Result of a comparison in sentences, the outcome first; `source` is such as "CAD gives"."""
    share = agreement.tolerance_kg / agreement.judged.mass_kg
    found = (
        f"{source} {_difference_text(agreement)}; the tolerance is {100.0 * share:.3g} % of the mass "
        f"({agreement.tolerance_kg:.3f} kg) and {1e3 * agreement.tolerance_m:.3g} mm."
    )
    match agreement.outcome:
        case Outcome.RIGHT:
            if agreement.differs:
                return [found, "The difference is statistically significant, but within the tolerance."]
            return [found]
        case Outcome.WRONG:
            return [
                _error_text(agreement),
                found,
                "A difference this large occurs by chance in fewer than 1 of 100 comparisons "
                f"(F {agreement.statistic:.1f}, limit {agreement.critical:.1f}).",
            ]
        case Outcome.CANNOT_TELL:
            share = agreement.noticeable_kg / agreement.judged.mass_kg
            return [
                found,
                "This does not contradict the payload, but is too uncertain to confirm it: the smallest error that "
                f"would be detected is {agreement.noticeable_kg:.2g} kg ({100.0 * share:.1f} %) of mass or "
                f"{1e3 * agreement.noticeable_m:.2g} mm of the centre of mass, {_weakest_direction(agreement)}.",
            ]


def _error_text(agreement: Agreement) -> str:
    """Values that differ by more than their own interval, as errors of the payload in question."""
    difference, beyond = agreement.difference, np.abs(agreement.difference) > agreement.half_width_95
    off = []
    if beyond[0]:
        way = "low" if difference[0] > 0.0 else "high"
        share = abs(difference[0]) / agreement.judged.mass_kg
        off.append(f"the payload's mass is {abs(difference[0]):.3f} kg ({100.0 * share:.1f} %) too {way}")
    if beyond[1:].any():
        moved = ", ".join(f"{-1e3 * difference[1 + i]:+z.1f} mm in {AXES[i]}" for i in np.flatnonzero(beyond[1:]))
        whose = "its" if off else "the payload's"
        off.append(f"{whose} centre of mass is off by {moved}")
    text = " and ".join(off) or "mass and centre of mass together do not match, though either alone might"
    return f"{text[0].upper()}{text[1:]}."


def _remounting_sentences(agreement: Agreement) -> list[str]:
    """A payload of the same mass with another centre of mass: the same one, mounted differently."""
    if abs(agreement.difference[0]) > max(agreement.half_width_95[0], agreement.tolerance_kg):
        return []
    before = agreement.judged.center_of_mass_m
    after = before + agreement.difference[1:]
    radii = np.hypot(before[0], before[1]), np.hypot(after[0], after[1])
    allowed = np.maximum(agreement.half_width_95[1:], agreement.tolerance_m)
    how = "moved or turned"
    if abs(radii[1] - radii[0]) < allowed[:2].max() < min(radii) and abs(agreement.difference[3]) < allowed[2]:
        angle = np.degrees(np.arctan2(after[1], after[0]) - np.arctan2(before[1], before[0])) % 360.0
        how = f"turned by {min(angle, 360.0 - angle):.0f} degrees about the flange's z axis"
    return [
        f"The mass agrees: the same payload may have been remounted, {how}, since it was identified. Identify it again "
        "as it is mounted now."
    ]


def _difference_text(agreement: Agreement) -> str:
    """Differences with their intervals."""
    mass, *center = agreement.difference
    width = agreement.half_width_95
    share = abs(mass) / agreement.judged.mass_kg
    moved = ", ".join(
        f"{axis} {1e3 * value:+z.1f} +- {1e3 * half:.1f}"
        for axis, value, half in zip(AXES, center, width[1:], strict=True)
    )
    higher = "higher" if mass >= 0.0 else "lower"
    return (
        f"a mass {abs(mass):.3f} kg {higher} ({100.0 * share:.1f} %) +- {width[0]:.3f} kg and a centre of mass "
        f"{1e3 * float(np.linalg.norm(agreement.difference[1:])):.1f} mm away ({moved} mm)"
    )


def _weakest_direction(agreement: Agreement) -> str:
    """The direction in which the centre of mass is least certain."""
    axis = int(np.argmax(np.abs(agreement.weakest)))
    if abs(agreement.weakest[axis]) >= VerdictText.along:
        return f"along the flange's {AXES[axis]} axis"
    vector = agreement.weakest * np.sign(agreement.weakest[axis])
    return "along [" + ", ".join(f"{value:z.2f}" for value in vector) + "] in the flange frame"


def _joint_sentences(verdict: PayloadVerdict, names: Sequence[str]) -> Iterator[str]:
    """Joints that disagree with the payload, and joints that disagree with each other."""
    wrong = verdict.of_payload.disagree
    if wrong.any():
        yield f"Measured over predicted torque: {_scales_text(verdict.of_payload, wrong, names)}."
    odd = verdict.of_measured.disagree
    if odd.any():
        yield (
            "The joints also contradict each other, whatever the payload. Measured torque relative to the best fit of "
            f"all joints: {_scales_text(verdict.of_measured, odd, names)}. Check the drive gain there."
        )


def _scales_text(scales: JointScales, which: NDArray[np.bool_], names: Sequence[str]) -> str:
    """Scales with intervals of the joints for which (n,) is True."""
    return ", ".join(
        f"{name} {scales.scale[joint]:.3f} +- {scales.half_width_95[joint]:.3f}"
        for joint, name in enumerate(names)
        if which[joint]
    )


def _remedy_sentences(remedy: Remedy, agreement: Agreement, names: Sequence[str]) -> Iterator[str]:
    """How an error equal to the tolerance could be detected."""
    if np.isfinite(remedy.length.factor):
        longer = max(remedy.length.factor, VerdictText.least_longer)
        yield (
            f"Identification and validation runs of {longer:.1f} times the length would detect "
            "an error equal to the tolerance."
        )
    elif remedy.length.gains_limit:
        yield "Longer runs would not detect it, because the drive gains are too uncertain: calibrate them."
        return
    else:
        yield (
            "No run would detect it: the variation between mountings and the servos' sag, "
            f"{1e3 * AgreementLevels.floor_kg:.0f} g and {1e3 * AgreementLevels.floor_m:.0f} mm (one standard "
            "deviation), is too large for this tolerance."
        )
        return
    if agreement.noticeable_kg > agreement.tolerance_kg:
        yield (
            f"The mass is best determined by {names[remedy.mass_joint]}: a motion that holds the payload far "
            "from that axis, perpendicular to gravity, needs less time."
        )
    if agreement.noticeable_m > agreement.tolerance_m:
        direction = _weakest_direction(agreement).removeprefix("along ")
        if remedy.level_share < VerdictText.level_share:
            yield (
                f"The motion hardly ever brings {direction} to the horizontal, where gravity has the greatest "
                "effect: add such poses."
            )
        else:
            yield (
                f"That direction is best determined by {names[remedy.center_joint]}: with more wrist motion that "
                "turns it to the horizontal and back, less time is needed."
            )
