"""An arm from a URDF: the chain of revolute joints from a base link to a flange link, and its joints' limits.

    pose of a joint's frame  =  pose of the parent link  *  origin  *  rotation about the axis by q

Fixed joints are folded into the origins. A mimic joint, or one that is neither fixed, revolute nor continuous, is
refused between base and flange; elsewhere it is listed and ignored.

The default `base` is the link without a parent. The default `flange` is the end of the only chain of at least four
revolute joints, without a gripper's jaws and fingers, which their joints' names tell; of several links fixed to each
other at that end, the one that ROS-Industrial calls `tool0` or `flange`. Anything else is ambiguous, and the error
lists the choices.

References:
    URDF XML specification, ROS; REP 103 (units and axes); ROS-Industrial REP-I0001 draft (tool0, flange).
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import ClassVar
from xml.etree import ElementTree

import numpy as np

from armload_controller.config.urdf_tree import UrdfJoint, UrdfTree, read_urdf_tree
from armload_identification.argument_types import path_of
from armload_identification.float_array import FloatArray
from armload_identification.identification_errors import ModelError, RecordingError
from armload_identification.model.chain import Chain
from armload_identification.model.dynamics import ArmBody
from armload_identification.model.payload import TENSOR_ELEMENTS, InertialParameters, symmetric_tensor
from armload_identification.recording.csv_columns import CsvColumns
from armload_identification.recording.recording import Recording, check_joints
from armload_identification.signals.joint_torque import Transmission
from armload_identification.verdict.recording_checks.impossible_magnitudes import ArmMagnitudes, require_possible

FEWEST_JOINTS, MOST_JOINTS = 4, 16
STANDARD_FLANGES = ("tool0", "flange")
"""Names of the frame to which tools are mounted, preferred first."""
STANDARD_GRAVITY_M_S2 = (0.0, 0.0, -9.81)


@dataclass(frozen=True, eq=False, kw_only=True)
class DescribedArm:
    """What a URDF, or an operator's answers, say about an arm of n joints; values that are not given are NaN.

    Attributes:
        name: Name of the robot.
        chain: Kinematics; gravity along -z of the URDF's root, with the joints between root and base at zero.
        joint_names: Names from the base to the flange.
        position_min_rad: (n,) lower limit; -inf for a continuous joint.
        position_max_rad: (n,) upper limit; inf for a continuous joint.
        velocity_max_rad_s: (n,) greatest speed.
        torque_max_nm: (n,) greatest torque.
        viscous_nm_s_rad: (n,) viscous friction.
        coulomb_nm: (n,) Coulomb friction.
        links: Per joint, the body between it and the next joint, in its frame, with all joints outside the chain at
            zero; None if no mass is given.
        other_joints: Movable joints of the URDF outside the chain, taken as fixed.
    """

    name: str
    chain: Chain
    joint_names: tuple[str, ...]
    position_min_rad: FloatArray
    position_max_rad: FloatArray
    velocity_max_rad_s: FloatArray
    torque_max_nm: FloatArray
    viscous_nm_s_rad: FloatArray
    coulomb_nm: FloatArray
    links: tuple[InertialParameters | None, ...]
    other_joints: tuple[str, ...]

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.joint_names)


@dataclass(frozen=True, eq=False, kw_only=True)
class UrdfArm(DescribedArm):
    """An arm described by a URDF; limits and friction are those of `<limit>` and `<dynamics>`.

    Attributes:
        file: The file's name, for messages.
        sha256: Hash of the file and of the choice of base and flange.
        base: First link of the chain.
        flange: Last link of the chain.
    """

    file: str
    sha256: str
    base: str
    flange: str
    csv_columns: ClassVar[CsvColumns | None] = None
    """A URDF does not describe logs, state a rated payload, or name a calibration."""
    rated_payload_kg: ClassVar[None] = None
    calibration_file: ClassVar[None] = None

    @property
    def description(self) -> str:
        """One line that describes the robot."""
        return f"from {Path(self.file).name}, {self.base} to {self.flange}"

    @property
    def position_limits_rad(self) -> FloatArray:
        """(n, 2) least and greatest position of each joint."""
        return np.stack([self.position_min_rad, self.position_max_rad], axis=1)

    @property
    def transmission(self) -> Transmission:
        """Unit gains: a URDF does not describe motors, so recordings must contain joint torque."""
        return Transmission(np.ones(self.n), np.eye(self.n))

    def own(self, recording: Recording) -> Recording:
        """A recording with this arm's joints; see `Robot.own`. Effort is joint torque."""
        if recording.torque_nm is None:
            raise RecordingError(
                f"{recording.source.path}: no joint torque, only motor currents, and a URDF has no torque constants. "
                "Create a robot file with `armload init` and give its joints gear_ratio and torque_constant_nm_a."
            )
        if recording.joint_names:
            recording = recording.named_joints(self.joint_names)
        check_joints(recording, self.n)
        require_possible(recording, self.chain, recording.torque_nm, self.magnitudes)
        return recording

    @property
    def magnitudes(self) -> ArmMagnitudes:
        """Ranges, speeds and torques of the joints; NaN for a limit of 0, which some files use for unspecified ones."""
        body, none = None, np.zeros(self.n)
        links = [link.theta for link in self.links if link is not None]
        if len(links) == self.n:
            body = ArmBody(np.array(links), none, none, none, np.eye(self.n))
        velocity_max, torque_max = (
            np.where(limit > 0.0, limit, np.nan) for limit in (self.velocity_max_rad_s, self.torque_max_nm)
        )
        return ArmMagnitudes(
            self.joint_names, self.position_min_rad, self.position_max_rad, velocity_max, torque_max, body
        )


