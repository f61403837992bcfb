"""An arm from a URDF: the chain of revolute joints from a base link to a flange link, and what its joints may do.

    pose of a joint's frame  =  pose of the parent link  *  origin  *  turn about the axis by q

Fixed joints are folded into the origins. A joint that is neither fixed nor revolute or continuous, and one that mimics
another, is refused where it lies between base and flange, and left out and named elsewhere.

Where `base` is not given it is the link without a parent. Where `flange` is not given it is the end of the only chain
of at least four revolute joints; of several links fixed to each other at that end the one that ROS-Industrial calls
`tool0` or `flange`. Anything else is ambiguous: the error lists what can be asked for.

References:
    URDF XML specification, ROS; REP 103 (units and axes); ROS-Industrial REP-I0001 draft (tool0, flange).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from armload_controller.control_errors import ConfigurationError
from armload_core.arrays import FloatArray
from armload_identification.identification_errors import ModelError
from armload_identification.model.chain import Chain, pose_from_xyz_rpy

FEWEST_JOINTS, MOST_JOINTS = 4, 16
STANDARD_FLANGES = ("tool0", "flange")
"""Names of the frame that tools are mounted to, the preferred one first."""
STANDARD_GRAVITY_M_S2 = (0.0, 0.0, -9.81)
_TURNING = ("revolute", "continuous")


@dataclass(frozen=True, eq=False)
class UrdfArm:
    """An arm of n joints as a URDF describes it; NaN where it does not say.

    Attributes:
        name: Of the robot.
        base: Link that the chain begins at.
        flange: Link that it ends at.
        chain: Kinematics; gravity along -z of the base.
        joint_names: From the base to the flange.
        position_min_rad: (n,) -inf for a continuous joint.
        position_max_rad: (n,) inf for a continuous joint.
        velocity_max_rad_s: (n,) from `<limit>`.
        torque_max_nm: (n,) effort of `<limit>`.
        viscous_nm_s_rad: (n,) damping of `<dynamics>`.
        coulomb_nm: (n,) friction of `<dynamics>`.
        other_joints: Movable joints of the file that are not of the chain.
    """

    name: str
    base: str
    flange: str
    chain: Chain
    joint_names: tuple[str, ...]
    position_min_rad: FloatArray
    position_max_rad: FloatArray
    velocity_max_rad_s: FloatArray
    torque_max_nm: FloatArray
    viscous_nm_s_rad: FloatArray
    coulomb_nm: FloatArray
    other_joints: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class _Joint:
    """One `<joint>`."""

    name: str
    kind: str
    parent: str
    child: str
    mimics: str | None
    element: ElementTree.Element

    @property
    def turns(self) -> bool:
        """Whether an arm may be made of it."""
        return self.kind in _TURNING and self.mimics is None


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

    Its chain is what `PayloadFeedforward` takes.

    Args:
        path: The file, with its xacro macros expanded.
        base: Link that the chain begins at; None for the root.
        flange: Link that it ends at; None where the file leaves one choice only.

    Returns:
        The arm.

    Raises:
        ConfigurationError: the file is no URDF, a link does not exist or the choice is ambiguous (the candidates are
            listed), a joint of the chain is of a kind that is not supported, or their number is not 4 to 16.
    """
    path = Path(path)
    root = _parse(path)
    joints = [_joint(path, i, element) for i, element in enumerate(root.findall("joint"))]
    links = [str(element.get("name")) for element in root.findall("link")]
    above = _parents(path, joints, links)
    start = _base(path, base, links, above)
    end = _flange(path, flange, start, links, above)
    way = _way(path, start, end, above)
    moving = [joint for joint in way if joint.kind != "fixed"]
    _require_supported(path, moving, start, end)
    chain = _chain(path, way, moving)
    limits = np.array([_limits(path, joint) for joint in moving])
    named = {joint.name for joint in moving}
    return UrdfArm(
        name=root.get("name") or path.stem,
        base=start,
        flange=end,
        chain=chain,
        joint_names=tuple(joint.name for joint in moving),
        position_min_rad=limits[:, 0],
        position_max_rad=limits[:, 1],
        velocity_max_rad_s=limits[:, 2],
        torque_max_nm=limits[:, 3],
        viscous_nm_s_rad=limits[:, 4],
        coulomb_nm=limits[:, 5],
        other_joints=tuple(j.name for j in joints if j.kind != "fixed" and j.name not in named),
    )


