"""`armload calibrate-gains`: torque per ampere of every joint, from a payload that was weighed."""

from __future__ import annotations

from importlib.metadata import version
from pathlib import Path
from typing import Annotated

import typer

from armload_controller.cli.options import LoadedOption, RobotArgument, UnloadedOption
from armload_controller.cli.output.json_output import JsonOption, print_document
from armload_controller.cli.output.output_files import require_folder
from armload_controller.control_errors import ConfigurationError


def calibrate_gains(
    robot: RobotArgument,
    loaded: LoadedOption,
    unloaded: UnloadedOption,
    output: Annotated[Path, typer.Option("--output", "-o", help="Gains file (TOML) to write.")],
    payload: Annotated[Path | None, typer.Option(help="Payload file: all ten parameters are known.")] = None,
    mass_kg: Annotated[float | None, typer.Option(help="The payload was weighed; nothing else is known.")] = None,
    as_json: JsonOption = False,
) -> None:
    """Calibrate the drive gains with a known payload."""
    from armload_controller.cli.output.cad_table import gains_table
    from armload_controller.cli.output.result_documents import gains_document
    from armload_controller.cli.screen import Screen
    from armload_controller.config.robot import load_robot
    from armload_controller.config.robot_recordings import read_of
    from armload_identification.calibration.drive_gains import calibrate_gains as calibrate
    from armload_identification.estimation.prior_knowledge import KnownPayload
    from armload_identification.files.gains_file import write_gains
    from armload_identification.files.payload_file import read_payload

    arm = load_robot(robot)
    screen = Screen(as_json=as_json)
    if (payload is None) == (mass_kg is None):
        raise ConfigurationError("command line", "--payload / --mass-kg", None, "exactly one of the two")
    known = KnownPayload(mass_kg=mass_kg) if payload is None else KnownPayload.weighed(read_payload(payload).model)
    require_folder(output)
    result = calibrate(read_of(arm, loaded), read_of(arm, unloaded), arm.chain, arm.drives.transmission, known)
    screen.table(gains_table(result, arm.joint_names))
    undetermined = [name for name, found in zip(arm.joint_names, result.determined, strict=True) if not found]
    if undetermined:
        screen.step(f"not determined, kept nominal: {', '.join(undetermined)}; the payload pulls too little on them")
    write_gains(output, result, version("armload"), arm.sha256)
    screen.step(f"written: {output}")
    if as_json:
        print_document(gains_document(arm.name, arm.joint_names, result, output))
