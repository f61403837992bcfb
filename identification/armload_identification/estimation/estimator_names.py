"""The names of the estimators, which `estimators` implements; cheap to import, for the command line."""

from __future__ import annotations

from enum import StrEnum
from typing import Literal

from armload_identification.identification_errors import EstimationError

EstimatorName = Literal["ols", "wls", "robust", "friction"]
"""Name of an `Estimator`, for callers from Python."""


class Estimator(StrEnum):
    """How a payload is fitted to a torque difference; identification/README.md explains the choice of the default."""

    OLS = "ols"
    """Least squares with equal weights, as in the paper."""
    WLS = "wls"
    """Weights by each joint's noise: from the scatter between periods, else from the residual."""
    ROBUST = "robust"
    """Weights by each joint's residual, reversals and outliers weighing less (Huber)."""
    FRICTION = "friction"
    """Weights by each joint's residual, reversals weighing less, friction columns where the data justify them."""


def named_estimator(name: str) -> Estimator:
    """An estimator by its name.

    Args:
        name: One of `EstimatorName`, or an `Estimator`.

    Raises:
        EstimationError: there is no such estimator.
    """
    if name not in tuple(Estimator):
        raise EstimationError(f"estimator is {name!r}; expected one of {', '.join(Estimator)}")
    return Estimator(name)
