"""The common part of all models of an arm's own torque: links, rotors and their coupling, friction."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final

import numpy as np

from armload_identification.float_array import FloatArray
from armload_identification.identification_errors import ModelError
from armload_identification.model.finite_array import finite_array, set_fields
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
        links = finite_array("links of the body", self.links, (None, PARAMETERS))
        n = len(links)
        drives = {name: finite_array(f"{name} of the body", getattr(self, name), (n,)) for name in DRIVE_FIELDS}
        coupling = finite_array("coupling of the body", self.coupling, (n, n))
        if np.linalg.matrix_rank(coupling) < n:
            raise ModelError(f"the body's coupling {coupling.tolist()} has no inverse; expected q_joint = C q_axis")
        to_axis = np.linalg.inv(coupling)
        rotors = to_axis.T * drives["rotor_inertia_kg_m2"] @ to_axis
        set_fields(self, {"links": links, **drives, "coupling": coupling, "rotor_mass_kg_m2": rotors})

    @property
    def n(self) -> int:
        """Number of joints."""
        return int(self.links.shape[0])
