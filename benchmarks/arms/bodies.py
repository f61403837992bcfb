"""Payloads to identify: solid bodies of uniform density, given by size, mass and position on the flange."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from armload_drivers.simulation.plant_spec import RigidBody
from armload_identification.model.payload import InertialParameters


@dataclass(frozen=True, slots=True)
class Cuboid:
    """A payload in the flange frame.

    Attributes:
        what: Its name.
        mass_kg: Mass.
        center_m: Centre of mass.
        size_m: Edges along the flange's axes before the rotation.
        turned_rad: Rotation about the flange's x and then about its z by the same angle, so that there are products of
            inertia.
    """

    what: str
    mass_kg: float
    center_m: tuple[float, float, float]
    size_m: tuple[float, float, float]
    turned_rad: float = 0.0

    def rigid_body(self) -> RigidBody:
        """As a body of the plant."""
        square = np.square(self.size_m)
        principal = np.diag(self.mass_kg / 12.0 * (square.sum() - square))
        c, s = np.cos(self.turned_rad), np.sin(self.turned_rad)
        about_x = np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])
        about_z = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        turn = about_z @ about_x
        return RigidBody(self.mass_kg, np.array(self.center_m), turn @ principal @ turn.T)

    def inertial(self) -> InertialParameters:
        """As inertial parameters."""
        body = self.rigid_body()
        return InertialParameters.from_center_of_mass(body.mass_kg, body.center_of_mass_m, body.inertia_kg_m2)


ER50_PAYLOADS = (
    Cuboid("pen holder", 0.5, (0.0, 0.02, 0.06), (0.06, 0.06, 0.12)),
    Cuboid("camera on an arm", 1.0, (0.12, 0.0, 0.15), (0.10, 0.08, 0.08), 0.3),
    Cuboid("flat suction frame", 2.0, (0.0, 0.0, 0.05), (0.50, 0.40, 0.02)),
    Cuboid("long gripper", 3.0, (0.0, -0.03, 0.25), (0.08, 0.10, 0.45)),
    Cuboid("bar across the flange", 4.0, (0.10, 0.05, 0.04), (0.60, 0.05, 0.05), 0.5),
    Cuboid("welding torch, far out", 5.0, (0.25, 0.0, 0.20), (0.30, 0.10, 0.10), 0.4),
    Cuboid("flat sheet, hanging", 7.0, (0.0, 0.20, 0.10), (0.80, 0.50, 0.01), 0.2),
    Cuboid("spindle", 10.0, (0.0, 0.05, 0.15), (0.15, 0.15, 0.35)),
    Cuboid("gearbox, far off-centre", 13.0, (0.15, -0.15, 0.10), (0.25, 0.20, 0.20), 0.6),
    Cuboid("rated load", 16.0, (0.02, 0.0, 0.12), (0.20, 0.20, 0.20)),
)
"""For er50, rated 16 kg."""

PRBT_PAYLOADS = (
    Cuboid("sensor", 0.3, (0.0, 0.01, 0.03), (0.05, 0.05, 0.05)),
    Cuboid("suction cup", 0.6, (0.01, 0.0, 0.05), (0.04, 0.04, 0.10)),
    Cuboid("camera on an arm", 1.0, (0.08, 0.0, 0.08), (0.08, 0.06, 0.06), 0.3),
    Cuboid("flat plate", 1.5, (0.0, 0.0, 0.03), (0.30, 0.25, 0.01)),
    Cuboid("long gripper", 2.0, (0.0, -0.02, 0.15), (0.06, 0.08, 0.28)),
    Cuboid("bar across the flange", 2.5, (0.06, 0.03, 0.03), (0.35, 0.04, 0.04), 0.5),
    Cuboid("screwdriver, far out", 3.0, (0.12, 0.0, 0.10), (0.20, 0.06, 0.06), 0.4),
    Cuboid("flat sheet, off-centre", 4.0, (0.0, 0.10, 0.05), (0.40, 0.30, 0.01), 0.2),
    Cuboid("gripper with a part", 5.0, (0.03, -0.02, 0.08), (0.10, 0.12, 0.15), 0.3),
    Cuboid("rated load", 6.0, (0.02, 0.02, 0.06), (0.12, 0.12, 0.12)),
)
"""For prbt, rated 6 kg."""

CALIBRATION_LOAD = Cuboid("weighed disc pack", 15.0, (0.0, 0.0, 0.06), (0.24, 0.24, 0.10))
"""Payload for the calibration of gains: heavy, compact, at another position than the paper's payload."""
