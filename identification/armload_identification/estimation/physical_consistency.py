"""The physically possible parameters nearest to an estimate.

    minimise   || R (theta - theta_hat) ||^2 + || rho (theta - theta_compact) ||^2 along undetermined directions
    subject to J(theta) - margin tr J(theta) 1 >= 0

J is the 4x4 pseudo-inertia, linear in theta, so this is convex with one linear matrix inequality in ten unknowns.
A logarithmic barrier and Newton's method with exact derivatives reach the unique minimum; the gap to it is at most
4 / t for the barrier's weight t, which the dual certificate of the result proves.

References:
    Wensing, Kim, Slotine, Linear matrix inequalities for physically consistent inertial parameter
    identification, IEEE RA-L 3(1), 2018.
    Boyd, Vandenberghe, Convex optimization, 2004, chapter 11.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from armload_identification.float_array import FloatArray
from armload_identification.identification_errors import EstimationError
from armload_identification.model.payload import PSEUDO_INERTIA_BASIS, SMALLEST_MARGIN, InertialParameters

if TYPE_CHECKING:  # the estimator in a control loop needs nothing of the pipeline
    from armload_identification.estimation.payload_from_posterior import PayloadEstimate

WRITTEN_MARGIN: Final = 2.0 * SMALLEST_MARGIN
"""Imposed margin, large enough that rounding in a file does not reduce it below `SMALLEST_MARGIN`."""

BARRIER: Final = 0.5
"""Weight of the barrier -log det J that stands for the end of a distribution. Samples of it are up to 5 % wider or 30 %
narrower. Half: intervals of inertias by up to -5 %; twice: by up to +16 %."""
_COMPACT_RADIUS_M: Final = 0.05
"""Radius of gyration per axis of the body towards which undetermined directions are drawn."""
_PULL: Final = 1e-3
"""Weight of that pull: a thousandth of a standard deviation of the noise per unit of the body's parameters."""
_RELATIVE_GAP: Final = 1e-12
_SUFFICIENT_GAP: Final = 1e-9
"""Accepted gap if rounding errors stop the method earlier; never needed so far."""
_BARRIER_GROWTH: Final = 20.0
_NEWTON_STEPS: Final = 60
_NEWTON_DECREMENT: Final = 1e-14
_NEAR_MINIMUM: Final = 0.06
"""Decrement from which Newton's steps are shortened, and up to which a minimum is accepted if rounding errors keep it
from settling further: it increases the gap by less than a fiftieth. In 262 of 847 cases they do, at 6e-4 or less."""


def make_physical(found: PayloadEstimate) -> InertialParameters:
    """Physically consistent parameters from an estimate.

    Args:
        found: The plain estimate; all other unknowns are left free.

    Returns:
        The plain parameters if they are possible and fully determined, else the nearest possible ones.

    Raises:
        EstimationError: the mass is not positive, or the search did not settle.
    """
    plain = InertialParameters(found.theta)
    if plain.mass_kg <= 0.0:
        raise EstimationError(
            f"the estimated mass is {plain.mass_kg:.3g} kg, which is physically impossible. Check that the loaded and "
            "the unloaded recording are not exchanged, and the sign of the currents."
        )
    if found.rank == found.theta.size:
        return nearest_possible(plain, found.root)
    compact = _ball(plain)
    size = compact.mass_kg * np.array([1.0] + [_COMPACT_RADIUS_M] * 3 + [_COMPACT_RADIUS_M**2] * 6)
    pull = _PULL * np.diag(1.0 / size)
    target = np.concatenate([found.root @ plain.theta, pull @ compact.theta])
    try:
        return InertialParameters(project(np.vstack([found.root, pull]), target, _interior(plain)))
    except EstimationError as error:
        raise EstimationError(
            f"the motion determines only {found.rank} of {found.theta.size} parameter directions, and no physically "
            "possible payload agrees with them: it moves too few joints, or the columns or their order do not belong "
            "to this arm. Record a longer motion of all joints."
        ) from error


