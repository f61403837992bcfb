"""Friction that a difference of two runs does not cancel, fitted with the payload where the data require it.

A gear has more friction under load, so that the loaded run's friction exceeds the unloaded run's by

    mu s (|tau_link,loaded| - |tau_link,unloaded|),    s the direction of motion,

with tau_link the torque of links and payload WITHOUT friction. Computed from the motors' torque, which includes
friction, the same column makes results worse. Body and friction are therefore fitted to the unloaded run first; the
loaded run's link torque is the body's plus the payload's, and is iterated with the payload.

A gear that has warmed up between the runs has less friction: a difference of viscous friction, d dq. Such columns cost
accuracy if nothing has changed.

A joint is given a column only if its coefficient is significant in a robust t test; mu must also be positive and
possible. The columns are dropped one by one, the least justified first.

The run of the empty arm also determines mu, and much more precisely, from torques many times the payload's. Unless
the difference contradicts it, that value is the prior on mu: with a payload of the paper's size, centre of mass and mu
are hard to distinguish.
"""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from armload_core.arrays import FloatArray
from armload_identification.estimation.empty_arm.unloaded_arm import GREATEST_LOAD_FRICTION, BodyFit, fit_body
from armload_identification.estimation.least_squares import Estimate
from armload_identification.estimation.uncertainty import nuisance_deviation
from armload_identification.model.body_model import BodyModel, smooth_sign
from armload_identification.model.chain import Chain
from armload_identification.model.regressor import rotor_columns
from armload_identification.signals.filters import low_pass_cutoff
from armload_identification.signals.load_signal import LoadSignal
from armload_identification.signals.reversals import reversal_speed

Solver = Callable[[FloatArray, FloatArray, FloatArray], Estimate]
"""Fits a (K, n, 10 + r) regressor, given expected values and standard deviations of the last r parameters."""

