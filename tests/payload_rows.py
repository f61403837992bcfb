"""A payload from rows of any regressor: the posterior of a problem with no more terms than a test needs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from armload_identification.estimation.arm_rows import ArmLayout, ArmRows
from armload_identification.estimation.arm_terms import (
    GAIN,
    LAWS,
    LINKS,
    PAYLOAD,
    arm_terms,
    effort_level,
    friction_change,
    payload_term,
)
from armload_identification.estimation.payload_from_posterior import PayloadEstimate
from armload_identification.estimation.payload_problem import PayloadProblem
from armload_identification.estimation.prior_knowledge import Prior
from armload_identification.estimation.problem import Group, Noise, Problem, RunRows
from armload_identification.estimation.solve import solve
from armload_identification.estimation.term_kinds import Load, Scope, Term
from armload_identification.float_array import FloatArray
from armload_identification.model.regressor import PARAMETERS

ROW_S = 0.1
SAMPLES, STEP_S = 500, 0.02
"""Of the motion of the fixture `regressor`."""
WIDE = 1e6
"""Prior standard deviation of a parameter: no knowledge."""


def white(arm) -> Noise:
    """The noise of a simulated arm's joints, known, row by row."""
    return Noise.given(arm.noise_nm, np.ones(6))


def all_terms(runs: Sequence[ArmRows], layout: ArmLayout) -> list[Term]:
    """The terms of an arm of which nothing is known, of its payloads and of its runs."""
    return [*arm_terms(runs, layout), friction_change(effort_level(runs), layout.peak_rad_s)]


def rows_of(
    payload: FloatArray, torque_nm: FloatArray, weight: FloatArray | None = None, links: FloatArray | None = None
) -> ArmRows:
    """Rows of a run.

    Args:
        payload: (N, n, 10) columns of the payload.
        torque_nm: (N, n) measured torque.
        weight: (N, n) weight; 1 if not given.
        links: (N, n, b) columns of the links; none if not given.
    """
    samples, n = torque_nm.shape
    zero, still = np.zeros((samples, n)), np.zeros((samples, n, 0))
    links = still if links is None else links
    weight = np.ones_like(zero) if weight is None else weight
    return ArmRows(
        time_s=ROW_S * np.arange(samples),
        position_rad=zero,
        velocity_rad_s=zero,
        axis_acceleration_rad_s2=zero,
        axis_jerk_rad_s3=zero,
        direction=zero,
        root=zero,
        effort_nm=torque_nm,
        weight=weight,
        links=links,
        links_moved=np.stack([0.0 * links] * 3, axis=1),
        payload=payload,
        payload_moved=np.stack([0.0 * payload] * 3, axis=1),
    )


def payload_of(
    payload: FloatArray,
    torque_nm: FloatArray,
    noise: Noise | None = None,
    *,
    prior: Prior | None = None,
    weight: FloatArray | None = None,
    links: FloatArray | None = None,
    deviation: FloatArray | float = WIDE,
    gain_covariance: FloatArray | None = None,
) -> PayloadEstimate:
    """The payload that explains the rows, with no error but theirs.

    Args:
        payload: (N, n, 10) columns of the payload.
        torque_nm: (N, n) measured torque.
        noise: Of the rows; to be estimated if not given.
        prior: Knowledge of the payload.
        weight: (N, n) weight of the rows.
        links: (N, n, b) columns of other unknowns.
        deviation: Prior standard deviation of the payload's parameters.
        gain_covariance: (n, n) of the logarithms of the gains; known exactly if not given.
    """
    n = torque_nm.shape[1]
    gains = np.full(n, 0.0 if gain_covariance is None else np.inf)
    terms: Sequence[Term] = [
        Term(GAIN, Scope.ARM, LAWS[GAIN], np.zeros(n), gains, "test"),
        payload_term(np.zeros(PARAMETERS), np.full(PARAMETERS, 1.0) * deviation, "test"),
    ]
    if links is not None:
        size = links.shape[2]
        law = Load(lambda rows: (rows.links, rows.links_moved))
        terms = [*terms, Term(LINKS, Scope.ARM, law, np.zeros(size), np.full(size, WIDE), "test")]
    group = Group((RunRows(rows_of(payload, torque_nm, weight, links), PAYLOAD),))
    noise = noise or Noise.unknown(np.sqrt(np.mean(torque_nm**2, axis=0)))
    problem = Problem(terms, [group], noise, np.eye(n))
    whole = PayloadProblem(problem, ArmLayout(None, np.eye(n), np.zeros(PARAMETERS * n, dtype=bool), np.ones(n)), ROW_S)
    whole = whole if gain_covariance is None else whole.with_gains(gain_covariance)
    nothing = np.zeros((0, PARAMETERS))
    found = solve(whole.knowing(prior), rough=True)
    return PayloadEstimate(found, whole, nothing, np.zeros((0, n)), np.zeros((0, n)), nothing)


def exactly(n: int, noise_nm: float = 1.0) -> Noise:
    """Known white noise of n axes, so that the fit is weighted least squares."""
    return Noise.given(np.full(n, noise_nm), np.ones(n))
