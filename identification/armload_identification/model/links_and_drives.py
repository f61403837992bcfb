"""The part that every model of an arm's own torque has: its links, and the rotor and friction of each joint."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from armload_core.arrays import FloatArray
from armload_identification.identification_errors import ModelError
from armload_identification.model.regressor import PARAMETERS

DRIVE_FIELDS: Final = ("rotor_inertia_kg_m2", "viscous_nm_s_rad", "coulomb_nm")
"""What each joint's drive has, one number per joint."""


@dataclass(frozen=True, eq=False)
class LinksAndDrives:
    """Links, rotors and friction of an arm of n joints.

    `ArmBody` holds them as specified and refuses what no arm has; `BodyModel` holds them as identified, where links
    are base parameters and noise may leave a number below zero.

    Attributes:
        links: (n, 10) inertial parameters of each link in its own JOINT frame, in the order of theta.
        rotor_inertia_kg_m2: (n,) inertia of each rotor, reflected through the gear: ratio squared times its own.
        viscous_nm_s_rad: (n,) friction per speed.
        coulomb_nm: (n,) friction at any speed.

    Raises:
        ModelError: shapes that do not fit, or a number that is not finite.
    """

    links: FloatArray
    rotor_inertia_kg_m2: FloatArray
    viscous_nm_s_rad: FloatArray
    coulomb_nm: FloatArray

    def __post_init__(self) -> None:
        links = np.array(self.links, dtype=np.float64)
        if links.ndim != 2 or links.shape[1] != PARAMETERS or not np.all(np.isfinite(links)):
            raise ModelError(f"links are {links.tolist()}; expected ten finite numbers per joint")
        object.__setattr__(self, "links", links)
        for name in DRIVE_FIELDS:
            values = np.array(getattr(self, name), dtype=np.float64)
            require_finite(name, values, links.shape[:1])
            object.__setattr__(self, name, values)

    @property
    def n(self) -> int:
        """Number of joints."""
        return int(self.links.shape[0])


def require_finite(name: str, value: ArrayLike, shape: tuple[int, ...]) -> None:
    """Refuse a field of another shape, or one that is not finite.

    Args:
        name: Of the field.
        value: What it holds.
        shape: Expected of it.

    Raises:
        ModelError: naming the field, its shape or its numbers, and what was expected.
    """
    array = np.asarray(value)
    if array.shape != shape:
        raise ModelError(f"{name} of the body has the shape {array.shape}; expected {shape}")
    if not np.isfinite(array).all():
        raise ModelError(f"{name} of the body holds a number that is not finite: {array.tolist()}")
