"""Friction that grows with the load: what a difference of two runs does not cancel.

A gear under load rubs more, so that the loaded run's friction exceeds the unloaded run's by

    mu s (|tau_link,loaded| - |tau_link,unloaded|),    s the direction of motion,

with tau_link the torque of links and payload WITHOUT friction. Built from the motors' torque, friction and all, the
same column makes results worse. So body and friction are fitted to the unloaded run first; the loaded run's link
torque is that of the body plus the payload's, and is iterated with the payload.

A joint gets the column only where its coefficient is positive, possible and significant by a robust t test.
Reversals say little about either and weigh little.

References:
    The form is METHOD.md's, found by measurement on a UR10e and in simulation; Chen 2016 names unmodelled friction
    as a source of error and has no remedy.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from armload_identification.body import BodyModel, smooth_sign
from armload_identification.body_fit import ArmSamples, fit_body, reversal_speed
from armload_identification.chain import Chain
from armload_identification.estimate import Estimate
from armload_identification.load_signal import LoadSignal
from armload_identification.uncertainty import nuisance_t

FloatArray = NDArray[np.float64]
Solver = Callable[[FloatArray], Estimate]

SIGNIFICANT: Final = 3.0
"""Robust t from which a coefficient counts; white noise alone reaches it in one joint of 740."""
GREATEST: Final = 0.5
"""No gear that an arm is built with loses more of its load to friction."""
_ROUGH: Final = 2
"""Iterations while joints are still being chosen."""
_ITERATIONS: Final = 12
_SETTLED: Final = 1e-5


@dataclass(frozen=True, eq=False)
class LoadFriction:
    """Load-dependent friction of n joints, as a payload's fit found it.

    Attributes:
        coefficient: (n,) mu; 0 where a joint has no column.
        t: (n,) robust t statistic of it; 0 where a joint has no column.
        joints: (n,) True where the data justify the column.
        torque_nm: (K, n) its part of the torque difference.
    """

    coefficient: FloatArray
    t: FloatArray
    joints: NDArray[np.bool_]
    torque_nm: FloatArray


def unloaded_body(signal: LoadSignal, chain: Chain, coupling: FloatArray) -> BodyModel:
    """Body and friction of the arm by the unloaded half of a pair of runs.

    Args:
        signal: The pair.
        chain: The arm.
        coupling: (n, n) C of its motors.
    """
    run = ArmSamples(
        signal.position_rad,
        signal.velocity_rad_s,
        signal.acceleration_rad_s2,
        signal.unloaded_nm,
        signal.valid,
        signal.averaged_noise_nm,
    )
    return fit_body([run], chain, coupling).model


def fit_load_friction(
    signal: LoadSignal, regressor: FloatArray, chain: Chain, body: BodyModel, solve: Solver
) -> tuple[Estimate, LoadFriction]:
    """Fit a payload together with the load-dependent friction that the data justify.

    Args:
        signal: Torque difference and unloaded torque.
        regressor: (K, n, 10) of the payload.
        chain: The arm.
        body: Its links; only their torque is used.
        solve: Fits a (K, n, p) regressor to the torque difference.

    Returns:
        The fit, whose parameters behind the ten are the coefficients of the joints that have a column, and these.
    """
    empty = body.link_torque(chain, signal.position_rad, signal.velocity_rad_s, signal.acceleration_rad_s2)
    turn_over = reversal_speed(signal.velocity_rad_s)
    direction = smooth_sign(signal.velocity_rad_s, turn_over)
    joints = np.abs(signal.velocity_rad_s).max(axis=0) > turn_over
    fit = solve(regressor)
    rounds = _ROUGH
    while joints.any():
        fit, column = _iterated(regressor, fit, empty, direction, joints, solve, rounds)
        t, coefficient = np.zeros(chain.n), np.zeros(chain.n)
        t[joints], coefficient[joints] = nuisance_t(fit), fit.theta[10:]
        weak = joints & ((t < SIGNIFICANT) | (coefficient > GREATEST))
        if weak.any():
            joints[int(np.argmin(np.where(weak, t, np.inf)))] = False
            rounds = _ROUGH
        elif rounds == _ROUGH:
            rounds = _ITERATIONS
        else:
            return fit, LoadFriction(coefficient, t, joints, column * coefficient)
    nothing = np.zeros(chain.n)
    return solve(regressor), LoadFriction(nothing, nothing, joints, np.zeros_like(empty))


def _iterated(
    regressor: FloatArray,
    fit: Estimate,
    empty: FloatArray,
    direction: FloatArray,
    joints: NDArray[np.bool_],
    solve: Solver,
    rounds: int,
) -> tuple[Estimate, FloatArray]:
    """The fit with a column on the given joints, iterated until the payload that makes the column stays."""
    theta = fit.theta[:10]
    column = np.zeros_like(empty)
    for _ in range(rounds):
        column = direction * (np.abs(empty + regressor @ theta) - np.abs(empty))
        own = column[:, :, None] * np.eye(joints.size)[:, joints]
        fit = solve(np.concatenate([regressor, own], axis=2))
        change = np.abs((fit.theta[:10] - theta) / fit.scale[:10]).max() / np.abs(theta / fit.scale[:10]).max()
        theta = fit.theta[:10]
        if change < _SETTLED:
            break
    return fit, column
