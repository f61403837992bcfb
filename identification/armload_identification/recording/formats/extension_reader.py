"""Recordings read by other packages: a function from a path to arrays, `armload.readers` named after the files' suffix.

    def read_trc(path: Path) -> dict[str, NDArray[np.float64]]      "time_s" (N,), "position_rad" (N, n), and, as far as
                                                                    known, "velocity_rad_s", "current_a", "torque_nm"
The function raises ValueError or OSError for a file that it cannot read, with a sentence for the user.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Final

import numpy as np

from armload_identification.extensions import ExtensionGroup, extension
from armload_identification.float_array import FloatArray
from armload_identification.identification_errors import RecordingError
from armload_identification.recording.reader import ReadingAccount, RecordingReader
from armload_identification.recording.row_block import QUANTITIES, RowBlock, parts_of, require_shapes
from armload_identification.storage.regular_file import hash_of_files

OWN_SUFFIXES: Final = frozenset({"csv", "tsv", "txt", "log", "mcap", "npz", "npy", "parquet", "db3", "bag"})
"""Suffixes of the formats that armload reads itself; no extension gets such a file."""

ReadArrays = Callable[[Path], Mapping[str, FloatArray]]


def open_extension(path: Path) -> ExtensionReader | None:
    """The reader of the installed package for files with this suffix."""
    suffix = path.suffix.removeprefix(".").lower()
    if not suffix or suffix in OWN_SUFFIXES or path.is_dir():
        return None
    found = extension(ExtensionGroup.READERS, suffix, OWN_SUFFIXES)
    if found is None:
        return None
    function, package = found
    if not callable(function):
        raise RecordingError(f"{path}: {package} provides {function!r} for .{suffix} files, expected a function")
    return ExtensionReader(path, function, package)


class ExtensionReader(RecordingReader):
    """Yields the arrays of a package's function in blocks of rows.

    Args:
        function: The package's function.
        package: Name and version of the package, for messages.
    """

    def __init__(self, path: Path, function: ReadArrays, package: str) -> None:
        self.kind = path.suffix.removeprefix(".").lower()
        self._path, self._function, self._package = path, function, package

    def blocks(self, account: ReadingAccount) -> Iterator[RowBlock]:
        """See `RecordingReader`.

        Raises:
            RecordingError: the function raises, or its arrays are not those of a recording.
        """
        account.sha256 = hash_of_files([self._path])
        account.remarks = (f"read by {self._package}",)
        try:
            found = dict(self._function(self._path))
            arrays = {name: np.array(values, dtype=np.float64) for name, values in found.items()}
        except Exception as problem:
            raise RecordingError(
                f"{self._path}: cannot be read by {self._package}: {type(problem).__name__}: {problem}"
            ) from problem
        if {"time_s", "position_rad"} - set(arrays) or set(arrays) - set(QUANTITIES):
            raise RecordingError(
                f"{self._path}: {self._package} gave {', '.join(arrays) or 'nothing'}; expected time_s (N,), "
                f"position_rad (N, n), and the same shape for others of {', '.join(QUANTITIES)}"
            )
        require_shapes(f"{self._path}: {self._package}", arrays)
        account.rows_read = len(arrays["time_s"])
        for part in parts_of(arrays):
            yield RowBlock(**part)
