"""What a robot's TOML file may hold: tables and keys, each key with its unit.

Every limit must be given, an unknown key is an error, numbers must be numbers. A problem becomes one
`ConfigurationError` with file, key, the value found and what was expected.
"""

from __future__ import annotations

import difflib
from typing import Annotated, Any, Literal, get_args

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from armload_controller.errors import ConfigurationError
from armload_drivers.plant_spec import RigidBody
from armload_drivers.servos import FloatArray
from armload_identification.payload import InertialParameters

Positive = Annotated[float, Field(gt=0)]
NonNegative = Annotated[float, Field(ge=0)]
Vector3 = Annotated[list[float], Field(min_length=3, max_length=3)]


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)


class InertiaTable(_Table):
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


class BodyTable(_Table):
    """A rigid body: mass, centre of mass, inertia about it."""

    mass_kg: Positive
    center_of_mass_m: Vector3
    inertia_kg_m2: InertiaTable

    def rigid_body(self) -> RigidBody:
        """As the plant takes it."""
        return RigidBody(self.mass_kg, np.array(self.center_of_mass_m), self.inertia_kg_m2.tensor())


class PayloadTable(BodyTable):
    """A body in the flange frame that some mass distribution can have."""

    def inertial(self) -> InertialParameters:
        """As the identification takes it."""
        return InertialParameters.from_center_of_mass(
            self.mass_kg, np.array(self.center_of_mass_m), self.inertia_kg_m2.tensor()
        )

    @model_validator(mode="after")
    def _possible(self) -> PayloadTable:
        if not self.inertial().is_physical:
            raise ValueError(
                "no mass distribution has this inertia about its centre of mass: the principal moments must be "
                "positive and each at most the sum of the other two"
            )
        return self


class RobotTable(_Table):
    """What the arm is."""

    name: str
    description: str
    rated_payload_kg: Positive
    gravity_m_s2: Vector3


class PoseTable(_Table):
    """A frame in another."""

    xyz_m: Vector3
    rpy_rad: Vector3


class DhRowTable(_Table):
    """One Denavit-Hartenberg row."""

    alpha_rad: float
    a_m: float
    d_m: float
    theta_rad: float


class OriginTable(PoseTable):
    """One joint's frame in the previous one, and its axis."""

    axis: Vector3


class KinematicsTable(_Table):
    """Rows or origins, and the flange in the last frame."""

    convention: Literal["modified-dh", "standard-dh", "joint-origins"]
    rows: list[DhRowTable] | None = None
    origins: list[OriginTable] | None = None
    flange: PoseTable

    @model_validator(mode="after")
    def _one_description(self) -> KinematicsTable:
        wanted, other = ("origins", "rows") if self.convention == "joint-origins" else ("rows", "origins")
        if getattr(self, wanted) is None or getattr(self, other) is not None:
            raise ValueError(f'with convention = "{self.convention}" give {wanted} and not {other}')
        return self

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.rows or self.origins or ())


class TransmissionTable(_Table):
    """Coupled motors: q_joint = C q_axis."""

    coupling: list[list[float]]


class ExcitationTable(_Table):
    """Excitation files beside this one."""

    identification: str
    validation: str


class BusTable(_Table):
    """The CANopen bus."""

    interface: str
    channel: str
    bitrate: Annotated[int, Field(ge=10_000, le=1_000_000)]
    cycle_hz: Annotated[float, Field(gt=0, le=1000)]
    heartbeat_s: Positive
    max_missing_cycles: Annotated[int, Field(ge=0)]


class LogTable(_Table):
    """Columns of foreign logs, counted from 0."""

    time_column: Annotated[int, Field(ge=0)]
    position_columns: list[int]
    velocity_columns: list[int] | None = None
    current_columns: list[int]


class IdentityTable(_Table):
    """What object 1018 has to say."""

    vendor_id: int
    product_code: int
    revision: int | None = None


