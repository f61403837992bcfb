"""The names of the estimators; what they do is in `estimators`. Light, so that a command line may offer them."""

from __future__ import annotations

from enum import StrEnum


class Estimator(StrEnum):
    """How a payload is fitted to a torque difference; identification/README.md has what chose the default."""

    OLS = "ols"
    """Least squares with equal weights, as in the paper."""
    WLS = "wls"
    """Weights by each joint's noise: from the scatter between periods, else from the residual."""
    ROBUST = "robust"
    """Weights by each joint's residual, reversals and outliers weighing less (Huber)."""
    FRICTION = "friction"
    """Weights by each joint's residual, reversals weighing less, friction columns where the data justify them."""
