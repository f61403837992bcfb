"""95 % intervals of the ten quantities of a payload, from the posterior of its problem."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from armload_core.arrays import FloatArray
from armload_identification.model.payload import (
    CONFIDENCE,
    DETERMINED_SHARE,
    PARAMETER_NAMES,
    InertialParameters,
    derived,
    value_scale,
)

if TYPE_CHECKING:
    from armload_identification.estimation.payload_estimate import PayloadEstimate

NORMAL_HALF_WIDTH: Final = 1.9599639845400536
"""Half width of the 95 % interval of a normal distribution, in standard deviations. A literal, as the modules that
compute it take as long to load as a loop's own; a test compares the two."""
ONE_SIDED: Final = 1.645
"""Standard deviations within which a value is with 95 %, on one side."""
_NEWTON_STEPS: Final = 6
_NEARLY_NORMAL: Final = 1e8
"""Degrees of freedom from which on the distribution is normal to 1e-8."""


@dataclass(frozen=True, eq=False)
class Uncertainty:
    """Uncertainty of the ten quantities of a payload file, in the order of `PARAMETER_NAMES`.

    Attributes:
        values: (10,) mass, centre of mass, inertia about the centre of mass.
        half_width_95: (10,) half width of the 95 % interval; inf where the data contain no information.
        degrees_of_freedom: (10,) of Student's t.
        determined: (10,) True for values with a half width of at most `DETERMINED_SHARE` of their scale.
        covariance: (10, 10) of theta, robust; without undetermined directions.
        limits: (10, 2) known ranges that limit the intervals; None without any.
    """

    values: FloatArray
    half_width_95: FloatArray
    degrees_of_freedom: FloatArray
    determined: NDArray[np.bool_]
    covariance: FloatArray
    limits: FloatArray | None = None

    @property
    def interval_95(self) -> FloatArray:
        """(10, 2) low and high."""
        both = np.stack([self.values - self.half_width_95, self.values + self.half_width_95], axis=1)
        return both if self.limits is None else np.clip(both, self.limits[:, :1], self.limits[:, 1:])

    @property
    def undetermined_names(self) -> tuple[str, ...]:
        """Names of the values that are not determined."""
        return tuple(name for name, known in zip(PARAMETER_NAMES, self.determined, strict=True) if not known)


def student_half_width(freedom: float | FloatArray) -> FloatArray:
    """Half width of the 95 % interval of Student's t distribution, in standard deviations.

    Args:
        freedom: Degrees of freedom of at least 1, of any shape.
    """
    return np.asarray(np.vectorize(_student, otypes=[np.float64])(freedom))


def _student(freedom: float) -> float:
    """The same of one number. scipy.special has it too, but takes twice as long to load as NumPy.

    Of the angle with t = sqrt(nu) tan(angle), the density is a power of its cosine; it falls, so that Newton's steps
    from the normal distribution's, which is below, do not overshoot.
    """
    if freedom > _NEARLY_NORMAL:
        return NORMAL_HALF_WIDTH
    root = math.sqrt(freedom)
    scale = 2.0 / math.sqrt(math.pi) * math.exp(math.lgamma(0.5 * freedom + 0.5) - math.lgamma(0.5 * freedom))
    angle = math.atan(NORMAL_HALF_WIDTH / root)
    nodes, weights = _quadrature()
    for _ in range(_NEWTON_STEPS):
        within = 0.5 * scale * angle * float(weights @ np.cos(0.5 * angle * (nodes + 1.0)) ** (freedom - 1.0))
        angle += (CONFIDENCE - within) / (scale * math.cos(angle) ** (freedom - 1.0))
    return root * math.tan(angle)


@cache
def _quadrature() -> tuple[FloatArray, FloatArray]:
    """Nodes and weights of Gauss and Legendre; computed when first used, as their module takes long to load."""
    nodes, weights = np.polynomial.legendre.leggauss(16)
    return nodes, weights


def quantify(found: PayloadEstimate, parameters: InertialParameters) -> Uncertainty:
    """Intervals of the ten quantities.

    Args:
        parameters: The reported parameters, at which derivatives are taken and intervals centred.

    Returns:
        Intervals, and which values are determined.
    """
    values, slope = derived(parameters)
    variance, freedom = found.spread(slope)
    width = student_half_width(freedom) * np.sqrt(variance)
    return Uncertainty(
        values=values,
        half_width_95=width,
        degrees_of_freedom=freedom,
        determined=width <= DETERMINED_SHARE * value_scale(abs(parameters.mass_kg)),
        covariance=found.covariance,
    )
