"""One robot from its TOML file: reading, checking, and the parts that the other layers use.

Three kinds of file share the same tables: an arm on a bus (`[bus]` and a drive per joint), an arm known only from logs
(`[log]`), and either of these with a `[simulation]`. Besides the form and consistency of the tables, it is checked that
the cycle fits the bus, that the joints can hold the stated payloads, and that the files it names can be used.

A process that only runs the loop loads a robot too: what it does not use is imported where it is needed.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from importlib import resources
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from armload_controller.config.drive_profiles import with_profiles
from armload_controller.config.robot_drives import RobotDrives
from armload_controller.config.robot_payloads import RobotPayloads
from armload_controller.config.robot_source import RobotSource
from armload_controller.config.tables.drive_tables import VIRTUAL, BusTable
from armload_controller.config.tables.robot_file import RobotFile
from armload_controller.config.urdf_tree import is_urdf
from armload_controller.control_errors import CommissioningError, ConfigurationError
from armload_identification.argument_types import path_of
from armload_identification.excitation.excitation_file import read_excitation
from armload_identification.excitation.fourier import Excitation
from armload_identification.excitation.geometry.workspace import Workspace
from armload_identification.float_array import FloatArray
from armload_identification.identification_errors import IdentificationError, ModelError
from armload_identification.storage.regular_file import require_regular
from armload_identification.storage.strict_toml import BadValue, read_toml, toml_values, validated

if TYPE_CHECKING:
    from armload_controller.config.robot_limits import RobotLimits
    from armload_controller.config.robot_simulation import RobotSimulation
    from armload_controller.config.robot_torque_limits import RobotStrength
    from armload_controller.motion.motion_constraints import MotionConstraints
    from armload_controller.motion.obstacles import Obstacles
    from armload_identification.excitation.design_envelope import Envelope
    from armload_identification.excitation.geometry.cartesian_speed import ArmPoints
    from armload_identification.recording.csv_columns import CsvColumns
    from armload_identification.recording.recording import Recording
    from armload_identification.signals.joint_torque import Transmission
    from armload_identification.verdict.recording_checks.impossible_magnitudes import ArmMagnitudes


@dataclass(frozen=True, eq=False, repr=False)
class Robot(RobotSource):
    """One robot's configuration, checked.

    Attributes:
        excitations: Excitation by role ("identification", "validation"); empty if the file names none.
    """

    excitations: dict[str, Excitation] = field(default_factory=dict)

    def __repr__(self) -> str:
        """Name, joints and description."""
        return f"Robot {self.name}: {self.n} joints, {self.description}"

    @property
    def sha256(self) -> str:
        """SHA-256 of the file's text."""
        return hashlib.sha256(self.text.encode()).hexdigest()

    @property
    def name(self) -> str:
        """Name of the robot."""
        return self.tables.robot.name

    @property
    def description(self) -> str:
        """One line that describes the robot."""
        return self.tables.robot.description

    @property
    def position_limits_rad(self) -> FloatArray:
        """(n, 2) least and greatest position of each joint."""
        return np.stack([self.limits.motion.position_min_rad, self.limits.motion.position_max_rad], axis=1)

    @property
    def rated_payload_kg(self) -> float:
        """Rated payload of the robot."""
        return self.tables.robot.rated_payload_kg

    @property
    def calibration_file(self) -> Path | None:
        """The calibration that the file names, relative to the file; None if it names none.

        Raises:
            ConfigurationError: the calibration does not exist, or is not a file.
        """
        name = self.tables.robot.calibration
        if name is None:
            return None
        path = self.folder / name
        try:
            require_regular(path)
        except OSError as problem:
            raise self.refused(
                "robot.calibration",
                name,
                f"cannot be read beside {self.file} ({problem.strerror}); create it with `armload calibrate`, or "
                "remove the key",
            ) from problem
        return path

    @property
    def plugins(self) -> Mapping[str, Mapping[str, object]]:
        """Settings of the cycle's plug-ins by name; each plug-in defines and checks its own."""
        return self.tables.plugins

    @property
    def has_bus(self) -> bool:
        """Whether the file has a `[bus]`; without one the robot is known only from logs."""
        return self.tables.bus is not None

    @property
    def csv_columns(self) -> CsvColumns | None:
        """Columns of other programs' logs; None if the file has no `[log]`."""
        log = self.tables.log
        return None if log is None else log.csv_columns()

    @property
    def transmission(self) -> Transmission:
        """How motor currents become joint torques."""
        return self.drives.transmission

    def own(self, recording: Recording) -> Recording:
        """A recording with this arm's joints, base first.

        Args:
            recording: Any recording; joints that it names are matched by name, others by their order.

        Raises:
            CommissioningError: the recording states another arm.
            RecordingError: the recording has other joints, or no torque usable for this arm.
        """
        from armload_identification.recording.joint_names import JointNames
        from armload_identification.recording.recording import check_joints
        from armload_identification.verdict.recording_checks.impossible_magnitudes import require_possible

        path, name = recording.source.path, recording.source.run().get("robot", self.name)
        if name != self.name:
            raise CommissioningError(
                f"{path} was recorded on {name}, not on {self.name}: give the robot it was recorded on, or recordings "
                "of this robot"
            )
        if recording.torque_nm is None:
            self.drives.require_current_gains(str(path))
        named = len(JointNames(self.joint_names).places(recording.joint_names)) == self.n
        if named or set(self.joint_names) & set(recording.joint_names):
            recording = recording.named_joints(self.joint_names)
        check_joints(recording, self.n)
        torque = self.transmission.measured(recording.torque_nm, recording.current_a)
        require_possible(recording, self.chain, torque, self.magnitudes)
        return recording

    @cached_property
    def magnitudes(self) -> ArmMagnitudes:
        """Ranges, speeds and torques that the joints can physically have."""
        from armload_identification.verdict.recording_checks.impossible_magnitudes import ArmMagnitudes

        limits = self.limits.motion
        body = None if self.tables.body is None else self.strength.arm_body
        return ArmMagnitudes(
            self.joint_names,
            limits.position_min_rad,
            limits.position_max_rad,
            limits.velocity_max_rad_s,
            self.limits.torque_max_nm,
            body,
        )

    @cached_property
    def drives(self) -> RobotDrives:
        """Settings of the drives, and how currents become torque."""
        return RobotDrives(self)

    @cached_property
    def limits(self) -> RobotLimits:
        """Limits and noise of the joints."""
        from armload_controller.config.robot_limits import RobotLimits

        return RobotLimits(self)

    @cached_property
    def payloads(self) -> RobotPayloads:
        """The payloads that the file names."""
        return RobotPayloads(self)

    @cached_property
    def strength(self) -> RobotStrength:
        """Torque available to the joints for a motion with a payload."""
        from armload_controller.config.robot_torque_limits import RobotStrength

        return RobotStrength(self, self.payloads, self.drives.coupling, self.limits.torque_max_nm)

    @cached_property
    def simulation(self) -> RobotSimulation:
        """The simulated twin."""
        from armload_controller.config.robot_simulation import RobotSimulation

        return RobotSimulation(self, self.drives.coupling)

    @property
    def has_workspace(self) -> bool:
        """Whether the file has a `[workspace]`."""
        return self.tables.workspace is not None

    @cached_property
    def workspace(self) -> Workspace:
        """Spheres around the arm and the obstacles; empty without a `[workspace]` in the file.

        Raises:
            ConfigurationError: the obstacles are invalid.
        """
        table = self.tables.workspace
        if table is None:
            return Workspace(self.chain)
        try:
            return table.workspace(self.chain)
        except ModelError as error:
            raise self.refused("workspace", {}, str(error)) from error

    @cached_property
    def obstacles(self) -> Obstacles:
        """The workspace and the meshes of its URDF.

        Raises:
            ConfigurationError: the URDF that the file names cannot be used.
        """
        from armload_controller.motion.obstacles import Obstacles

        table = self.tables.workspace
        try:
            meshes = None if table is None else table.meshes(self.folder, self.chain, self.joint_names)
        except ModelError as error:
            raise self.refused("workspace.urdf", table and table.urdf, str(error)) from error
        return Obstacles(self.workspace, meshes)

    @property
    def controlled_points(self) -> ArmPoints:
        """The points that keep reduced speed: those of the arm, and spheres around all that the file says it carries.

        The same with every load: what the arm carries before it is identified is known from its file only.
        """
        from armload_identification.excitation.geometry.cartesian_speed import CarriedSphere

        flange = self.n + 1
        tool = (CarriedSphere("tool", s.center_m, s.radius_m) for s in self.workspace.spheres if s.link == flange)
        return replace(self.limits.points, carried=(*tool, *self.payloads.envelopes))

    def envelope(self, position_margin_rad: float, rate_share: float, torque_share: float) -> Envelope:
        """All limits that an excitation is designed within.

        Args:
            position_margin_rad: Margin at both ends of every joint's range.
            rate_share: Usable share of the joints' speed, acceleration and jerk limits.
            torque_share: Usable share of the joints' torque.

        Raises:
            ConfigurationError: the file states neither the arm's body nor its share of the torque.
            ExcitationError: nothing is left of a range.
        """
        from armload_identification.excitation.design_envelope import Envelope

        return Envelope(
            self.limits.excitation.reduced(position_margin_rad, rate_share),
            self.strength.limits(torque_share),
            self.workspace,
            self.limits.speed,
        )

    @cached_property
    def motion_constraints(self) -> MotionConstraints:
        """What every motion of the arm must respect.

        Raises:
            ConfigurationError: the URDF cannot be used, or friction alone uses up a joint's torque.
        """
        from armload_controller.motion.motion_constraints import MotionConstraints

        limits = self.limits
        return MotionConstraints(
            self.sha256,
            limits.motion,
            limits.following_speed_rad_s,
            self.strength.limits_if_stated,
            self.strength.axis_limits_if_stated,
            self.obstacles,
            self.controlled_points,
            limits.speed,
        )

    def require_complete_for_real_arm(self) -> None:
        """Refuse to move an arm that may be real if the file lacks data that protects people and arm.

        Raises:
            ConfigurationError: naming the missing key: a drive's identity (1018), the joints' torque, the payload to
                carry, or the workspace.
        """
        self.drives.require_identities()
        self.strength.require_stated()
        if not self.has_workspace:
            raise self.refused("workspace", None, "a real arm is moved only if the file states what it must not touch")

    def with_bus(
        self,
        interface: str | None = None,
        channel: str | None = None,
        bitrate: int | None = None,
        cycle_hz: float | None = None,
    ) -> Robot:
        """The same robot with some of its `[bus]` overridden from the command line.

        Raises:
            ConfigurationError: the robot has no bus, or the new values do not fit it.
        """
        given: dict[str, object] = {"bitrate": bitrate, "cycle_hz": cycle_hz}
        if interface is not None and channel is not None:
            try:
                given |= self.bus.elsewhere(interface, channel)
            except BadValue as error:
                raise ConfigurationError("command line", "--bus", channel, error.expected) from error
        values = msgspec.to_builtins(self.bus) | {key: value for key, value in given.items() if value is not None}
        bus = validated(values, "command line", BusTable, ConfigurationError, within="bus")
        robot = self.with_tables(bus=bus)
        RobotDrives(replace(robot, file="command line")).require_bus_load()
        return robot

    def with_simulated_payload(self, name: str) -> Robot:
        """The same robot, with another of its payloads mounted in simulation.

        Raises:
            ConfigurationError: the arm is not simulated in this process, or the file has no simulation, or no payload
                of that name.
        """
        if not self.bus.in_virtual_time:
            raise ConfigurationError(
                "command line",
                "--mounted",
                name,
                f"expected the bus {VIRTUAL!r}, on which the arm is simulated in this process, not "
                f"{self.bus.address}; for simulated drives on a bus see `armload simulate --payload`",
            )
        self.simulation.payload(name)
        return self.with_tables(simulation=msgspec.structs.replace(self.simulation_table, payload=name))


