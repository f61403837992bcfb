"""When a run began, as its recording states it: in its metadata, or by time stamps that count from 1970.

Times that cannot be are ignored: clocks that count from the start of a controller, or were never set.
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from enum import StrEnum
from typing import Final

from armload_identification.recording.recording import Recording

_EARLIEST: Final = datetime(2000, 1, 1, tzinfo=UTC)
_LATEST: Final = datetime(2100, 1, 1, tzinfo=UTC)


class StatedBy(StrEnum):
    """What states the start of a run."""

    RECORDING = "recording"
    TIME_STAMPS = "time stamps"


@dataclass(frozen=True)
class RunStart:
    """The start, UTC, of a run or of the part of it that was selected, and what states it."""

    moment: datetime
    stated_by: StatedBy


def run_start(recording: Recording, latest: datetime = _LATEST) -> RunStart | None:
    """The start of a run; None if the recording states no possible one.

    Args:
        recording: The run. Metadata without a time zone are in UTC.
        latest: A later time is from a wrong clock.
    """
    for moment, by in ((_created(recording), StatedBy.RECORDING), (_first_stamp(recording), StatedBy.TIME_STAMPS)):
        if moment is not None and _EARLIEST <= moment <= latest:
            return RunStart(moment, by)
    return None


def run_start_text(recording: Recording) -> str:
    """The start of a run, ISO 8601; empty if the recording states no possible one."""
    start = run_start(recording)
    return "" if start is None else start.moment.isoformat(timespec="seconds")


def _created(recording: Recording) -> datetime | None:
    """The start by the metadata, which are those of the whole file."""
    source = recording.source
    try:
        created = datetime.fromisoformat(str(source.run().get("created", "")))
        created = created.replace(tzinfo=UTC) if created.tzinfo is None else created.astimezone(UTC)
        return created if source.between_s is None else created + timedelta(seconds=source.between_s[0])
    except (ValueError, OverflowError):
        return None


def _first_stamp(recording: Recording) -> datetime | None:
    """The first time stamp, as a time since 1970."""
    try:
        return datetime.fromtimestamp(float(recording.time_s[0]), UTC)
    except (ValueError, OverflowError, OSError):
        return None