def read_urdf_arm(path: str | PathLike[str], base: str | None = None, flange: str | None = None) -> UrdfArm:
    """Read the arm between two links of a URDF.

        >>> import armload
        >>> from pathlib import Path
        >>> links = "".join(f'<link name="link_{i}"/>' for i in range(5))
        >>> joint = '<joint name="joint_{1}" type="revolute"><parent link="link_{0}"/><child link="link_{1}"/></joint>'
        >>> joints = "".join(joint.format(i, i + 1) for i in range(4))
        >>> _ = Path("arm.urdf").write_text(f'<robot name="arm">{links}{joints}</robot>')
        >>> arm = armload.read_urdf_arm("arm.urdf")
        >>> isinstance(arm, armload.UrdfArm), arm.base, arm.flange, len(arm.joint_names)
        (True, 'link_0', 'link_4', 4)

    `identify` and `validate` accept it in place of a robot, and `PayloadFeedforward` accepts its chain.

    Args:
        path: The file, with its xacro macros expanded.
        base: First link of the chain; None for the root.
        flange: Last link of the chain; None if the file leaves only one choice.

    Returns:
        The arm.

    Raises:
        ConfigurationError: the file is not a URDF, a link does not exist or the choice is ambiguous (the candidates are
            listed), a joint of the chain is of a kind that is not supported, or their number is not 4 to 16.
    """
    tree = read_urdf_tree(path_of("path", path, "the path of a URDF"))
    start = _base_link(tree, base)
    end = _flange_link(tree, flange, start)
    way = _joints_between(tree, start, end)
    moving = [joint for joint in way if joint.kind != "fixed"]
    _require_supported(tree, moving, start, end)
    limits = np.array([_limits(tree, joint) for joint in moving])
    named = {joint.name for joint in moving}
    return UrdfArm(
        file=str(path),
        sha256=hashlib.sha256(f"{tree.sha256} {start} {end}".encode()).hexdigest(),
        name=tree.name,
        base=start,
        flange=end,
        chain=_chain(tree, way, moving, _gravity(tree, start)),
        joint_names=tuple(joint.name for joint in moving),
        position_min_rad=limits[:, 0],
        position_max_rad=limits[:, 1],
        velocity_max_rad_s=limits[:, 2],
        torque_max_nm=limits[:, 3],
        viscous_nm_s_rad=limits[:, 4],
        coulomb_nm=limits[:, 5],
        links=_links(tree, moving),
        other_joints=tuple(j.name for j in tree.joints if j.kind != "fixed" and j.name not in named),
    )


