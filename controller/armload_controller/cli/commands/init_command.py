"""`armload init`: a first robot file, from a URDF or from answers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from math import isnan
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from armload_controller.cli.attendance import attended
from armload_controller.cli.options import BUS_FORM, BaseOption, FlangeOption, bus_address
from armload_controller.cli.output.output_files import require_folder
from armload_controller.cli.screen import PLAIN, Screen

if TYPE_CHECKING:
    from armload_controller.new_robot.arm_draft import ArmDraft
    from armload_controller.new_robot.drafted_file import DraftedFile
    from armload_controller.new_robot.drive_drafts import BusDraft
    from armload_controller.new_robot.workspace_draft import WorkspaceDraft
    from armload_identification.float_array import FloatArray

_ROLES = ("identification", "validation")


def init(
    output: Annotated[
        Path,
        typer.Option(
            "--output", "-o", help="Robot file (TOML) to write; the excitations are written to the same folder."
        ),
    ],
    urdf: Annotated[
        Path | None, typer.Argument(metavar="[URDF]", help="URDF of the arm; without one, questions at the terminal.")
    ] = None,
    base: BaseOption = None,
    flange: FlangeOption = None,
    name: Annotated[str | None, typer.Option("--name", help="Name of the robot, instead of the URDF's.")] = None,
    payload_kg: Annotated[
        float | None, typer.Option(min=1e-3, help="Maximum payload of the arm, including the tool.")
    ] = None,
    scan: Annotated[
        str | None,
        typer.Option(metavar=BUS_FORM, help="Use the drives that answer on this bus. Only reads."),
    ] = None,
    bitrate: Annotated[int, typer.Option(help="Bit rate of that bus in bit/s.")] = 1_000_000,
    description: Annotated[Path | None, typer.Option(help="EDS or DCF file of the drives.")] = None,
    simulated: Annotated[
        bool, typer.Option("--simulated", help="Add a simulated twin of the arm, to try a commissioning.")
    ] = False,
    restarts: Annotated[int, typer.Option(min=1, help="Random starts of each excitation's design.")] = 8,
    screen: Screen = PLAIN,
) -> None:
    """Write a first robot file, complete except for values that only you can know, and design its two excitations."""
    from armload_controller.cli.output.json_documents import init_document
    from armload_controller.control_errors import CommissioningError, ConfigurationError
    from armload_controller.new_robot.draft_text import draft_file
    from armload_identification.storage.strict_toml import write_text

    require_folder(output)
    if output.exists():
        raise CommissioningError(f"{output} exists and is not overwritten: choose another --output")
    for role in _ROLES:
        require_folder(output.with_name(f"{output.stem}_{role}.toml"), "excitation")
    if urdf is None and not attended():
        raise ConfigurationError("command line", "URDF", None, "required if there is no terminal to ask at")
    if payload_kg is None and attended():
        from armload_controller.new_robot.arm_interview import Interview

        question = "Maximum payload of the arm, including the tool, in kg; empty to fill in later: "
        payload_kg = Interview(screen.ask, screen.step).positive(question)
        payload_kg = None if isnan(payload_kg) else payload_kg
    arm, workspace = _arm(screen, urdf, base, flange, payload_kg, output)
    arm = arm if name is None else replace(arm, name=name)
    if simulated:
        _require_twin(arm, payload_kg, scan is not None or description is not None)
    bus = _bus(arm.n, scan, bitrate, description, output)

    def draft(ranges: ArmDraft) -> DraftedFile:
        return draft_file(ranges, payload_kg, workspace, None)

    if draft(arm).holes or payload_kg is None:
        designed = _Designed(None, "values are missing", None)
    else:
        designed = _designed(screen, output, arm, draft, restarts)
    start_rad = designed.roomiest_rad if simulated else None
    drafted = draft_file(arm, payload_kg, workspace, bus, designed.names, twin_start_rad=start_rad)
    write_text(output, drafted.text, ConfigurationError)
    if designed.names is None:
        screen.step(f"no excitation is designed: {designed.problem}")
    screen.step(f"written: {output}")
    _show_open_points(screen, drafted)
    if simulated and designed.names is not None:
        following = f"`armload commission {output} --output runs/{output.stem}`"
    else:
        following = _next_step(output, drafted, has_bus=bus is not None, designed=designed.names is not None)
    screen.step(f"next: {following}")
    written = [output, *(output.with_name(name) for name in designed.names or ())]
    files = dict.fromkeys(("robot", *_ROLES)) | dict(zip(("robot", *_ROLES), written, strict=False))
    screen.document(partial(init_document, arm, drafted, designed.problem, following), files)


@dataclass(frozen=True, eq=False)
class _Designed:
    """Both excitations of an arm, or the reason why there are none.

    Attributes:
        names: Names of their files; None if there are none.
        problem: The reason why there are none; None otherwise.
        roomiest_rad: (n,) the random pose with the greatest clearance; None if no design was attempted.
    """

    names: tuple[str, str] | None
    problem: str | None
    roomiest_rad: FloatArray | None


def _require_twin(arm: ArmDraft, payload_kg: float | None, has_drives: bool) -> None:
    """Refuse a simulated twin without sufficient data."""
    from armload_controller.control_errors import ConfigurationError

    if has_drives:
        raise ConfigurationError("command line", "--simulated", None, "without --scan and --description")
    if payload_kg is None:
        raise ConfigurationError("command line", "--payload-kg", None, "required: the payload of the simulated arm")
    limits = (*arm.torque_max_nm, *arm.velocity_max_rad_s, *arm.position_min_rad)
    if None in arm.links or any(isnan(value) for value in limits):
        raise ConfigurationError(
            "command line", "--simulated", None, "only for a URDF with mass, effort, velocity and range of every joint"
        )


def _arm(
    screen: Screen, urdf: Path | None, base: str | None, flange: str | None, payload_kg: float | None, output: Path
) -> tuple[ArmDraft, WorkspaceDraft]:
    """The arm and its workspace."""
    from armload_controller.config.chain_from_urdf import read_urdf_arm
    from armload_controller.new_robot.arm_draft import draft_of_urdf
    from armload_controller.new_robot.arm_interview import interviewed
    from armload_controller.new_robot.drive_drafts import path_beside
    from armload_controller.new_robot.flange_notes import flange_notes
    from armload_controller.new_robot.payload_draft import tool_sphere
    from armload_controller.new_robot.workspace_draft import workspace_of_spheres, workspace_of_urdf
    from armload_identification.identification_errors import ModelError

    if urdf is None:
        arm = interviewed(screen.ask, screen.step)
        return arm, workspace_of_spheres(arm, [], tool_sphere(arm.n, payload_kg))
    found = read_urdf_arm(urdf, base, flange)
    arm = draft_of_urdf(found)
    screen.step(f"{urdf}: {arm.n} joints from {found.base} to {found.flange}: {', '.join(arm.joint_names)}")
    for note in flange_notes(found):
        screen.step(note)
    if found.other_joints:
        screen.step(f"not part of the arm, and assumed fixed: {', '.join(found.other_joints)}")
    tool = tool_sphere(arm.n, payload_kg)
    try:
        return arm, replace(workspace_of_urdf(found, arm, tool), urdf=path_beside(urdf, output))
    except ModelError as error:
        return arm, workspace_of_spheres(arm, [], tool, str(error).removeprefix(f"{urdf}: "))


def _bus(n: int, scan: str | None, bitrate: int, description: Path | None, output: Path) -> BusDraft | None:
    """The drives from a scan or a device description; None without either."""
    from armload_controller.new_robot.drive_drafts import (
        BusDraft,
        drives_found,
        nodes_described,
        path_beside,
    )
    from armload_drivers.bring_up.description_file import read_description

    described = None if description is None else read_description(description)
    beside = None if description is None else path_beside(description, output)
    if scan is not None:
        from armload_controller.session.arm_access import nodes_on

        interface, channel = bus_address(scan, "--scan")
        drives = drives_found(nodes_on(interface, channel, bitrate), n, described)
        return BusDraft(drives, interface, channel, bitrate, beside, f"found on {scan}")
    if described is None:
        return None
    drives = nodes_described(described, n)
    nodes = f"nodes {drives[0].node_id} to {drives[-1].node_id} assumed"
    return BusDraft(drives, "socketcan", "can0", bitrate, beside, f"from {described.source}, {nodes}, on can0")


def _designed(
    screen: Screen, output: Path, arm: ArmDraft, draft: Callable[[ArmDraft], DraftedFile], restarts: int
) -> _Designed:
    """The two excitations, in the first of the candidate ranges in which both are found."""
    from armload_controller.analysis.robot_excitation import DesignSearch, design, design_envelope
    from armload_controller.config.robot import parse_robot
    from armload_controller.new_robot.arm_draft import within
    from armload_controller.new_robot.design_range import design_range
    from armload_identification.identification_errors import ExcitationError

    # Drafts are not written: a program that is killed leaves no file, for which the same command would be refused.
    robot = parse_robot(draft(arm).text, str(output), output.parent)
    boxes, roomiest_rad = design_range(robot, design_envelope(robot))
    problem = ""
    for box in boxes:
        robot = parse_robot(draft(within(arm, box)).text, str(output), output.parent)
        try:
            excitations = []
            for seed, role in enumerate(_ROLES, 1):
                with screen.track(f"designing the excitation for {role}", restarts) as done:
                    excitations.append(design(robot, search=DesignSearch(seed, restarts), progress=done))
        except ExcitationError as error:
            if box is not boxes[-1]:
                screen.step(
                    "none found in this part of the joints' ranges: trying a narrower one that is clear of everything"
                )
            problem = str(error)
            continue
        paths = [output.with_name(f"{output.stem}_{role}.toml") for role in _ROLES]
        for path, excitation in zip(paths, excitations, strict=True):
            excitation.save(path)
            screen.step(f"written: {path}")
        return _Designed((paths[0].name, paths[1].name), None, roomiest_rad)
    return _Designed(None, problem, roomiest_rad)


def _show_open_points(screen: Screen, drafted: DraftedFile) -> None:
    """Show what is missing or assumed."""
    if drafted.holes:
        screen.step("to be filled in; the file is refused until then:")
        for place in drafted.holes:
            screen.step(f"  {place}")
    screen.step("assumed, to be checked:")
    for sentence in drafted.unchecked:
        screen.step(f"  {sentence}")


def _next_step(output: Path, drafted: DraftedFile, *, has_bus: bool, designed: bool) -> str:
    """The next step for the operator."""
    if drafted.holes:
        return f"fill these in, then `armload drives check {output}`" if has_bus else "fill these in"
    if not designed:
        return f"`armload design {output} --seed 1 --output {output.stem}_identification.toml`"
    if not has_bus:
        return f"use your own recordings with `armload identify {output} ...`, or fill in the drives in {output}"
    return f"`armload drives check {output}`"