class DriveTable(_Table):
    """One joint's drive."""

    node_id: Annotated[int, Field(ge=1, le=127)]
    mode: Literal["csp", "ip"]
    feedback: Literal["current", "torque"]
    counts_per_axis_turn: Positive
    rated_current_a: Positive | None = None
    rated_torque_nm: Positive
    max_torque_permille: Annotated[int, Field(ge=1, le=65535)]
    following_error_rad: Positive
    has_brake: bool
    identity: IdentityTable | None = None

    @model_validator(mode="after")
    def _rated_current(self) -> DriveTable:
        if self.feedback == "current" and self.rated_current_a is None:
            raise ValueError('feedback = "current" needs rated_current_a: 6078 is per mille of it')
        return self


class JointTable(_Table):
    """One joint and its limits."""

    name: str
    position_min_rad: float
    position_max_rad: float
    velocity_max_rad_s: Positive
    acceleration_max_rad_s2: Positive
    jerk_max_rad_s3: Positive
    torque_max_nm: Positive
    torque_noise_nm: Positive
    gear_ratio: Positive | None = None
    torque_constant_nm_a: Positive | None = None
    drive: DriveTable | None = None

    @model_validator(mode="after")
    def _ordered(self) -> JointTable:
        if self.position_min_rad >= self.position_max_rad:
            raise ValueError(
                f"position_min_rad = {self.position_min_rad} is not below position_max_rad = "
                f"{self.position_max_rad}: exchange them"
            )
        return self


class SimulatedJointTable(_Table):
    """The truth about one simulated joint."""

    link: BodyTable
    reflected_rotor_inertia_kg_m2: NonNegative
    coulomb_nm: NonNegative
    viscous_nm_s_rad: NonNegative
    stribeck_nm: NonNegative
    stribeck_velocity_rad_s: Positive
    load_friction: Annotated[float, Field(ge=0, lt=1)]
    torque_ripple_nm: NonNegative
    ripple_per_motor_turn: Annotated[int, Field(ge=1)]


class SimulationTable(_Table):
    """The simulated twin."""

    seed: int
    payload: str
    start_position_rad: list[float]
    variant: Literal["normative", "harsh"] = "normative"
    payloads: dict[str, PayloadTable]
    joints: list[SimulatedJointTable]


class RobotFile(_Table):
    """The whole file."""

    robot: RobotTable
    kinematics: KinematicsTable
    transmission: TransmissionTable | None = None
    expected_payload: PayloadTable | None = None
    excitation: ExcitationTable | None = None
    bus: BusTable | None = None
    log: LogTable | None = None
    joints: Annotated[list[JointTable], Field(min_length=1)]
    simulation: SimulationTable | None = None


def explained(file: str, error: ValidationError, prefix: str = "") -> ConfigurationError:
    """The first problem that pydantic found, as file, key, value and what was expected."""
    problems = error.errors()
    first = problems[0]
    key = _dotted((prefix, *first["loc"]) if prefix else first["loc"])
    found: object = first["input"]
    expected = first["msg"].removeprefix("Value error, ")
    match first["type"]:
        case "missing":
            found, expected = None, "this key is required; nothing is assumed in its place"
        case "extra_forbidden":
            found, expected = first["input"], "unknown key" + _nearest(first["loc"])
        case kind if isinstance(found, dict | list) and kind == "value_error":
            found = "(table)"
    if len(problems) > 1:
        expected += f" (and {len(problems) - 1} more problems in this file)"
    return ConfigurationError(file, key, found, expected)


def _dotted(loc: tuple[int | str, ...]) -> str:
    """Path of a key as a reader counts: the first joint is joints[1]."""
    text = ""
    for part in loc:
        text += f"[{part + 1}]" if isinstance(part, int) else f".{part}" if text else str(part)
    return text


def _nearest(loc: tuple[int | str, ...]) -> str:
    """', did you mean x?' for an unknown key."""
    table: type[BaseModel] | None = RobotFile
    for part in loc[:-1]:
        if isinstance(part, str) and table is not None and part in table.model_fields:
            table = _table_of(table.model_fields[part].annotation)
    close = difflib.get_close_matches(str(loc[-1]), table.model_fields if table else (), n=1, cutoff=0.5)
    return f": did you mean {close[0]}?" if close else ""


def _table_of(annotation: Any) -> type[BaseModel] | None:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    return next((table for a in get_args(annotation) if (table := _table_of(a)) is not None), None)
