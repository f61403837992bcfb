"""Robots from TOML: what a file may hold, and what the other layers get made from it.

Every key carries its unit, every limit must be given, an unknown key is an error. A problem is reported as
file, key, value and what was expected. Three kinds of file are accepted by the same model: an arm on a bus
(`[bus]` and a `drive` per joint), an arm known from logs (`[log]`), and either with a `[simulation]`.
"""

from __future__ import annotations

import difflib
import math
import tomllib
from dataclasses import dataclass, replace
from importlib import resources
from pathlib import Path
from typing import Annotated, Any, Literal, get_args

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from armload_controller.errors import ConfigurationError
from armload_drivers.arm import ArmSettings, DriveSettings, EffortFeedback, Identity, OperationMode
from armload_drivers.bus_budget import forecast
from armload_drivers.plant_spec import PlantJoint, PlantSpec, PlantVariant, RigidBody
from armload_drivers.servos import FloatArray
from armload_identification.chain import Chain
from armload_identification.excitation import ExcitationLimits
from armload_identification.fourier import Excitation, read_excitation
from armload_identification.payload import InertialParameters
from armload_identification.recording import CsvColumns
from armload_identification.regressor import payload_torque
from armload_identification.signals import Transmission

Positive = Annotated[float, Field(gt=0)]
NonNegative = Annotated[float, Field(ge=0)]
Vector3 = Annotated[list[float], Field(min_length=3, max_length=3)]


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)


class _Inertia(_Table):
    ixx: float
    iyy: float
    izz: float
    ixy: float
    ixz: float
    iyz: float

    def tensor(self) -> FloatArray:
        return np.array(
            [[self.ixx, self.ixy, self.ixz], [self.ixy, self.iyy, self.iyz], [self.ixz, self.iyz, self.izz]]
        )


class _Body(_Table):
    mass_kg: Positive
    center_of_mass_m: Vector3
    inertia_kg_m2: _Inertia

    def rigid_body(self) -> RigidBody:
        return RigidBody(self.mass_kg, np.array(self.center_of_mass_m), self.inertia_kg_m2.tensor())


class _Payload(_Body):
    def inertial(self) -> InertialParameters:
        return InertialParameters.from_center_of_mass(
            self.mass_kg, np.array(self.center_of_mass_m), self.inertia_kg_m2.tensor()
        )

    @model_validator(mode="after")
    def _possible(self) -> _Payload:
        if not self.inertial().is_physical:
            raise ValueError(
                "no mass distribution has this inertia about its centre of mass: the principal moments must be "
                "positive and each at most the sum of the other two"
            )
        return self


class _Robot(_Table):
    name: str
    description: str
    rated_payload_kg: Positive
    gravity_m_s2: Vector3


class _Pose(_Table):
    xyz_m: Vector3
    rpy_rad: Vector3


class _DhRow(_Table):
    alpha_rad: float
    a_m: float
    d_m: float
    theta_rad: float


class _Origin(_Pose):
    axis: Vector3


class _Kinematics(_Table):
    convention: Literal["modified-dh", "standard-dh", "joint-origins"]
    rows: list[_DhRow] | None = None
    origins: list[_Origin] | None = None
    flange: _Pose

    @model_validator(mode="after")
    def _one_description(self) -> _Kinematics:
        wanted, other = ("origins", "rows") if self.convention == "joint-origins" else ("rows", "origins")
        if getattr(self, wanted) is None or getattr(self, other) is not None:
            raise ValueError(f'with convention = "{self.convention}" give {wanted} and not {other}')
        return self

    @property
    def n(self) -> int:
        return len(self.rows or self.origins or ())


class _Transmission(_Table):
    coupling: list[list[float]]


class _Excitation(_Table):
    identification: str
    validation: str


class _Bus(_Table):
    interface: str
    channel: str
    bitrate: Annotated[int, Field(ge=10_000, le=1_000_000)]
    cycle_hz: Annotated[float, Field(gt=0, le=1000)]
    heartbeat_s: Positive
    max_missing_cycles: Annotated[int, Field(ge=0)]


