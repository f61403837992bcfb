"""A payload from one run of any motion on a known arm, whose own torque and friction are subtracted first.

    tau - tau_arm = (1 + mu s sgn(tau_l)) Phi theta + s dFc + dq dFv + dF0,    tau_l torque of links and payload

with tau_arm of the calibrated arm, s the direction of motion, and three changes of friction per joint. Their prior is
the spread between the calibration's runs, and a fifth of the friction for a cold arm. Without them the median error
on 20 s of the UR10e's motion is three times as great. A row's noise is the greater of the calibration's residual and
the run's own. It is correlated in time: rows within the correlation time count as one. Rows near a reversal have
little weight.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from armload_core.arrays import FloatArray
from armload_identification.estimation.empty_arm.known_arm import KnownArm
from armload_identification.estimation.empty_arm.known_arm_signal import KnownArmSignal
from armload_identification.estimation.friction_columns import FrictionDifference, load_column
from armload_identification.estimation.least_squares import NOTHING_KNOWN, Estimate, Prior, estimate_reweighted
from armload_identification.model.body_model import smooth_sign
from armload_identification.model.chain import Chain
from armload_identification.signals.reversals import moving_weights

CHANGES: Final = 3
"""Changes of a run's friction per joint: Coulomb, viscous, offset."""
MOVING: Final = 10.0
"""Multiple of the reversal speed at which a row's weight is 0.7: as in the calibration, a tenth of the greatest speed
there."""
_ITERATIONS: Final = 8
_SETTLED: Final = 1e-5


def fit_on_known_arm(
    seen: KnownArmSignal, chain: Chain, arm: KnownArm, prior: Prior | None = None
) -> tuple[Estimate, FrictionDifference]:
    """Fit a payload to one run minus its arm.

    Args:
        seen: The run minus the calibrated arm's torque, row by row.
        chain: The arm.
        arm: Its calibration.
        prior: Prior knowledge of the payload.

    Returns:
        The fit, whose parameters after the ten are the changes of Coulomb friction, viscous friction and offset of all
        joints; and the friction.

    Raises:
        EstimationError: too few samples, or no motion.
    """
    body, n = arm.fit.model, chain.n
    signal, regressor = seen.signal, seen.regressor
    velocity = signal.states.velocity_rad_s
    direction = smooth_sign(velocity, body.reversal_speed_rad_s)
    empty = body.link_torque(chain, *signal.states)
    own = np.concatenate([direction, velocity, np.ones_like(velocity)], axis=1)
    changes = own[:, None, :] * np.tile(np.eye(n), CHANGES)
    known = (prior or NOTHING_KNOWN).and_nuisance(np.zeros(CHANGES * n), arm.friction_spread.ravel())
    independent = np.sqrt(np.minimum(signal.interval_s / arm.correlation_s, 1.0))
    weight = moving_weights(velocity, MOVING * body.reversal_speed_rad_s) * seen.onward * independent
    theta = np.zeros(10)
    for _ in range(_ITERATIONS):
        turned = np.sign(empty + regressor @ theta)
        through = 1.0 + body.load_friction * direction * turned
        columns = np.concatenate([through[:, :, None] * regressor, changes], axis=2)
        already = body.load_friction * direction * (turned * empty - np.abs(empty))
        fit = estimate_reweighted(columns, signal.torque_nm - already, signal.valid, arm.noise_nm, weight, known)
        before, theta = theta, fit.theta[:10]
        if np.abs((theta - before) / fit.scale[:10]).max() <= _SETTLED * np.abs(theta / fit.scale[:10]).max():
            break
    carried = load_column(empty, regressor @ theta, direction) * body.load_friction
    return fit, _named(fit, carried + changes @ fit.theta[10:], arm)


def friction_covariance(fit: Estimate, n: int) -> FloatArray:
    """Covariance of a run's changes of friction.

    Args:
        fit: By `fit_on_known_arm`.
        n: Number of joints.

    Returns:
        (n, 2, 2) for each joint's Coulomb (N m) and viscous friction (N m s/rad).
    """
    both = 10 + np.arange(n)[:, None] + [0, n]
    return np.asarray(fit.covariance[both[:, :, None], both[:, None, :]])


def _named(fit: Estimate, torque_nm: FloatArray, arm: KnownArm) -> FrictionDifference:
    """The friction by name; load-dependent friction is the calibration's."""
    n = arm.noise_nm.size
    return FrictionDifference(
        load_joints=np.zeros(n, dtype=bool),
        load=arm.fit.model.load_friction,
        viscous_joints=np.zeros(n, dtype=bool),
        viscous_nm_s_rad=fit.theta[10 + n : 10 + 2 * n],
        torque_nm=torque_nm,
        known_deviation=np.full(2 * n, np.inf),
        known=np.zeros(2 * n),
        doubts_nm=np.zeros((0, *torque_nm.shape)),
    )
