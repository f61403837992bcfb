"""The text of a first robot file, and the list of unknown values.

There are three kinds of value: known, from the URDF, the bus or answers; `# assumed`, a cautious initial value to be
checked; and a HOLE, text instead of a number, so that the file is refused until it is filled in.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from armload_controller.new_robot.arm_draft import ArmDraft
from armload_controller.new_robot.drive_drafts import BusDraft, DriveDraft
from armload_controller.new_robot.twin_draft import body_lines, twin_bus, twin_drive, twin_simulation
from armload_controller.new_robot.workspace_draft import BARE_RADIUS_M, KEEP_M, WorkspaceDraft, up_of
from armload_core.arrays import FloatArray
from armload_identification.excitation.geometry.workspace import Sphere
from armload_identification.model.payload import InertialParameters
from armload_identification.storage.toml_text import array, inline, number, text

HOLE: Final = '"FILL IN"'
"""Stands for a number that only the arm's manufacturer or user knows."""
FULL_SPEED_AFTER_S: Final = 0.5
JERK_PER_ACCELERATION: Final = 100.0
NOISE_SHARE: Final = 0.005
FRICTION_SHARE: Final = 0.1
BODY_SHARE: Final = 0.5
DENSITY_KG_M3: Final = 2000.0
CYCLE_HZ: Final = 100.0
_WORST_FRICTION: Final = 0.5
"""Greatest plausible share of friction in a joint's torque; a greater value in a URDF is not a friction torque."""


@dataclass
class DraftedFile:
    """A robot's file as text.

    Attributes:
        holes: Keys that must be filled in before the file is accepted.
        unchecked: Assumptions and omissions, one sentence each.
    """

    holes: list[str] = field(default_factory=list)
    unchecked: list[str] = field(default_factory=list)
    _lines: list[str] = field(default_factory=list)

    @property
    def text(self) -> str:
        """The file's text."""
        return "\n".join(self._lines) + "\n"

    def add(self, *lines: str) -> None:
        """Add lines unchanged."""
        self._lines += lines

    def value(self, key: str, value: float, where: str, comment: str = "") -> None:
        """Add a line with a number, or with a hole if it is NaN."""
        self.add(f"{key} = {self.number(value, f'{where}.{key}')}" + (f"  # {comment}" if comment else ""))

    def number(self, value: float, place: str) -> str:
        """TOML of a number; a hole, which is listed, if it is NaN."""
        if np.isnan(value):
            self.holes.append(place)
            return HOLE
        return number(value)


def cube(mass_kg: float) -> InertialParameters:
    """A payload of known mass, assumed to be a cube in front of the flange.

    Args:
        mass_kg: Mass.
    """
    edge = _edge_m(mass_kg)
    return InertialParameters.from_center_of_mass(
        mass_kg, np.array([0.0, 0.0, 0.5 * edge]), mass_kg * edge**2 / 6.0 * np.eye(3)
    )


def tool_sphere(n: int, mass_kg: float | None) -> Sphere:
    """The sphere around that cube; around the flange if the mass is unknown.

    Args:
        n: Number of joints.
        mass_kg: Mass of the payload; None if unknown.
    """
    edge = 0.1 if mass_kg is None else _edge_m(mass_kg)
    return Sphere(n + 1, np.array([0.0, 0.0, 0.5 * edge]), 0.87 * edge)


def _edge_m(mass_kg: float) -> float:
    return float((mass_kg / DENSITY_KG_M3) ** (1.0 / 3.0))


