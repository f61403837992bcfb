"""The collision geometry of one arm in a URDF, through Pinocchio: its joints move, all others stay at zero.

The file is adapted first: joints outside the arm become fixed, continuous ones revolute, and meshes are searched for
relative to the file: `package://NAME/PATH` in any parent folder, as PATH or NAME/PATH.

Requires Pinocchio with coal (the `urdf` extra), which is loaded only if a URDF is given.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from armload_identification.identification_errors import ModelError

_PACKAGE = "package://"
_TURNING = ("revolute", "continuous")
_ANY_LIMIT = {"lower": "-10", "upper": "10", "effort": "1", "velocity": "1"}
"""Limits of joints without any: Pinocchio requires them, nothing here depends on them."""


@dataclass(frozen=True, eq=False)
class UrdfGeometry:
    """A loaded URDF; objects of Pinocchio and coal, which have no type hints.

    Attributes:
        pin: Pinocchio.
        coal: Its collision library.
        model: Kinematics of the arm.
        geometry: Its collision geometry, in the links' frames.
        connected: Pairs of links that a joint connects.
    """

    pin: Any
    coal: Any
    model: Any
    geometry: Any
    connected: frozenset[frozenset[str]]


def load_urdf_geometry(file: Path, joint_names: Collection[str]) -> UrdfGeometry:
    """Read a URDF with its meshes.

    Args:
        file: The URDF.
        joint_names: The joints of the arm.

    Raises:
        ModelError: Pinocchio is missing, or the file or one of its meshes cannot be used.
    """
    try:
        import coal
        import pinocchio as pin
    except ImportError as error:
        raise ModelError(f'{file}: a URDF needs Pinocchio with coal: pip install "armload[urdf]"') from error
    root, connected = _prepared(file, joint_names)
    text = ElementTree.tostring(root, encoding="unicode")
    try:
        model = pin.buildModelFromXML(text)
        geometry = pin.buildGeomFromUrdfString(model, text, pin.GeometryType.COLLISION)
    except (ValueError, RuntimeError) as error:
        raise ModelError(f"{file}: {error}. Expected a URDF with its meshes in the same folder") from error
    return UrdfGeometry(pin, coal, model, geometry, connected)


def _prepared(file: Path, joint_names: Collection[str]) -> tuple[ElementTree.Element, frozenset[frozenset[str]]]:
    """The file with other joints fixed and paths of meshes resolved; and the pairs of links that joints connect."""
    try:
        root = ElementTree.parse(file).getroot()
    except (OSError, ElementTree.ParseError) as error:
        raise ModelError(f"{file}: {error}. Expected a URDF") from error
    connected = set()
    for joint in root.findall("joint"):
        ends = [joint.find(tag) for tag in ("parent", "child")]
        connected.add(frozenset(str(end.get("link")) for end in ends if end is not None))
        if joint.get("name") not in joint_names or joint.get("type") not in _TURNING:
            joint.set("type", "fixed")
        else:
            joint.set("type", "revolute")
            limit = joint.find("limit")
            limit = ElementTree.SubElement(joint, "limit") if limit is None else limit
            for key, value in _ANY_LIMIT.items():
                limit.set(key, limit.get(key, value))
        for mimic in joint.findall("mimic"):
            joint.remove(mimic)
    for mesh in root.iterfind("link/collision/geometry/mesh"):
        mesh.set("filename", str(_mesh_file(file, mesh.get("filename", ""))))
    return root, frozenset(connected)


def _mesh_file(file: Path, name: str) -> Path:
    """Path of a mesh."""
    inner = name.removeprefix("file://")
    places = [file.parent / inner]
    if name.startswith(_PACKAGE):
        inner = name.removeprefix(_PACKAGE)
        folders = [file.resolve().parent, *file.resolve().parent.parents]
        places = [folder / part for folder in folders for part in (inner, inner.partition("/")[2]) if part]
    found = next((place for place in places if place.is_file()), None)
    if found is None:
        raise ModelError(
            f"{file}: the mesh {name} was not found in its folder or in a parent folder. Put the package's folder there"
        )
    return found.resolve()