SIGNIFICANT_LOAD: Final = 3.0
"""Robust t above which load-dependent friction is significant; white noise reaches it in one joint of 740."""
SIGNIFICANT_VISCOUS: Final = 4.0
"""The same for a change of viscous friction, which is less to be expected: one joint in 16,000."""
_THINNED: Final = 8.0
"""Samples kept per period of the low-pass's cutoff frequency."""
_ALIKE: Final = 0.03
"""Relative standard deviation of the same gear's mu between loads."""
_HOPELESS: Final = 1.0 / 3.0
"""Columns below this share of their threshold are dropped together."""
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
        viscous_joints: (n,) True where a change of viscous friction has a column.
        viscous_nm_s_rad: (n,) the change; 0 where there is no column.
        torque_nm: (K, n) torque of both.
        known_deviation: (2 n,) standard deviations of the prior from the unloaded run: of mu where that run determines
            it; inf elsewhere, and for viscous changes.
        known: (2 n,) expected values of that prior.
        doubts_nm: (k, K, n) error of the torque difference for one standard deviation of each quantity taken from the
            unloaded run: the rotors' inertia, the delay of the torque.
    """

    load_joints: NDArray[np.bool_]
    load: FloatArray
    viscous_joints: NDArray[np.bool_]
    viscous_nm_s_rad: FloatArray
    torque_nm: FloatArray
    known_deviation: FloatArray
    known: FloatArray
    doubts_nm: FloatArray


def unloaded_body(signal: LoadSignal, chain: Chain, coupling: FloatArray) -> BodyFit:
    """Body and friction of the arm from the unloaded run of a pair.

    Args:
        signal: The pair.
        chain: The arm.
        coupling: (n, n) C of its motors.
    """
    step = 1
    if not signal.periodic:
        # After the low-pass a few samples per period of its cutoff frequency contain all the information.
        cutoff_hz = low_pass_cutoff(signal.states.velocity_rad_s, signal.interval_s)
        step = max(int(1.0 / (_THINNED * cutoff_hz * signal.interval_s)), 1)
    return fit_body([signal.empty_arm.every(step)], chain, coupling)


def load_column(empty_nm: FloatArray, payload_nm: FloatArray, direction: FloatArray) -> FloatArray:
    """The column s (|tau_link,loaded| - |tau_link,unloaded|) of every joint.

    Args:
        empty_nm: (K, n) torque of the links without payload.
        payload_nm: (K, n) torque of the payload.
        direction: (K, n) direction of motion, -1 to 1.
    """
    return np.asarray(direction * (np.abs(empty_nm + payload_nm) - np.abs(empty_nm)))


def fit_with_friction(
    columns: FrictionColumns, body: BodyModel, solve: Solver, arm: BodyFit | None = None
) -> tuple[Estimate, FrictionDifference]:
    """Fit a payload together with the friction that the data justify.

    Args:
        columns: Of payload and friction.
        body: The arm's body, for its load-dependent friction.
        solve: Fits a regressor to the torque difference.
        arm: How well the body is known, if it was fitted to the unloaded run; its mu is then a prior.

    Returns:
        The fit, whose parameters after the ten are mu of the joints that have it and then the viscous changes;
        and these by joint.
    """
    n = body.n
    moving = columns.moving
    fit, chosen = _justified(columns, solve, np.concatenate([moving, moving]))
    expected = np.concatenate([body.load_friction, np.zeros(n)])
    deviation = np.full(2 * n, np.inf)
    if arm is not None:
        own, doubt = body.load_friction, np.hypot(arm.load_deviation, _ALIKE * body.load_friction)
        known = moving & (own > SIGNIFICANT_LOAD * arm.load_deviation)
        both = chosen | np.concatenate([known, np.zeros(n, dtype=bool)])
        trial, coefficient = _iterate(columns, solve, fit, both, _ROUGH)
        free = _deviation(trial, both)[:n]
        known &= np.abs(coefficient[:n] - own) <= SIGNIFICANT_LOAD * np.hypot(free, doubt)
        chosen = chosen | np.concatenate([known, np.zeros(n, dtype=bool)])
        deviation[:n][known] = doubt[known]
    coefficient = np.zeros(2 * n)
    if chosen.any():
        fit, coefficient = _iterate(columns, solve, fit, chosen, _ITERATIONS, expected, deviation)
    return fit, columns.difference(fit, coefficient, chosen, expected, deviation, arm)


def _justified(
    columns: FrictionColumns, solve: Solver, chosen: NDArray[np.bool_]
) -> tuple[Estimate, NDArray[np.bool_]]:
    """A rough fit, and (2 n,) True for the columns that the difference itself justifies."""
    n = chosen.size // 2
    threshold = np.repeat([SIGNIFICANT_LOAD, SIGNIFICANT_VISCOUS], n)
    plain = solve(columns.regressor, np.empty(0), np.empty(0))
    fit = plain
    while chosen.any():
        fit, coefficient = _iterate(columns, solve, fit, chosen, _ROUGH)
        merit = np.where(chosen, coefficient / _deviation(fit, chosen) / threshold, np.inf)
        merit[:n] = np.where(coefficient[:n] > GREATEST_LOAD_FRICTION, 0.0, merit[:n])
        merit[n:] = np.abs(merit[n:])
        if merit.min() >= 1.0:
            return fit, chosen
        chosen = chosen & (merit >= _HOPELESS) & (np.arange(2 * n) != np.argmin(merit))
    return plain, chosen


def _iterate(
    columns: FrictionColumns,
    solve: Solver,
    fit: Estimate,
    chosen: NDArray[np.bool_],
    rounds: int,
    expected: FloatArray | None = None,
    deviation: FloatArray | None = None,
) -> tuple[Estimate, FloatArray]:
    """The fit with the chosen columns and all 2 n coefficients, iterated until the payload in the columns settles."""
    mean = np.zeros(chosen.size) if expected is None else expected
    spread = np.full(chosen.size, np.inf) if deviation is None else deviation
    for _ in range(rounds):
        theta = fit.theta[:10]
        everything = np.concatenate([columns.regressor, columns.chosen(theta, chosen)], axis=2)
        fit = solve(everything, mean[chosen], spread[chosen])
        size = np.abs(theta / fit.scale[:10]).max()
        if np.abs((fit.theta[:10] - theta) / fit.scale[:10]).max() < _SETTLED * size:
            break
    coefficient = np.zeros(chosen.size)
    coefficient[chosen] = fit.theta[10:]
    return fit, coefficient


def _deviation(fit: Estimate, chosen: NDArray[np.bool_]) -> FloatArray:
    """(2 n,) standard deviations, inf where there is no column."""
    deviation = np.full(chosen.size, np.inf)
    deviation[chosen] = nuisance_deviation(fit)[: int(np.count_nonzero(chosen))]
    return deviation


class FrictionColumns:
    """The payload's ten columns and 2 n of friction: load-dependent friction, then viscous changes.

    Args:
        signal: Torque difference and its motion.
        regressor: (K, n, 10) of the payload.
        chain: The arm.
        body: Its links; only their torque is used.
    """

    def __init__(self, signal: LoadSignal, regressor: FloatArray, chain: Chain, body: BodyModel) -> None:
        self.regressor = regressor
        self._interval_s, self._coupling = signal.interval_s, body.coupling
        _, self._velocity, self._acceleration = signal.states
        turn_over = reversal_speed(self._velocity)
        self.moving = np.abs(self._velocity).max(axis=0) > turn_over
        self.empty_nm = body.link_torque(chain, *signal.states)
        self._direction = smooth_sign(self._velocity, turn_over)

    def with_empty_times(self, matrix: FloatArray) -> FrictionColumns:
        """These columns with the torque of the arm's links multiplied by a matrix.

        Args:
            matrix: (n, n) effect of other gains.
        """
        other = copy(self)
        other.empty_nm = self.empty_nm @ matrix
        return other

    def payload_nm(self, theta: FloatArray) -> FloatArray:
        """(K, n) torque of a payload.

        Args:
            theta: (10,) its parameters.
        """
        return (self.regressor.reshape(-1, 10) @ theta).reshape(self.empty_nm.shape)

    def chosen(self, theta: FloatArray, chosen: NDArray[np.bool_]) -> FloatArray:
        """Columns of friction.

        Args:
            theta: (10,) the payload that loads the gears.
            chosen: (2 n,) True for the columns to compute.

        Returns:
            (K, n, c) for c chosen columns.
        """
        own, n = np.concatenate([self._load(theta), self._velocity], axis=1), self._velocity.shape[1]
        place = np.flatnonzero(chosen)
        columns = np.zeros((len(own), n, place.size))
        columns[:, place % n, np.arange(place.size)] = own[:, place]
        return columns

    def growth(self, theta: FloatArray, load: FloatArray) -> FloatArray:
        """Derivative of load-dependent friction with respect to the payload's torque, mu s sgn(tau_link).

        Args:
            theta: (10,) the payload that loads the gears.
            load: (n,) mu.

        Returns:
            (K, n).
        """
        turned = np.sign(self.empty_nm + self.payload_nm(theta))
        return np.asarray(load * self._direction * turned)

    def slope_of_empty(self, theta: FloatArray, load: FloatArray) -> FloatArray:
        """Its derivative with respect to the links' torque, mu s (sgn tau_link,loaded - sgn tau_link,unloaded).

        Args:
            theta: (10,) the payload that loads the gears.
            load: (n,) mu.

        Returns:
            (K, n).
        """
        turned = np.sign(self.empty_nm + self.payload_nm(theta)) - np.sign(self.empty_nm)
        return np.asarray(load * self._direction * turned)

    def difference(
        self,
        fit: Estimate,
        coefficient: FloatArray,
        chosen: NDArray[np.bool_],
        expected: FloatArray,
        deviation: FloatArray,
        arm: BodyFit | None,
    ) -> FrictionDifference:
        """Coefficients by name.

        Args:
            fit: The fit; its parameters are the payload's ten, those chosen, and possibly others.
            coefficient: (2 n,) all coefficients.
            chosen: (2 n,) True for those with a column.
            expected: (2 n,) expected values of their prior.
            deviation: (2 n,) standard deviations of their prior.
            arm: How well the body is known, if it was fitted to the unloaded run.
        """
        load, viscous = np.split(coefficient, 2)
        load_joints, viscous_joints = np.split(chosen, 2)
        torque_nm = self._load(fit.theta[:10]) * load + self._velocity * viscous
        return FrictionDifference(
            load_joints=load_joints,
            load=load,
            viscous_joints=viscous_joints,
            viscous_nm_s_rad=viscous,
            torque_nm=torque_nm,
            known_deviation=deviation,
            known=expected,
            doubts_nm=self._doubts(fit, load, torque_nm, arm),
        )

    def _load(self, theta: FloatArray) -> FloatArray:
        return load_column(self.empty_nm, self.payload_nm(theta), self._direction)

    def _doubts(self, fit: Estimate, load: FloatArray, friction: FloatArray, arm: BodyFit | None) -> FloatArray:
        """Changes of the torque difference for one standard deviation of each rotor and of the delay."""
        if arm is None:
            return np.zeros((0, *self.empty_nm.shape))
        payload = self.payload_nm(fit.theta[:10])
        turned = np.sign(self.empty_nm + payload) - np.sign(self.empty_nm)
        per_rotor = rotor_columns(self._acceleration, self._coupling).transpose(1, 0, 2)
        rotors = per_rotor * arm.rotor_deviation_kg_m2[:, None, None] * (load * self._direction * turned)
        change = np.gradient(payload + friction, self._interval_s, axis=0)
        return np.concatenate([rotors, arm.delay_deviation_s * change[None]])