def shipped_robots() -> tuple[str, ...]:
    """Names of the configurations that come with armload."""
    files = resources.files("armload_configs").iterdir()
    texts = {f.name.removesuffix(".toml"): f.read_text("utf-8") for f in files if f.name.endswith(".toml")}
    return tuple(sorted(name for name, text in texts.items() if "[kinematics]" in text))


def load_robot(name_or_path: str | PathLike[str]) -> Robot:
    """Read and check a robot's configuration.

    Args:
        name_or_path: Name of a shipped configuration, or a path to a TOML file.

    Raises:
        ConfigurationError: naming file, key, the value found and what was expected.

    Examples:
        >>> import armload
        >>> robot = armload.load_robot("er50")
        >>> isinstance(robot, armload.Robot), robot.n, robot.chain.n
        (True, 6, 6)
    """
    expected = "the name of a shipped robot, or the path of a robot's file"
    shipped, given = shipped_robots(), str(path_of("name_or_path", name_or_path, expected))
    if given in shipped:
        path, file = Path(str(resources.files("armload_configs") / f"{given}.toml")), f"{given}.toml"
    else:
        path, file = Path(given), given
        if not path.is_file():
            found = "a folder" if path.is_dir() else "no such file"
            expected = f"{found}, and no shipped robot: {', '.join(shipped)}"
            raise ConfigurationError(file, "", None, expected)
    if is_urdf(path):
        expected = "a URDF has no drives and limits of an arm's use: make a robot file of it with `armload init`"
        raise ConfigurationError(file, "", None, expected)
    return parse_robot(read_toml(path, ConfigurationError), file, path.parent)