def draft_file(
    arm: ArmDraft,
    payload_kg: float | None,
    workspace: WorkspaceDraft,
    urdf: str | None,
    bus: BusDraft | None,
    excitations: tuple[str, str] | None = None,
    *,
    twin_start_rad: FloatArray | None = None,
) -> DraftedFile:
    """The file of an arm.

    Args:
        arm: Kinematics, limits, links.
        payload_kg: The heaviest payload; None if unknown.
        workspace: The workspace.
        urdf: Path of the URDF to write into the file if its meshes are checked.
        bus: Its drives; None writes a template.
        excitations: Files of the identification's and the validation's excitation.
        twin_start_rad: (n,) initial pose of a simulated arm; if given, drives and arm are simulated, in place of
            `bus`. Requires known links and payload.
    """
    twin = twin_start_rad is not None
    file = DraftedFile()
    file.add(
        f"# Drafted by `armload init` from {arm.source}.",
        "# `# assumed`: no source; a cautious initial value, check it.",
        f"# {HOLE}: only you or the manufacturer can know this; the file is refused until it is filled in.",
        "",
    )
    _robot(file, arm, payload_kg)
    _kinematics(file, arm)
    _payload(file, payload_kg)
    _workspace(file, arm, workspace, urdf)
    whole = _whole_body(arm.links)
    if whole is not None:
        _body(file, arm, whole)
    if excitations is not None:
        file.add(
            "[excitation]", *(f"{role} = {text(name)}" for role, name in zip(_ROLES, excitations, strict=True)), ""
        )
    _bus(file, arm.name, bus, twin=twin)
    for joint in range(arm.n):
        _joint(file, arm, joint, has_body=whole is not None)
        if twin:
            file.add(*twin_drive(arm, joint), "")
        else:
            _drive(file, joint, None if bus is None else bus.drives[joint], bus)
    if twin_start_rad is not None and whole is not None and payload_kg is not None:
        friction = [_coulomb(arm, joint)[0] for joint in range(arm.n)]
        acceleration = arm.velocity_max_rad_s / FULL_SPEED_AFTER_S
        file.add(*twin_simulation(arm, whole, cube(payload_kg), twin_start_rad, friction, acceleration))
    return file


_ROLES = ("identification", "validation")


def _robot(file: DraftedFile, arm: ArmDraft, payload_kg: float | None) -> None:
    file.add("[robot]", f"name = {text(arm.name)}", f"description = {text(arm.description)}")
    file.value(
        "rated_payload_kg",
        np.nan if payload_kg is None else payload_kg,
        "robot",
        "maximum payload, including the tool",
    )
    gravity = array(np.round(arm.chain.gravity_m_s2, 9) + 0.0)
    file.add(f"gravity_m_s2 = {gravity}  # assumed: the arm is upright; change it for any other mounting", "")
    file.unchecked.append(f"gravity: {gravity} m/s2 in the base frame, for an upright arm")


def _kinematics(file: DraftedFile, arm: ArmDraft) -> None:
    key = "origins" if arm.convention == "joint-origins" else "rows"
    file.add("[kinematics]", f"convention = {text(arm.convention)}", f"{key} = [")
    file.add(*(f"    {row},  # {name}" for row, name in zip(arm.rows, arm.joint_names, strict=True)))
    file.add("]", f"flange = {arm.flange}  # in the last frame", "")


def _payload(file: DraftedFile, payload_kg: float | None) -> None:
    if payload_kg is None:
        file.unchecked.append(
            "payload: give --payload-kg, or fill in [robot] and add [expected_payload]; no excitation without it"
        )
        return
    body = cube(payload_kg)
    file.add(
        "# The payload that excitations are designed for and must be safe with. If a heavier one is possible, add",
        "# [heaviest_payload], with the same keys.",
        "[expected_payload]",
        *(f"{line}  # assumed" if "mass_kg" not in line else line for line in body_lines(body)),
        "",
    )
    file.unchecked.append(f"payload: the lever of {payload_kg:g} kg, a cube in front of the flange")


def _workspace(file: DraftedFile, arm: ArmDraft, workspace: WorkspaceDraft, urdf: str | None) -> None:
    n = arm.n

    def link(index: int) -> str:
        return '"tool"' if index == n + 1 else str(index)

    file.add(
        "# What the arm must not touch. Spheres in the joint frames (0: base); the tool's in the flange frame.",
        "[workspace]",
        f"keep_m = {number(KEEP_M)}  # assumed: clearance to everything",
        "spheres = [",
    )
    for sphere in workspace.spheres:
        why = (
            "  # assumed"
            if sphere.link > n
            else "  # assumed: no geometry known"
            if sphere.link in workspace.bare
            else ""
        )
        row = {
            "link": link(sphere.link),
            "center_m": array(np.round(sphere.center_m, 4) + 0.0),
            "radius_m": number(round(sphere.radius_m, 4)),
        }
        file.add(f"    {inline(row)},{why}")
    file.add("]")
    if workspace.apart:
        file.add("apart = [", *(f"    [{link(a)}, {link(b)}]," for a, b in workspace.apart), "]")
    if urdf is not None and workspace.meshes:
        file.add(f"urdf = {text(urdf)}  # its meshes are also checked")
        if workspace.touching:
            file.add(
                "urdf_touching = [  # neighbours whose shapes touch in nearly every pose",
                *(f"    [{text(a)}, {text(b)}]," for a, b in workspace.touching),
                "]",
            )
    if workspace.above_floor:
        row = {
            "name": '"floor"',
            "normal": array(np.round(up_of(arm), 9) + 0.0),
            "offset_m": number(round(workspace.floor_m, 4) + 0.0),
            "links": "[" + ", ".join(link(index) for index in workspace.above_floor) + "]",
        }
        file.add("half_spaces = [", f"    {inline(row)},  # assumed: at the height of the root", "]")
    file.add("")
    file.unchecked.append("surroundings: only a floor at the height of the root; add tables, walls, fences")
    low = [str(index) for index in range(1, n + 1) if index not in workspace.above_floor]
    if low:
        file.unchecked.append(
            f"link {', '.join(low)}: not kept above that floor, which its spheres reach in most poses"
        )
    if workspace.bare:
        numbers = ", ".join(map(str, workspace.bare))
        file.unchecked.append(f"shape of link {numbers}: a sphere of {BARE_RADIUS_M:g} m around its origin")
    if workspace.overlapping and not workspace.meshes:
        pairs = ", ".join(f"{link(a)} and {link(b)}" for a, b in workspace.overlapping)
        file.unchecked.append(
            f"pairs of links not checked for collision, because their spheres overlap in most poses: {pairs}"
        )
    if workspace.meshes and workspace.touching:
        pairs = ", ".join(f"{a} and {b}" for a, b in workspace.touching)
        file.unchecked.append(f"pairs of meshes that may touch, because their convex hulls do in most poses: {pairs}")
    if workspace.why_no_meshes:
        file.unchecked.append(f"meshes are not checked: {workspace.why_no_meshes}")


