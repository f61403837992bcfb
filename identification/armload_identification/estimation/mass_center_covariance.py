"""How precisely a fit determines mass and centre of mass, for comparison with another identification.

The covariance is that of the intervals, from the residual's local spectrum and the errors of rotors and delay. The
gains' share is kept separately, as slopes. One number of degrees of freedom describes the entire matrix: that of the
Wishart matrix whose elements have the same scatter,

    nu = p (p + 1) / sum_kl var(C_kl),       in the coordinates in which C is the identity, p = 4.

References:
    Nel, van der Merwe, Communications in Statistics, Theory and Methods 15(12), 1986.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from armload_core.arrays import FloatArray
from armload_identification.estimation.gain_columns import GainFit
from armload_identification.estimation.least_squares import Estimate, Prior
from armload_identification.estimation.uncertainty import (
    ResidualSpectrum,
    derived,
    determined_basis,
    shifts_by,
    shifts_by_knowledge,
)
from armload_identification.model.mass_center import MassCenterCovariance, unknown_deviation
from armload_identification.model.payload import InertialParameters
from armload_identification.signals.joint_torque import Transmission


@dataclass(frozen=True, eq=False)
class GainShare:
    """Effect of the gains on a fit that was made with them.

    Attributes:
        gain: (n,) factors by which currents, or reported torques, were multiplied.
        slope: (p, n) change of theta per change of the logarithm of each.
        covariance: (n, n) of the logarithms.
    """

    gain: FloatArray
    slope: FloatArray
    covariance: FloatArray

    @classmethod
    def of(cls, fit: Estimate, torque_nm: FloatArray, transmission: Transmission, gains: GainFit | None) -> GainShare:
        """For gains that were fitted with the payload and then held, or that were not fitted.

        Args:
            fit: The plain estimate with these gains.
            torque_nm: (N, n) fitted torque.
            transmission: The assumed gains.
            gains: The fitted gains; None if they were not fitted.
        """
        used = transmission.torque_gain if transmission.torque_calibrated else transmission.gain_nm_a
        slope = shifts_by(fit, transmission.gain_shares(torque_nm)).T
        if gains is None:
            return cls(used, slope, transmission.covariance)
        return cls(used * np.exp(gains.log_gain), slope, gains.covariance + gains.common_deviation**2)


def mass_center_covariance(
    fit: Estimate,
    parameters: InertialParameters,
    doubts_nm: FloatArray,
    gains: GainShare | None,
    prior: Prior | None = None,
) -> MassCenterCovariance:
    """Covariance of mass and centre of mass of a fit.

    Args:
        fit: The plain estimate with the gains held, on equidistant samples.
        parameters: The reported parameters, at which derivatives are taken.
        doubts_nm: (k, N, n) torque of one standard deviation of each systematic error except the gains'.
        gains: Effect of the gains on the fit; None if no gain was applied.
        prior: Prior knowledge.

    Returns:
        The covariance; very wide along directions that the data do not determine.
    """
    slope = derived(parameters)[1][:4]
    gradient = np.zeros((4, fit.theta.size))
    gradient[:, :10] = slope
    half = determined_basis(fit)
    spectrum = ResidualSpectrum.of(fit, half)
    contrast = gradient @ half
    known = contrast @ (fit.prior_rows @ half).T
    random = contrast @ spectrum.covariance() @ contrast.T
    shifts = np.vstack([shifts_by(fit, doubts_nm), shifts_by_knowledge(fit, prior)])[:, :10] @ slope.T
    measured = random + known @ known.T + shifts.T @ shifts
    measured = measured + _blind(fit, gradient, parameters.mass_kg)
    freedom = spectrum.joint_freedom(contrast, measured)
    if gains is None:
        return MassCenterCovariance.of_measured(measured, freedom)
    return MassCenterCovariance(measured, freedom, gains.gain, slope @ gains.slope[:10], gains.covariance)


def _blind(fit: Estimate, gradient: FloatArray, mass_kg: float) -> FloatArray:
    """(4, 4) covariance along the directions that the data do not determine."""
    unit = unknown_deviation(mass_kg)
    if fit.rank == fit.theta.size:
        return np.zeros((4, 4))
    directions = ((gradient * fit.scale) @ fit.undetermined) / unit[:, None]
    left, size, _ = np.linalg.svd(directions)
    seen = np.linalg.norm((gradient * fit.scale) / unit[:, None])
    blind = left[:, : size.size][:, size > 1e-6 * seen] * unit[:, None]
    return np.asarray(blind @ blind.T)
