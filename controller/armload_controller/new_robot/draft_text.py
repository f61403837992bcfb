"""The text of a first robot file, and the list of unknown values.

There are three kinds of value: known, from the URDF, the bus or answers; `# assumed`, a cautious initial value to be
checked; and a HOLE, text instead of a number, so that the file is refused until it is filled in.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from armload_controller.new_robot.arm_draft import ArmDraft
from armload_controller.new_robot.drafted_file import HOLE, DraftedFile
from armload_controller.new_robot.drive_drafts import BusDraft
from armload_controller.new_robot.drive_text import add_bus, add_drive
from armload_controller.new_robot.payload_draft import cube
from armload_controller.new_robot.twin_draft import body_lines, twin_drive, twin_simulation
from armload_controller.new_robot.workspace_draft import WorkspaceDraft
from armload_controller.new_robot.workspace_text import add_workspace
from armload_identification.float_array import FloatArray
from armload_identification.model.payload import InertialParameters
from armload_identification.storage.toml_text import value

SLOW_RAD_S: Final = 1.0
"""Greatest speed of a joint of which none is given: a slow industrial arm's."""
FULL_SPEED_AFTER_S: Final = 0.5
JERK_PER_ACCELERATION: Final = 100.0
NOISE_SHARE: Final = 0.005
FRICTION_SHARE: Final = 0.1
BODY_SHARE: Final = 0.5
_WORST_FRICTION: Final = 0.5
"""Greatest plausible share of friction in a joint's torque; a greater value in a URDF is not a friction torque."""


def draft_file(
    arm: ArmDraft,
    payload_kg: float | None,
    workspace: WorkspaceDraft,
    bus: BusDraft | None,
    excitations: tuple[str, str] | None = None,
    *,
    twin_start_rad: FloatArray | None = None,
) -> DraftedFile:
    """The file of an arm.

    Args:
        arm: Kinematics, limits, links.
        payload_kg: The heaviest payload; None if unknown.
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
    add_workspace(file, arm, workspace)
    whole = _whole_body(arm.links)
    if whole is not None:
        _body(file, arm, whole)
    if excitations is not None:
        file.add(
            "[excitation]", *(f"{role} = {value(name)}" for role, name in zip(_ROLES, excitations, strict=True)), ""
        )
    add_bus(file, arm.name, bus, twin=twin)
    for joint in range(arm.n):
        _joint(file, arm, joint, has_body=whole is not None)
        if twin:
            file.add(*twin_drive(arm, joint), "")
        else:
            add_drive(file, joint, None if bus is None else bus.drives[joint], bus)
    if twin_start_rad is not None and whole is not None and payload_kg is not None:
        friction = [_coulomb(arm, joint)[0] for joint in range(arm.n)]
        acceleration = arm.velocity_max_rad_s / FULL_SPEED_AFTER_S
        file.add(*twin_simulation(arm, whole, cube(payload_kg), twin_start_rad, friction, acceleration))
    return file


_ROLES = ("identification", "validation")


def _robot(file: DraftedFile, arm: ArmDraft, payload_kg: float | None) -> None:
    file.add("[robot]", f"name = {value(arm.name)}", f"description = {value(arm.description)}")
    file.value(
        "rated_payload_kg",
        np.nan if payload_kg is None else payload_kg,
        "robot",
        "maximum payload, including the tool",
    )
    gravity = value(np.round(arm.chain.gravity_m_s2, 9) + 0.0)
    file.add(f"gravity_m_s2 = {gravity}  # assumed: the arm is upright; change it for any other mounting", "")
    file.unchecked.append(f"gravity: {gravity} m/s2 in the base frame, for an upright arm")


def _kinematics(file: DraftedFile, arm: ArmDraft) -> None:
    key = "origins" if arm.convention == "joint-origins" else "rows"
    file.add("[kinematics]", f"convention = {value(arm.convention)}", f"{key} = [")
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
    file.unchecked.append(f"payload: a cube of {payload_kg:g} kg in front of the flange")


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
            f"coulomb_nm = {value(coulomb)}{comment}",
            f"viscous_nm_s_rad = {value(max(viscous, 0.0))}",
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
    file.add("[[joints]]", f"name = {value(arm.joint_names[joint])}")
    file.value("position_min_rad", lower, where, endless)
    file.value("position_max_rad", upper, where, endless)
    if np.isnan(speed):
        speed = SLOW_RAD_S
        file.value("velocity_max_rad_s", speed, where, "assumed: slow; with the data sheet's, motions are shorter")
        file.unchecked.append(f"{arm.joint_names[joint]}: a greatest speed of {speed:g} rad/s")
    else:
        file.value("velocity_max_rad_s", speed, where)
    acceleration = speed / FULL_SPEED_AFTER_S
    file.value("acceleration_max_rad_s2", acceleration, where, f"assumed: full speed after {FULL_SPEED_AFTER_S:g} s")
    file.value("jerk_max_rad_s3", JERK_PER_ACCELERATION * acceleration, where, "assumed")
    file.value("torque_max_nm", torque, where)
    if not has_body:
        file.add(f"arm_torque_share = {BODY_SHARE}  # assumed: fraction of its torque that the arm itself requires")
    file.value(
        "torque_noise_nm",
        NOISE_SHARE * torque,
        where,
        f"assumed: {100 * NOISE_SHARE:g} % of torque_max_nm; one raw sample at 100 Hz",
    )
    if joint == 0:
        file.unchecked.append(
            f"accelerations (full speed after {FULL_SPEED_AFTER_S:g} s), jerks and the noise of the torque"
        )
        if not has_body:
            file.unchecked.append(
                f"fraction of the joints' torque that the arm itself requires: {100.0 * BODY_SHARE:.0f} %"
            )
    file.add("")
