"""`armload recordings`: inspects recordings."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from armload_controller.cli.command_group import Commands
from armload_controller.cli.recording_options import RecordingOptions
from armload_controller.cli.screen import PLAIN, Screen

recordings = Commands("Inspect recordings.")


@recordings.callback()
def _group() -> None:
    """Inspect recordings."""


@recordings.command("show")
def show_recording(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A recording: MCAP, ROS bag, CSV, Parquet, NPZ.")],
    other: Annotated[
        Path | None,
        typer.Argument(
            metavar="[OTHER]", help="A second recording, to check whether the two fit as loaded and unloaded run."
        ),
    ] = None,
    *,
    robot: Annotated[
        str | None, typer.Option(metavar="ROBOT", help="Arm whose joint names and [log] apply: a robot, TOML or URDF.")
    ] = None,
    chosen: RecordingOptions,
    screen: Screen = PLAIN,
) -> None:
    """Show joints, rate, gaps, range and motion of a recording, and what is missing to identify a payload."""
    from armload_controller.cli.output.recording_output import joint_table, pair_text, recording_document, survey_text
    from armload_controller.config.objects_or_paths import arm_of
    from armload_controller.config.robot_recordings import chosen_joints
    from armload_identification.pipeline.recording_survey import pair_mismatch, survey
    from armload_identification.recording.file_reading import read_recording_file
    from armload_identification.recording.reading_options import ReadingOptions

    files = [path for path in (file, other) if path is not None]
    choices = chosen.choices(len(files))
    of_arm = None if robot is None else arm_of(robot)
    names, limits_rad, log = (
        ((), None, None) if of_arm is None else (of_arm.joint_names, of_arm.position_limits_rad, of_arm.csv_columns)
    )
    runs = [
        chosen_joints(
            read_recording_file(
                path,
                ReadingOptions(choice.columns, choice.effort, names, choice.episode, limits_rad, log),
                between_s=choice.between_s,
                with_effort=False,
            ),
            choice.joints,
        )
        for path, choice in zip(files, choices, strict=True)
    ]
    surveys = [survey(run) for run in runs]
    problem = pair_mismatch(*runs) if len(runs) == 2 else None
    screen.document(partial(recording_document, surveys, problem))
    for facts in surveys:
        screen.result(survey_text(facts))
        screen.result_table(joint_table(facts))
    screen.result(pair_text(surveys, problem))