def parse_robot(text: str, file: str, folder: Path) -> Robot:
    """A robot from the text of its file.

    Args:
        text: TOML.
        file: The file's name, for messages.
        folder: The file's folder; other files are named relative to it.

    Raises:
        ConfigurationError: naming file, key, the value found and what was expected.
    """
    values = with_profiles(toml_values(text, file, ConfigurationError), folder, file)
    robot = Robot(file, text, folder, validated(values, file, RobotFile, ConfigurationError))
    robot = replace(robot, excitations=_read_excitations(robot))
    _ = robot.drives.descriptions, robot.drives.transmission, robot.workspace
    robot.payloads.require_carried()
    if robot.has_bus:
        robot.drives.require_bus_load()
    return robot


def _read_excitations(source: RobotSource) -> dict[str, Excitation]:
    """The excitation files that a robot's file names, by role."""
    excitations = {}
    named = source.tables.excitation
    for role, name in msgspec.structs.asdict(named).items() if named is not None else ():
        try:
            excitation = read_excitation(source.folder / name)
        except IdentificationError as error:
            raise source.refused(
                f"excitation.{role}", name, f"{error}. Create one with `armload design`, or leave [excitation] out"
            ) from error
        if excitation.trajectory.n != source.n:
            expected = f"expected a trajectory of {source.n} joints"
            raise source.refused(f"excitation.{role}", excitation.trajectory.n, expected)
        excitations[role] = excitation
    return excitations
