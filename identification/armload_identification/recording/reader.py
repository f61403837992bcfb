"""Interface of the readers of recording formats."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Protocol

from armload_identification.recording.csv_columns import CsvColumns
from armload_identification.recording.row_block import RowBlock


@dataclass
class ReadingAccount:
    """What a reader found in a file; complete after its last block.

    Attributes:
        sha256: Hash of the file.
        rows_read: Number of rows found, valid or not.
        reasons: Rows that are not part of a block, by reason.
        truncated: Whether the file ends in the middle of a record.
        joint_names: Names of the joints in the order of the columns; empty if the file does not name them.
        columns: Of a table: the columns that were used, and the names of all.
        remarks: What the reader concluded, for the user to check.
    """

    sha256: str = ""
    rows_read: int = 0
    reasons: Counter[str] = field(default_factory=Counter)
    truncated: bool = False
    joint_names: tuple[str, ...] = ()
    columns: tuple[CsvColumns, Sequence[str]] | None = None
    remarks: tuple[str, ...] = ()


class RecordingReader(Protocol):
    """Reads one file, repeatedly if necessary, in blocks of a few thousand rows.

    Attributes:
        kind: Name of the format.
        attachments: Text of the file's attachments by name.
    """

    kind: str
    attachments: Mapping[str, str] = MappingProxyType({})

    def blocks(self, account: ReadingAccount) -> Iterator[RowBlock]:
        """Read the file from its beginning.

        Args:
            account: Filled in during reading.

        Yields:
            The file's rows in their order, unchecked: invalid rows are dropped elsewhere.

        Raises:
            RecordingError: the file cannot be read, is damaged, or does not contain the requested data.
        """
