"""The names of the estimators, which `estimators` implements; cheap to import, for the command line."""

from __future__ import annotations

from enum import StrEnum
from typing import Literal

from armload_identification.identification_errors import EstimationError

EstimatorName = Literal["ols", "wls", "robust", "friction"]
"""Name of an `Estimator`, for callers from Python."""


class Estimator(StrEnum):
    """How a payload is fitted to a torque difference; identification/README.md explains the choice of the default.

    Attributes:
        description: How the joints are weighted, and what else is fitted.
    """

    description: str

    def __new__(cls, name: str, description: str) -> Estimator:
        """A member whose value is its name."""
        member = str.__new__(cls, name)
        member._value_ = name
        member.description = description
        return member

    OLS = "ols", "all joints weighted equally, as in the paper"
    WLS = "wls", "weighted by each joint's noise"
    ROBUST = "robust", "weighted by each joint's residual, less at reversals and for outliers"
    FRICTION = (
        "friction",
        "weighted by each joint's residual, less at reversals; load-dependent friction and changes of viscous friction "
        "are fitted if the data justify it",
    )


def named_estimator(name: str) -> Estimator:
    """An estimator by its name.

    Args:
        name: One of `EstimatorName`, or an `Estimator`.

    Raises:
        EstimationError: there is no such estimator.
    """
    for estimator in Estimator:
        if estimator == name:
            return estimator
    raise EstimationError(f"estimator is {name!r}; expected one of {', '.join(Estimator)}")
