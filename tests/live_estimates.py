"""Hand-made estimates of a payload in the form of the recursive estimator's."""

from dataclasses import replace

import numpy as np

from armload_identification.model.payload import InertialParameters
from armload_identification.pipeline.recursive_estimator import LivePayload


def sphere(mass_kg, center_m):
    """A sphere with a given centre of mass."""
    return InertialParameters.from_center_of_mass(mass_kg, center_m, 0.004 * mass_kg * np.eye(3))


def live_estimate(n, mass_kg, width_kg, center_m, time_s=0.0, **changes):
    """An estimate from a long motion of an arm of n joints; its centre of mass is known within 5 mm."""
    plain = LivePayload(
        time_s=time_s,
        theta=np.zeros(10) if not mass_kg > 0.0 else sphere(mass_kg, center_m).theta,
        values=np.array([mass_kg, *center_m]),
        half_width_95=np.array([width_kg, 0.005, 0.005, 0.005]),
        determined=np.ones(4, dtype=bool),
        moving_s=np.full(n, 20.0),
        friction=np.zeros((3, n)),
        changes=0,
        changed_s=0.0,
        change_kg=0.0,
        contact=False,
        refused=0,
        covariance=1e-4 * np.eye(10),
        friction_covariance=np.zeros((n, 2, 2)),
    )
    return replace(plain, **changes)
