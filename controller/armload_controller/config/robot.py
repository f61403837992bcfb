"""Robots from TOML: reading, checking, and what the other layers get made from a file.

Three kinds of file are accepted by the same tables (`schema`): an arm on a bus (`[bus]` and a drive per joint),
an arm known from logs (`[log]`), and either with a `[simulation]`. What a file says is checked beyond its
form: counts, the bus load, and whether the joints can hold the payloads it names.
"""

from __future__ import annotations

import hashlib
import tomllib
from dataclasses import dataclass, field, replace
from importlib import resources
from pathlib import Path

import numpy as np
from pydantic import ValidationError

from armload_controller.config.drive_tables import (
    BusTable,
    DriveTable,
    drive_settings,
    read_descriptions,
    require_scales,
)
from armload_controller.config.motion_envelope import (
    expected_torque_of,
    following_speed_of,
    meshes_of,
    require_consistent,
    require_drivable,
    require_told,
    torque_limits_of,
    workspace_of,
)
from armload_controller.config.robot_file import RobotFile, SimulationTable, explained
from armload_controller.config.table_types import PayloadTable
from armload_controller.control_errors import ConfigurationError
from armload_controller.motion.expected_torque import ExpectedTorque
from armload_controller.motion.joint_limits import MotionLimits
from armload_controller.motion.obstacles import Cell
from armload_core.arrays import FloatArray
from armload_drivers.cia402.arm_settings import ArmSettings
from armload_drivers.cia402.bus_budget import require_room
from armload_drivers.cia402.device_description import DeviceDescription
from armload_drivers.driver_errors import BusOverload
from armload_drivers.simulation.plant_spec import PlantJoint, PlantSpec, PlantVariant
from armload_identification.excitation.design_envelope import Envelope, ExcitationLimits
from armload_identification.excitation.excitation_file import read_excitation
from armload_identification.excitation.fourier import Excitation
from armload_identification.excitation.workspace import Workspace
from armload_identification.identification_errors import IdentificationError
from armload_identification.model.chain import Chain, pose_from_xyz_rpy
from armload_identification.model.payload import InertialParameters
from armload_identification.model.regressor import payload_torque
from armload_identification.recording.recording import CsvColumns
from armload_identification.signals.joint_torque import Transmission

HARSH_GAIN_ERROR = 0.02
"""The harsh twin's torque gains are off by up to this share, the same in every run."""
HARSH_SECOND_RUN_FRICTION = 1.03
"""The harsh twin's friction in every run after the first."""