def _whole_body(links: Sequence[InertialParameters | None]) -> list[InertialParameters] | None:
    """The links; None if one of them is unknown."""
    known = [link for link in links if link is not None]
    return known if len(known) == len(links) else None


def _body(file: DraftedFile, arm: ArmDraft, links: Sequence[InertialParameters]) -> None:
    file.add("# The arm itself, for the torque that a motion requires.")
    assumed = set()
    for joint, link in enumerate(links):
        coulomb, comment = _coulomb(arm, joint)
        if comment:
            assumed.add("friction")
        viscous = np.nan_to_num(arm.viscous_nm_s_rad[joint], nan=0.0)
        file.add(
            "[[body.links]]",
            *body_lines(link),
            "reflected_rotor_inertia_kg_m2 = 0.0  # assumed: not known",
            f"coulomb_nm = {number(coulomb)}{comment}",
            f"viscous_nm_s_rad = {number(max(viscous, 0.0))}",
            "",
        )
    file.unchecked.append("rotor inertias: none; motions require more torque than computed from this file")
    if assumed:
        file.unchecked.append(f"friction: {100.0 * FRICTION_SHARE:.0f} % of a joint's maximum torque if none is given")


def _coulomb(arm: ArmDraft, joint: int) -> tuple[float, str]:
    """Coulomb friction of a joint in N m, and a comment if it is assumed."""
    given, greatest = float(arm.coulomb_nm[joint]), float(arm.torque_max_nm[joint])
    if 0.0 < given < _WORST_FRICTION * float(np.nan_to_num(greatest, nan=np.inf)):
        return given, ""
    assumed = round(FRICTION_SHARE * float(np.nan_to_num(greatest, nan=0.0)), 6)
    return assumed, f"  # assumed: {100.0 * FRICTION_SHARE:.0f} % of the greatest torque"


def _bus(file: DraftedFile, name: str, bus: BusDraft | None, *, twin: bool) -> None:
    interface, channel = ("socketcan", "can0") if bus is None else (bus.interface, bus.channel)
    head = ["[bus]", f"interface = {text(interface)}", f"channel = {text(channel)}"]
    lines = [
        *(twin_bus(name) if twin else head),
        f"bitrate = {1_000_000 if bus is None else bus.bitrate}",
        f"cycle_hz = {CYCLE_HZ}  # assumed",
        "heartbeat_s = 0.1  # assumed",
        "max_missing_cycles = 3  # assumed",
    ]
    if twin:
        file.unchecked.append(
            "drives and arm are simulated, with assumed friction, rotors and noise: nothing real moves"
        )
    elif bus is None:
        file.add("# To move this arm over CANopen, remove the # in front of [bus] and of every [joints.drive].")
        lines = [f"# {line}" for line in lines]
        file.unchecked.append(
            "drives: a template in comments; `armload init --scan INTERFACE:CHANNEL` or --description x.eds fills it in"
        )
    else:
        file.unchecked.append(f"drives: {bus.source}; the order of the nodes is assumed, lowest at the base")
    file.add(*lines, "")