def nearest_possible(plain: InertialParameters, root: FloatArray) -> InertialParameters:
    """The possible body nearest to an estimate whose directions are all determined, by the data or by a prior.

    Args:
        plain: The estimate, with a mass above 0.
        root: (10, 10) R with ||R (theta - estimate)||^2 the additional cost of another theta.

    Returns:
        The estimate itself if it is possible.

    Raises:
        EstimationError: the search did not settle.
    """
    if plain.margin >= WRITTEN_MARGIN:
        return plain
    return InertialParameters(project(root, root @ plain.theta, _interior(plain)))


def root_of(covariance: FloatArray) -> FloatArray:
    """(k, k) R with ||R error||^2 the squared size of an error, in standard deviations of a (k, k) covariance."""
    size = np.sqrt(np.diag(covariance))
    lower = np.linalg.cholesky(covariance / np.outer(size, size))
    return np.asarray(np.linalg.solve(lower, np.diag(1.0 / size)))


def possible_spread(plain: InertialParameters, root: FloatArray) -> tuple[InertialParameters, FloatArray]:
    """Mean and covariance of the possible bodies among those that an estimate's errors allow.

    The normal distribution that ends where bodies become impossible, by Laplace's method with a barrier for that end.

    Args:
        plain: The estimate, possible or not, with a mass above 0.
        root: (10, 10) of the covariance of its errors (`root_of`).

    Returns:
        The mean, and (10, 10) its covariance, at most that of the errors.

    Raises:
        LinAlgError: the search did not settle.
    """
    distance = _Distance.of(root, root @ plain.theta, 0.0)
    x = _interior(plain) / distance.scale
    sharp = 0.5 / BARRIER
    stages = int(np.ceil(np.log(1.0 + distance.squared(x)) / np.log(_BARRIER_GROWTH)))
    for left in range(stages, -1, -1):
        x = distance.nearest(x, sharp * _BARRIER_GROWTH**-left)
    curved = _whitened(x, distance.constraint).reshape(len(x), -1)
    spread = np.linalg.inv(BARRIER * (sharp * distance.hessian + curved @ curved.T))
    return InertialParameters(x * distance.scale), spread * np.outer(distance.scale, distance.scale)


def project(rows: FloatArray, target: FloatArray, start: FloatArray) -> FloatArray:
    """Minimise ||rows theta - target||^2 over the bodies with a margin of at least `WRITTEN_MARGIN`.

    Args:
        rows: (k, 10) with full column rank.
        target: (k,).
        start: (10,) parameters of a body with a greater margin.

    Returns:
        (10,) the minimum; the gap in cost is 1e-12 of the starting cost, or up to 1e-9 if rounding errors end the
        method earlier.

    Raises:
        EstimationError: the barrier method did not settle.
    """
    distance = _Distance.of(rows, target, WRITTEN_MARGIN)
    x = start / distance.scale
    size = max(distance.squared(x), distance.squared(0.0 * x) * 1e-12)
    sharpness = 4.0 / size
    while True:
        try:
            x = distance.nearest(x, sharpness)
        except np.linalg.LinAlgError as error:
            if 4.0 / sharpness <= _SUFFICIENT_GAP * size:
                return np.asarray(x * distance.scale)
            raise EstimationError(
                "no physically possible payload was found near the estimate "
                f"(gap {4.0 / sharpness:.2g} of {size:.2g}): columns, joint order or signs do not belong "
                "to this arm, or the motion moves too few joints: check them, or record a longer motion of all joints."
            ) from error
        if 4.0 / sharpness <= _RELATIVE_GAP * size:
            return np.asarray(x * distance.scale)
        sharpness *= _BARRIER_GROWTH


