"""A robot's file: all tables, and their consistency.

Every limit must be given, an unknown key is an error, and text is not accepted as a number.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

from msgspec import Meta, field

from armload_controller.config.tables.body_tables import ArmBodyTable, CarriedPayloadTable, PayloadTable
from armload_controller.config.tables.drive_tables import BusTable
from armload_controller.config.tables.joint_table import JointTable
from armload_controller.config.tables.kinematics_table import KinematicsTable, TransmissionTable
from armload_controller.config.tables.simulation_table import SimulationTable
from armload_controller.config.tables.table_types import Positive, RatedMass, Vector3
from armload_controller.config.tables.workspace_table import WorkspaceTable
from armload_identification.storage.strict_toml import BadValue, Table, Text

if TYPE_CHECKING:
    from armload_identification.recording.csv_columns import CsvColumns


class RobotTable(Table):
    """Name, rated payload and mounting of the arm."""

    name: str
    description: str
    rated_payload_kg: RatedMass
    gravity_m_s2: Vector3
    calibration: str | None = None


class ToolTable(Table):
    """The tool on the flange during motion, for the limit of its speed."""

    xyz_m: Vector3


class LimitsTable(Table):
    """Limits that belong to the arm rather than to a joint."""

    tcp_speed_m_s: Positive


class ExcitationTable(Table):
    """Excitation files in the folder of this file."""

    identification: str
    validation: str


_Column = Annotated[int, Meta(ge=0)] | Text
_Columns = Annotated[list[_Column], Meta(min_length=1)]


class LogTable(Table):
    """Columns of other programs' logs: numbered from 0, or by the header's names."""

    time_column: _Column
    position_columns: _Columns
    velocity_columns: _Columns | None = None
    current_columns: _Columns | None = None
    torque_columns: _Columns | None = None

    def __post_init__(self) -> None:
        """Refuse a map without current or torque, or with unequal numbers of columns."""
        if (self.current_columns is None) == (self.torque_columns is None):
            raise BadValue("current_columns", self.current_columns, "give either current_columns or torque_columns")
        for key in ("velocity_columns", "current_columns", "torque_columns"):
            columns = getattr(self, key)
            if columns is not None and len(columns) != len(self.position_columns):
                raise BadValue(key, columns, f"expected {len(self.position_columns)} columns, as position_columns has")

    def csv_columns(self) -> CsvColumns:
        """For the reader of recordings."""
        from armload_identification.recording.csv_columns import QUANTITIES_BY_KEY, CsvColumns

        columns = self.position_columns, self.velocity_columns, self.current_columns, self.torque_columns
        groups = zip(QUANTITIES_BY_KEY.values(), ([self.time_column], *columns), strict=True)
        return CsvColumns({quantity: group for quantity, group in groups if group is not None})


class RobotFile(Table):
    """All tables of the file."""

    content = "a robot's configuration"

    robot: RobotTable
    kinematics: KinematicsTable
    transmission: TransmissionTable | None = None
    tool: ToolTable | None = None
    limits: LimitsTable | None = None
    expected_payload: CarriedPayloadTable | None = None
    heaviest_payload: CarriedPayloadTable | None = None
    payload_set: dict[str, PayloadTable] = field(default_factory=dict)
    body: ArmBodyTable | None = None
    workspace: WorkspaceTable | None = None
    excitation: ExcitationTable | None = None
    bus: BusTable | None = None
    log: LogTable | None = None
    joints: Annotated[list[JointTable], Meta(min_length=1)]
    simulation: SimulationTable | None = None
    plugins: dict[str, dict[str, Any]] = field(default_factory=dict)

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.joints)

    def carried_payloads(self) -> dict[str, CarriedPayloadTable]:
        """The payloads that every motion is planned for, by key."""
        named = {"expected_payload": self.expected_payload, "heaviest_payload": self.heaviest_payload}
        return {key: table for key, table in named.items() if table is not None}

    def payloads(self) -> dict[str, PayloadTable]:
        """Every payload of the file by its dotted key."""
        found: dict[str, PayloadTable] = dict(self.carried_payloads())
        found |= {f"payload_set.{name}": payload for name, payload in self.payload_set.items()}
        if self.simulation is not None:
            found |= {f"simulation.payloads.{name}": payload for name, payload in self.simulation.payloads.items()}
        return found

    def __post_init__(self) -> None:
        self._joints_are_told_apart()
        self._kinematics_fit_the_joints()
        if self.simulation is not None:
            self.simulation.check(self.joints)
        self._body_fits_the_joints()
        self._workspace_fits_the_arm()

    def _joints_are_told_apart(self) -> None:
        names = [joint.name for joint in self.joints]
        if len(set(names)) != self.n:
            raise BadValue("joints", names, "every joint needs its own name")
        nodes = [joint.drive.node_id for joint in self.joints if joint.drive is not None]
        if self.bus is not None and len(set(nodes)) != len(nodes):
            shared = next(node for node in nodes if nodes.count(node) > 1)
            both = " and ".join(j.name for j in self.joints if j.drive is not None and j.drive.node_id == shared)
            raise BadValue("joints.drive.node_id", shared, f"{both} share it; give each a different one")
        if self.bus is not None:
            used = {joint.drive.bus for joint in self.joints if joint.drive is not None}
            for name in sorted(used - set("ab"[: len(self.bus.parts)])):
                raise BadValue("joints.drive.bus", name, "the file has one bus; add [bus.a] and [bus.b]")
            if used and len(used) < len(self.bus.parts):
                raise BadValue(
                    "joints.drive.bus", next(iter(used)), "the file has [bus.a] and [bus.b]; put joints on both"
                )

    def _kinematics_fit_the_joints(self) -> None:
        if self.kinematics.n != self.n:
            found = f"{self.kinematics.n} rows"
            raise BadValue("kinematics", found, f"the file has {self.n} [[joints]]; give one row per joint")
        if self.transmission is not None:
            self.transmission.check(self.n)

    def _body_fits_the_joints(self) -> None:
        if self.body is None:
            return
        if len(self.body.links) != self.n:
            raise BadValue("body.links", len(self.body.links), f"expected one per joint, {self.n} in this file")
        for number, (link, joint) in enumerate(zip(self.body.links, self.joints, strict=True), start=1):
            if joint.arm_torque_share is not None:
                key = f"joints[{number}].arm_torque_share"
                raise BadValue(key, joint.arm_torque_share, "give either [body] or the shares, not both")
            if link.coulomb_nm >= joint.torque_max_nm:
                expected = f"expected less than joints[{number}].torque_max_nm = {joint.torque_max_nm:g}"
                raise BadValue(f"body.links[{number}].coulomb_nm", link.coulomb_nm, expected)

    def _workspace_fits_the_arm(self) -> None:
        if self.workspace is None:
            return
        self.workspace.check(self.n)
        floor_m = self.workspace.floor_height_m
        if floor_m is not None and not any(self.robot.gravity_m_s2):
            expected = "a floor requires gravity, which defines the vertical; or give a half-space instead"
            raise BadValue("workspace.floor_height_m", floor_m, expected)
