"""Options that select parts of recordings, and that supply what a table or bag does not state."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Annotated

import typer

from armload_controller.cli.options import seconds_of
from armload_identification.recording.reading_options import Effort

if TYPE_CHECKING:
    from armload_controller.config.robot_recordings import RecordingChoice

BetweenOption = Annotated[
    tuple[str, str] | None,
    typer.Option(
        metavar="BEGIN END",
        help="Use the rows between two times since the first row, such as 10s 1.5min; does not apply to --validation.",
    ),
]
JointsOption = Annotated[
    str | None,
    typer.Option(help="Which of the recorded joints are the arm's, such as 1-5,7; by default by name, or all."),
]
ColumnsOption = Annotated[
    str | None,
    typer.Option(help='Columns of a table, such as "time[ms]=0 position[deg]=1-6 torque=7-12", or by names.'),
]
EffortOption = Annotated[
    Effort, typer.Option(help="Meaning of effort in a ROS message: joint torque or motor current.")
]
EpisodeOption = Annotated[
    str | None,
    typer.Option(
        metavar="N[,N...]",
        help="Episode of a data set to use: one for all recordings, or one for each, loaded first.",
    ),
]

_RANGE = re.compile(r"(\d{1,4})(?:-(\d{1,4}))?")


def recording_choices(
    columns: str | None,
    effort: Effort,
    between: tuple[str, str] | None,
    joints: str | None,
    episode: str | None,
    *,
    count: int,
) -> list[RecordingChoice]:
    """The options as one choice for each recording.

    Args:
        columns: Value of --columns.
        effort: Value of --effort.
        between: Value of --between.
        joints: Value of --joints.
        episode: Value of --episode.
        count: Number of recordings.

    Raises:
        BadParameter: an invalid time, joint or episode.
        RecordingError: invalid columns.
    """
    from armload_controller.config.robot_recordings import RecordingChoice
    from armload_identification.recording.csv_columns import parse_columns

    known = None if columns is None else parse_columns(columns)
    between_s = None if between is None else _between(*between)
    chosen = () if joints is None else _joints(joints)
    episodes = _episodes(episode, count)
    return [RecordingChoice(known, effort, between_s, number, chosen) for number in episodes]


def _between(begin: str, end: str) -> tuple[float, float]:
    """Two times in seconds."""
    begin_s, end_s = (seconds_of(text, "--between", above_zero=False) for text in (begin, end))
    if end_s <= begin_s:
        raise typer.BadParameter(f"{begin} is not before {end}", param_hint="--between")
    return begin_s, end_s


def _joints(text: str) -> tuple[int, ...]:
    """Indices from 0 of joints that are numbered from 1."""
    chosen: list[int] = []
    for part in text.split(","):
        match = _RANGE.fullmatch(part.strip())
        first = int(match[1]) if match else 0
        last = int(match[2] or match[1]) if match else 0
        if not 1 <= first <= last:
            raise typer.BadParameter(f"--joints: {part!r} is neither a joint nor a range; write 1-5 or 1,2,4")
        chosen += range(first - 1, last)
    if len(set(chosen)) < len(chosen):
        raise typer.BadParameter(f"--joints: {text!r} names a joint twice")
    return tuple(chosen)


def _episodes(text: str | None, count: int) -> list[int | None]:
    """An episode for each recording."""
    if text is None:
        return [None] * count
    parts = text.split(",")
    if not all(part.strip().isdecimal() for part in parts):
        raise typer.BadParameter(f"--episode: {text!r} is not an episode number; write 3, or 3,4")
    if len(parts) not in {1, count}:
        raise typer.BadParameter(f"--episode: {len(parts)} numbers for {count} recordings; give one, or one for each")
    return [int(part) for part in (parts * count)[:count]]