def _parse(path: Path) -> ElementTree.Element:
    """The `<robot>` of a file."""
    try:
        root = ElementTree.fromstring(path.read_bytes())
    except OSError as error:
        raise ConfigurationError(str(path), "file", None, f"a URDF that can be read ({error.strerror})") from error
    except (ElementTree.ParseError, LookupError, ValueError) as error:
        raise ConfigurationError(
            str(path), "XML", str(error), "a URDF; expand a xacro file first: `xacro arm.urdf.xacro > arm.urdf`"
        ) from error
    if root.tag != "robot":
        raise ConfigurationError(str(path), "root element", root.tag, "<robot>, as every URDF has")
    macros = [element.tag for element in root.iter() if "ros.org/wiki/xacro" in element.tag]
    if macros:
        raise ConfigurationError(
            str(path), "xacro", macros[0].split("}")[-1], "no macros; expand them: `xacro arm.urdf.xacro > arm.urdf`"
        )
    return root


def _joint(path: Path, index: int, element: ElementTree.Element) -> _Joint:
    """One joint, with the links that it connects."""
    name = element.get("name")
    if not name:
        raise ConfigurationError(str(path), f"joint {index + 1}, name", None, "a name")
    ends = []
    for tag in ("parent", "child"):
        end = element.find(tag)
        link = None if end is None else end.get("link")
        if not link:
            raise ConfigurationError(str(path), f"joint {name}, {tag}", None, f'<{tag} link="..."/>')
        ends.append(link)
    mimic = element.find("mimic")
    mimics = None if mimic is None else mimic.get("joint") or "another"
    return _Joint(name, element.get("type") or "", ends[0], ends[1], mimics, element)


def _parents(path: Path, joints: list[_Joint], links: list[str]) -> dict[str, _Joint]:
    """The joint above each link."""
    above: dict[str, _Joint] = {}
    for joint in joints:
        if joint.child in above:
            raise ConfigurationError(
                str(path),
                f"joint {joint.name}, child",
                joint.child,
                f"a link without a parent; {above[joint.child].name} is its parent already: a chain has no loops",
            )
        for link in (joint.parent, joint.child):
            if link not in links:
                raise ConfigurationError(str(path), f"joint {joint.name}, link", link, "one of the file's <link>s")
        above[joint.child] = joint
    return above


def _base(path: Path, base: str | None, links: list[str], above: dict[str, _Joint]) -> str:
    """The link that the chain begins at."""
    if base is not None:
        return _known(path, "--base", base, links)
    roots = [link for link in links if link not in above]
    if len(roots) != 1:
        raise ConfigurationError(str(path), "root link", roots, "one link without a parent; or name one with --base")
    return roots[0]


def _known(path: Path, option: str, link: str, links: list[str]) -> str:
    """A link that was asked for and exists."""
    if link not in links:
        raise ConfigurationError(str(path), option, link, f"one of its links: {', '.join(links)}")
    return link


def _flange(path: Path, flange: str | None, base: str, links: list[str], above: dict[str, _Joint]) -> str:
    """The link that the chain ends at."""
    if flange is not None:
        return _known(path, "--flange", flange, links)
    ends: dict[tuple[str, ...], list[str]] = {}
    for link in links:
        names = _turning_names(link, base, above)
        if names is not None and len(names) >= FEWEST_JOINTS:
            ends.setdefault(names, []).append(link)
    longest = {
        names: at for names, at in ends.items() if not any(n != names and n[: len(names)] == names for n in ends)
    }
    if not longest:
        raise ConfigurationError(
            str(path),
            "chain",
            None,
            f"at least {FEWEST_JOINTS} revolute joints in a row from {base!r}; begin elsewhere with --base",
        )
    candidates = [link for at in longest.values() for link in at]
    if len(longest) == 1:
        standard = [link for name in STANDARD_FLANGES for link in candidates if link == name]
        if len(candidates) == 1 or standard:
            return standard[0] if standard else candidates[0]
    raise ConfigurationError(
        str(path), "--flange", None, f"needed, because several links could be it: {', '.join(candidates)}"
    )


def _goes_on(names: tuple[str, ...], other: tuple[str, ...]) -> bool:
    """Whether another chain is the same and longer."""
    return len(other) > len(names) and other[: len(names)] == names


def _turning_names(link: str, base: str, above: dict[str, _Joint]) -> tuple[str, ...] | None:
    """Names of the joints from the base to a link; None where one is not revolute or the link is not below it."""
    names = []
    for joint in _upwards(link, above):
        if link == base:
            break
        if joint.kind != "fixed":
            if not joint.turns:
                return None
            names.append(joint.name)
        link = joint.parent
    return tuple(reversed(names)) if link == base else None


