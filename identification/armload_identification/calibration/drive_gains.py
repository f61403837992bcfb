"""Drive gains from a payload that was weighed.

A current gives torque only through its gain, and nominal gains are several per cent off. The torque of a known
payload is known, so each axis' gain follows from the current that it took. In terms of the torque y by nominal
gains,

    y_a = h_a (C^T (Phi theta + friction))_a,        h_a = nominal gain / gain,

solved by Gauss and Newton for the log of every h, for what is not known of theta, and for the load-dependent
friction found on the way. The known mass alone sets the scale; centre of mass and inertia are then found with the
gains. An axis on which the payload hardly pulls keeps its nominal gain and is named.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student
from threadpoolctl import threadpool_limits

from armload_core.arrays import FloatArray
from armload_identification.estimation.body_fit import reversal_speed
from armload_identification.estimation.estimators import least_noise, steadiness
from armload_identification.estimation.friction_columns import (
    FrictionDifference,
    fit_with_friction,
    load_column,
    unloaded_body,
)
from armload_identification.estimation.least_squares import NOTHING_KNOWN, Estimate, Prior, estimate_reweighted
from armload_identification.estimation.physical_consistency import make_physical, nuisance_beside
from armload_identification.estimation.prior_knowledge import KnownPayload
from armload_identification.estimation.uncertainty import CONFIDENCE, nuisance_deviation, shifts_by
from armload_identification.identification_errors import EstimationError
from armload_identification.model.body_model import smooth_sign
from armload_identification.model.chain import Chain
from armload_identification.model.payload import InertialParameters
from armload_identification.model.regressor import payload_regressor
from armload_identification.recording.recording import Recording, RecordingSource, check_joints
from armload_identification.signals.joint_torque import NOMINAL_DEVIATION, Transmission
from armload_identification.signals.load_signal import LoadSignal, load_signal
from armload_identification.verdict.sanity import check_pair

DETERMINED_WITHIN: Final = 0.05
"""A gain is determined where its 95 % half width is at most this share of it."""
_CHOICES: Final = 3
_STEPS: Final = 30
_SETTLED: Final = 1e-6
_BODY_SETTLED: Final = 1e-3
_LARGEST_STEP: Final = 0.3
_FARTHEST: Final = np.log(3.0)


@dataclass(frozen=True, eq=False)
class GainCalibration:
    """Gains of n axes from one weighed payload.

    Attributes:
        gain_nm_a: (n,) axis torque per ampere; the nominal one where it could not be determined.
        half_width_95: (n,) half width of its 95 % interval, N m/A; where it could not be determined, the one
            assumed for the nominal gain.
        determined: (n,) True where the data determine the gain.
        nominal_nm_a: (n,) gains that the calibration began with.
        coupling: (n, n) C of the motors.
        payload: The payload, what was not known of it estimated.
        load_friction: (n,) coefficient of load-dependent friction per joint, 0 where none was found.
        viscous_nm_s_rad: (n,) change of viscous friction between the runs per joint, 0 where none was found.
        residual_rms_nm: (n,) RMS of the averaged torque difference of every axis minus prediction.
        sources: Of the loaded and the unloaded recording.
    """

    gain_nm_a: FloatArray
    half_width_95: FloatArray
    determined: NDArray[np.bool_]
    nominal_nm_a: FloatArray
    coupling: FloatArray
    payload: InertialParameters
    load_friction: FloatArray
    viscous_nm_s_rad: FloatArray
    residual_rms_nm: FloatArray
    sources: tuple[RecordingSource, ...]

    @property
    def transmission(self) -> Transmission:
        """For identification: calibrated where the gain could be determined, with its uncertainty."""
        deviation = self.half_width_95 / student.ppf(0.5 + CONFIDENCE / 2.0, np.inf) / self.gain_nm_a
        return Transmission(self.gain_nm_a, self.coupling, self.determined, deviation)


def calibrate_gains(
    loaded: Recording, unloaded: Recording, chain: Chain, transmission: Transmission, known: KnownPayload
) -> GainCalibration:
    """Gains from a run with and a run without a weighed payload.

    Args:
        loaded: Run with the payload, recorded as motor currents.
        unloaded: Run of the same motion without it.
        chain: The arm.
        transmission: Nominal gains and coupling.
        known: What is known of the payload: at least its mass.

    Returns:
        One gain per axis, with interval.

    Raises:
        EstimationError: torque was recorded, the mass is not known, or no gain can be determined.
        RecordingError: the recordings do not fit the arm or each other, or cannot be right.
    """
    # Threads would wait for each other, on a busy machine for minutes: see `pipeline.payload_identification.identify`.
    with threadpool_limits(1):
        return _calibrated(loaded, unloaded, chain, transmission, known)


def _calibrated(
    loaded: Recording, unloaded: Recording, chain: Chain, transmission: Transmission, known: KnownPayload
) -> GainCalibration:
    """What `calibrate_gains` does."""
    if loaded.torque_nm is not None or unloaded.torque_nm is not None:
        raise EstimationError(
            "the recordings hold the drives' own torque, to which no gain of this program is applied. "
            "Calibrate from recordings of motor current (6078)."
        )
    if not known.gives_scale:
        raise EstimationError("gains can be determined from a payload of known mass only. Weigh it and give --mass-kg.")
    for run in (loaded, unloaded):
        check_joints(run, chain.n)
    check_pair(loaded, unloaded, transmission)
    signal = load_signal(loaded, unloaded, transmission)
    signal = signal.with_delay(unloaded_body(signal, chain, transmission.coupling).model.torque_delay_s)
    problem = _Problem(signal, chain, transmission.coupling, known)
    free = np.ones(chain.n, dtype=bool)
    while free.any():
        solution = problem.solve(free)
        worst = int(np.argmax(np.where(free, solution.half_width, 0.0)))
        if solution.half_width[worst] <= DETERMINED_WITHIN:
            return _calibration(solution, free, transmission, (loaded.source, unloaded.source))
        free[worst] = False
    raise EstimationError(
        f"no gain can be determined within {DETERMINED_WITHIN:.0%}: the payload pulls too little. "
        "Use a heavier one, mounted off the flange axis, or record more periods."
    )


@dataclass(frozen=True, eq=False)
class _Solution:
    """Log of h per axis with its relative 95 % half width, payload, (2 n) friction coefficients and residual."""

    log_h: FloatArray
    half_width: FloatArray
    theta: FloatArray
    friction: FloatArray
    residual_rms_nm: FloatArray


class _Problem:
    """The bilinear problem of gains and payload, in axis torques."""

    def __init__(self, signal: LoadSignal, chain: Chain, coupling: FloatArray, known: KnownPayload) -> None:
        self._signal, self._chain, self._coupling = signal, chain, coupling
        self._prior = known.prior()
        self._regressor = payload_regressor(chain, *signal.states)
        self._measured = signal.torque_nm @ coupling
        velocity = signal.states.velocity_rad_s
        self._direction = smooth_sign(velocity, reversal_speed(velocity))
        self._start, self._difference = self._friction_by(np.zeros(chain.n), None)
        self._mass_kg = known.reference_mass_kg or self._start[0]

    def solve(self, free: NDArray[np.bool_]) -> _Solution:
        """Gains, and with them the friction columns that the data justify, until these stay the same."""
        for _ in range(_CHOICES):
            solution = self._gauss_newton(free)
            before = _chosen(self._difference)
            _, self._difference = self._friction_by(solution.log_h, self._prior)
            if (_chosen(self._difference) == before).all():
                break
        return solution

    def _friction_by(self, log_h: FloatArray, prior: Prior | None) -> tuple[FloatArray, FrictionDifference]:
        """Payload and friction as some gains have them."""
        coupling = self._coupling
        signal = self._by_gains(log_h)
        arm = unloaded_body(signal, self._chain, coupling)

        def weighted(columns: FloatArray, expected: FloatArray, deviation: FloatArray) -> Estimate:
            known = (prior or NOTHING_KNOWN).and_nuisance(expected, deviation)
            return self._fit(columns, signal.torque_nm, known)

        fit, friction = fit_with_friction(signal, self._regressor, self._chain, arm.model, weighted, arm)
        return fit.theta[:10], friction

    def _by_gains(self, log_h: FloatArray) -> LoadSignal:
        """The signal as other gains than the nominal ones have it."""
        back = np.linalg.inv(self._coupling)
        return self._signal.with_torque_times(self._coupling * np.exp(-log_h) @ back)

    def _gauss_newton(self, free: NDArray[np.bool_]) -> _Solution:
        """Gauss-Newton; the body is fitted anew as the gains move, for its links' torque."""
        n, count, difference = self._chain.n, int(np.count_nonzero(free)), self._difference
        with_friction = _chosen(difference)
        prior = self._prior.and_nuisance(
            np.concatenate([np.zeros(count), difference.known[with_friction]]),
            np.concatenate([np.full(count, np.inf), difference.known_deviation[with_friction]]),
        )
        scale = self._start[0] / self._mass_kg
        log_h = np.where(free, np.log(np.clip(scale, 1.0 / 3.0, 3.0)), 0.0)
        theta = self._start / scale if scale > 0.0 else self._start
        friction = np.concatenate([difference.load, difference.viscous_nm_s_rad])
        axes = self._regressor.transpose(0, 2, 1) @ self._coupling
        axes = axes.transpose(0, 2, 1)
        fitted_at: FloatArray | None = None
        for _ in range(_STEPS):
            if fitted_at is None or np.abs(log_h - fitted_at).max() > _BODY_SETTLED:
                empty, fitted_at = self._links(log_h), log_h
            column = load_column(empty, self._regressor @ theta, self._direction)
            own = np.concatenate([column, self._signal.states.velocity_rad_s], axis=1)
            rubbing = own[:, None, :] * np.tile(self._coupling.T, 2)
            h = np.exp(log_h)
            model = h * (axes @ theta + rubbing @ friction)
            jacobian = np.concatenate(
                [
                    h[:, None] * axes,
                    (model[:, :, None] * np.eye(n))[:, :, free],
                    (h[:, None] * rubbing)[:, :, with_friction],
                ],
                axis=2,
            )
            now = np.concatenate([theta, log_h[free], friction[with_friction]])
            fit = self._fit(jacobian, self._measured - model + jacobian @ now, prior)
            body = make_physical(fit).parameters
            beside = nuisance_beside(fit, body)
            step = np.clip(beside[:count] - log_h[free], -_LARGEST_STEP, _LARGEST_STEP)
            log_h = log_h.copy()
            log_h[free] = np.clip(log_h[free] + step, -_FARTHEST, _FARTHEST)
            theta = body.theta
            friction = np.zeros(2 * n)
            friction[with_friction] = beside[count:]
            if np.abs(step).max() < _SETTLED:
                break
        return _Solution(log_h, self._half_width(fit, free), theta, friction, fit.residual_rms_nm)

    def _links(self, log_h: FloatArray) -> FloatArray:
        """(K, n) torque of the empty arm's links, by the unloaded run and the present gains."""
        body = unloaded_body(self._by_gains(log_h), self._chain, self._coupling).model
        return body.link_torque(self._chain, *self._signal.states)

    def _fit(self, columns: FloatArray, target: FloatArray, prior: Prior | None) -> Estimate:
        signal = self._signal
        return estimate_reweighted(columns, target, signal.valid, least_noise(signal), steadiness(signal), prior)

    def _half_width(self, fit: Estimate, free: NDArray[np.bool_]) -> FloatArray:
        """(n,) relative, with the error that gains left nominal put on the others."""
        count = int(np.count_nonzero(free))
        deviation, freedom = (values[:count] for values in nuisance_deviation(fit))
        nominal = (self._measured[:, :, None] * np.eye(free.size)).transpose(2, 0, 1)[~free] * NOMINAL_DEVIATION
        doubts = np.concatenate([nominal, self._difference.doubts_nm @ self._coupling])
        shifts = shifts_by(fit, doubts)[:, 10 : 10 + count]
        width = np.full(free.size, student.ppf(0.5 + CONFIDENCE / 2.0, np.inf) * NOMINAL_DEVIATION)
        quantile = student.ppf(0.5 + CONFIDENCE / 2.0, freedom)
        width[free] = np.hypot(quantile * deviation, 2.0 * np.sqrt(np.sum(shifts**2, axis=0)))
        return width


def _chosen(friction: FrictionDifference) -> NDArray[np.bool_]:
    """(2 n,) which friction has a column."""
    return np.concatenate([friction.load_joints, friction.viscous_joints])


def _calibration(
    solution: _Solution, determined: NDArray[np.bool_], transmission: Transmission, sources: tuple[RecordingSource, ...]
) -> GainCalibration:
    gain = transmission.gain_nm_a * np.exp(-solution.log_h)
    load, viscous = np.split(solution.friction, 2)
    return GainCalibration(
        gain_nm_a=gain,
        half_width_95=gain * solution.half_width,
        determined=determined,
        nominal_nm_a=transmission.gain_nm_a,
        coupling=transmission.coupling,
        payload=InertialParameters(solution.theta),
        load_friction=load,
        viscous_nm_s_rad=viscous,
        residual_rms_nm=solution.residual_rms_nm,
        sources=sources,
    )