def _joint(file: DraftedFile, arm: ArmDraft, joint: int, *, has_body: bool) -> None:
    where = f"joints[{joint + 1}]"
    lower, upper = float(arm.position_min_rad[joint]), float(arm.position_max_rad[joint])
    speed, torque = float(arm.velocity_max_rad_s[joint]), float(arm.torque_max_nm[joint])
    endless = ""
    if np.isinf(lower) or np.isinf(upper):
        lower, upper, endless = -3.14159, 3.14159, "assumed: the joint is continuous, but its cables may limit it"
        file.unchecked.append(f"{arm.joint_names[joint]}: continuous; a range of one turn is assumed")
    if joint == 0:
        file.add(
            "# If recordings contain motor currents, every [[joints]] also requires gear_ratio (motor turns per axis "
            "turn)"
        )
        file.add("# and torque_constant_nm_a (of the motor, N m per ampere).")
    file.add("[[joints]]", f"name = {text(arm.joint_names[joint])}")
    file.value("position_min_rad", lower, where, endless)
    file.value("position_max_rad", upper, where, endless)
    file.value("velocity_max_rad_s", speed, where)
    acceleration = speed / FULL_SPEED_AFTER_S
    file.value("acceleration_max_rad_s2", acceleration, where, f"assumed: full speed after {FULL_SPEED_AFTER_S:g} s")
    file.value("jerk_max_rad_s3", JERK_PER_ACCELERATION * acceleration, where, "assumed")
    file.value("torque_max_nm", torque, where)
    if not has_body:
        file.add(f"arm_torque_share = {BODY_SHARE}  # assumed: fraction of its torque that the arm itself requires")
    file.value("torque_noise_nm", NOISE_SHARE * torque, where, "assumed: one raw sample at 100 Hz")
    if joint == 0:
        file.unchecked.append(
            f"accelerations (full speed after {FULL_SPEED_AFTER_S:g} s), jerks and the noise of the torque"
        )
        if not has_body:
            file.unchecked.append(
                f"fraction of the joints' torque that the arm itself requires: {100.0 * BODY_SHARE:.0f} %"
            )
    file.add("")


def _drive(file: DraftedFile, joint: int, drive: DriveDraft | None, bus: BusDraft | None) -> None:
    """The drive's table, or a commented-out template of it."""
    where = f"joints[{joint + 1}]"
    lines = ["[joints.drive]"]

    def add(key: str, value: str | None, comment: str = "") -> None:
        if value is None and drive is not None:
            file.holes.append(f"{where}.drive.{key}")
        lines.append(f"{key} = {value or HOLE}" + (f"  # {comment}" if comment else ""))

    known = drive or DriveDraft(joint + 1, None, None, None, None, None, ())
    add("node_id", str(known.node_id))
    add("mode", None if known.mode is None else text(known.mode), '"csp" or "ip"')
    add("feedback", None if known.feedback is None else text(known.feedback), '"torque" (6077) or "current" (6078)')
    permille = known.max_torque_permille
    add("max_torque_permille", None if permille is None else str(permille), "6072, per mille of the rated torque")
    add("following_error_rad", "0.1", "assumed: beyond this the drive stops")
    add("has_brake", None, "true or false")
    if known.torque_offset is False:
        add("torque_offset", "false", "no 60B2: no feed-forward")
    if known.missing:
        listed = ", ".join(text(name) for name in known.missing)
        lines.append(
            f"# accept_missing = [{listed}]  # the drive has no object for these: read drivers/SAFETY.md before "
            "accepting this"
        )
        if joint == 0:
            file.unchecked.append(f"the drives lack objects that safety rests on: {', '.join(known.missing)}")
    lines.append("# counts_per_axis_turn, rated_torque_nm, rated_current_a: read from the drive if omitted")
    if known.feedback == "current":
        file.holes += [f"{where}.gear_ratio", f"{where}.torque_constant_nm_a"]
        lines[:0] = [
            f"gear_ratio = {HOLE}  # motor turns per axis turn",
            f"torque_constant_nm_a = {HOLE}  # of the motor, N m per ampere as 6078 counts it",
        ]
    if bus is not None and bus.description is not None:
        lines.append(f"description = {text(bus.description)}")
    if known.identity is not None:
        numbers = {"vendor_id": known.identity.vendor_id, "product_code": known.identity.product_code}
        lines.append(f"identity = {inline({key: f'0x{value or 0:08X}' for key, value in numbers.items()})}")
    file.add(*(lines if drive is not None else [f"# {line}".replace("# #", "#") for line in lines]), "")
