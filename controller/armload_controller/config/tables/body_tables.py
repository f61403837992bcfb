"""Rigid bodies in a robot's file: payloads, simulated links, and `[body]`, what the arm itself is made of."""

from __future__ import annotations

import numpy as np
from pydantic import model_validator

from armload_controller.config.tables.table_types import NonNegative, Positive, Vector3
from armload_core.arrays import FloatArray
from armload_drivers.simulation.plant_spec import RigidBody
from armload_identification.model.dynamics import ArmBody
from armload_identification.model.payload import InertialParameters
from armload_identification.storage.strict_toml import Table


class InertiaTable(Table):
    """Tensor elements, kg m2."""

    ixx: float
    iyy: float
    izz: float
    ixy: float
    ixz: float
    iyz: float

    def tensor(self) -> FloatArray:
        """(3, 3) symmetric tensor."""
        return np.array(
            [[self.ixx, self.ixy, self.ixz], [self.ixy, self.iyy, self.iyz], [self.ixz, self.iyz, self.izz]]
        )


class BodyTable(Table):
    """A rigid body: mass, centre of mass, inertia about it."""

    mass_kg: Positive
    center_of_mass_m: Vector3
    inertia_kg_m2: InertiaTable

    def rigid_body(self) -> RigidBody:
        """As the simulated arm takes it."""
        return RigidBody(self.mass_kg, np.array(self.center_of_mass_m), self.inertia_kg_m2.tensor())

    def inertial(self) -> InertialParameters:
        """As the identification takes it."""
        return InertialParameters.from_center_of_mass(
            self.mass_kg, np.array(self.center_of_mass_m), self.inertia_kg_m2.tensor()
        )


class PayloadTable(BodyTable):
    """A body in the flange frame that some mass distribution can have."""

    @model_validator(mode="after")
    def _possible(self) -> PayloadTable:
        if not self.inertial().is_physical:
            raise ValueError(
                "no mass distribution has this inertia about its centre of mass: the principal moments must be "
                "positive and each at most the sum of the other two"
            )
        return self


class ArmLinkTable(BodyTable):
    """One link in its joint frame, with its joint's friction and the rotor of the axis of the same number.

    Where `[transmission]` couples motors, that rotor turns with q_axis = C^-1 q_joint.
    """

    reflected_rotor_inertia_kg_m2: NonNegative
    coulomb_nm: NonNegative
    viscous_nm_s_rad: NonNegative


class ArmBodyTable(Table):
    """What the arm itself is made of, from its manufacturer or a CAD model."""

    links: list[ArmLinkTable]

    def arm_body(self, coupling: FloatArray) -> ArmBody:
        """Links, rotors and friction as the dynamics take them.

        Args:
            coupling: (n, n) C with q_joint = C q_axis.
        """
        return ArmBody(
            np.array([link.inertial().theta for link in self.links]),
            np.array([link.reflected_rotor_inertia_kg_m2 for link in self.links]),
            np.array([link.viscous_nm_s_rad for link in self.links]),
            np.array([link.coulomb_nm for link in self.links]),
            coupling,
        )
