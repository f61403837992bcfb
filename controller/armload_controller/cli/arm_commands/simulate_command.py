"""`armload simulate`: the drives of a simulated arm, to be commanded by another process."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from armload_controller.cli.given_arm import ArmOnBus
from armload_controller.cli.options import CycleOption, duration_s
from armload_controller.cli.output.output_files import make_folder
from armload_controller.control_errors import CommissioningError, ConfigurationError
from armload_controller.motion.motion_control import MotionControl

if TYPE_CHECKING:
    from armload_controller.config.robot_simulation import RobotSimulation
    from armload_drivers.simulation.plant_spec import ScheduledPayload

POLL_S = 0.1


def payload_change(text: str) -> tuple[float, str]:
    """Time and payload of a text such as '10s=tool.toml'."""
    at, _, name = text.partition("=")
    if not name:
        raise typer.BadParameter(f"{text!r}: expected a time and a payload, such as 10s=tool.toml or 40s=none")
    return duration_s(at), name


def simulate(
    on_bus: ArmOnBus,
    cycle_hz: CycleOption = None,
    payload: Annotated[
        str | None,
        typer.Option(
            help="A payload named under simulation.payloads, a payload file (.toml), or 'none'; by default the "
            "configured one."
        ),
    ] = None,
    payload_at: Annotated[
        list[Any] | None,
        typer.Option(
            "--payload-at",
            metavar="TIME=PAYLOAD",
            parser=payload_change,
            help="Mount another payload, or 'none', at this time after the first SYNC, whether or not the arm is "
            "moving, such as 10s=tool.toml; may be given several times.",
        ),
    ] = None,
    description: Annotated[
        list[Path] | None,
        typer.Option(
            help="Serve exactly the objects of this EDS or DCF file: one for all joints, or one per joint in order.",
        ),
    ] = None,
    write_eds: Annotated[
        Path | None,
        typer.Option(help="Write an EDS file per joint into this folder, for other masters, and exit."),
    ] = None,
) -> None:
    """Serve simulated CiA 402 drives and their simulated arm, until Ctrl-C."""
    from armload_controller.cli.screen import Screen
    from armload_controller.session.arm_access import drives_alone
    from armload_controller.session.stop_signals import StopSignals
    from armload_drivers.bring_up.description_file import read_description
    from armload_drivers.simulation.drives.drive_eds import drive_eds
    from armload_identification.storage.own_file import require_own
    from armload_identification.storage.strict_toml import write_text

    arm = on_bus.arm(cycle_hz)
    name = arm.simulation.payload_name if payload is None else payload
    changes = payload_changes(payload_at or [], arm.simulation)
    screen = Screen()
    described = [read_description(path) for path in description or ()]
    screen.remarks("warning", (warning for found in described for warning in found.warnings))
    if len(described) not in {0, 1, arm.n}:
        expected = f"expected one for all joints, or one per joint: {arm.n}"
        raise ConfigurationError("command line", "--description", len(described), expected)
    if write_eds is not None:
        make_folder(write_eds)
        for drive in arm.drives.settings.drives:
            path = write_eds / f"{drive.joint}.eds"
            require_own(path, "EDS", CommissioningError, "--write-eds")
            write_text(path, drive_eds(drive, arm.drives.settings.cycle_s), ConfigurationError)
            screen.step(f"written: {path}")
        return
    control = MotionControl()
    with StopSignals(control), drives_alone(arm, name, changes, described) as drives:
        later = "".join(f", {at_s:g} s: {then}" for at_s, then in payload_at or [])
        screen.step(
            f"{arm.n} simulated drives of {arm.name} on {arm.bus.address}, payload {name}{later}. Ctrl-C ends them."
        )
        while drives.running and control.goal.stop is None:
            time.sleep(POLL_S)
    screen.step("drives stopped")


def payload_changes(given: list[tuple[float, str]], simulation: RobotSimulation) -> list[ScheduledPayload]:
    """Payload changes from times and names.

    Returns:
        Changes in order of time.

    Raises:
        BadParameter: two changes have the same time.
        ConfigurationError: no payload of that name.
    """
    from armload_drivers.simulation.plant_spec import ScheduledPayload

    if len(dict(given)) < len(given):
        raise typer.BadParameter("expected each time once", param_hint="--payload-at")
    return [ScheduledPayload(at_s, simulation.mounted(name)) for at_s, name in sorted(given)]
