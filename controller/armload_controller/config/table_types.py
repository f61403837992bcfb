"""What several tables of a robot's file are made of: strict tables, numbers with a range, poses, rigid bodies."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator

from armload_core.arrays import FloatArray
from armload_drivers.simulation.plant_spec import RigidBody
from armload_identification.model.payload import InertialParameters

Positive = Annotated[float, Field(gt=0)]
NonNegative = Annotated[float, Field(ge=0)]
Vector3 = Annotated[list[float], Field(min_length=3, max_length=3)]


class Table(BaseModel):
    """A table in which every key is known and every number a finite number."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)


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
        """As the plant takes it."""
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


class PoseTable(Table):
    """A frame in another."""

    xyz_m: Vector3
    rpy_rad: Vector3
