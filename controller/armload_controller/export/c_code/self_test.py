"""Vectors of the self-test: joint states, and the payload's torque from the core, a second implementation."""

from __future__ import annotations

from typing import Final

import numpy as np

from armload_controller.export.exported_payload import ExportSubject
from armload_controller.export.straight_line.precision import Precision
from armload_controller.feedforward.body_torque import LoadFriction
from armload_identification.float_array import FloatArray
from armload_identification.model.regressor import payload_torque

VECTORS: Final = 8
_SEED: Final = 20


def self_test(subject: ExportSubject, precision: Precision) -> tuple[FloatArray, FloatArray]:
    """Vectors for a payload on an arm.

    Returns:
        (VECTORS, 3, n) q, dq, ddq within the joints' limits, rounded to the precision; and (VECTORS, 2 or 3, n) torque
        in N m: in motion, at rest, and for a calibrated arm the payload's friction.
    """
    given = states_within(subject, VECTORS, _SEED).astype(precision.dtype).astype(np.float64)
    q, dq, ddq = np.swapaxes(given, 0, 1)
    still = np.zeros_like(q)
    theta = subject.payload.model.theta
    moving = payload_torque(subject.chain, theta, q, dq, ddq)
    resting = payload_torque(subject.chain, theta, q, still, still)
    expected = [moving, resting]
    if subject.calibration is not None:
        friction = LoadFriction(subject.chain, subject.calibration.body)
        expected.append(np.array([friction.torque_nm(*row) for row in zip(q, dq, ddq, moving, strict=True)]))
    return given, np.stack(expected, axis=1)


def states_within(subject: ExportSubject, count: int, seed: int) -> FloatArray:
    """(count, 3, n) joint states, uniform within the joints' limits."""
    limits = subject.limits
    least = np.stack([limits.position_min_rad, -limits.velocity_max_rad_s, -limits.acceleration_max_rad_s2])
    greatest = np.stack([limits.position_max_rad, limits.velocity_max_rad_s, limits.acceleration_max_rad_s2])
    return np.random.default_rng(seed).uniform(least, greatest, (count, *least.shape))
