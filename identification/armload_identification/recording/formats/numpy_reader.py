"""NumPy archives (.npz): one array per quantity, by its name.

`time_s` (N,), `position_rad` (N, n), and `velocity_rad_s`, `current_a`, `torque_nm` of the same shape, as in
`Recording.from_arrays`, or another name that `column_names` knows; `joint_names` (n,) is optional. Nothing is
unpickled.
"""

from __future__ import annotations

import math
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import numpy as np

from armload_identification.float_array import FloatArray
from armload_identification.identification_errors import RecordingError
from armload_identification.recording.column_names import arrays_by_name
from armload_identification.recording.reader import ReadingAccount, RecordingReader
from armload_identification.recording.row_block import BLOCK_ROWS, RowBlock
from armload_identification.storage.regular_file import hash_of_files

_JOINT_NAMES: Final = "joint_names"
_MOST_JOINTS: Final = 1024
_MOST_NAME_BYTES: Final = 2**20


class NumpyReader(RecordingReader):
    """Reads the arrays of an archive in blocks of rows.

    Raises:
        RecordingError: not an archive, or one without time or position.
    """

    kind = "npz"

    def __init__(self, path: Path) -> None:
        self._path = path
        with zipfile.ZipFile(path) as archive:
            there = {name.removesuffix(".npy") for name in archive.namelist() if name.endswith(".npy")}
        self._arrays = arrays_by_name(there)
        self._named = _JOINT_NAMES in there
        absent = [quantity for quantity in ("time_s", "position_rad") if quantity not in self._arrays]
        if absent:
            raise RecordingError(
                f"{path}: no array {' and no array '.join(absent)}; the archive has "
                f"{', '.join(sorted(there)) or 'none'}. "
                "Save them with these names: np.savez(path, time_s=..., position_rad=..., torque_nm=...)."
            )

    def blocks(self, account: ReadingAccount) -> Iterator[RowBlock]:
        """See `RecordingReader`; blocks are decompressed one at a time.

        Raises:
            RecordingError: damaged, or arrays of inconsistent shapes.
        """
        account.sha256 = hash_of_files([self._path])
        with zipfile.ZipFile(self._path) as archive:
            streams = {quantity: archive.open(f"{name}.npy") for quantity, name in self._arrays.items()}
            kinds = {quantity: _header_of(stream) for quantity, stream in streams.items()}
            shape = kinds["position_rad"][0]
            for quantity, (found, _) in kinds.items():
                expected = shape[:1] if quantity == "time_s" else shape
                if len(shape) != 2 or not 1 <= shape[1] <= _MOST_JOINTS or found != expected:
                    raise ValueError(f"{self._arrays[quantity]} has shape {found}, position {shape}; expected (N, n)")
            if self._named and archive.getinfo(f"{_JOINT_NAMES}.npy").file_size <= _MOST_NAME_BYTES:
                with archive.open(f"{_JOINT_NAMES}.npy") as stream:
                    names = np.lib.format.read_array(stream, allow_pickle=False)
                if names.shape == shape[1:] and names.dtype.kind == "U" and len(set(names.tolist())) == shape[1]:
                    account.joint_names = tuple(names.tolist())
            for first in range(0, shape[0], BLOCK_ROWS):
                rows = min(BLOCK_ROWS, shape[0] - first)
                account.rows_read += rows
                block: dict[str, FloatArray] = {}
                for quantity, ((_, *columns), kind) in kinds.items():
                    numbers = streams[quantity].read(rows * math.prod(columns) * kind.itemsize)
                    block[quantity] = np.frombuffer(numbers, dtype=kind).reshape(rows, *columns).astype(np.float64)
                yield RowBlock(**block)


def _header_of(stream: Any) -> tuple[tuple[int, ...], np.dtype[Any]]:
    """Shape and type of an array of real numbers, which must be stored row by row."""
    version = np.lib.format.read_magic(stream)
    read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
    shape, by_columns, kind = read(stream)
    if kind.kind not in "fiu" or (by_columns and len(shape) > 1):
        raise ValueError("an array is not of real numbers, row by row (np.ascontiguousarray)")
    return shape, kind