def _base_link(tree: UrdfTree, base: str | None) -> str:
    """The first link of the chain."""
    if base is not None:
        return _existing_link(tree, "`base=`", base)
    roots = [link for link in tree.links if link not in tree.above]
    if len(roots) != 1:
        raise tree.refused("root link", roots, "exactly one link without a parent; or name one with `base=`")
    return roots[0]


def _existing_link(tree: UrdfTree, option: str, link: str) -> str:
    """A requested link, after checking that it exists."""
    if link not in tree.links:
        raise tree.refused(option, link, f"one of its links: {', '.join(tree.links)}")
    return link


def _flange_link(tree: UrdfTree, flange: str | None, base: str) -> str:
    """The last link of the chain."""
    if flange is not None:
        return _existing_link(tree, "`flange=`", flange)
    ends: dict[tuple[str, ...], list[str]] = {}
    for link in tree.links:
        names = _turning_names(tree, link, base)
        held = any(joint.grips and joint.name in (names or ()) for joint in tree.upwards(link))
        if names is not None and len(names) >= FEWEST_JOINTS and not held:
            ends.setdefault(names, []).append(link)
    longest = {
        names: at for names, at in ends.items() if not any(n != names and n[: len(names)] == names for n in ends)
    }
    if not longest:
        expected = f"at least {FEWEST_JOINTS} revolute joints in a row from {base!r}"
        raise tree.refused("chain", None, f"{expected}; {_other_starts(tree)}")
    candidates = [link for at in longest.values() for link in at]
    if len(longest) == 1:
        standard = [link for name in STANDARD_FLANGES for link in candidates if link == name]
        if len(candidates) == 1 or standard:
            return standard[0] if standard else candidates[0]
    raise tree.refused("`flange=`", None, f"name the link that carries the payload: {', '.join(candidates)}")


def _other_starts(tree: UrdfTree) -> str:
    """The links from which a chain could start, and joints that no chain can have."""
    starts = [
        base
        for base in tree.links
        if any(len(_turning_names(tree, link, base) or ()) >= FEWEST_JOINTS for link in tree.links)
    ]
    first = [base for base in starts if base not in tree.above or tree.above[base].parent not in starts]
    sliding = [joint.name for joint in tree.above.values() if joint.kind == "prismatic"]
    said = f"choose another start with `base=`: {', '.join(first)}" if first else "no link is the start of such a row"
    return f"{said}; prismatic joints are not supported: {', '.join(sliding)}" if sliding else said


def _joints_down_to(tree: UrdfTree, base: str, link: str) -> list[UrdfJoint] | None:
    """All joints from the base to a link; None if the link is not below the base."""
    way: list[UrdfJoint] = []
    for joint in tree.upwards(link):
        if link == base:
            break
        way.append(joint)
        link = joint.parent
    return way[::-1] if link == base else None


def _turning_names(tree: UrdfTree, link: str, base: str) -> tuple[str, ...] | None:
    """Names of the joints from the base to a link; None if one is not revolute or the link is not below the base."""
    way = _joints_down_to(tree, base, link)
    moving = [joint for joint in way or () if joint.kind != "fixed"]
    return None if way is None or not all(joint.turns for joint in moving) else tuple(joint.name for joint in moving)


def _joints_between(tree: UrdfTree, base: str, flange: str) -> list[UrdfJoint]:
    """All joints from the base to the flange."""
    way = _joints_down_to(tree, base, flange)
    if way is None:
        above = ", ".join(joint.parent for joint in tree.upwards(flange))
        expected = f"a link below {base!r}; above it are {above or 'none'}; {_other_starts(tree)}"
        raise tree.refused("`flange=`", flange, expected)
    return way