class _Log(_Table):
    time_column: Annotated[int, Field(ge=0)]
    position_columns: list[int]
    velocity_columns: list[int] | None = None
    current_columns: list[int]


class _Identity(_Table):
    vendor_id: int
    product_code: int
    revision: int | None = None


class _Drive(_Table):
    node_id: Annotated[int, Field(ge=1, le=127)]
    mode: Literal["csp", "ip"]
    feedback: Literal["current", "torque"]
    counts_per_axis_turn: Positive
    rated_current_a: Positive | None = None
    rated_torque_nm: Positive
    max_torque_permille: Annotated[int, Field(ge=1, le=65535)]
    following_error_rad: Positive
    has_brake: bool
    identity: _Identity | None = None

    @model_validator(mode="after")
    def _rated_current(self) -> _Drive:
        if self.feedback == "current" and self.rated_current_a is None:
            raise ValueError('feedback = "current" needs rated_current_a: 6078 is per mille of it')
        return self


class _Joint(_Table):
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
    drive: _Drive | None = None

    @model_validator(mode="after")
    def _ordered(self) -> _Joint:
        if self.position_min_rad >= self.position_max_rad:
            raise ValueError(
                f"position_min_rad = {self.position_min_rad} is not below position_max_rad = "
                f"{self.position_max_rad}: exchange them"
            )
        return self


class _SimulatedJoint(_Table):
    link: _Body
    reflected_rotor_inertia_kg_m2: NonNegative
    coulomb_nm: NonNegative
    viscous_nm_s_rad: NonNegative
    stribeck_nm: NonNegative
    stribeck_velocity_rad_s: Positive
    load_friction: Annotated[float, Field(ge=0, lt=1)]
    torque_ripple_nm: NonNegative
    ripple_per_motor_turn: Annotated[int, Field(ge=1)]


class _Simulation(_Table):
    seed: int
    payload: str
    start_position_rad: list[float]
    variant: Literal["normative", "harsh"] = "normative"
    payloads: dict[str, _Payload]
    joints: list[_SimulatedJoint]


class _File(_Table):
    robot: _Robot
    kinematics: _Kinematics
    transmission: _Transmission | None = None
    expected_payload: _Payload | None = None
    excitation: _Excitation | None = None
    bus: _Bus | None = None
    log: _Log | None = None
    joints: Annotated[list[_Joint], Field(min_length=1)]
    simulation: _Simulation | None = None