@dataclass(frozen=True, eq=False)
class _Distance:
    """||rows theta - target||^2 of a body, and the constraint on it, for x = theta / scale.

    Attributes:
        scale: (10,) units of x: unit columns, as Newton's method is invariant to scale, the rounding in its linear
            systems is not.
        root: (10, 10) triangle of the rows.
        hessian: (10, 10) of the distance.
        unconstrained: (10,) its minimum.
        constraint: (10, 4, 4) G per parameter.
    """

    scale: FloatArray
    root: FloatArray
    hessian: FloatArray
    unconstrained: FloatArray
    constraint: FloatArray

    @classmethod
    def of(cls, rows: FloatArray, target: FloatArray, margin: float) -> _Distance:
        """The distance of (k, 10) rows and a (k,) target."""
        scale = 1.0 / np.sqrt(np.sum(rows**2, axis=0))
        scaled = rows * scale
        unconstrained, *_ = np.linalg.lstsq(scaled, target, rcond=None)
        _, root = np.linalg.qr(scaled)
        trace = np.trace(PSEUDO_INERTIA_BASIS, axis1=1, axis2=2)
        constraint = PSEUDO_INERTIA_BASIS - margin * trace[:, None, None] * np.eye(4)
        return cls(scale, root, 2.0 * root.T @ root, unconstrained, constraint * scale[:, None, None])

    def squared(self, x: FloatArray) -> float:
        """The distance beyond its minimum."""
        return float(np.sum((self.root @ (x - self.unconstrained)) ** 2))

    def nearest(self, x: FloatArray, sharpness: float) -> FloatArray:
        """The minimum of sharpness times the distance, plus the barrier, from an x inside.

        Raises:
            LinAlgError: it did not settle.
        """
        square = sharpness * self.hessian
        return inside_barrier(x, square, lambda x: np.asarray(square @ (x - self.unconstrained)), self.constraint)


def inside_barrier(
    x: FloatArray, square: FloatArray, slope: Callable[[FloatArray], FloatArray], constraint: FloatArray
) -> FloatArray:
    """Minimum of f(x) - sum_i log det G(x_i) over bodies x_i, by Newton's method with exact derivatives.

    Args:
        x: (10 b,) parameters of b bodies with G(x_i) positive definite.
        square: (10 b, 10 b) Hessian of f, which is quadratic.
        slope: Its (10 b,) gradient.
        constraint: (10, 4, 4) G per parameter of a body.

    Raises:
        LinAlgError: it did not settle.
    """

    def derivatives(x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Gradient, and `_whitened`."""
        whitened = _whitened(x, constraint)
        return slope(x) - np.trace(whitened, axis1=-2, axis2=-1).ravel(), whitened

    gradient, whitened = derivatives(x)
    for _ in range(_NEWTON_STEPS):
        hessian = square.copy()
        for at, flat in enumerate(whitened.reshape(*whitened.shape[:2], -1)):
            own = slice(len(flat) * at, len(flat) * (at + 1))
            hessian[own, own] += flat @ flat.T
        step = -np.linalg.solve(hessian, gradient)
        decrement = float(-gradient @ step)
        if decrement < _NEWTON_DECREMENT:
            return x
        # The function is self-concordant: this length stays inside and descends. Longer steps are judged by the
        # slope, which suffers less from rounding than the function's value.
        length = 1.0 / (1.0 + np.sqrt(decrement)) if decrement > _NEAR_MINIMUM else 1.0
        gradient, whitened = derivatives(x + length * step)
        while length < 1.0:
            longer = min(2.0 * length, 1.0)
            try:
                trial = derivatives(x + longer * step)
            except np.linalg.LinAlgError:
                break
            if trial[0] @ step > 0.0:
                break
            length, (gradient, whitened) = longer, trial
        x = x + length * step
    if decrement > _NEAR_MINIMUM:
        raise np.linalg.LinAlgError(f"no minimum within {_NEWTON_STEPS} steps")
    return x


def _whitened(x: FloatArray, constraint: FloatArray) -> FloatArray:
    """(b, 10, 4, 4) L^-1 G_k L^-T per parameter of b bodies x (10 b,), with G = L L^T."""
    bodies = np.tensordot(x.reshape(-1, len(constraint)), constraint, 1)
    inverse = np.linalg.inv(np.linalg.cholesky(bodies))[:, None]
    return np.asarray(inverse @ constraint @ inverse.swapaxes(-1, -2))


def _ball(plain: InertialParameters, spread: float = 1.0) -> InertialParameters:
    """A small ball with the plain estimate's mass and centre of mass; its inertia is multiplied by a factor."""
    inertia = 2.0 * plain.mass_kg * _COMPACT_RADIUS_M**2 * spread * np.eye(3)
    return InertialParameters.from_center_of_mass(plain.mass_kg, plain.center_of_mass_m, inertia)


def _interior(plain: InertialParameters) -> FloatArray:
    """A body well inside the constraint, even with a distant centre of mass."""
    return _ball(plain, 1.0 + float(plain.center_of_mass_m @ plain.center_of_mass_m)).theta
