"""Rigid bodies in a robot's file: payloads, simulated links, and the arm's own links in `[body]`."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from armload_controller.config.tables.table_types import NonNegative, Positive, Vector3
from armload_identification.files.inertia_table import InertiaTable
from armload_identification.float_array import FloatArray
from armload_identification.model.dynamics import ArmBody
from armload_identification.model.payload import InertialParameters
from armload_identification.storage.strict_toml import BadValue, Table

if TYPE_CHECKING:
    from armload_drivers.simulation.plant_spec import RigidBody
    from armload_identification.excitation.geometry.cartesian_speed import CarriedSphere

_WATER_KG_M3 = 1000.0
"""Density of an envelope that a file does not state."""


class BodyTable(Table):
    """A rigid body: mass, centre of mass, inertia about it."""

    mass_kg: Positive
    center_of_mass_m: Vector3
    inertia_kg_m2: InertiaTable

    def rigid_body(self) -> RigidBody:
        """For the simulated arm."""
        from armload_drivers.simulation.plant_spec import RigidBody

        return RigidBody(self.mass_kg, np.array(self.center_of_mass_m), self.inertia_kg_m2.tensor())

    def inertial(self) -> InertialParameters:
        """For the identification."""
        return InertialParameters.from_center_of_mass(
            self.mass_kg, np.array(self.center_of_mass_m), self.inertia_kg_m2.tensor()
        )


class PayloadTable(BodyTable):
    """A physically possible body in the flange frame."""

    def __post_init__(self) -> None:
        if not self.inertial().is_physical:
            raise ValueError(
                "no mass distribution has this inertia about its centre of mass: the principal moments must be "
                "positive and each at most the sum of the other two"
            )


class CarriedPayloadTable(PayloadTable):
    """A payload that motions are planned for, with the radius of a sphere about its centre of mass that contains it."""

    envelope_radius_m: Positive | None = None

    def __post_init__(self) -> None:
        """Refuse a sphere that is too small for the payload's inertia."""
        super().__post_init__()
        radius_m, least_m = self.envelope_radius_m, self._radius_of_gyration_m
        if radius_m is not None and not radius_m >= 0.99 * least_m:  # the message rounds
            raise BadValue("envelope_radius_m", radius_m, f"expected at least {least_m:.3g}: the inertia requires it")

    def envelope(self, name: str) -> CarriedSphere:
        """The sphere, with the assumed radius if the file gives none."""
        from armload_identification.excitation.geometry.cartesian_speed import CarriedSphere

        radius_m = self.assumed_radius[0] if self.envelope_radius_m is None else self.envelope_radius_m
        return CarriedSphere(name, np.array(self.center_of_mass_m), radius_m)

    @property
    def assumed_radius(self) -> tuple[float, str]:
        """Radius of the same mass of water, or the radius of gyration if that is greater, in m, and which it is."""
        water_m = (3.0 * self.mass_kg / (4.0 * np.pi * _WATER_KG_M3)) ** (1.0 / 3.0)
        of_inertia = f"its inertia (its mass at the density of water: {water_m:.3f} m)"
        return max((water_m, "its mass at the density of water"), (self._radius_of_gyration_m, of_inertia))

    @property
    def _radius_of_gyration_m(self) -> float:
        """About the centre of mass: r^2 = tr(I) / (2 m) is the mean of the squared distances from it."""
        return float(np.sqrt(np.trace(self.inertia_kg_m2.tensor()) / (2.0 * self.mass_kg)))


class ArmLinkTable(BodyTable):
    """One link in its joint frame, with its joint's friction and the rotor of the axis with the same number.

    If `[transmission]` couples the motors, the rotor turns with q_axis = C^-1 q_joint.
    """

    reflected_rotor_inertia_kg_m2: NonNegative
    coulomb_nm: NonNegative
    viscous_nm_s_rad: NonNegative


class ArmBodyTable(Table):
    """The arm's own links, from its manufacturer or a CAD model."""

    links: list[ArmLinkTable]

    def arm_body(self, coupling: FloatArray) -> ArmBody:
        """Links, rotors and friction for the dynamics.

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
