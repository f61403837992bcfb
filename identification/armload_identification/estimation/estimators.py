"""The payload's fit by one of the estimators."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from armload_core.arrays import FloatArray
from armload_identification.estimation.empty_arm.unloaded_arm import BodyFit
from armload_identification.estimation.estimator_names import Estimator
from armload_identification.estimation.friction_columns import FrictionColumns, FrictionDifference, fit_with_friction
from armload_identification.estimation.gain_columns import GainFit, fit_with_gains
from armload_identification.estimation.least_squares import (
    NOTHING_KNOWN,
    Estimate,
    Prior,
    estimate,
    estimate_reweighted,
    estimate_robust,
)
from armload_identification.model.body_model import BodyModel
from armload_identification.model.chain import Chain
from armload_identification.signals.joint_torque import Transmission
from armload_identification.signals.load_signal import LoadSignal
from armload_identification.signals.motion import SCATTER
from armload_identification.signals.reversals import REVERSAL, reversal_weights

_NEGLIGIBLE: Final = 1e-3
_REPEATED_REVERSAL: Final = 0.05
"""`REVERSAL` if two runs are compared phase by phase, so that half of the servo's behaviour at a reversal cancels."""


def least_noise(signal: LoadSignal) -> FloatArray:
    """(n,) lower bound of the noise in a fit, N m: that of the averages, if known from the scatter between periods.

    Otherwise only the residual decides, as noise above the motion's band says little about noise within it.

    Args:
        signal: The torque difference.
    """
    return signal.averaged_noise_nm * (1.0 if signal.noise_source == SCATTER else _NEGLIGIBLE)


def steadiness(signal: LoadSignal) -> FloatArray:
    """(K, n) weights that exclude joints at rest, and reversals, according to how well they cancel between two runs.

    Args:
        signal: The torque difference.
    """
    repeated = signal.periodic and min(signal.periods) > 0
    position, velocity, _ = signal.states
    return reversal_weights(position, velocity, _REPEATED_REVERSAL if repeated else REVERSAL)


@dataclass(frozen=True, eq=False)
class PayloadFit:
    """A fitted payload and what was fitted with it.

    Attributes:
        estimate: The fit.
        friction: The friction fitted with it; None if the estimator fits none.
        gains: The uncertain gains as fitted; None if the estimator does not fit them.
        signal: The fitted signal, its torque computed with the estimated gains.
    """

    estimate: Estimate
    friction: FrictionDifference | None
    gains: GainFit | None
    signal: LoadSignal


def fit_payload(
    signal: LoadSignal,
    regressor: FloatArray,
    chain: Chain,
    body: BodyModel,
    estimator: Estimator,
    prior: Prior | None = None,
    arm: BodyFit | None = None,
    gains: Transmission | None = None,
) -> PayloadFit:
    """Fit a payload.

    Args:
        signal: Torque difference and unloaded torque.
        regressor: (K, n, 10) of the payload.
        chain: The arm.
        body: The arm's body.
        estimator: The estimator.
        prior: Prior knowledge.
        arm: How well the body is known, if it was fitted to the unloaded run.
        gains: The gains, if they are to be fitted too; only `friction` does so.
    """
    least = least_noise(signal)
    steady = steadiness(signal)
    known = prior or NOTHING_KNOWN

    def solve(columns: FloatArray, expected: FloatArray, deviation: FloatArray) -> Estimate:
        both = known.and_nuisance(expected, deviation)
        return estimate_reweighted(columns, signal.torque_nm, signal.valid, least, steady, both)

    friction: FrictionDifference | None = None
    match estimator:
        case Estimator.OLS:
            fit = estimate(regressor, signal.torque_nm, signal.valid, np.ones_like(least), None, prior)
        case Estimator.WLS:
            weighted = estimate if signal.noise_source == SCATTER else estimate_reweighted
            fit = weighted(regressor, signal.torque_nm, signal.valid, least, None, prior)
        case Estimator.ROBUST:
            fit = estimate_robust(regressor, signal.torque_nm, signal.valid, least, steady, prior)
        case Estimator.FRICTION:
            columns = FrictionColumns(signal, regressor, chain, body)
            fit, friction = fit_with_friction(columns, body, solve, arm)
            if gains is not None and (gains.deviation > 0.0).any():
                return PayloadFit(*fit_with_gains(signal, columns, fit, friction, gains, known, arm, least))
    return PayloadFit(fit, friction, None, signal)