def _upwards(link: str, above: dict[str, _Joint]) -> Iterator[_Joint]:
    """The joints above a link, nearest first; a ring ends where it began."""
    seen = set()
    while link in above and link not in seen:
        seen.add(link)
        yield above[link]
        link = above[link].parent


def _way(path: Path, base: str, flange: str, above: dict[str, _Joint]) -> list[_Joint]:
    """All joints from the base to the flange."""
    way: list[_Joint] = []
    link = flange
    for joint in _upwards(flange, above):
        if link == base:
            break
        way.append(joint)
        link = joint.parent
    if link != base:
        raise ConfigurationError(
            str(path), "--flange", flange, f"a link below {base!r}; above it are {', '.join(j.parent for j in way)}"
        )
    return way[::-1]


def _require_supported(path: Path, moving: list[_Joint], base: str, flange: str) -> None:
    """Refuse a chain that is not of 4 to 16 independent revolute joints."""
    for joint in moving:
        if joint.mimics is not None:
            raise ConfigurationError(
                str(path),
                f"joint {joint.name}, mimic",
                joint.mimics,
                "a joint with a motor of its own; choose another chain with --base and --flange",
            )
        if not joint.turns:
            raise ConfigurationError(
                str(path),
                f"joint {joint.name}, type",
                joint.kind,
                "revolute, continuous or fixed between base and flange; choose another chain with --base and --flange",
            )
    if not FEWEST_JOINTS <= len(moving) <= MOST_JOINTS:
        names = ", ".join(joint.name for joint in moving) or "none"
        raise ConfigurationError(
            str(path),
            f"joints from {base} to {flange}",
            names,
            f"{FEWEST_JOINTS} to {MOST_JOINTS}; choose another chain with --base and --flange",
        )


def _chain(path: Path, way: list[_Joint], moving: list[_Joint]) -> Chain:
    """The chain, fixed joints folded."""
    placements, pose = [], np.eye(4)
    for joint in way:
        origin = joint.element.find("origin")
        values = [_numbers(path, joint, "origin", origin, key, (0.0, 0.0, 0.0)) for key in ("xyz", "rpy")]
        pose = pose @ pose_from_xyz_rpy(values[0], values[1])
        if joint.kind != "fixed":
            placements.append(pose)
            pose = np.eye(4)
    axes = [_numbers(path, joint, "axis", joint.element.find("axis"), "xyz", (1.0, 0.0, 0.0)) for joint in moving]
    try:
        return Chain(np.array(placements), np.array(axes), pose, np.array(STANDARD_GRAVITY_M_S2))
    except ModelError as error:
        raise ConfigurationError(str(path), "joints", [joint.name for joint in moving], str(error)) from error


def _limits(path: Path, joint: _Joint) -> tuple[float, float, float, float, float, float]:
    """Lower and upper position, velocity, effort, damping, friction."""
    limit, dynamics = joint.element.find("limit"), joint.element.find("dynamics")
    if joint.kind == "continuous":
        lower, upper = -math.inf, math.inf
    else:
        lower, upper = (_number(path, joint, "limit", limit, key) for key in ("lower", "upper"))
    velocity, effort = (_number(path, joint, "limit", limit, key) for key in ("velocity", "effort"))
    damping, friction = (_number(path, joint, "dynamics", dynamics, key) for key in ("damping", "friction"))
    return lower, upper, velocity, effort, damping, friction


def _number(path: Path, joint: _Joint, tag: str, element: ElementTree.Element | None, key: str) -> float:
    """One attribute; NaN where it is not there."""
    text = None if element is None else element.get(key)
    if text is None:
        return math.nan
    return _floats(path, joint, tag, key, text, 1)[0]


def _numbers(
    path: Path,
    joint: _Joint,
    tag: str,
    element: ElementTree.Element | None,
    key: str,
    default: tuple[float, float, float],
) -> tuple[float, ...]:
    """Three numbers of one attribute."""
    text = None if element is None else element.get(key)
    return default if text is None else _floats(path, joint, tag, key, text, 3)


def _floats(path: Path, joint: _Joint, tag: str, key: str, text: str, count: int) -> tuple[float, ...]:
    """Finite numbers of a text."""
    try:
        values = tuple(float(word) for word in text.split())
    except ValueError:
        values = ()
    if len(values) != count or not all(math.isfinite(value) for value in values):
        what = "a finite number" if count == 1 else f"{count} finite numbers"
        raise ConfigurationError(str(path), f"joint {joint.name}, {tag} {key}", text, what)
    return values
