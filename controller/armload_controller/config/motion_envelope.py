"""What an excitation has to stay within, from a robot's file: its `[workspace]`, `[body]` and joint limits."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Literal

import numpy as np

from armload_controller.config.body_workspace_tables import WorkspaceTable
from armload_controller.config.robot_file import RobotFile
from armload_controller.control_errors import ConfigurationError
from armload_controller.motion.expected_torque import ExpectedTorque
from armload_controller.motion.obstacles import Cell
from armload_core.arrays import FloatArray
from armload_identification.excitation.collision_meshes import Meshes
from armload_identification.excitation.fourier import FourierTrajectory
from armload_identification.excitation.joint_strength import TorqueLimits
from armload_identification.excitation.workspace import Box, HalfSpace, Sphere, Workspace
from armload_identification.identification_errors import ModelError
from armload_identification.model.chain import Chain, pose_from_xyz_rpy
from armload_identification.model.dynamics import ArmBody
from armload_identification.model.payload import InertialParameters

LinkName = int | Literal["tool"]


def require_consistent(file: str, model: RobotFile) -> None:
    """Check what the tables say about each other.

    Raises:
        ConfigurationError: naming file, key, the value found and what was expected.
    """
    n = len(model.joints)
    shares = [joint.arm_torque_share for joint in model.joints]
    if model.body is not None:
        if len(model.body.links) != n:
            raise ConfigurationError(file, "body.links", len(model.body.links), f"one per joint, {n} in this file")
        for i, share in enumerate(shares):
            if share is not None:
                raise ConfigurationError(
                    file, f"joints[{i + 1}].arm_torque_share", share, "either [body] or the shares, not both"
                )
        for i, (link, joint) in enumerate(zip(model.body.links, model.joints, strict=True)):
            if link.coulomb_nm >= joint.torque_max_nm:
                raise ConfigurationError(
                    file,
                    f"body.links[{i + 1}].coulomb_nm",
                    link.coulomb_nm,
                    f"less than joints[{i + 1}].torque_max_nm = {joint.torque_max_nm:g}",
                )
    if model.workspace is not None:
        _require_links(file, model.workspace, n)


def workspace_of(file: str, model: RobotFile, chain: Chain) -> Workspace:
    """The workspace; without a `[workspace]` nothing is in the way.

    Raises:
        ConfigurationError: naming file, key, the value found and what was expected.
    """
    table = model.workspace
    if table is None:
        return Workspace(chain)
    n = chain.n
    moving = tuple(range(1, n + 2))

    def links(names: Sequence[LinkName] | None) -> tuple[int, ...]:
        return moving if names is None else tuple(_number(name, n) for name in names)

    half_spaces = [_floor(file, table.floor_height_m, chain, moving)] if table.floor_height_m is not None else []
    if table.inside is not None:
        for axis, letter in enumerate("xyz"):
            direction = np.eye(3)[axis]
            half_spaces.append(HalfSpace(f"inside, -{letter}", direction, table.inside.min_m[axis], moving))
            half_spaces.append(HalfSpace(f"inside, +{letter}", -direction, -table.inside.max_m[axis], moving))
    for plane in table.half_spaces:
        normal = np.array(plane.normal)
        half_spaces.append(HalfSpace(plane.name, normal / np.linalg.norm(normal), plane.offset_m, links(plane.links)))
    try:
        return Workspace(
            chain,
            tuple(Sphere(_number(s.link, n), np.array(s.center_m), s.radius_m) for s in table.spheres),
            tuple(half_spaces),
            tuple(
                Box(b.name, pose_from_xyz_rpy(b.xyz_m, b.rpy_rad), np.array(b.size_m), links(b.links))
                for b in table.boxes
            ),
            tuple((_number(a, n), _number(b, n)) for a, b in table.apart),
            table.keep_m,
        )
    except ModelError as error:
        raise ConfigurationError(file, "workspace", "(table)", str(error)) from error


def torque_limits_of(
    file: str, model: RobotFile, chain: Chain, payload: InertialParameters, share: float
) -> TorqueLimits:
    """What the joints can give, from `[body]` or from the joints' `arm_torque_share`.

    Args:
        file: For messages.
        model: The file.
        chain: The arm.
        payload: The heaviest one expected, in the flange frame.
        share: Of every joint's torque_max_nm that a motion may use.

    Raises:
        ConfigurationError: neither is given, or a joint has no torque left to move with.
    """
    usable = share * np.array([joint.torque_max_nm for joint in model.joints])
    if model.body is not None:
        body = arm_body_of(model)
        for i, left in enumerate(usable - body.coulomb_nm):
            if left <= 0.0:
                raise ConfigurationError(
                    file,
                    f"body.links[{i + 1}].coulomb_nm",
                    float(body.coulomb_nm[i]),
                    f"less than the {usable[i]:g} N m that a motion may use",
                )
        return TorqueLimits.from_body(chain, body, payload, usable)
    shares = []
    for i, joint in enumerate(model.joints):
        if joint.arm_torque_share is None:
            raise ConfigurationError(
                file,
                f"joints[{i + 1}].arm_torque_share",
                None,
                "needed to design an excitation: the share of torque_max_nm that the arm's own links, rotor and "
                "friction take at most; or a [body] in its place",
            )
        shares.append(joint.arm_torque_share)
    return TorqueLimits.from_share(chain, np.array(shares), payload, usable)


def expected_torque_of(model: RobotFile, chain: Chain, *, loaded: bool) -> ExpectedTorque | None:
    """Between which torques motions lie; None where the file tells too little of arm or payload."""
    heaviest = model.heaviest_payload or model.expected_payload
    shares = [joint.arm_torque_share for joint in model.joints]
    told = [share for share in shares if share is not None]
    if (model.body is None and len(told) < len(shares)) or (loaded and heaviest is None):
        return None
    torque_max = np.array([joint.torque_max_nm for joint in model.joints])
    return ExpectedTorque(
        chain,
        arm_body_of(model),
        np.zeros_like(torque_max) if model.body is not None else np.array(told) * torque_max,
        heaviest.inertial() if loaded and heaviest is not None else None,
        torque_max,
    )


def require_told(file: str, model: RobotFile) -> None:
    """Refuse to move an arm that may be real where the file leaves out what keeps a motion from doing harm.

    Raises:
        ConfigurationError: naming the first key that is missing.
    """
    for i, joint in enumerate(model.joints):
        if model.body is None and joint.arm_torque_share is None:
            raise ConfigurationError(
                file,
                f"joints[{i + 1}].arm_torque_share",
                None,
                "a real arm is moved only where its joints are known to be strong enough: give it, or a [body]",
            )
    if model.workspace is None:
        raise ConfigurationError(
            file, "workspace", None, "a real arm is moved only where the file tells what it must not touch"
        )
    if model.heaviest_payload is None and model.expected_payload is None:
        raise ConfigurationError(file, "heaviest_payload", None, "needed to know what a real arm may have to carry")


def meshes_of(file: str, folder: Path, model: RobotFile, chain: Chain) -> Meshes | None:
    """The collision geometry of `[workspace] urdf`; None where the file names none.

    Raises:
        ConfigurationError: the URDF cannot be used, or what reads it is not installed.
    """
    table = model.workspace
    if table is None or table.urdf is None:
        return None
    touching = tuple((a, b) for a, b in table.urdf_touching)
    names = tuple(joint.name for joint in model.joints)
    try:
        return Meshes(folder / table.urdf, chain, names, table.keep_m, touching)
    except ModelError as error:
        raise ConfigurationError(file, "workspace.urdf", table.urdf, str(error)) from error


def require_drivable(file: str, model: RobotFile, chain: Chain, cell: Cell, role: str, path: FourierTrajectory) -> None:
    """Refuse an excitation that the tables of today do not allow, whatever it was designed for.

    Checked at any time and any steady speed, between samples too: that nothing of `[workspace]` is touched, and that
    the torque for arm and heaviest payload is there, as far as the file tells of either.

    Raises:
        ConfigurationError: naming what would be touched, or the joint that is too weak.
    """
    objection = cell.objection(path)
    if objection is not None:
        raise ConfigurationError(file, f"excitation.{role}", objection, "one designed for this cell")
    heaviest = model.heaviest_payload or model.expected_payload
    told = model.body is not None or all(joint.arm_torque_share is not None for joint in model.joints)
    if heaviest is None or not told:
        return
    limits = torque_limits_of(file, model, chain, heaviest.inertial(), 1.0)
    needed = limits.greatest(path).reshape(limits.cases, -1).max(axis=0)
    weakest = int(np.argmax(needed / limits.available_nm))
    if needed[weakest] > limits.available_nm[weakest]:
        joint = model.joints[weakest]
        raise ConfigurationError(
            file,
            f"excitation.{role}",
            f"asks {needed[weakest]:.0f} N m of {joint.name}, which has {limits.available_nm[weakest]:.0f} N m for it",
            "one designed for this arm and its heaviest payload",
        )


def arm_body_of(model: RobotFile) -> ArmBody:
    """The arm itself, as `[body]` tells; massless without one."""
    if model.body is None:
        return ArmBody.massless(len(model.joints))
    links = model.body.links
    return ArmBody(
        np.array([link.inertial().theta for link in links]),
        np.array([link.reflected_rotor_inertia_kg_m2 for link in links]),
        np.array([link.viscous_nm_s_rad for link in links]),
        np.array([link.coulomb_nm for link in links]),
    )


def following_speed_of(model: RobotFile) -> FloatArray:
    """(n,) speed at which each following error reaches its window, inf where the file does not tell the lag."""
    drives = [joint.drive for joint in model.joints]
    return np.array(
        [
            drive.following_error_rad / drive.following_lag_s
            if drive is not None and drive.following_lag_s is not None
            else np.inf
            for drive in drives
        ]
    )


def _require_links(file: str, table: WorkspaceTable, n: int) -> None:
    """Every name of a link is one that the arm has, and every moving link is in a sphere."""
    named: list[tuple[str, LinkName]] = [(f"spheres[{i + 1}].link", s.link) for i, s in enumerate(table.spheres)]
    named += [(f"half_spaces[{i + 1}].links", a) for i, p in enumerate(table.half_spaces) for a in p.links or ()]
    named += [(f"boxes[{i + 1}].links", a) for i, b in enumerate(table.boxes) for a in b.links or ()]
    named += [(f"apart[{i + 1}]", a) for i, pair in enumerate(table.apart) for a in pair]
    for key, link in named:
        if link != "tool" and link > n:
            raise ConfigurationError(file, f"workspace.{key}", link, f'0 (the base) to {n}, or "tool"')
    bare = sorted(set(range(1, n + 2)) - {_number(s.link, n) for s in table.spheres})
    if bare:
        name = "tool" if bare[0] == n + 1 else str(bare[0])
        raise ConfigurationError(
            file, "workspace.spheres", f"none with link = {name}", "at least one around every link and around the tool"
        )


def _number(name: LinkName, n: int) -> int:
    return n + 1 if name == "tool" else int(name)


def _floor(file: str, height_m: float, chain: Chain, links: tuple[int, ...]) -> HalfSpace:
    """Everything below a height over the base frame's origin; up is against gravity."""
    size = float(np.linalg.norm(chain.gravity_m_s2))
    if size == 0.0:
        raise ConfigurationError(
            file, "workspace.floor_height_m", height_m, "gravity, to know where up is; or a half-space in its place"
        )
    return HalfSpace("floor", -chain.gravity_m_s2 / size, height_m, links)
