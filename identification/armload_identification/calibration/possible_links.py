"""Physically possible links with the torque of the identified arm.

Only base parameters beta are identified; these are linear combinations of the links' parameters, beta = K theta, which
many sets of links satisfy. Of these, the links nearest to rods from joint to joint are chosen, in the distance of Lee,
Wensing and Park, which keeps every pseudo-inertia P_i positive definite:

    min_theta  w/2 (K theta - beta)' C^-1 (K theta - beta) + sum_i [tr(W_i^-1 P_i) - log det(W_i^-1 P_i)]

with C the covariance of beta and W_i the rods' pseudo-inertia. w is increased in stages, each solved by damped Newton
steps, which remain possible because the function is self-concordant. As soon as the rest of beta can be corrected
without leaving the possible set, this is done, and the links have exactly the identified torque. Identified parameters
that no possible links have never reach this point; the result is then that with w = 10: with a larger w, the links of
the UR10e are closer to the data by one part in twenty, but weigh hundreds of kilograms.

With a metric of torque at random states instead of C, the links of the UR10e weighed 4.5 t, because poorly determined
parameters were held as firmly as the others.

References:
    Lee, Wensing, Park, Geometric robot dynamic identification, IEEE Transactions on Robotics 36(2), 2020.
    Gautier, Numerical calculation of the base inertial parameters of robots, Journal of Robotic Systems 8(4), 1991.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from armload_identification.calibration.calibration_result import ArmCalibration
from armload_identification.estimation.arm_terms import LINKS
from armload_identification.estimation.physical_consistency import inside_barrier
from armload_identification.estimation.residual_spectrum import whitening
from armload_identification.float_array import FloatArray
from armload_identification.identification_errors import EstimationError
from armload_identification.model.chain import Chain
from armload_identification.model.payload import PSEUDO_INERTIA_BASIS, SMALLEST_MARGIN, InertialParameters
from armload_identification.model.regressor import PARAMETERS, body_regressor

_STATES: Final = 200
_SEED: Final = 20160606
_INDEPENDENT: Final = 1e-9
"""Share of the greatest singular value from which a direction is identifiable."""
_FLAT: Final = 1e-9
"""Lower bound of the eigenvalues of a correlation matrix when it is inverted."""
_THICKNESS_M: Final = 0.08
"""Radius of gyration of a rod in every direction, in addition to its length."""
_WEIGHTS: Final = 10.0 ** np.arange(-6, 11)
_FIRM_ENOUGH: Final = 10.0


@dataclass(frozen=True, eq=False)
class PossibleLinks:
    """Physically possible links of an arm of n joints.

    Attributes:
        links: (n, 10) theta of each link in its joint frame.
        exact: Whether they have the identified torque; otherwise no possible links have it.
        off: RMS difference of the base parameters from the identified ones in standard deviations; 0 if exact.
        left_nm: (n,) RMS difference of the links' torque from the identified one at random states, up to 1 rad/s and
            1 rad/s2; rounding errors if exact.
    """

    links: FloatArray
    exact: bool
    off: float
    left_nm: FloatArray


def possible_links(chain: Chain, calibration: ArmCalibration) -> PossibleLinks:
    """Physically possible links with the torque of an arm's identified base parameters, or as close to it as possible.

    Args:
        chain: The arm, mounted as it was calibrated.
        calibration: Its base parameters and their covariance.

    Raises:
        EstimationError: none were found near these parameters.
    """
    n, base, identified = chain.n, calibration.body.base.ravel(), calibration.body.links.ravel()
    rng = np.random.default_rng(_SEED)
    q, (dq, ddq) = rng.uniform(-np.pi, np.pi, (_STATES, n)), rng.uniform(-1.0, 1.0, (2, _STATES, n))
    torque = body_regressor(chain, q, dq, ddq).reshape(_STATES * n, PARAMETERS * n)
    _, size, right = np.linalg.svd(torque, full_matrices=False)
    right = right[: int(np.count_nonzero(size > _INDEPENDENT * size[0]))]
    at = calibration.place(LINKS)
    whitened = whitening(calibration.covariance[at, at], _FLAT)
    rows = whitened @ np.linalg.lstsq(torque[:, base], torque)[0]
    target = whitened @ identified[base]
    theta = _rods(chain, torque, torque @ identified)
    inverse_rods = np.asarray(np.linalg.inv(_pseudo_inertia(theta)), dtype=np.float64)
    exact, trial = False, theta
    for weight in _WEIGHTS:
        try:
            trial = _nearest(trial, inverse_rods, weight * rows.T @ rows, weight * rows.T @ target)
        except np.linalg.LinAlgError as error:
            if weight > _FIRM_ENOUGH:  # at the edge of the possible, rounding ends the search for still firmer ones
                break
            raise EstimationError(
                "no physically possible links were found near those of the calibration: calibrate from more motion"
            ) from error
        corrected = trial + (right.T @ (right @ (identified - trial.ravel()))).reshape(n, PARAMETERS)
        exact = _margin(corrected, inverse_rods) > SMALLEST_MARGIN
        if exact:
            theta = corrected
        elif weight <= _FIRM_ENOUGH:
            theta = trial
        if exact or _margin(trial, inverse_rods) < SMALLEST_MARGIN:
            break
    off = 0.0 if exact else float(np.sqrt(np.mean((rows @ theta.ravel() - target) ** 2)))
    left = (torque @ (theta.ravel() - identified)).reshape(_STATES, n)
    return PossibleLinks(theta, exact, off, np.sqrt(np.mean(left**2, axis=0)))


def _nearest(theta: FloatArray, inverse_rods: FloatArray, square: FloatArray, linear: FloatArray) -> FloatArray:
    """The minimum of the distance to the rods plus x' square x / 2 - linear' x, starting at a possible theta."""
    linear = linear - np.einsum("kab,iba->ik", PSEUDO_INERTIA_BASIS, inverse_rods).ravel()
    found = inside_barrier(theta.ravel(), square, lambda x: square @ x - linear, PSEUDO_INERTIA_BASIS)
    return found.reshape(theta.shape)


def _rods(chain: Chain, torque: FloatArray, identified: FloatArray) -> FloatArray:
    """(n, 10) rods from each joint to the next, with the common mass per length that best fits the torque."""
    ends = np.vstack([chain.placement[1:, :3, 3], chain.flange[None, :3, 3]])
    rods = np.array([_rod(end) for end in ends])
    own = torque @ rods.ravel()
    per_length = float(own @ identified) / float(own @ own)
    return rods * max(per_length, 1.0)


def _rod(end: FloatArray) -> FloatArray:
    """(10,) theta of a rod from the origin to a point, 1 kg/m and some thickness beyond both ends."""
    center, length = 0.5 * end, float(np.linalg.norm(end)) + 2.0 * _THICKNESS_M
    spread = np.outer(end, end) / 12.0 + _THICKNESS_M**2 * np.eye(3)
    inertia = length * (np.trace(spread) * np.eye(3) - spread)
    return InertialParameters.from_center_of_mass(length, center, inertia).theta


def _pseudo_inertia(links: FloatArray) -> FloatArray:
    """(n, 4, 4) [[int r r' dm, int r dm], [int r' dm, m]] of each link."""
    return np.asarray(np.einsum("ik,kab->iab", links, PSEUDO_INERTIA_BASIS))


def _margin(links: FloatArray, inverse_rods: FloatArray) -> float:
    """Smallest eigenvalue of all pseudo-inertias relative to the rods'."""
    half = np.linalg.cholesky(inverse_rods)
    return float(np.linalg.eigvalsh(half.transpose(0, 2, 1) @ _pseudo_inertia(links) @ half).min())