@dataclass(frozen=True)
class Robot:
    """One robot's configuration, checked.

    Attributes:
        file: Where it was read from, for messages.
        text: The file's text, kept for the recordings.
        folder: Where it lies, and what it names beside it.
        excitations: Excitation by role ("identification", "validation"); empty where the file names none.
        descriptions: Device description by joint, where the file names one.
    """

    file: str
    text: str
    excitations: dict[str, Excitation]
    _model: RobotFile
    folder: Path = Path()
    descriptions: dict[str, DeviceDescription] = field(default_factory=dict)

    @property
    def name(self) -> str:
        """Name of the robot."""
        return self._model.robot.name

    @property
    def description(self) -> str:
        """What the robot is, in a line."""
        return self._model.robot.description

    @property
    def sha256(self) -> str:
        """Hash of the configuration."""
        return hashlib.sha256(self.text.encode()).hexdigest()

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self._model.joints)

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints, from the base to the flange."""
        return tuple(joint.name for joint in self._model.joints)

    @property
    def has_bus(self) -> bool:
        """Whether the file has a `[bus]`; else the robot is known from logs only."""
        return self._model.bus is not None

    @property
    def bus(self) -> BusTable:
        """The bus.

        Raises:
            ConfigurationError: the robot has none.
        """
        if self._model.bus is None:
            raise ConfigurationError(
                self.file, "bus", None, "this robot is known from logs only; use `armload identify`"
            )
        return self._model.bus

    def with_bus(
        self,
        interface: str | None = None,
        channel: str | None = None,
        bitrate: int | None = None,
        cycle_hz: float | None = None,
    ) -> Robot:
        """The same robot with some of its `[bus]` overridden.

        Raises:
            ConfigurationError: the robot has no bus, or the new values do not fit it.
        """
        given = {"interface": interface, "channel": channel, "bitrate": bitrate, "cycle_hz": cycle_hz}
        values = self.bus.model_dump() | {key: value for key, value in given.items() if value is not None}
        try:
            bus = BusTable.model_validate(values)
        except ValidationError as error:
            raise explained("command line", error, prefix="bus") from error
        robot = replace(self, _model=self._model.model_copy(update={"bus": bus}))
        _check_bus_load(robot, "command line")
        return robot

    def chain(self) -> Chain:
        """Kinematics up to the flange, and gravity."""
        kinematics = self._model.kinematics
        flange = pose_from_xyz_rpy(kinematics.flange.xyz_m, kinematics.flange.rpy_rad)
        gravity = np.array(self._model.robot.gravity_m_s2)
        if kinematics.origins is not None:
            return Chain.from_origins(
                np.array([o.xyz_m for o in kinematics.origins]),
                np.array([o.rpy_rad for o in kinematics.origins]),
                np.array([o.axis for o in kinematics.origins]),
                flange,
                gravity,
            )
        rows = np.array([[r.alpha_rad, r.a_m, r.d_m, r.theta_rad] for r in kinematics.rows or ()])
        build = Chain.from_modified_dh if kinematics.convention == "modified-dh" else Chain.from_standard_dh
        return build(rows, flange, gravity)

    def transmission(self) -> Transmission:
        """How motor currents become joint torques.

        Raises:
            ConfigurationError: a joint has no torque constant and its drive sends no torque.
        """
        gains = []
        for i, joint in enumerate(self._model.joints):
            if joint.drive is not None and joint.drive.feedback == "torque":
                gains.append(1.0)  # never applied: such recordings hold torque, not current
                continue
            for key in ("gear_ratio", "torque_constant_nm_a"):
                if getattr(joint, key) is None:
                    raise ConfigurationError(
                        self.file,
                        f"joints[{i + 1}].{key}",
                        None,
                        "needed to turn this joint's current into torque",
                    )
            gains.append(float(joint.gear_ratio or 0) * float(joint.torque_constant_nm_a or 0))
        return Transmission(np.array(gains), self.coupling())

    def coupling(self) -> FloatArray:
        """(n, n) C with q_joint = C q_axis."""
        if self._model.transmission is None:
            return np.eye(self.n)
        return np.array(self._model.transmission.coupling)

    def motion_limits(self) -> MotionLimits:
        """What the joints may do; without a drive a joint has no window for its following error."""
        joints = self._model.joints
        return MotionLimits(
            joint_names=self.joint_names,
            position_min_rad=np.array([j.position_min_rad for j in joints]),
            position_max_rad=np.array([j.position_max_rad for j in joints]),
            velocity_max_rad_s=np.array([j.velocity_max_rad_s for j in joints]),
            acceleration_max_rad_s2=np.array([j.acceleration_max_rad_s2 for j in joints]),
            jerk_max_rad_s3=np.array([j.jerk_max_rad_s3 for j in joints]),
            following_error_rad=np.array([j.drive.following_error_rad if j.drive else np.inf for j in joints]),
        )

    def excitation_limits(self) -> ExcitationLimits:
        """What an excitation's joints may do; a drive whose lag is known keeps its following error."""
        limits = self.motion_limits()
        return ExcitationLimits(
            limits.position_min_rad,
            limits.position_max_rad,
            np.minimum(limits.velocity_max_rad_s, following_speed_of(self._model)),
            limits.acceleration_max_rad_s2,
            limits.jerk_max_rad_s3,
        )

    def workspace(self) -> Workspace:
        """What the arm must not touch; without a `[workspace]` in the file there is nothing."""
        return workspace_of(self.file, self._model, self.chain())

    def cell(self) -> Cell:
        """What the arm must not touch, meshes included.

        Raises:
            ConfigurationError: the URDF that the file names cannot be used.
        """
        return Cell(self.workspace(), meshes_of(self.file, self.folder, self._model, self.chain()))

    @property
    def knows_workspace(self) -> bool:
        """Whether the file has a `[workspace]`."""
        return self._model.workspace is not None

    def envelope(self, position_margin_rad: float, rate_share: float, torque_share: float) -> Envelope:
        """All limits that an excitation is designed within.

        Args:
            position_margin_rad: Taken off at both ends of every joint's range.
            rate_share: Share of the joints' speed, acceleration and jerk.
            torque_share: Share of the joints' torque.

        Raises:
            ConfigurationError: the file tells neither the arm's body nor its share of the torque.
            ExcitationError: nothing is left of a range.
        """
        return Envelope(
            self.excitation_limits().reduced(position_margin_rad, rate_share),
            torque_limits_of(self.file, self._model, self.chain(), self.heaviest_payload(), torque_share),
            self.workspace(),
        )

    def require_drivable(self, role: str) -> None:
        """Refuse one of the excitations where the file's cell, arm or heaviest payload do not allow it any more.

        Args:
            role: "identification" or "validation"; the file must name it.

        Raises:
            ConfigurationError: naming what would be touched, or the joint that is too weak.
        """
        path = self.excitations[role].trajectory
        require_drivable(self.file, self._model, self.chain(), self.cell(), role, path)

    def require_told(self) -> None:
        """Refuse to move an arm that may be real where the file leaves out what that takes.

        Raises:
            ConfigurationError: naming the key: who a drive is (1018), the workspace, or what the joints can give.
        """
        for i, (joint, drive) in enumerate(zip(self._model.joints, self.arm_settings().drives, strict=True)):
            described = self.descriptions.get(joint.name)
            known = drive.identity.vendor_id is not None or (
                described is not None and described.vendor_id is not None and described.product_code is not None
            )
            if not known:
                raise ConfigurationError(
                    self.file,
                    f"joints[{i + 1}].drive.identity",
                    None,
                    "a real arm is moved only where the file says who its drives are: give vendor_id and product_code "
                    "(`armload drives scan` shows them). Where `armload simulate` answers on that bus, say so with "
                    "--simulated-drives",
                )
        require_told(self.file, self._model)

    def expected_torque(self, *, loaded: bool) -> ExpectedTorque | None:
        """Between which torques motions lie; None where the file tells too little of arm or payload.

        Args:
            loaded: Something up to the heaviest payload hangs on the flange; else nothing.
        """
        return expected_torque_of(self._model, self.chain(), loaded=loaded)

    def weak_points(self) -> tuple[str, ...]:
        """What an operator has to know of the drives before the arm moves, in words."""
        found = []
        for drive in self.arm_settings().drives:
            if not drive.has_brake:
                found.append(f"{drive.joint} has no brake: it falls when torque is removed")
            if drive.accept_missing:
                found.append(f"{drive.joint} may lack {', '.join(sorted(drive.accept_missing))} (accept_missing)")
        return tuple(found)

    def torque_max_nm(self) -> FloatArray:
        """(n,) greatest torque of each joint."""
        return np.array([j.torque_max_nm for j in self._model.joints])

    def torque_for_drives_nm(self) -> FloatArray:
        """(n,) greatest torque that may be added: the joint's, or what its drive gives (6072) where that is less."""
        given = [
            np.inf if j.drive is None or j.drive.rated_torque_nm is None else _greatest_torque_nm(j.drive)
            for j in self._model.joints
        ]
        return np.minimum(self.torque_max_nm(), given)

    def torque_noise_nm(self) -> FloatArray:
        """(n,) expected noise of one raw torque sample at 100 Hz."""
        return np.array([j.torque_noise_nm for j in self._model.joints])

    def expected_payload(self) -> InertialParameters:
        """The payload that excitations are designed for.

        Raises:
            ConfigurationError: the file names none.
        """
        if self._model.expected_payload is None:
            raise ConfigurationError(self.file, "expected_payload", None, "needed to design an excitation")
        return self._model.expected_payload.inertial()

    def heaviest_payload(self) -> InertialParameters:
        """The heaviest payload that an excitation must be safe with; the expected one where the file names none.

        Raises:
            ConfigurationError: the file names neither.
        """
        heaviest = self._model.heaviest_payload
        return self.expected_payload() if heaviest is None else heaviest.inertial()

    def payload_set(self) -> tuple[InertialParameters, ...]:
        """The payloads that a robust excitation is designed for; empty where the file names none."""
        return tuple(payload.inertial() for payload in self._model.payload_set.values())

    def csv_columns(self) -> CsvColumns | None:
        """Column map of foreign logs, or None where the file has no `[log]`."""
        log = self._model.log
        if log is None:
            return None
        return CsvColumns(log.time_column, log.position_columns, log.velocity_columns, log.current_columns)

    def arm_settings(self) -> ArmSettings:
        """What the driver layer has to know.

        Raises:
            ConfigurationError: the robot has no bus.
        """
        bus = self.bus
        drives = []
        for i, joint in enumerate(self._model.joints):
            drive = joint.drive
            if drive is None:
                raise ConfigurationError(
                    self.file, f"joints[{i + 1}].drive", None, "an arm on a bus needs one per joint"
                )
            limits = (joint.position_min_rad, joint.position_max_rad)
            described = self.descriptions.get(joint.name)
            drives.append(drive_settings(drive, joint.name, limits, joint.gear_ratio, described))
        return ArmSettings(
            drives=tuple(drives),
            coupling=self.coupling(),
            cycle_s=1 / bus.cycle_hz,
            bitrate=bus.bitrate,
            heartbeat_s=bus.heartbeat_s,
            max_missing_cycles=bus.max_missing_cycles,
            sync_counter=bus.sync_counter,
            other_nodes=frozenset(bus.other_nodes),
        )

    @property
    def simulated_start_rad(self) -> FloatArray:
        """(n,) where the simulated twin's axes are at first; zeros where there is no twin."""
        simulation = self._model.simulation
        return np.zeros(self.n) if simulation is None else np.array(simulation.start_position_rad)

    @property
    def simulated_payload_name(self) -> str:
        """Name of the payload that a simulated commissioning mounts."""
        return self._simulation().payload

    def with_simulated_payload(self, name: str) -> Robot:
        """The same robot with another of its payloads mounted in simulation.

        Raises:
            ConfigurationError: the file has no simulation, or no payload of that name.
        """
        self._payload(name)
        simulation = self._simulation().model_copy(update={"payload": name})
        return replace(self, _model=self._model.model_copy(update={"simulation": simulation}))

    def simulated_payload(self, name: str) -> InertialParameters:
        """One of the payloads of `[simulation.payloads]`, in the flange frame.

        Raises:
            ConfigurationError: there is none of that name.
        """
        return self._payload(name).inertial()

    def plant_spec(self, payload: str | None, run: int = 0) -> PlantSpec:
        """The simulated arm.

        Args:
            payload: Name of a payload of `[simulation.payloads]`; None is the empty flange.
            run: Number of the run, so that no two runs share their noise; the harsh twin's friction rises after 0.

        Raises:
            ConfigurationError: the file has no simulation, or no payload of that name.
        """
        simulation = self._simulation()
        variant = PlantVariant(simulation.variant)
        harsh = variant is PlantVariant.HARSH
        gains = np.random.default_rng(simulation.seed)
        chain = self.chain()
        joints = []
        for i, (joint, truth) in enumerate(zip(self._model.joints, simulation.joints, strict=True)):
            joints.append(
                PlantJoint(
                    name=joint.name,
                    placement=chain.placement[i],
                    axis=chain.axis[i],
                    link=truth.link.rigid_body(),
                    coulomb_nm=truth.coulomb_nm,
                    viscous_nm_s_rad=truth.viscous_nm_s_rad,
                    stribeck_nm=truth.stribeck_nm,
                    stribeck_velocity_rad_s=truth.stribeck_velocity_rad_s,
                    load_friction=truth.load_friction,
                    rotor_inertia_kg_m2=truth.reflected_rotor_inertia_kg_m2,
                    gear_ratio=joint.gear_ratio or 1.0,
                    torque_ripple_nm=truth.torque_ripple_nm,
                    ripple_per_motor_turn=truth.ripple_per_motor_turn,
                    torque_noise_nm=joint.torque_noise_nm,
                    max_torque_nm=joint.torque_max_nm,
                    has_brake=joint.drive.has_brake if joint.drive else True,
                )
            )
        return PlantSpec(
            joints=tuple(joints),
            flange=chain.flange,
            gravity_m_s2=chain.gravity_m_s2,
            coupling=self.coupling(),
            start_position_rad=np.array(simulation.start_position_rad),
            seed=simulation.seed + run,
            payload=None if payload is None else self._payload(payload).rigid_body(),
            variant=variant,
            rated_payload=self._payload(simulation.payload).rigid_body(),
            friction_scale=HARSH_SECOND_RUN_FRICTION if harsh and run else 1.0,
            torque_gain_error=gains.uniform(-HARSH_GAIN_ERROR, HARSH_GAIN_ERROR, self.n) if harsh else None,
        )

    def _simulation(self) -> SimulationTable:
        if self._model.simulation is None:
            raise ConfigurationError(self.file, "simulation", None, "this robot has no simulated twin")
        return self._model.simulation

    def _payload(self, name: str) -> PayloadTable:
        payloads = self._simulation().payloads
        if name not in payloads:
            known = ", ".join(sorted(payloads))
            raise ConfigurationError(self.file, "simulation.payloads", name, f"one of: {known}")
        return payloads[name]


