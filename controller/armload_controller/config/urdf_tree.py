"""The elements of a URDF: links, joints, and the joint above each link. `chain_from_urdf` makes an arm of them.

References:
    URDF XML specification, ROS.
"""

from __future__ import annotations

import hashlib
import math
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from msgspec import Struct

from armload_controller.control_errors import ConfigurationError
from armload_identification.float_array import FloatArray
from armload_identification.model.chain import pose_from_xyz_rpy
from armload_identification.storage.regular_file import read_whole

if TYPE_CHECKING:
    from xml.etree import ElementTree

_REVOLUTE_TYPES = ("revolute", "continuous")
_HAND_WORDS = {"gripper", "finger", "jaw", "thumb", "knuckle", "hand", "pinky", "pincer", "claw"}
_WRIST_WORDS = {"yaw", "pitch", "roll", "wrist"}
_ZERO = (0.0, 0.0, 0.0)


class UrdfJoint(Struct, frozen=True, eq=False):
    """One `<joint>`.

    Attributes:
        kind: Its type, such as "revolute".
        parent: The link above it.
        child: The link below it.
        mimics: The joint that it follows; None if it is independent.
        element: The XML element.
    """

    name: str
    kind: str
    parent: str
    child: str
    mimics: str | None
    element: ElementTree.Element

    @property
    def turns(self) -> bool:
        """Whether it can be a joint of an arm: revolute or continuous, and independent."""
        return self.kind in _REVOLUTE_TYPES and self.mimics is None

    @property
    def grips(self) -> bool:
        """Whether its name is that of a gripper's jaw or of a finger, not of a wrist's axis."""
        words = {word.lower() for word in re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+", self.name)}
        return bool(words & _HAND_WORDS) and not words & _WRIST_WORDS


class UrdfTree(Struct, frozen=True, eq=False):
    """One file.

    Attributes:
        path: The file.
        sha256: Hash of its content.
        name: Name of the robot.
        links: XML element by name.
        joints: Joints in the file's order.
        above: The joint above each link that has one.
    """

    path: Path
    sha256: str
    name: str
    links: Mapping[str, ElementTree.Element]
    joints: tuple[UrdfJoint, ...]
    above: Mapping[str, UrdfJoint]

    def refused(self, key: str, found: object, expected: str) -> ConfigurationError:
        """An error that names this file; see `ConfigurationError`."""
        return ConfigurationError(str(self.path), key, found, expected)

    def upwards(self, link: str) -> Iterator[UrdfJoint]:
        """The joints above a link, nearest first; stops if the links form a ring."""
        seen = set()
        while link in self.above and link not in seen:
            seen.add(link)
            yield self.above[link]
            link = self.above[link].parent

    def pose(self, owner: str, element: ElementTree.Element) -> FloatArray:
        """(4, 4) the `<origin>` of an element; the identity if it has none.

        Args:
            owner: The element's name, for messages.
            element: A joint, an inertial or a geometry.

        Raises:
            ConfigurationError: an attribute is not three finite numbers.
        """
        origin = element.find("origin")
        values = [self.numbers(owner, "origin", origin, key, _ZERO) for key in ("xyz", "rpy")]
        return pose_from_xyz_rpy(values[0], values[1])

    def number(self, owner: str, tag: str, element: ElementTree.Element | None, key: str) -> float:
        """One attribute of an element; NaN if the element or the attribute is missing.

        Args:
            owner: Name of the joint or link that contains it, for messages.
            tag: Name of the element.
            key: Name of the attribute.

        Raises:
            ConfigurationError: the attribute is not a finite number.
        """
        text = None if element is None else element.get(key)
        return math.nan if text is None else self._floats(owner, tag, key, text, 1)[0]

    def numbers(
        self,
        owner: str,
        tag: str,
        element: ElementTree.Element | None,
        key: str,
        default: tuple[float, float, float],
    ) -> tuple[float, ...]:
        """Three numbers of one attribute; see `number`."""
        text = None if element is None else element.get(key)
        return default if text is None else self._floats(owner, tag, key, text, 3)

    def _floats(self, owner: str, tag: str, key: str, text: str, count: int) -> tuple[float, ...]:
        """Finite numbers from a text."""
        try:
            values = tuple(float(word) for word in text.split())
        except ValueError:
            values = ()
        if len(values) != count or not all(math.isfinite(value) for value in values):
            what = "a finite number" if count == 1 else f"{count} finite numbers"
            raise self.refused(f"{owner}, {tag} {key}", text, what)
        return values


def is_urdf(path: Path) -> bool:
    """Whether a file is XML: its first character is `<`; False if it cannot be read."""
    try:
        with path.open("rb") as file:
            return file.read(64).removeprefix(b"\xef\xbb\xbf").lstrip().startswith(b"<")
    except OSError:
        return False


def read_urdf_tree(path: Path) -> UrdfTree:
    """Read a URDF.

    Args:
        path: The file, with its xacro macros expanded.

    Raises:
        ConfigurationError: the file cannot be read, is not a URDF, or its joints and links do not form a tree.
    """
    try:
        data = read_whole(path)
    except OSError as error:
        raise ConfigurationError(str(path), "", None, f"{error.strerror}: expected a URDF") from error
    root = _parsed(path, data)
    joints = tuple(_joint(path, i, element) for i, element in enumerate(root.findall("joint")))
    links = {str(element.get("name")): element for element in root.findall("link")}
    above = {joint.child: joint for joint in reversed(joints)}
    tree = UrdfTree(path, hashlib.sha256(data).hexdigest(), root.get("name") or path.stem, links, joints, above)
    _require_tree(tree)
    return tree


def _parsed(path: Path, data: bytes) -> ElementTree.Element:
    """The `<robot>` element of a file."""
    from xml.etree import ElementTree

    try:
        root = ElementTree.fromstring(data)
    except (ElementTree.ParseError, LookupError, ValueError) as error:
        expected = "a URDF; expand a xacro file first: `xacro arm.urdf.xacro > arm.urdf`"
        raise ConfigurationError(str(path), "XML", str(error), expected) from error
    if root.tag != "robot":
        raise ConfigurationError(str(path), "root element", root.tag, "<robot>, as in every URDF")
    macros = [element.tag for element in root.iter() if "ros.org/wiki/xacro" in element.tag]
    if macros:
        expected = "no macros; expand them: `xacro arm.urdf.xacro > arm.urdf`"
        raise ConfigurationError(str(path), "xacro", macros[0].split("}")[-1], expected)
    return root


def _joint(path: Path, index: int, element: ElementTree.Element) -> UrdfJoint:
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
    return UrdfJoint(name, element.get("type") or "", ends[0], ends[1], mimics, element)


def _require_tree(tree: UrdfTree) -> None:
    """Refuse a link with two joints above it, and a joint to a link that the file does not contain."""
    for joint in tree.joints:
        first = tree.above[joint.child]
        if first is not joint:
            expected = f"a link without a parent; {first.name} is already its parent: a chain has no loops"
            raise tree.refused(f"joint {joint.name}, child", joint.child, expected)
        for link in (joint.parent, joint.child):
            if link not in tree.links:
                raise tree.refused(f"joint {joint.name}, link", link, "one of the <link> elements in the file")
