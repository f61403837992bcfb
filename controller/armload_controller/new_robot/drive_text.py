"""`[bus]` and `[joints.drive]` of a first robot file: from the bus, simulated, or as templates."""

from __future__ import annotations

from typing import Final

from armload_controller.config.drive_profiles import profile_hint
from armload_controller.new_robot.drafted_file import HOLE, DraftedFile
from armload_controller.new_robot.drive_drafts import BusDraft, DriveDraft
from armload_controller.new_robot.twin_draft import twin_bus
from armload_identification.storage.toml_text import inline, value

CYCLE_HZ: Final = 100.0


def add_bus(file: DraftedFile, name: str, bus: BusDraft | None, *, twin: bool) -> None:
    """Add `[bus]`.

    Args:
        name: Name of the robot.
        bus: The bus; None adds a commented-out template.
        twin: Whether drives and arm are simulated.
    """
    interface, channel = ("socketcan", "can0") if bus is None else (bus.interface, bus.channel)
    head = ["[bus]", f"interface = {value(interface)}", f"channel = {value(channel)}"]
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


def add_drive(file: DraftedFile, joint: int, drive: DriveDraft | None, bus: BusDraft | None) -> None:
    """Add `[joints.drive]`.

    Args:
        joint: Index of the joint, from 0.
        drive: The drive; None adds a commented-out template.
    """
    where = f"joints[{joint + 1}]"
    lines = ["[joints.drive]"]

    def add(key: str, value: str | None, comment: str = "") -> None:
        if value is None and drive is not None:
            file.holes.append(f"{where}.drive.{key}")
        lines.append(f"{key} = {value or HOLE}" + (f"  # {comment}" if comment else ""))

    known = drive or DriveDraft(joint + 1, None, None, None, None, None, ())
    add("node_id", str(known.node_id))
    add("mode", None if known.mode is None else value(known.mode), '"csp" or "ip"')
    add("feedback", None if known.feedback is None else value(known.feedback), '"torque" (6077) or "current" (6078)')
    permille = known.max_torque_permille
    add("max_torque_permille", None if permille is None else str(permille), "6072, per mille of the rated torque")
    add("following_error_rad", "0.1", "assumed: beyond this the drive stops")
    add("has_brake", None, "true or false")
    if known.torque_offset is False:
        add("torque_offset", "false", "no 60B2: no feed-forward")
    lines += [f"{key} = 32  # as its description states" for key in known.wide]
    if known.missing:
        listed = ", ".join(value(name) for name in known.missing)
        lines.append(
            f"# accept_missing = [{listed}]  # the drive has no object for these: read drivers/SAFETY.md before "
            "accepting this"
        )
        if joint == 0:
            file.unchecked.append(f"the drives have no objects for these safety properties: {', '.join(known.missing)}")
    lines.append("# counts_per_axis_turn, rated_torque_nm, rated_current_a: read from the drive if omitted")
    if known.feedback == "current":
        file.holes += [f"{where}.gear_ratio", f"{where}.torque_constant_nm_a"]
        lines[:0] = [
            f"gear_ratio = {HOLE}  # motor turns per axis turn",
            f"torque_constant_nm_a = {HOLE}  # of the motor, N m per ampere as 6078 counts it",
        ]
    if bus is not None and bus.description is not None:
        lines.append(f"description = {value(bus.description)}")
    if known.identity is not None:
        hint = profile_hint(known.identity.vendor_id)
        lines += [f"# {hint}"] if hint else []
        numbers = {"vendor_id": known.identity.vendor_id, "product_code": known.identity.product_code}
        stated = {key: f"0x{number:08X}" for key, number in numbers.items() if number is not None}
        lines.append(f"identity = {inline(stated)}")
    file.add(*(lines if drive is not None else [f"# {line}".replace("# #", "#") for line in lines]), "")