def _greatest_torque_nm(drive: DriveTable) -> float:
    """What 6072 allows a drive whose rated torque the file tells."""
    return float(drive.rated_torque_nm or 0.0) * drive.max_torque_permille / 1000.0


def shipped_robots() -> tuple[str, ...]:
    """Names of the configurations that come with armload."""
    files = resources.files("armload_configs").iterdir()
    texts = {f.name.removesuffix(".toml"): f.read_text("utf-8") for f in files if f.name.endswith(".toml")}
    return tuple(sorted(name for name, text in texts.items() if "[kinematics]" in text))


def load_robot(name_or_path: str) -> Robot:
    """Read and check a robot's configuration.

    Args:
        name_or_path: Name of a shipped configuration, or a path to a TOML file.

    Raises:
        ConfigurationError: naming file, key, the value found and what was expected.
    """
    path = _find(name_or_path)
    file = f"{name_or_path}.toml" if _is_shipped(name_or_path) else str(path)
    try:
        text = path.read_text("utf-8")
        values = tomllib.loads(text)
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ConfigurationError(file, "syntax", str(error), "expected TOML in UTF-8") from error
    except OSError as error:
        raise ConfigurationError(file, "file", error.strerror, "expected a readable file") from error
    try:
        model = RobotFile.model_validate(values)
    except ValidationError as error:
        raise explained(file, error) from error
    _check_counts(file, model)
    excitations = _read_excitations(file, path.parent, model)
    drives = {joint.name: joint.drive for joint in model.joints}
    if model.simulation is not None:
        require_scales(file, drives)
    robot = Robot(file, text, excitations, model, path.parent, read_descriptions(file, path.parent, drives))
    robot.workspace()
    _check_excitations(robot)
    _check_strength(robot)
    robot.transmission()
    if model.bus is not None:
        _check_bus_load(robot, file)
    return robot


