"""When a run began, as its recording states it: in its metadata, or by time stamps that count from 1970.

Times that cannot be are ignored: clocks that count from the start of a controller, or were never set.
"""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, datetime, timedelta
from typing import Final

from armload_identification.recording.recording import Recording

_EARLIEST: Final = datetime(2000, 1, 1, tzinfo=UTC)
_LATEST: Final = datetime(2100, 1, 1, tzinfo=UTC)
STATED_BY: Final = ("recording", "time stamps")
"""What states the start of a run, the more certain one first."""


def run_start(recording: Recording, latest: datetime = _LATEST) -> tuple[datetime, str] | None:
    """The start, UTC, of a run or of the part of it that was selected, and what of `STATED_BY` states it.

    None if the recording states no possible one.

    Args:
        recording: The run. Metadata without a time zone are in UTC.
        latest: A later time is from a wrong clock.
    """
    for moment, by in zip((_created(recording), _first_stamp(recording)), STATED_BY, strict=True):
        if moment is not None and _EARLIEST <= moment <= latest:
            return moment, by
    return None


def run_start_text(recording: Recording) -> str:
    """The start of a run, ISO 8601; empty if the recording states no possible one."""
    start = run_start(recording)
    return "" if start is None else start[0].isoformat(timespec="seconds")


def stated_starts(texts: Sequence[str]) -> tuple[datetime, ...]:
    """The starts of runs, each ISO 8601 and in UTC if it names no zone; none of them if one is not known."""
    try:
        starts = [datetime.fromisoformat(text) for text in texts]
    except ValueError:
        return ()
    return tuple(start if start.tzinfo else start.replace(tzinfo=UTC) for start in starts)


def _created(recording: Recording) -> datetime | None:
    """The start by the metadata, which are those of the whole file."""
    source = recording.source
    try:
        starts = stated_starts([str(source.run().get("created", ""))])
        later = timedelta(seconds=source.between_s[0] if source.between_s else 0.0)
        return starts[0].astimezone(UTC) + later if starts else None
    except OverflowError:
        return None


def _first_stamp(recording: Recording) -> datetime | None:
    """The first time stamp, as a time since 1970."""
    try:
        return datetime.fromtimestamp(float(recording.time_s[0]), UTC)
    except (ValueError, OverflowError, OSError):
        return None
