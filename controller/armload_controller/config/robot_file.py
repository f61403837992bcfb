"""What a robot's TOML file may hold: tables and keys, each key with its unit.

Every limit must be given, an unknown key is an error, numbers must be numbers. A problem becomes one
`ConfigurationError` with file, key, the value found and what was expected.
"""

from __future__ import annotations

import difflib
from typing import Annotated, Any, Literal, get_args

from pydantic import BaseModel, Field, ValidationError, model_validator

from armload_controller.config.body_workspace_tables import ArmBodyTable, WorkspaceTable
from armload_controller.config.drive_tables import BusTable, DriveTable
from armload_controller.config.table_types import (
    BodyTable,
    NonNegative,
    PayloadTable,
    PoseTable,
    Positive,
    Table,
    Vector3,
)
from armload_controller.control_errors import ConfigurationError


class RobotTable(Table):
    """What the arm is."""

    name: str
    description: str
    rated_payload_kg: Positive
    gravity_m_s2: Vector3


class DhRowTable(Table):
    """One Denavit-Hartenberg row."""

    alpha_rad: float
    a_m: float
    d_m: float
    theta_rad: float


class OriginTable(PoseTable):
    """One joint's frame in the previous one, and its axis."""

    axis: Vector3


class KinematicsTable(Table):
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


class TransmissionTable(Table):
    """Coupled motors: q_joint = C q_axis."""

    coupling: list[list[float]]


class ExcitationTable(Table):
    """Excitation files beside this one."""

    identification: str
    validation: str


class LogTable(Table):
    """Columns of foreign logs, counted from 0."""

    time_column: Annotated[int, Field(ge=0)]
    position_columns: list[int]
    velocity_columns: list[int] | None = None
    current_columns: list[int]


class JointTable(Table):
    """One joint and its limits."""

    name: str
    position_min_rad: float
    position_max_rad: float
    velocity_max_rad_s: Positive
    acceleration_max_rad_s2: Positive
    jerk_max_rad_s3: Positive
    torque_max_nm: Positive
    arm_torque_share: Annotated[float, Field(ge=0, lt=1)] | None = None
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


class SimulatedJointTable(Table):
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


class SimulationTable(Table):
    """The simulated twin."""

    seed: int
    payload: str
    start_position_rad: list[float]
    variant: Literal["normative", "harsh"] = "normative"
    payloads: dict[str, PayloadTable]
    joints: list[SimulatedJointTable]


class RobotFile(Table):
    """The whole file."""

    robot: RobotTable
    kinematics: KinematicsTable
    transmission: TransmissionTable | None = None
    expected_payload: PayloadTable | None = None
    heaviest_payload: PayloadTable | None = None
    payload_set: dict[str, PayloadTable] = Field(default={})
    body: ArmBodyTable | None = None
    workspace: WorkspaceTable | None = None
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
            found, expected = None, "it is required, nothing is assumed in its place"
        case "extra_forbidden":
            found, expected = first["input"], "unknown key" + _nearest(first["loc"])
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
