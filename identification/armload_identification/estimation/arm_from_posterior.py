"""The body of an arm from the posterior of its terms."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from armload_identification.estimation.arm_terms import (
    COULOMB,
    LINKS,
    LOAD_FRICTION,
    ROOT,
    ROTORS,
    VISCOUS,
)
from armload_identification.estimation.posterior import Posterior
from armload_identification.float_array import FloatArray
from armload_identification.model.body_model import BodyModel
from armload_identification.model.regressor import PARAMETERS


def identified_body(
    found: Posterior, base: NDArray[np.bool_], reversal_speed_rad_s: FloatArray, changes: FloatArray
) -> BodyModel:
    """The arm with its friction in one run, or without changes that of all.

    Args:
        found: The solution.
        base: (10 n,) True for the base parameters of the links.
        reversal_speed_rad_s: (n,) v in the direction of motion.
        changes: (3, n) of the run's Coulomb friction, viscous friction and offset.
    """
    links = np.zeros(base.size)
    links[base] = found.value(LINKS)
    coulomb, viscous, offset = changes
    return BodyModel(
        links=links.reshape(-1, PARAMETERS),
        base=base.reshape(-1, PARAMETERS),
        rotor_inertia_kg_m2=found.value(ROTORS),
        coulomb_nm=found.value(COULOMB) + coulomb,
        viscous_nm_s_rad=found.value(VISCOUS) + viscous,
        root_nm=found.value(ROOT),
        offset_nm=offset,
        load_friction=found.value(LOAD_FRICTION),
        torque_delay_s=found.delay_s,
        reversal_speed_rad_s=reversal_speed_rad_s,
        coupling=found.problem.coupling,
    )
