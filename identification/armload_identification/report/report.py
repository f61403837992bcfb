"""The report of an identification: one self-contained HTML file.

It loads nothing, contains no scripts, and the same inputs give the same bytes.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from markupsafe import Markup

from armload_identification.excitation.excitation_file import parse_excitation
from armload_identification.identification_errors import ReportError
from armload_identification.model.payload import (
    DETERMINED_SHARE,
    PARAMETER_NAMES,
    REFERENCE_LENGTH_M,
    SMALLEST_MARGIN,
    PayloadResult,
)
from armload_identification.numerals import NO_BREAK, numeral
from armload_identification.pipeline.identification_result import Identification
from armload_identification.pipeline.payload_validation import Validation
from armload_identification.recording.run_format import EXCITATION_ATTACHMENT
from armload_identification.report.figures import joint_figures
from armload_identification.report.figures.center_figure import FLANGE_MM, center_views
from armload_identification.report.joints import joint_rows
from armload_identification.report.page import rendered
from armload_identification.report.payload_in_words import (
    compared_rows,
    half_widths,
    headline,
    mass_card,
    parameter_rows,
    truth_sentence,
)
from armload_identification.report.reported_payload import ReportedPayload
from armload_identification.signals.motion import Motion
from armload_identification.signals.signal_constants import Smoothing
from armload_identification.verdict.joint_words import listed


def render_report(subject: ReportedPayload, created: str) -> str:
    """The report.

    Args:
        created: Date and time, as printed.

    Returns:
        HTML.

    Raises:
        ReportError: the names do not fit the joints.
    """
    payload, motion, names = subject.payload, subject.motion, subject.arm.joint_names
    if len(names) != len(payload.noise_nm):
        raise ReportError(
            f"{len(names)} joint names for recordings of {len(payload.noise_nm)} joints; give one name per joint"
        )
    fit, hashes = subject.identification, payload.provenance
    half_width_95 = half_widths(payload) if fit is None else fit.uncertainty.half_width_95
    used = {source.sha256 for sources in subject.sources for source in sources}
    others = (*hashes.recordings_sha256.items(), *hashes.validation_sha256.items())
    planned = None if motion is None else motion[1].attachments.get(EXCITATION_ATTACHMENT)
    return rendered(
        "template.html.j2",
        subject=subject,
        created=created,
        fit=fit,
        headline=headline(payload),
        mass=mass_card(payload),
        views=[(heading, Markup(svg)) for heading, svg in center_views(payload)],
        flange_mm=FLANGE_MM,
        truth_sentence="" if subject.truth is None else truth_sentence(payload, subject.truth),
        notes=tuple(_notes(payload, fit)),
        parameters=parameter_rows(payload, half_width_95, subject.truth),
        compared=() if fit is None or not fit.changed else compared_rows(fit, payload),
        motion=() if motion is None else tuple(_motion_panels(motion[0], names)),
        excitation=None if planned is None else parse_excitation(planned),
        runs=tuple(_runs(subject, names)),
        named=[(name, sha256) for name, sha256 in others if sha256 not in used],
        colors=joint_figures.COLORS,
        determined_share=DETERMINED_SHARE,
        reference_m=REFERENCE_LENGTH_M,
        loss_limit=Smoothing.loss_limit,
        smallest_margin=SMALLEST_MARGIN,
    )


def _notes(payload: PayloadResult, fit: Identification | None) -> Iterator[str]:
    """Important notes, the most severe first."""
    if not payload.feedforward_ready:
        unknown = [name for name, there in zip(PARAMETER_NAMES[:4], payload.determined[:4], strict=True) if not there]
        yield (
            "Do not use this payload for feed-forward: this requires mass and centre of mass, and "
            f"{listed(unknown)} {'is' if len(unknown) == 1 else 'are'} not determined."
        )
    if fit is not None:
        yield from fit.notes


def _motion_panels(run: Motion, names: tuple[str, ...]) -> Iterator[tuple[str, str, Markup]]:
    """Name, caption and figure of every joint's motion."""
    for joint, name in enumerate(names):
        low, high = run.states.position_rad[:, joint].min(), run.states.position_rad[:, joint].max()
        fastest = np.abs(run.states.velocity_rad_s[:, joint]).max()
        caption = f"{numeral(low, 2)} to {numeral(high, 2)}{NO_BREAK}rad, at most {numeral(fastest, 2)}{NO_BREAK}rad/s"
        title = f"Position and velocity of joint {joint + 1} ({name}) over time: {caption}."
        yield name, caption, Markup(joint_figures.motion_figure(run, joint, f"motion-{joint + 1}", title))


def _runs(subject: ReportedPayload, names: tuple[str, ...]) -> Iterator[dict[str, object]]:
    """Text, figures and table of the pairs of runs of identification and validation, as far as available."""
    scales = None if subject.validation is None else subject.validation.verdict.of_payload
    for key, heading, runs, judged in (
        ("identification", "Torque: the runs it was identified from", subject.fitted, None),
        ("validation", "Torque: the runs it was validated on", subject.validation, scales),
    ):
        if runs is not None:
            rows = joint_rows(runs.signal, runs.residual_rms_nm, names, judged)
            yield {
                "key": key,
                "heading": heading,
                "signal": runs.signal,
                "panels": list(_torque_panels(key, runs, rows)),
                "rows": rows,
                "judged": judged is not None,
            }


def _torque_panels(
    key: str, runs: Identification | Validation, rows: list[dict[str, Any]]
) -> Iterator[tuple[str, str, Markup]]:
    """Name, caption and figure of every joint's torque."""
    for joint, row in enumerate(rows):
        caption = (
            f"residual {row['residual'].text}{NO_BREAK}N{NO_BREAK}m RMS, noise {row['noise'].text}{NO_BREAK}N{NO_BREAK}"
            f"m, ratio {row['ratio'].text}"
        )
        number, name = row["number"], row["name"]
        title = f"Joint {number} ({name}): measured and predicted payload torque, and the difference; {caption}."
        svg = joint_figures.torque_figure(runs.signal, runs.predicted_nm, joint, f"{key}-{number}", title)
        yield name, caption, Markup(svg)
