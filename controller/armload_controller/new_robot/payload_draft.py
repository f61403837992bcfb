"""The payload of which only the mass is known: a cube in front of the flange."""

from __future__ import annotations

from typing import Final

import numpy as np

from armload_identification.excitation.geometry.workspace import Sphere
from armload_identification.model.payload import InertialParameters

DENSITY_KG_M3: Final = 2000.0


def cube(mass_kg: float) -> InertialParameters:
    """A payload of known mass, assumed to be a cube in front of the flange."""
    edge = _edge_m(mass_kg)
    return InertialParameters.from_center_of_mass(
        mass_kg, np.array([0.0, 0.0, 0.5 * edge]), mass_kg * edge**2 / 6.0 * np.eye(3)
    )


def tool_sphere(n: int, mass_kg: float | None) -> Sphere:
    """The sphere around that cube; around the flange if the mass is unknown.

    Args:
        mass_kg: Mass of the payload; None if unknown.
    """
    edge = 0.1 if mass_kg is None else _edge_m(mass_kg)
    return Sphere(n + 1, np.array([0.0, 0.0, 0.5 * edge]), 0.87 * edge)


def _edge_m(mass_kg: float) -> float:
    return float((mass_kg / DENSITY_KG_M3) ** (1.0 / 3.0))
