"""Friction that a difference of two runs does not cancel, fitted with the payload where the data ask for it.

A gear under load rubs more, so that the loaded run's friction exceeds the unloaded run's by

    mu s (|tau_link,loaded| - |tau_link,unloaded|),    s the direction of motion,

with tau_link the torque of links and payload WITHOUT friction. Built from the motors' torque, friction and all, the
same column makes results worse. So body and friction are fitted to the unloaded run first; the loaded run's link
torque is that of the body plus the payload's, and is iterated with the payload.

A gear that has warmed up between the runs rubs less: a difference of viscous friction, d dq. Such columns cost
accuracy where nothing has changed.

A joint gets a column only where its coefficient is significant by a robust t test; mu must be positive and
possible besides. The columns are thrown out one after the other, the least justified first.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from armload_identification.body import BodyModel, smooth_sign
from armload_identification.body_fit import ArmSamples, BodyFit, fit_body, reversal_speed
from armload_identification.chain import Chain
from armload_identification.estimate import Estimate
from armload_identification.load_signal import LoadSignal
from armload_identification.uncertainty import nuisance_deviation

FloatArray = NDArray[np.float64]
Solver = Callable[[FloatArray], Estimate]

SIGNIFICANT_LOAD: Final = 3.0
"""Robust t from which load-dependent friction counts; white noise alone reaches it in one joint of 740."""
SIGNIFICANT_VISCOUS: Final = 4.0
"""The same for a change of viscous friction, of which there is less reason to expect any: one joint in 16,000."""
GREATEST_LOAD: Final = 0.5
"""No gear that an arm is built with loses more of its load to friction."""
_HOPELESS: Final = 1.0 / 3.0
"""Columns below this share of their threshold go together."""
_ROUGH: Final = 2
"""Iterations while columns are still being chosen."""
_ITERATIONS: Final = 12
_SETTLED: Final = 1e-5


@dataclass(frozen=True, eq=False)
class FrictionDifference:
    """Friction of the loaded run beyond that of the unloaded run, n joints.

    Attributes:
        load_joints: (n,) True where load-dependent friction has a column.
        load: (n,) its coefficient mu; 0 where there is no column.
        load_t: (n,) robust t statistic of it.
        viscous_joints: (n,) True where a change of viscous friction has a column.
        viscous_nm_s_rad: (n,) the change; 0 where there is no column.
        viscous_t: (n,) robust t statistic of it.
        torque_nm: (K, n) all of it as a torque.
    """

    load_joints: NDArray[np.bool_]
    load: FloatArray
    load_t: FloatArray
    viscous_joints: NDArray[np.bool_]
    viscous_nm_s_rad: FloatArray
    viscous_t: FloatArray
    torque_nm: FloatArray


def unloaded_body(signal: LoadSignal, chain: Chain, coupling: FloatArray) -> BodyFit:
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
    return fit_body([run], chain, coupling)


def load_column(empty_nm: FloatArray, payload_nm: FloatArray, direction: FloatArray) -> FloatArray:
    """The column s (|tau_link,loaded| - |tau_link,unloaded|) of every joint.

    Args:
        empty_nm: (K, n) torque of the links without payload.
        payload_nm: (K, n) torque of the payload.
        direction: (K, n) direction of motion, -1 to 1.
    """
    return np.asarray(direction * (np.abs(empty_nm + payload_nm) - np.abs(empty_nm)))


def fit_with_friction(
    signal: LoadSignal, regressor: FloatArray, chain: Chain, body: BodyModel, solve: Solver
) -> tuple[Estimate, FrictionDifference]:
    """Fit a payload together with the friction that the data justify.

    Args:
        signal: Torque difference and its motion.
        regressor: (K, n, 10) of the payload.
        chain: The arm.
        body: Its links; only their torque is used.
        solve: Fits a (K, n, p) regressor to the torque difference.

    Returns:
        The fit, whose parameters behind the ten are mu of the joints that have it and then the viscous changes,
        and these by joint.
    """
    columns = _Columns(signal, regressor, chain, body)
    n = chain.n
    moving = np.abs(signal.velocity_rad_s).max(axis=0) > reversal_speed(signal.velocity_rad_s)
    chosen = np.concatenate([moving, moving])
    threshold = np.repeat([SIGNIFICANT_LOAD, SIGNIFICANT_VISCOUS], n)
    fit = solve(regressor)
    while chosen.any():
        fit, coefficient = columns.iterate(fit, chosen, solve, _ROUGH)
        merit = np.where(chosen, _t(fit, coefficient, chosen) / threshold, np.inf)
        merit[:n] = np.where(coefficient[:n] > GREATEST_LOAD, 0.0, merit[:n])
        merit[n:] = np.abs(merit[n:])
        if merit.min() < 1.0:
            chosen &= (merit >= _HOPELESS) & (np.arange(2 * n) != np.argmin(merit))
            continue
        fit, coefficient = columns.iterate(fit, chosen, solve, _ITERATIONS)
        return fit, columns.result(fit, coefficient, chosen)
    fit = solve(regressor)
    return fit, columns.result(fit, np.zeros(2 * n), chosen)


def _t(fit: Estimate, coefficient: FloatArray, chosen: NDArray[np.bool_]) -> FloatArray:
    """(2 n,) t statistics, 0 where there is no column."""
    t = np.zeros(chosen.size)
    t[chosen] = coefficient[chosen] / nuisance_deviation(fit)[0]
    return t


class _Columns:
    """The 2 n columns beside the payload's: load-dependent friction, then viscous changes."""

    def __init__(self, signal: LoadSignal, regressor: FloatArray, chain: Chain, body: BodyModel) -> None:
        self._regressor = regressor
        self._velocity = signal.velocity_rad_s
        self._empty = body.link_torque(chain, signal.position_rad, signal.velocity_rad_s, signal.acceleration_rad_s2)
        self._direction = smooth_sign(signal.velocity_rad_s, reversal_speed(signal.velocity_rad_s))

    def iterate(
        self, fit: Estimate, chosen: NDArray[np.bool_], solve: Solver, rounds: int
    ) -> tuple[Estimate, FloatArray]:
        """The fit with the chosen columns, and all 2 n coefficients, until the payload in the columns stays."""
        n = self._velocity.shape[1]
        for _ in range(rounds):
            theta = fit.theta[:10]
            own = np.concatenate([self._load(theta), self._velocity], axis=1)
            tall = own[:, None, :] * np.tile(np.eye(n), 2)
            fit = solve(np.concatenate([self._regressor, tall[:, :, chosen]], axis=2))
            size = np.abs(theta / fit.scale[:10]).max()
            if np.abs((fit.theta[:10] - theta) / fit.scale[:10]).max() < _SETTLED * size:
                break
        coefficient = np.zeros(2 * n)
        coefficient[chosen] = fit.theta[10:]
        return fit, coefficient

    def result(self, fit: Estimate, coefficient: FloatArray, chosen: NDArray[np.bool_]) -> FrictionDifference:
        """Coefficients by name."""
        load, viscous = np.split(coefficient, 2)
        load_joints, viscous_joints = np.split(chosen, 2)
        load_t, viscous_t = np.split(_t(fit, coefficient, chosen), 2)
        return FrictionDifference(
            load_joints,
            load,
            load_t,
            viscous_joints,
            viscous,
            viscous_t,
            self._load(fit.theta[:10]) * load + self._velocity * viscous,
        )

    def _load(self, theta: FloatArray) -> FloatArray:
        return load_column(self._empty, self._regressor @ theta, self._direction)
