"""From a file to a recording: blocks of rows, cleaned and reduced while they are read.

Memory does not grow with the file. A run of up to `SHORT_ROWS` rows is kept unchanged; a longer one is reduced
(`period_average`, `time_average`). Whether a reduction suits a long run is known only while it is read; if it does not,
the file is read again with the next one.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Final

from threadpoolctl import threadpool_limits

from armload_identification.excitation.excitation_file import parse_excitation
from armload_identification.excitation.fourier import Excitation
from armload_identification.identification_errors import RecordingError
from armload_identification.recording.formats.frame_reader import DataFrame, FrameReader
from armload_identification.recording.garbage_rows import FIRST_WINDOW, GarbageFilter, WrongUnit
from armload_identification.recording.read_boundary import reading
from armload_identification.recording.reader import ReadingAccount, RecordingReader
from armload_identification.recording.reader_registry import reader_of
from armload_identification.recording.reading_options import ReadingOptions
from armload_identification.recording.recording import Recording, RecordingSource
from armload_identification.recording.reduction.period_average import PeriodAverager
from armload_identification.recording.reduction.reduction import Reduction, WrongReduction
from armload_identification.recording.reduction.time_average import TimeAverager
from armload_identification.recording.row_block import RowBlock, joined
from armload_identification.recording.run_format import EXCITATION_ATTACHMENT

SHORT_ROWS: Final = FIRST_WINDOW
"""Most rows of a recording that is kept unchanged."""
MOST_POSITIONS: Final = 2**27
"""Most positions in a file, before its rows are averaged: six hours of six joints at 1 kHz."""
_NO_OPTIONS: Final = ReadingOptions()


def read_recording_file(
    source: Path | DataFrame,
    options: ReadingOptions = _NO_OPTIONS,
    *,
    between_s: tuple[float, float] | None = None,
    with_effort: bool = True,
    short_rows: int = SHORT_ROWS,
) -> Recording:
    """Read a recording of any known format.

    Args:
        source: The file, or a data frame.
        options: What the file does not say about itself.
        between_s: Start and end in s since the first row; all rows are used if not given.
        with_effort: Whether a recording without torque and current is refused; False only for inspection.
        short_rows: Most rows of a recording that is kept unchanged.

    Returns:
        The recording; invalid rows are dropped and counted.

    Raises:
        RecordingError: the file is missing, empty, damaged, of an unknown format, or contains no usable rows.
    """
    path = source if isinstance(source, Path) else Path("data frame")
    with reading(path):
        reader = reader_of(source, options) if isinstance(source, Path) else FrameReader(source, path, options)
    text = reader.attachments.get(EXCITATION_ATTACHMENT)
    excitation = None if text is None else parse_excitation(text, f"{path}, attachment {EXCITATION_ATTACHMENT}")
    shown = path if options.episode is None else path.with_name(f"{path.name} episode {options.episode}")
    reductions: list[Callable[[], Reduction]] = [partial(TimeAverager, excitation)]  # this one suits every long run
    if excitation is not None:
        reductions.insert(0, partial(PeriodAverager, shown, excitation))
    for reduction in reductions:
        read = _Reading(reader, GarbageFilter(shown, with_effort=with_effort), excitation, between_s)
        try:
            # One thread: a second one saves no time with products of blocks, and costs half of the processor time.
            with threadpool_limits(1):
                return read.recording(reduction, short_rows)
        except WrongReduction:
            continue
        except WrongUnit as error:
            if read.account.columns is None or not error.factors.keys().isdisjoint(read.account.columns[0].scale):
                raise
            columns, names = read.account.columns
            option = columns.in_units(error.factors).option(names)
            raise RecordingError(f"{error} Or specify the unit: {option}.") from None
    raise RecordingError(f"{path}: the recording cannot be reduced. Record it again.")


@dataclass
class _Reading:
    """A file while it is read once; `between_s` selects rows by the time since the first one."""

    reader: RecordingReader
    garbage: GarbageFilter
    excitation: Excitation | None
    between_s: tuple[float, float] | None
    account: ReadingAccount = field(default_factory=ReadingAccount)
    start_s: float | None = None
    last_s: float = 0.0
    outside: Counter[str] = field(default_factory=Counter)

    def recording(self, reduction_of: Callable[[], Reduction], short_rows: int) -> Recording:
        """The recording, with the given reduction if the run is long."""
        kept: list[RowBlock] = []
        size = 0
        reduction: Reduction | None = None
        for rows in self._selected_rows():
            size += rows.size
            kept.append(rows)
            if size > short_rows:
                reduction = reduction or reduction_of()
                while kept:
                    reduction.add(kept.pop(0))
        if self.between_s is not None and self.start_s is not None and not size:
            begin_s, end_s = self.between_s
            raise RecordingError(
                f"{self.garbage.path}: no row between {begin_s:g} and {end_s:g} s (`between_s=`): the recording has "
                f"rows from 0 to {self.last_s:.1f} s."
            )
        account = self.account
        self.garbage.require_enough(size, account.rows_read, account.reasons + self.outside)
        found = ("sha256", "rows_read", "truncated", "joint_names", "remarks")
        source = RecordingSource(
            **{name: getattr(account, name) for name in found},
            path=self.garbage.path,
            kind=self.reader.kind,
            reasons=dict(account.reasons + self.garbage.reasons),
            attachments=dict(self.reader.attachments),
            between_s=self.between_s,
        )
        if reduction is not None:
            return reduction.recording(source)
        return Recording(**vars(joined(kept)), excitation=self.excitation, source=source)

    def _selected_rows(self) -> Iterator[RowBlock]:
        """The usable rows between the two times; all of them without such times."""
        for rows in self.garbage.valid(self._blocks()):
            if self.between_s is None or not rows.size:
                yield rows
                continue
            self.start_s = float(rows.time_s[0]) if self.start_s is None else self.start_s
            elapsed = rows.time_s - self.start_s
            self.last_s = float(elapsed[-1])
            chosen = (elapsed >= self.between_s[0]) & (elapsed <= self.between_s[1])
            self.outside["outside `between_s=`"] += int((~chosen).sum())
            yield rows.rows(chosen)

    def _blocks(self) -> Iterator[RowBlock]:
        """The reader's blocks, up to a length that no recording of an arm has, but a small compressed file may.

        The phase is dropped without an excitation.
        """
        positions = 0
        with reading(self.garbage.path):
            for block in self.reader.blocks(self.account):
                positions += block.position_rad.size
                if positions > MOST_POSITIONS:
                    raise RecordingError(
                        f"{self.garbage.path}: more than {MOST_POSITIONS // block.n:,} rows of {block.n} joints. Split "
                        "the recording."
                    )
                yield block if self.excitation is not None else replace(block, phase_s=None)
