"""Options that select parts of recordings, and that supply what a table or bag does not state."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

import typer

from armload_controller.cli.options import time_s
from armload_identification.recording.reading_options import Effort

if TYPE_CHECKING:
    from armload_controller.config.robot_recordings import RecordingChoice

_RANGE = re.compile(r"(\d{1,4})(?:-(\d{1,4}))?")


@dataclass(frozen=True)
class RecordingOptions:
    """Options that select parts of recordings."""

    columns: Annotated[
        str | None,
        typer.Option(help='Columns of a table, such as "time[ms]=0 position[deg]=1-6 torque=7-12", or by names.'),
    ] = None
    effort: Annotated[
        Effort, typer.Option(help="Meaning of effort in a ROS message: joint torque or motor current.")
    ] = Effort.TORQUE
    between: Annotated[
        tuple[float, float] | None,
        typer.Option(
            metavar="BEGIN END",
            parser=time_s,
            help="Use the rows between two times since the first row, such as 10s 1.5min; validation runs are whole.",
        ),
    ] = None
    joints: Annotated[
        str | None,
        typer.Option(help="Which of the recorded joints are the arm's, such as 1-5,7; by default by name, or all."),
    ] = None
    episode: Annotated[
        str | None,
        typer.Option(
            metavar="N[,N...]",
            help="Episode of a data set to use: one for all recordings, or one for each, loaded first.",
        ),
    ] = None

    def choices(self, count: int) -> list[RecordingChoice]:
        """The options as one choice for each recording.

        Args:
            count: Number of recordings.

        Raises:
            BadParameter: an invalid time, joint or episode.
            RecordingError: invalid columns.
        """
        from armload_controller.config.robot_recordings import RecordingChoice
        from armload_identification.recording.csv_columns import parse_columns

        known = None if self.columns is None else parse_columns(self.columns)
        if self.between is not None and self.between[0] >= self.between[1]:
            raise typer.BadParameter(
                f"{self.between[0]:g} s is not before {self.between[1]:g} s", param_hint="--between"
            )
        chosen = () if self.joints is None else _joints(self.joints)
        episodes = _episodes(self.episode, count)
        return [RecordingChoice(known, self.effort, self.between, number, chosen) for number in episodes]


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