def _require_supported(tree: UrdfTree, moving: Sequence[UrdfJoint], base: str, flange: str) -> None:
    """Refuse a chain that does not consist of 4 to 16 independent revolute joints."""
    remedy = f"choose another `flange=`; {_other_starts(tree)}"
    for joint in moving:
        if joint.mimics is not None:
            raise tree.refused(f"joint {joint.name}, mimic", joint.mimics, f"a joint with its own motor; {remedy}")
        if not joint.turns:
            expected = f"revolute, continuous or fixed between base and flange; {remedy}"
            raise tree.refused(f"joint {joint.name}, type", joint.kind, expected)
    if not FEWEST_JOINTS <= len(moving) <= MOST_JOINTS:
        names = ", ".join(joint.name for joint in moving) or "none"
        raise tree.refused(f"joints from {base} to {flange}", names, f"{FEWEST_JOINTS} to {MOST_JOINTS}; {remedy}")


def _chain(tree: UrdfTree, way: Sequence[UrdfJoint], moving: Sequence[UrdfJoint], gravity: FloatArray) -> Chain:
    """The chain, fixed joints folded."""
    placements, pose = [], np.eye(4)
    for joint in way:
        pose = pose @ tree.pose(f"joint {joint.name}", joint.element)
        if joint.kind != "fixed":
            placements.append(pose)
            pose = np.eye(4)
    axes = [
        tree.numbers(f"joint {joint.name}", "axis", joint.element.find("axis"), "xyz", (1.0, 0.0, 0.0))
        for joint in moving
    ]
    try:
        return Chain(np.array(placements), np.array(axes), pose, gravity)
    except ModelError as error:
        raise tree.refused("joints", [joint.name for joint in moving], str(error)) from error


def _gravity(tree: UrdfTree, base: str) -> FloatArray:
    """(3,) gravity in the base's axes: along -z of the root, with the joints between them at zero."""
    pose = np.eye(4)
    for joint in tree.upwards(base):
        pose = tree.pose(f"joint {joint.name}", joint.element) @ pose
    return np.asarray(pose[:3, :3].T @ STANDARD_GRAVITY_M_S2)


def _limits(tree: UrdfTree, joint: UrdfJoint) -> tuple[float, float, float, float, float, float]:
    """Lower and upper position, velocity, effort, damping, friction."""
    owner = f"joint {joint.name}"
    limit, dynamics = joint.element.find("limit"), joint.element.find("dynamics")
    if joint.kind == "continuous":
        lower, upper = -math.inf, math.inf
    else:
        lower, upper = (tree.number(owner, "limit", limit, key) for key in ("lower", "upper"))
        if not lower < upper:  # as some programs write unspecified limits
            lower = upper = math.nan
    velocity, effort = (tree.number(owner, "limit", limit, key) for key in ("velocity", "effort"))
    damping, friction = (tree.number(owner, "dynamics", dynamics, key) for key in ("damping", "friction"))
    return lower, upper, velocity, effort, damping, friction


def _links(tree: UrdfTree, moving: Sequence[UrdfJoint]) -> tuple[InertialParameters | None, ...]:
    """The body moved by each joint of the chain, other joints at zero; None if no mass is given."""
    place = {joint.name: i for i, joint in enumerate(moving)}
    sums = np.zeros((len(moving), 10))
    for name, element in tree.links.items():
        inertial = element.find("inertial")
        if inertial is None:
            continue
        pose = np.eye(4)
        for joint in tree.upwards(name):
            if joint.name in place:
                sums[place[joint.name]] += _inertial(tree, f"link {name}", inertial, pose).theta
                break
            pose = tree.pose(f"joint {joint.name}", joint.element) @ pose
    return tuple(InertialParameters(theta) if theta[0] > 0.0 else None for theta in sums)


def _inertial(tree: UrdfTree, owner: str, inertial: ElementTree.Element, pose: FloatArray) -> InertialParameters:
    """An `<inertial>` expressed in another frame; `pose` is the (4, 4) pose of its link in that frame."""
    mass, inertia = inertial.find("mass"), inertial.find("inertia")
    values = [tree.number(owner, "mass", mass, "value")]
    values += [tree.number(owner, "inertia", inertia, key) for key in TENSOR_ELEMENTS]
    kg, *elements = np.nan_to_num(values)
    body = InertialParameters.from_center_of_mass(float(kg), np.zeros(3), symmetric_tensor(elements))
    return body.transformed(pose @ tree.pose(owner, inertial))
