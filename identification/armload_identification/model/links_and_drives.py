"""The common part of all models of an arm's own torque: links, rotors and their coupling, friction."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from armload_core.arrays import FloatArray
from armload_identification.identification_errors import ModelError
from armload_identification.model.regressor import PARAMETERS

DRIVE_FIELDS: Final = ("rotor_inertia_kg_m2", "viscous_nm_s_rad", "coulomb_nm")
"""Parameters of the drives, one number per joint."""


@dataclass(frozen=True, eq=False)
class LinksAndDrives:
    """Links, rotors and friction of an arm of n joints.

    `ArmBody` holds them as specified, with checks of their signs; `BodyModel` holds them as identified, where links are
    base parameters and noise can make a number negative.

    Attributes:
        links: (n, 10) inertial parameters of each link in its own JOINT frame, in the order of theta.
        rotor_inertia_kg_m2: (n,) inertia of each AXIS's rotor times the square of the gear ratio.
        viscous_nm_s_rad: (n,) friction per speed.
        coulomb_nm: (n,) friction independent of speed.
        coupling: (n, n) C with q_joint = C q_axis; the identity if every motor moves only its own joint.
        rotor_mass_kg_m2: (n, n) C^-T diag(I_r) C^-1, the rotors' part of the mass matrix in joint coordinates.

    Raises:
        ModelError: shapes that do not fit, a number that is not finite, or a coupling without an inverse.
    """

    links: FloatArray
    rotor_inertia_kg_m2: FloatArray
    viscous_nm_s_rad: FloatArray
    coulomb_nm: FloatArray
    coupling: FloatArray
    rotor_mass_kg_m2: FloatArray = field(init=False, repr=False)

    def __post_init__(self) -> None:
        links = np.array(self.links, dtype=np.float64)
        if links.ndim != 2 or links.shape[1] != PARAMETERS or not np.all(np.isfinite(links)):
            raise ModelError(f"links are {links.tolist()}; expected ten finite numbers per joint")
        object.__setattr__(self, "links", links)
        for name in DRIVE_FIELDS:
            values = np.array(getattr(self, name), dtype=np.float64)
            require_finite(name, values, links.shape[:1])
            object.__setattr__(self, name, values)
        coupling = np.array(self.coupling, dtype=np.float64)
        require_finite("coupling", coupling, (self.n, self.n))
        if np.linalg.matrix_rank(coupling) < self.n:
            raise ModelError(f"the body's coupling {coupling.tolist()} has no inverse; expected q_joint = C q_axis")
        object.__setattr__(self, "coupling", coupling)
        to_axis = np.linalg.inv(coupling)
        object.__setattr__(self, "rotor_mass_kg_m2", to_axis.T * self.rotor_inertia_kg_m2 @ to_axis)

    @property
    def n(self) -> int:
        """Number of joints."""
        return int(self.links.shape[0])


def require_finite(name: str, value: ArrayLike, shape: tuple[int, ...]) -> None:
    """Raise unless a field has the expected shape and finite values.

    Raises:
        ModelError: naming the field, its shape or its numbers, and what was expected.
    """
    array = np.asarray(value)
    if array.shape != shape:
        raise ModelError(f"{name} of the body has shape {array.shape}; expected {shape}")
    if not np.isfinite(array).all():
        raise ModelError(f"{name} of the body contains a number that is not finite: {array.tolist()}")
