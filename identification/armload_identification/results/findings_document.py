"""Findings as a document of plain numbers, texts, lists and dictionaries: the schema `armload/payload/1`.

`json_schemas.json` describes every key.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from armload_identification.files.payload_file import grouped_parameters
from armload_identification.float_array import FloatArray
from armload_identification.model.payload import AXES, PayloadResult
from armload_identification.pipeline.identification_result import Identification
from armload_identification.pipeline.payload_validation import Validation
from armload_identification.recording.recording import RecordingSource
from armload_identification.report.reported_payload import ReportedPayload
from armload_identification.verdict.agreement import Agreement


def findings_document(found: ReportedPayload) -> dict[str, Any]:
    """The document."""
    joint_names, identification = found.arm.joint_names, found.identification
    validation, (fitted, validating) = found.validation, found.sources
    return {
        "robot": found.arm.name,
        "joint_names": list(joint_names),
        "payload": payload_fields(found.payload),
        "identification": None if identification is None else _identification_fields(identification),
        "validation": None if validation is None else validation_fields(validation, joint_names),
        "verdict": {
            "outcome": None if validation is None else validation.verdict.outcome.value,
            "title": found.verdict.title,
            "text": found.verdict.text,
        },
        "recordings": {
            "identification": [_source_fields(source) for source in fitted],
            "validation": [_source_fields(source) for source in validating],
        },
    }


def payload_fields(payload: PayloadResult) -> dict[str, Any]:
    """A payload: determined values, their intervals, the complete model, and the residual torque."""
    known = payload.determined.tolist()
    values = [value if there else None for value, there in zip(payload.values.tolist(), known, strict=True)]
    intervals = [pair if there else None for pair, there in zip(payload.interval_95.tolist(), known, strict=True)]
    return {
        "frame": payload.frame,
        **grouped_parameters(values),
        "determined": grouped_parameters(known),
        "interval_95": grouped_parameters(intervals),
        "model": grouped_parameters(payload.model.values.tolist()),
        "residual_rms_nm": json_numbers(payload.residual_rms_nm),
        "noise_nm": json_numbers(payload.noise_nm),
        "feedforward_ready": payload.feedforward_ready,
        **{key: value for key, value in asdict(payload.provenance).items() if key != "armload_version"},
    }


def validation_fields(validation: Validation, joint_names: Sequence[str]) -> dict[str, Any]:
    """A validation: comparison of the payload with the one identified from the second pair of runs, and by joint."""
    scales = validation.verdict.of_payload
    scale, half_width = (np.where(scales.determined, each, np.nan) for each in (scales.scale, scales.half_width_95))
    columns = {
        "torque_in_band_nm": json_numbers(validation.torque_in_band_nm),
        "left_in_band_nm": json_numbers(validation.left_in_band_nm),
        "residual_rms_nm": json_numbers(validation.residual_rms_nm),
        "measured_over_predicted": json_numbers(scale),
        "measured_over_predicted_half_width_95": json_numbers(half_width),
    }
    return {
        **agreement_fields(validation.verdict.agreement),
        "joints": [
            {"name": name, **{key: values[joint] for key, values in columns.items()}}
            for joint, name in enumerate(joint_names)
        ],
    }


def agreement_fields(agreement: Agreement) -> dict[str, Any]:
    """Comparison of a payload with measured values, and the smallest error that would have been detected."""

    def four(values: FloatArray) -> dict[str, Any]:
        mass, *center = json_numbers(values)
        return {"mass_kg": mass, "center_of_mass_m": dict(zip(AXES, center, strict=True))}

    return {
        "outcome": agreement.outcome.value,
        "difference": four(agreement.difference),
        "half_width_95": four(agreement.half_width_95),
        "tolerance": {"mass_kg": agreement.tolerance_kg, "center_of_mass_m": agreement.tolerance_m},
        "noticeable": {
            "mass_kg": json_number(agreement.noticeable_kg),
            "center_of_mass_m": json_number(agreement.noticeable_m),
        },
    }


def json_numbers(values: FloatArray) -> list[float | None]:
    """Numbers of an array, None if not finite, which JSON cannot represent."""
    return [json_number(value) for value in values.tolist()]


def json_number(value: float) -> float | None:
    """A number, None if it is not finite."""
    return float(value) if math.isfinite(value) else None


def _identification_fields(identification: Identification) -> dict[str, Any]:
    plain = identification.plain_parameters
    return {
        "plain_mass_kg": plain.mass_kg,
        "plain_is_possible": not identification.changed,
        "plain_margin": json_number(plain.margin),
        "condition_number": json_number(identification.plain.condition_number),
        "scale_verified": identification.scale_verified,
        "notes": list(identification.notes),
    }


def _source_fields(source: RecordingSource) -> dict[str, Any]:
    return {"file": str(source.path), **{key: getattr(source, key) for key in ("sha256", "rows_read", "rows_dropped")}}
