"""`[simulation]`: the simulated twin of an arm."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Literal

import msgspec
from msgspec import Meta

from armload_controller.config.tables.body_tables import BodyTable, PayloadTable
from armload_controller.config.tables.joint_table import JointTable
from armload_controller.config.tables.table_types import NonNegative, Positive, Share
from armload_drivers.simulation.servo_loops import BRAKE_DELAY_S
from armload_identification.float_array import FloatArray
from armload_identification.storage.strict_toml import BadValue, Table

if TYPE_CHECKING:
    from armload_drivers.simulation.plant_spec import PlantJoint


class SimulatedJointTable(Table):
    """True parameters of one simulated joint."""

    link: BodyTable
    reflected_rotor_inertia_kg_m2: NonNegative
    coulomb_nm: NonNegative
    viscous_nm_s_rad: NonNegative
    stribeck_nm: NonNegative
    stribeck_velocity_rad_s: Positive
    load_friction: Share
    torque_ripple_nm: NonNegative
    ripple_per_motor_turn: Annotated[int, Meta(ge=1)]
    brake_torque_nm: Positive | None = None
    brake_delay_s: NonNegative = BRAKE_DELAY_S

    def plant_joint(self, joint: JointTable, placement: FloatArray, axis: FloatArray) -> PlantJoint:
        """For the simulated arm.

        Args:
            joint: The joint's table in `[[joints]]`.
            placement: (4, 4) pose of its frame in the previous one.
            axis: (3,) its axis in its own frame.
        """
        from armload_drivers.simulation.plant_spec import PlantJoint

        truth = msgspec.structs.asdict(self) | {"link": self.link.rigid_body()}
        return PlantJoint(
            **truth,
            name=joint.name,
            placement=placement,
            axis=axis,
            gear_ratio=joint.gear_ratio or 1.0,
            torque_noise_nm=joint.torque_noise_nm,
            max_torque_nm=joint.torque_max_nm,
            has_brake=joint.drive.has_brake if joint.drive else True,
        )


class SimulationTable(Table):
    """The simulated twin."""

    seed: int
    payload: str
    start_position_rad: list[float]
    variant: Literal["normative", "harsh"] = "normative"
    payloads: dict[str, PayloadTable]
    joints: list[SimulatedJointTable]

    def check(self, joints: list[JointTable]) -> None:
        """Refuse a twin that does not fit the joints.

        Raises:
            BadValue: naming the key.
        """
        for key in ("joints", "start_position_rad"):
            found, n = len(getattr(self, key)), len(joints)
            if found != n:
                raise BadValue(f"simulation.{key}", f"{found} entries", f"expected one per joint, {n} in this file")
        for joint, start in zip(joints, self.start_position_rad, strict=True):
            if not joint.position_min_rad <= start <= joint.position_max_rad:
                expected = f"{joint.name} must be between {joint.position_min_rad} and {joint.position_max_rad}"
                raise BadValue("simulation.start_position_rad", start, expected)
        if self.payload not in self.payloads:
            raise BadValue("simulation.payload", self.payload, f"expected one of {', '.join(sorted(self.payloads))}")
        for number, joint in enumerate(joints, start=1):
            missing = joint.drive.missing_scale() if joint.drive is not None else None
            if missing is not None:
                raise BadValue(f"joints[{number}].drive.{missing}", None, "a simulated drive needs its scale here")
