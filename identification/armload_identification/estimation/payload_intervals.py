"""95 % intervals of the ten quantities of a payload, from the posterior of its problem."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from armload_identification.estimation.physical_consistency import possible_spread, root_of
from armload_identification.float_array import FloatArray
from armload_identification.model.payload import (
    CONFIDENCE,
    DETERMINED_SHARE,
    PARAMETER_NAMES,
    InertialParameters,
    derived,
    value_scale,
)

if TYPE_CHECKING:
    from armload_identification.estimation.payload_from_posterior import PayloadEstimate

NORMAL_HALF_WIDTH: Final = 1.9599639845400536
"""Half width of the 95 % interval of a normal distribution, in standard deviations. A literal, as the modules that
compute it take as long to load as a loop's own; a test compares the two."""
ONE_SIDED: Final = 1.645
"""Standard deviations within which a value is with 95 %, on one side."""


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
    from scipy.special import stdtrit

    return np.asarray(stdtrit(freedom, 0.5 + 0.5 * CONFIDENCE))


def quantify(found: PayloadEstimate, parameters: InertialParameters) -> Uncertainty:
    """Intervals of the ten quantities.

    Args:
        parameters: The reported parameters, at which derivatives are taken and intervals centred.

    Returns:
        Intervals, and which values are determined.
    """
    values, slope = derived(parameters)
    variance, freedom = found.spread(slope)
    width = student_half_width(freedom) * np.sqrt(variance) * _share_of_possible(found, parameters)
    return Uncertainty(
        values=values,
        half_width_95=width,
        degrees_of_freedom=freedom,
        determined=width <= DETERMINED_SHARE * value_scale(abs(parameters.mass_kg)),
        covariance=found.covariance,
    )


def _share_of_possible(found: PayloadEstimate, parameters: InertialParameters) -> FloatArray:
    """(10,) share, up to 1, of the errors about the reported values that leave a possible body.

    An estimate further from every possible body than its errors explain has greater ones.
    """
    if found.rank < found.theta.size:
        return np.ones(len(found.theta))
    values, slope = derived(parameters)
    try:
        root = root_of(found.covariance)
        apart = float(np.linalg.norm(root @ (parameters.theta - found.theta)))
        doubt = max(1.0, apart / NORMAL_HALF_WIDTH)
        mean, covariance = possible_spread(InertialParameters(found.theta), root / doubt)
    except np.linalg.LinAlgError:  # not seen: 0 of 3,000 random bodies and covariances
        return np.ones(len(found.theta))
    away = mean.values - values
    free, kept = (np.sum((slope @ of) * slope, axis=1) for of in (found.covariance, covariance))
    return np.asarray(np.minimum(np.sqrt((kept + away**2) / free), 1.0))
