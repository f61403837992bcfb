"""Gains that a pair of runs contradicts, and which of them explain it.

Every nominal gain is a term with its assumed covariance. What the rows say of one gain without its own prior, from a
posterior with mean x and variance v where the prior's variance is p, has the mean x p / (p - v) and the variance
v p / (p - v). A gain is contradicted if that mean is beyond what was assumed and beyond four standard deviations. The
test is made with that gain unknown: while it is held near its assumed value, the error counts as noise and hides
itself.

A gain explains the runs if, with it unknown, no other gain is contradicted. It is named, and treated as unknown, only
if no other gain explains them as well. Errors of several gains within the assumed ones are left to the priors: on the
UR10e, joints 2 and 3 are 2 % stronger than assumed and the wrist 3 % weaker, which a pair cannot tell from joints 2 and
3 being 5 % stronger; with these treated as unknown the mass is 3.5 % too great.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armload_identification.estimation.arm_terms import GAIN
from armload_identification.estimation.estimation_constants import GainTest
from armload_identification.estimation.payload_intervals import student_half_width
from armload_identification.estimation.payload_problem import HELD, PayloadProblem
from armload_identification.estimation.posterior import Posterior
from armload_identification.estimation.prior_knowledge import Prior
from armload_identification.estimation.solve import solve
from armload_identification.float_array import FloatArray
from armload_identification.signals.joint_torque import Gains


@dataclass(frozen=True, eq=False)
class GainFit:
    """The n gains as estimated from a pair of runs.

    Attributes:
        log_gain: (n,) logarithm of the ratio of estimated to assumed gain.
        half_width_95: (n,) half width of its 95 % interval.
        contradicted: (n,) True for the one gain that explains the runs if it is wrong; it was treated as unknown.
        possible: (n,) True for each gain that explains the runs if it alone is wrong.
        disagree: Whether gains contradict each other, and it is not clear which is wrong.
        assumed_deviation: (n,) assumed relative standard deviation.
        noticeable: (n,) error of a log gain that is named with a probability of 90 %, if it is the only one.
    """

    log_gain: FloatArray
    half_width_95: FloatArray
    contradicted: NDArray[np.bool_]
    possible: NDArray[np.bool_]
    disagree: bool
    assumed_deviation: FloatArray
    noticeable: FloatArray


@dataclass(frozen=True, eq=False)
class _Trial:
    """A solution with one gain unknown or none, and (n,) what the rows say of each without its own prior."""

    posterior: Posterior
    value: FloatArray
    deviation: FloatArray


def fit_gains(problem: PayloadProblem, gains: Gains, prior: Prior | None) -> tuple[Posterior, GainFit]:
    """Solve a problem with uncertain gains, those that the rows contradict unknown.

    Args:
        problem: A pair on an arm that is not calibrated.
        gains: The assumed gains.
        prior: Prior knowledge of the payload.

    Returns:
        The solution and the gains.
    """

    def solved(unknown: int | None = None, before: Posterior | None = None) -> _Trial:
        wide = gains.covariance.copy()
        if unknown is not None:
            wide[unknown], wide[:, unknown] = 0.0, 0.0
            wide[unknown, unknown] = GainTest.unknown**2
        found = solve(problem.with_gains(wide).knowing(prior), rough=True, start=before)
        return _Trial(found, *_by_others(found, np.diag(wide), gains.common_deviation))

    assumed = np.sqrt(np.diag(gains.own_covariance))
    start = solved()
    noticeable = _noticeable(start, assumed)
    suspects = [
        int(axis)
        for axis in np.argsort(-np.abs(start.value) / _named_from(start.deviation, assumed), kind="stable")
        if abs(start.value[axis]) > GainTest.suspect * np.maximum(GainTest.assumed * assumed, GainTest.matters)[axis]
    ]
    alone = {axis: solved(axis, start.posterior) for axis in suspects}
    contradicted = {axis: np.abs(trial.value) > _named_from(trial.deviation, assumed) for axis, trial in alone.items()}
    wrong = [axis for axis in suspects if contradicted[axis][axis]]
    for axis, trial in alone.items():
        noticeable[axis] = min(noticeable[axis], _noticeable(trial, assumed)[axis])
    # Each of these explains the others: with it unknown, none of them is contradicted.
    right = [axis for axis in wrong if not np.delete(contradicted[axis], axis).any()]
    possible = np.isin(np.arange(assumed.size), right)
    best = alone[right[0]].posterior if len(right) == 1 else start.posterior
    variance, freedom = best.spread(np.eye(best.problem.shared_size)[best.problem.place(GAIN)])
    return best, GainFit(
        log_gain=-best.value(GAIN),
        half_width_95=student_half_width(freedom) * np.sqrt(variance),
        contradicted=possible & (len(right) == 1),
        possible=possible,
        disagree=bool(wrong) and len(right) != 1,
        assumed_deviation=assumed,
        noticeable=noticeable,
    )


def _by_others(found: Posterior, prior: FloatArray, common_deviation: float) -> tuple[FloatArray, FloatArray]:
    """(n,) each log gain without its own prior, of (n,) variances, and its standard deviation."""
    place = found.problem.place(GAIN)
    # An error that all gains have in common contradicts none.
    common = common_deviation**2
    before = prior - common
    variance, _ = found.spread(np.eye(found.problem.shared_size)[place])
    after = np.clip(variance - common, HELD**2, GainTest.less * before)
    return -found.value(GAIN) * before / (before - after), np.sqrt(after * before / (before - after))


def _named_from(deviation: FloatArray, assumed: FloatArray) -> FloatArray:
    """(n,) error of each log gain from which it is contradicted."""
    poor = np.where(deviation > GainTest.poor * assumed, GainTest.poorly, 1.0)
    worth_naming = np.maximum(GainTest.assumed * assumed, GainTest.matters)
    return np.asarray(np.maximum(worth_naming, poor * GainTest.contradicts * deviation))


def _noticeable(trial: _Trial, assumed: FloatArray) -> FloatArray:
    return np.asarray(_named_from(trial.deviation, assumed) + GainTest.nine_of_ten * trial.deviation)
