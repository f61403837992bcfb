"""The supported recording formats. A new one requires its own file with a reader, and an entry here.

The libraries of a format are loaded only for its files.
"""

from __future__ import annotations

from pathlib import Path
from typing import Final

from armload_identification.extras import Extra, require_extra
from armload_identification.identification_errors import RecordingError
from armload_identification.recording.formats.csv_reader import CsvReader
from armload_identification.recording.formats.extension_reader import open_extension
from armload_identification.recording.reader import ReaderFactory, RecordingReader
from armload_identification.recording.reading_options import ReadingOptions
from armload_identification.recording.run_format import MAGIC
from armload_identification.storage.regular_file import require_regular

_SQLITE: Final = b"SQLite format 3\x00"
_ROS_1: Final = b"#ROSBAG V2.0"
_ROS_PROFILE: Final = b"\x04\x00\x00\x00ros2"
_PROFILE_AT: Final = len(MAGIC) + 9
"""Position of the profile in an MCAP file, after the kind and length of the first record."""
_ZIP: Final = b"PK\x03\x04"
_PARQUET: Final = b"PAR1"
_START_BYTES: Final = 4096


def open_ros(path: Path, start: bytes, options: ReadingOptions) -> RecordingReader | None:
    """The reader of ROS bags: of ROS 2, a folder, SQLite file or MCAP file with that profile; of ROS 1, a file."""
    folder = path.is_dir() and (any(path.glob("*.db3*")) or any(path.glob("*.mcap*")))
    mcap = start.startswith(MAGIC) and start[_PROFILE_AT:].startswith(_ROS_PROFILE)
    if not (folder or mcap or start.startswith((_SQLITE, _ROS_1))):
        return None
    require_extra(Extra.ROS, f"{path}: a ROS bag")
    from armload_identification.recording.formats.ros_reader import RosReader

    return RosReader(path, options)


def open_mcap(path: Path, start: bytes, _options: ReadingOptions) -> RecordingReader | None:
    """The reader of armload's own recordings."""
    if not start.startswith(MAGIC):
        return None
    from armload_identification.recording.formats.mcap_reader import McapReader

    return McapReader(path)


def open_numpy(path: Path, start: bytes, _options: ReadingOptions) -> RecordingReader | None:
    """The reader of NumPy archives."""
    if not start.startswith(_ZIP) or path.suffix != ".npz":
        return None
    from armload_identification.recording.formats.numpy_reader import NumpyReader

    return NumpyReader(path)


def open_parquet(path: Path, start: bytes, options: ReadingOptions) -> RecordingReader | None:
    """The reader of Parquet tables, and of LeRobot data sets (folders)."""
    if not start.startswith(_PARQUET) and not (path.is_dir() and (path / "meta" / "info.json").is_file()):
        return None
    require_extra(Extra.PARQUET, f"{path}: a Parquet table")
    from armload_identification.recording.formats.parquet_reader import ParquetReader

    return ParquetReader(path, options)


def open_csv(path: Path, start: bytes, options: ReadingOptions) -> RecordingReader | None:
    """The reader of text tables: any other file without zero bytes."""
    if not start or (b"\x00" in start and options.columns is None and options.log_columns is None):
        return None
    return CsvReader(path, options)


READERS: Final[tuple[ReaderFactory, ...]] = (open_ros, open_mcap, open_numpy, open_parquet, open_extension, open_csv)
"""The first reader that accepts a file is used; CSV comes last, because a text table has no signature. Other packages'
readers get only files that have none of armload's suffixes and signatures."""


def reader_of(path: Path, options: ReadingOptions) -> RecordingReader:
    """The reader of a file or folder.

    Args:
        path: The recording.
        options: Information that is not in the file.

    Raises:
        RecordingError: it cannot be opened, is empty, or has an unknown format.
    """
    start = b"" if path.is_dir() else _start_of(path)
    for factory in READERS:
        reader = factory(path, start, options)
        if reader is None:
            continue
        if options.episode is not None and factory is not open_parquet:
            raise RecordingError(f"{path}: has no episodes, unlike a LeRobot data set. Omit `episode=`.")
        return reader
    raise RecordingError(
        f"{path}: a {'folder' if path.is_dir() else 'file'} of unknown format. Give a recording made by armload, a ROS "
        "bag (folder, .db3, .mcap or .bag), or a table with column names (.csv, .parquet, .npz). Spreadsheets and "
        "MATLAB can save a table as .csv."
    )


def _start_of(path: Path) -> bytes:
    """The first bytes of a file, which must contain more than white space."""
    require_regular(path)
    with path.open("rb") as file:
        start = file.read(_START_BYTES)
        if not start.strip() and not any(rest.strip() for rest in iter(lambda: file.read(_START_BYTES), b"")):
            raise RecordingError(f"{path}: the file is empty. Give a recording with rows of numbers.")
    return start
