"""`armload identify-body`: the empty arm's own torque, so that later no empty run is needed."""

from __future__ import annotations

from importlib.metadata import version
from pathlib import Path
from typing import Annotated

import typer

from armload_controller.cli.options import GainsOption, RobotArgument
from armload_controller.cli.output.json_output import JsonOption, print_document
from armload_controller.cli.output.output_files import require_folder


def identify_body(
    robot: RobotArgument,
    recordings: Annotated[list[Path], typer.Argument(metavar="RECORDING...", help="Runs of the empty arm.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="Body file (TOML) to write.")],
    check: Annotated[
        Path | None, typer.Option(help="A run of the empty arm that is not used, to try the body on.")
    ] = None,
    gains: GainsOption = None,
    stribeck: Annotated[bool, typer.Option("--stribeck", help="Friction near standstill gets a column.")] = False,
    as_json: JsonOption = False,
) -> None:
    """Identify an arm's base parameters and friction from runs without a payload."""
    from armload_controller.analysis.arm_in_use import transmission_of
    from armload_controller.cli.output.cad_table import body_table
    from armload_controller.cli.output.result_documents import body_document
    from armload_controller.cli.screen import Screen
    from armload_controller.config.robot import load_robot
    from armload_controller.config.robot_recordings import read_of
    from armload_identification.calibration.body_identification import check_body
    from armload_identification.calibration.body_identification import identify_body as fit
    from armload_identification.files.body_file import write_body

    arm = load_robot(robot)
    screen = Screen(as_json=as_json)
    require_folder(output)
    chain, transmission = arm.chain, transmission_of(arm, gains)
    body = fit([read_of(arm, path) for path in recordings], chain, transmission, stribeck=stribeck)
    screen.step(
        f"{body.base_parameters} base parameters of links and rotors, {body.determined} determined by these runs"
    )
    title = "Averaged torque, and what the body leaves of it, on the runs used"
    screen.table(body_table(title, arm.joint_names, body.torque_rms_nm, body.residual_rms_nm, body.noise_nm))
    checked = None
    if check is not None:
        trial = check_body(body.model, read_of(arm, check), chain, transmission)
        title = f"The same on {check.name}, which was not used"
        screen.table(body_table(title, arm.joint_names, trial.torque_rms_nm, trial.error_rms_nm, trial.noise_nm))
        checked = (trial.torque_rms_nm, trial.error_rms_nm, trial.noise_nm)
    write_body(output, body.result(version("armload"), arm.sha256))
    screen.step(f"written: {output}")
    if as_json:
        used = (body.torque_rms_nm, body.residual_rms_nm, body.noise_nm)
        counts = (body.base_parameters, body.determined)
        print_document(body_document(arm.name, arm.joint_names, counts, used, checked, output))