@dataclass(frozen=True)
class Robot:
    """One robot's configuration, checked.

    Attributes:
        file: Where it was read from, for messages.
        text: The file's text, kept for the recordings.
        excitations: Excitation by role ("identification", "validation"); empty where the file names none.
    """

    file: str
    text: str
    excitations: dict[str, Excitation]
    _model: _File

    @property
    def name(self) -> str:
        return self._model.robot.name

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self._model.joints)

    @property
    def joint_names(self) -> tuple[str, ...]:
        return tuple(joint.name for joint in self._model.joints)

    @property
    def bus(self) -> _Bus:
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
            bus = _Bus.model_validate(values)
        except ValidationError as error:
            raise _explained("command line", error, prefix="bus") from error
        robot = replace(self, _model=self._model.model_copy(update={"bus": bus}))
        _check_bus_load(robot)
        return robot

    def chain(self) -> Chain:
        """Kinematics up to the flange, and gravity."""
        kinematics = self._model.kinematics
        flange = _transform(kinematics.flange)
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
                        self.file, f"joints[{i + 1}].{key}", None, "needed to turn this joint's current into torque"
                    )
            gains.append(float(joint.gear_ratio or 0) * float(joint.torque_constant_nm_a or 0))
        return Transmission(np.array(gains), self.coupling())

    def coupling(self) -> FloatArray:
        """(n, n) C with q_joint = C q_axis."""
        if self._model.transmission is None:
            return np.eye(self.n)
        return np.array(self._model.transmission.coupling)

    def limits(self) -> ExcitationLimits:
        """Position, velocity and acceleration limits of the joints."""
        joints = self._model.joints
        return ExcitationLimits(
            np.array([j.position_min_rad for j in joints]),
            np.array([j.position_max_rad for j in joints]),
            np.array([j.velocity_max_rad_s for j in joints]),
            np.array([j.acceleration_max_rad_s2 for j in joints]),
        )

    def jerk_max_rad_s3(self) -> FloatArray:
        return np.array([j.jerk_max_rad_s3 for j in self._model.joints])

    def torque_max_nm(self) -> FloatArray:
        return np.array([j.torque_max_nm for j in self._model.joints])

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
                raise ConfigurationError(self.file, f"joints[{i + 1}].drive", None, "an arm on a bus needs one per joint")
            identity = drive.identity
            drives.append(
                DriveSettings(
                    joint=joint.name,
                    node_id=drive.node_id,
                    mode=OperationMode.CYCLIC_SYNCHRONOUS_POSITION
                    if drive.mode == "csp"
                    else OperationMode.INTERPOLATED_POSITION,
                    feedback=EffortFeedback.CURRENT if drive.feedback == "current" else EffortFeedback.TORQUE,
                    counts_per_rad=drive.counts_per_axis_turn / (2 * math.pi),
                    rated_current_a=drive.rated_current_a,
                    rated_torque_nm=drive.rated_torque_nm,
                    max_torque_permille=drive.max_torque_permille,
                    following_error_rad=drive.following_error_rad,
                    position_min_rad=joint.position_min_rad,
                    position_max_rad=joint.position_max_rad,
                    has_brake=drive.has_brake,
                    identity=Identity(identity.vendor_id, identity.product_code, identity.revision)
                    if identity
                    else Identity(None, None),
                )
            )
        return ArmSettings(
            drives=tuple(drives),
            coupling=self.coupling(),
            cycle_s=1 / bus.cycle_hz,
            bitrate=bus.bitrate,
            heartbeat_s=bus.heartbeat_s,
            max_missing_cycles=bus.max_missing_cycles,
        )

    @property
    def simulated_payload_name(self) -> str:
        """Name of the payload that a simulated commissioning mounts."""
        return self._simulation().payload

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
            run: Number of the run, so that no two runs share their noise.

        Raises:
            ConfigurationError: the file has no simulation, or no payload of that name.
        """
        simulation = self._simulation()
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
            variant=PlantVariant(simulation.variant),
        )

    def _simulation(self) -> _Simulation:
        if self._model.simulation is None:
            raise ConfigurationError(self.file, "simulation", None, "this robot has no simulated twin")
        return self._model.simulation

    def _payload(self, name: str) -> _Payload:
        payloads = self._simulation().payloads
        if name not in payloads:
            known = ", ".join(sorted(payloads))
            raise ConfigurationError(self.file, "simulation.payloads", name, f"one of: {known}")
        return payloads[name]


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
    file = str(path) if path.suffix == ".toml" and not _is_shipped(name_or_path) else f"{name_or_path}.toml"
    try:
        text = path.read_text("utf-8")
        values = tomllib.loads(text)
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ConfigurationError(file, "(syntax)", str(error), "a TOML file, UTF-8") from error
    except OSError as error:
        raise ConfigurationError(file, "(file)", error.strerror, "a readable file") from error
    try:
        model = _File.model_validate(values)
    except ValidationError as error:
        raise _explained(file, error) from error
    _check_counts(file, model)
    excitations: dict[str, Excitation] = {}
    if model.excitation is not None:
        excitations = {
            role: read_excitation(path.parent / getattr(model.excitation, role))
            for role in ("identification", "validation")
        }
    robot = Robot(file, text, excitations, model)
    _check_excitations(robot)
    _check_strength(robot)
    if model.bus is not None:
        _check_bus_load(robot)
    return robot


def _is_shipped(name: str) -> bool:
    return name in shipped_robots()


def _find(name_or_path: str) -> Path:
    if _is_shipped(name_or_path):
        return Path(str(resources.files("armload_configs") / f"{name_or_path}.toml"))
    path = Path(name_or_path)
    if not path.is_file():
        known = ", ".join(shipped_robots())
        raise ConfigurationError(name_or_path, "ROBOT", name_or_path, f"a shipped robot ({known}) or a TOML file")
    return path


def _explained(file: str, error: ValidationError, prefix: str = "") -> ConfigurationError:
    """The first problem pydantic found, in this project's form."""
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
    table: type[BaseModel] | None = _File
    for part in loc[:-1]:
        if isinstance(part, str) and table is not None and part in table.model_fields:
            table = _table_of(table.model_fields[part].annotation)
    close = difflib.get_close_matches(str(loc[-1]), table.model_fields if table else (), n=1, cutoff=0.5)
    return f": did you mean {close[0]}?" if close else ""