def _is_shipped(name: str) -> bool:
    return name in shipped_robots()


def _find(name_or_path: str) -> Path:
    if _is_shipped(name_or_path):
        return Path(str(resources.files("armload_configs") / f"{name_or_path}.toml"))
    path = Path(name_or_path)
    if not path.is_file():
        known = ", ".join(shipped_robots())
        raise ConfigurationError("command line", "ROBOT", name_or_path, f"no such file, and no shipped robot: {known}")
    return path


def _check_counts(file: str, model: RobotFile) -> None:
    n = len(model.joints)
    names = [joint.name for joint in model.joints]
    if len(set(names)) != n:
        raise ConfigurationError(file, "joints", names, "every joint a name of its own")
    if model.kinematics.n != n:
        raise ConfigurationError(
            file, "kinematics", f"{model.kinematics.n} rows", f"the file has {n} [[joints]]; give one row per joint"
        )
    if model.transmission is not None:
        coupling = model.transmission.coupling
        if len(coupling) != n or any(len(row) != n for row in coupling):
            raise ConfigurationError(file, "transmission.coupling", coupling, f"{n} rows of {n} numbers")
        if abs(np.linalg.det(np.array(coupling))) < 1e-6:
            raise ConfigurationError(file, "transmission.coupling", coupling, "an invertible matrix")
    if model.simulation is not None:
        for key in ("joints", "start_position_rad"):
            if len(getattr(model.simulation, key)) != n:
                found = f"{len(getattr(model.simulation, key))} entries"
                raise ConfigurationError(file, f"simulation.{key}", found, f"give one per joint, {n} in this file")
        for joint, start in zip(model.joints, model.simulation.start_position_rad, strict=True):
            if not joint.position_min_rad <= start <= joint.position_max_rad:
                raise ConfigurationError(
                    file,
                    "simulation.start_position_rad",
                    start,
                    f"{joint.name} may stand between {joint.position_min_rad} and {joint.position_max_rad}",
                )
        if model.simulation.payload not in model.simulation.payloads:
            known = ", ".join(sorted(model.simulation.payloads))
            raise ConfigurationError(file, "simulation.payload", model.simulation.payload, f"one of: {known}")
    require_consistent(file, model)
    if model.bus is not None:
        nodes = [joint.drive.node_id for joint in model.joints if joint.drive is not None]
        if len(set(nodes)) != len(nodes):
            shared = next(node for node in nodes if nodes.count(node) > 1)
            both = " and ".join(j.name for j in model.joints if j.drive is not None and j.drive.node_id == shared)
            raise ConfigurationError(file, "joints.drive.node_id", shared, f"{both} share it; give each its own")


