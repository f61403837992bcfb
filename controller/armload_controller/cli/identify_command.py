"""`armload identify`: from recordings to a payload."""

from __future__ import annotations

from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from armload_controller.cli.options import CalibrationOption, GainsOption, LoadedOption, RobotArgument, arm_in_use
from armload_controller.cli.output_files import require_folder
from armload_identification.estimation.estimator_names import Estimator

if TYPE_CHECKING:
    from armload_identification.estimation.prior_knowledge import KnownPayload
    from armload_identification.model.body_model import BodyModel
    from armload_identification.recording.recording import Recording
    from armload_identification.signals.joint_torque import Transmission


def identify(
    robot: RobotArgument,
    loaded: LoadedOption,
    unloaded: Annotated[
        Path | None, typer.Option("--unloaded", help="Recording of the same motion without the payload.")
    ] = None,
    body: Annotated[
        Path | None, typer.Option("--body", help="Body file of `armload identify-body`, in place of --unloaded.")
    ] = None,
    output: Annotated[Path | None, typer.Option("--output", "-o", help="Payload file (TOML) to write.")] = None,
    gains: GainsOption = None,
    calibration: CalibrationOption = None,
    mass_kg: Annotated[float | None, typer.Option(help="The payload was weighed.")] = None,
    center_of_mass_m: Annotated[
        tuple[float, float, float] | None, typer.Option(help="The centre of mass is known, in the flange frame.")
    ] = None,
    cad: Annotated[Path | None, typer.Option(help="Payload file with CAD values, believed within --cad-share.")] = None,
    cad_share: Annotated[
        float,
        typer.Option(help="Standard deviation of the CAD values: share of the mass, of 0.1 m, of m (0.1 m)^2."),
    ] = 0.05,
    estimator: Annotated[
        Estimator, typer.Option(help="How to fit; 'friction' is the best on every benchmark.")
    ] = Estimator.FRICTION,
) -> None:
    """Identify a payload from a recording with it and one without it, or from the calibrated arm or its body."""
    from armload_controller.cli.result_tables import payload_table, possibility
    from armload_controller.cli.screen import Screen
    from armload_controller.config.robot import load_robot
    from armload_controller.config.robot_recordings import read_of
    from armload_identification.files.payload_file import write_payload
    from armload_identification.pipeline.payload_identification import identify as identify_payload
    from armload_identification.pipeline.payload_identification import payload_result

    arm = load_robot(robot)
    screen = Screen()
    if output is not None:
        require_folder(output)
    run = read_of(arm, loaded)
    empty = None if unloaded is None else read_of(arm, unloaded)
    used = arm_in_use(arm, gains, calibration)
    result = identify_payload(
        run,
        empty,
        used.chain,
        used.transmission,
        estimator=estimator,
        known=_known(mass_kg, center_of_mass_m, cad, cad_share),
        body=_body(body, run, used.transmission),
        arm=used.known,
    )
    payload = payload_result(result, version("armload"), arm.sha256)
    screen.table(payload_table(payload, truth=None))
    screen.step(possibility(result))
    for note in result.notes:
        screen.step(f"note: {note}")
    if output is not None:
        write_payload(output, payload)
        screen.step(f"written: {output}")


def _known(
    mass_kg: float | None, center_of_mass_m: tuple[float, float, float] | None, cad: Path | None, cad_share: float
) -> KnownPayload | None:
    """What the operator knows of the payload; None where it is nothing."""
    from armload_identification.estimation.prior_knowledge import KnownPayload
    from armload_identification.files.payload_file import read_payload

    if mass_kg is None and center_of_mass_m is None and cad is None:
        return None
    return KnownPayload(mass_kg, center_of_mass_m, None if cad is None else read_payload(cad).model, cad_share)


def _body(path: Path | None, loaded: Recording, transmission: Transmission) -> BodyModel | None:
    """The body of a file, which belongs to the gains in use."""
    from armload_identification.calibration.body_identification import require_same_gains
    from armload_identification.files.body_file import read_body

    if path is None:
        return None
    body = read_body(path)
    require_same_gains(body.gain_nm_a, loaded, transmission)
    return body.model