def _table_of(annotation: Any) -> type[BaseModel] | None:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    return next((table for a in get_args(annotation) if (table := _table_of(a)) is not None), None)


def _check_counts(file: str, model: _File) -> None:
    n = len(model.joints)
    names = [joint.name for joint in model.joints]
    if len(set(names)) != n:
        raise ConfigurationError(file, "joints", names, "every joint a name of its own")
    if model.kinematics.n != n:
        raise ConfigurationError(file, "kinematics", model.kinematics.n, f"one row per joint, {n} in this file")
    if model.transmission is not None:
        coupling = model.transmission.coupling
        if len(coupling) != n or any(len(row) != n for row in coupling):
            raise ConfigurationError(file, "transmission.coupling", coupling, f"{n} rows of {n} numbers")
        if abs(np.linalg.det(np.array(coupling))) < 1e-6:  # noqa: PLR2004
            raise ConfigurationError(file, "transmission.coupling", coupling, "an invertible matrix")
    if model.simulation is not None:
        for key in ("joints", "start_position_rad"):
            if len(getattr(model.simulation, key)) != n:
                found = len(getattr(model.simulation, key))
                raise ConfigurationError(file, f"simulation.{key}", found, f"one entry per joint, {n} in this file")
        if model.simulation.payload not in model.simulation.payloads:
            known = ", ".join(sorted(model.simulation.payloads))
            raise ConfigurationError(file, "simulation.payload", model.simulation.payload, f"one of: {known}")
    if model.bus is not None:
        nodes = [joint.drive.node_id for joint in model.joints if joint.drive is not None]
        if len(set(nodes)) != len(nodes):
            raise ConfigurationError(file, "joints.drive.node_id", nodes, "a node id of its own for every drive")


def _check_excitations(robot: Robot) -> None:
    for role, excitation in robot.excitations.items():
        found = excitation.trajectory.n
        if found != robot.n:
            raise ConfigurationError(robot.file, f"excitation.{role}", found, f"a trajectory of {robot.n} joints")


def _check_strength(robot: Robot) -> None:
    """Refuse payloads that the arm is not made for or that its joints cannot hold up."""
    model = robot._model  # noqa: SLF001
    payloads: dict[str, _Payload] = {}
    if model.expected_payload is not None:
        payloads["expected_payload"] = model.expected_payload
    if model.simulation is not None:
        payloads |= {f"simulation.payloads.{name}": p for name, p in model.simulation.payloads.items()}
    chain, limits = robot.chain(), robot.limits()
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


def _check_bus_load(robot: Robot) -> None:
    arm = robot.arm_settings()
    load = forecast(arm)
    if load.share > arm.max_bus_load:
        raise ConfigurationError(
            robot.file,
            "bus.cycle_hz",
            robot.bus.cycle_hz,
            f"at most {load.max_cycle_hz:.0f} on this bus of {arm.bitrate} bit/s: {robot.n} joints would need "
            f"{load.share:.0%} of it in the worst case, {arm.max_bus_load:.0%} is allowed",
        )
