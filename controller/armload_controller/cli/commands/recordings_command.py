"""`armload recordings`: inspects recordings."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from armload_controller.cli.command_group import CommandGroup
from armload_controller.cli.output.json_output import JsonOption
from armload_controller.cli.recording_options import (
    BetweenOption,
    ColumnsOption,
    EffortOption,
    EpisodeOption,
    JointsOption,
    recording_choices,
)
from armload_identification.recording.reading_options import Effort

recordings = typer.Typer(cls=CommandGroup, help="Inspect recordings.", no_args_is_help=True)


@recordings.callback()
def _group() -> None:
    """Inspect recordings."""


@recordings.command("show")
def show_command(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A recording: MCAP, ROS bag, CSV, Parquet, NPZ.")],
    other: Annotated[
        Path | None,
        typer.Argument(
            metavar="[OTHER]", help="A second recording, to check whether the two fit as loaded and unloaded run."
        ),
    ] = None,
    robot: Annotated[
        str | None, typer.Option(metavar="ROBOT", help="Arm whose joint names and [log] apply: a robot, TOML or URDF.")
    ] = None,
    columns: ColumnsOption = None,
    effort: EffortOption = Effort.TORQUE,
    between: BetweenOption = None,
    joints: JointsOption = None,
    episode: EpisodeOption = None,
    as_json: JsonOption = False,
) -> None:
    """Show joints, rate, gaps, range and motion of a recording, and what is missing to identify a payload."""
    from armload_controller.cli.output.recording_output import joint_table, pair_text, recording_document, survey_text
    from armload_controller.cli.screen import Screen
    from armload_controller.config.objects_or_paths import arm_of
    from armload_controller.config.robot_recordings import chosen_joints
    from armload_identification.pipeline.recording_survey import pair_mismatch, survey
    from armload_identification.recording.file_reading import read_recording
    from armload_identification.recording.reading_options import ReadingOptions

    files = [path for path in (file, other) if path is not None]
    choices = recording_choices(columns, effort, between, joints, episode, count=len(files))
    of_arm = None if robot is None else arm_of(robot)
    names, log = ((), None) if of_arm is None else (of_arm.joint_names, of_arm.csv_columns)
    runs = [
        chosen_joints(
            read_recording(
                path,
                ReadingOptions(choice.columns, choice.effort, names, choice.episode, log_columns=log),
                between_s=choice.between_s,
                with_effort=False,
            ),
            choice.joints,
        )
        for path, choice in zip(files, choices, strict=True)
    ]
    surveys = [survey(run) for run in runs]
    problem = pair_mismatch(*runs) if len(runs) == 2 else None
    screen = Screen(as_json=as_json)
    screen.document(partial(recording_document, surveys, problem))
    for facts in surveys:
        screen.result(survey_text(facts))
        screen.table(joint_table(facts))
    screen.result(pair_text(surveys, problem))