def _read_excitations(file: str, folder: Path, model: RobotFile) -> dict[str, Excitation]:
    """The excitation files that a robot's file names, by role."""
    if model.excitation is None:
        return {}
    excitations = {}
    for role, name in model.excitation:
        try:
            excitations[role] = read_excitation(folder / name)
        except IdentificationError as error:
            raise ConfigurationError(
                file, f"excitation.{role}", name, f"{error}. Make one with `armload design`, or leave [excitation] out"
            ) from error
    return excitations


def _check_excitations(robot: Robot) -> None:
    for role, excitation in robot.excitations.items():
        found = excitation.trajectory.n
        if found != robot.n:
            raise ConfigurationError(robot.file, f"excitation.{role}", found, f"a trajectory of {robot.n} joints")


def _check_strength(robot: Robot) -> None:
    """Refuse payloads that the arm is not made for or that its joints cannot hold up."""
    model = robot._model  # noqa: SLF001
    payloads: dict[str, PayloadTable] = {}
    if model.expected_payload is not None:
        payloads["expected_payload"] = model.expected_payload
    if model.heaviest_payload is not None:
        payloads["heaviest_payload"] = model.heaviest_payload
    payloads |= {f"payload_set.{name}": p for name, p in model.payload_set.items()}
    if model.simulation is not None:
        payloads |= {f"simulation.payloads.{name}": p for name, p in model.simulation.payloads.items()}
    chain, limits = robot.chain(), robot.motion_limits()
    rng = np.random.default_rng(0)
    q = rng.uniform(limits.position_min_rad, limits.position_max_rad, (512, robot.n))
    still = np.zeros_like(q)
    for key, payload in payloads.items():
        rated = model.robot.rated_payload_kg
        if payload.mass_kg > rated:
            raise ConfigurationError(
                robot.file, f"{key}.mass_kg", payload.mass_kg, f"at most robot.rated_payload_kg = {rated:g}"
            )
        torque = np.abs(payload_torque(chain, payload.inertial().theta, q, still, still)).max(axis=0)
        weakest = int(np.argmax(torque / robot.torque_max_nm()))
        bound = robot.torque_max_nm()[weakest]
        if torque[weakest] > bound:
            raise ConfigurationError(
                robot.file,
                key,
                f"{torque[weakest]:.0f} N m on {robot.joint_names[weakest]}",
                f"a payload that this joint can hold, torque_max_nm = {bound:g}: less mass or a shorter lever",
            )


def _check_bus_load(robot: Robot, where: str) -> None:
    try:
        require_room(robot.arm_settings())
    except BusOverload as error:
        raise ConfigurationError(where, "bus.cycle_hz", robot.bus.cycle_hz, str(error)) from error
