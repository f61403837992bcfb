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
from armload_identification.recording.reader import RecordingReader
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


def reader_of(path: Path, options: ReadingOptions) -> RecordingReader:
    """The reader of a file or folder.

    Args:
        path: The recording.
        options: Information that is not in the file.

    Raises:
        RecordingError: it cannot be opened, is empty, or has an unknown format.
    """
    reader = _reader(path, b"" if path.is_dir() else _start_of(path), options)
    if reader is not None and options.episode is not None and reader.kind != "parquet":
        raise RecordingError(f"{path}: has no episodes, unlike a LeRobot data set. Omit `episode=`.")
    if reader is not None:
        return reader
    raise RecordingError(
        f"{path}: a {'folder' if path.is_dir() else 'file'} of unknown format. Give a recording made by armload, a ROS "
        "bag (folder, .db3, .mcap or .bag), or a table with column names (.csv, .parquet, .npz). Spreadsheets and "
        "MATLAB can save a table as .csv."
    )


def _reader(path: Path, start: bytes, options: ReadingOptions) -> RecordingReader | None:
    """The reader of a file by its first bytes, or of a folder, which has none; None for an unknown format.

    CSV comes last, because a text table has no signature: it is any other file without zero bytes. Other packages'
    readers get only files that have none of armload's suffixes and signatures.
    """
    mcap, folder = start.startswith(MAGIC), path.is_dir()
    ros_2 = mcap and start[_PROFILE_AT:].startswith(_ROS_PROFILE)
    bag = folder and (any(path.glob("*.db3*")) or any(path.glob("*.mcap*")))
    if bag or ros_2 or start.startswith((_SQLITE, _ROS_1)):
        require_extra(Extra.ROS, f"{path}: a ROS bag")
        from armload_identification.recording.formats.ros_reader import RosReader

        return RosReader(path, options)
    if mcap:
        from armload_identification.recording.formats.mcap_reader import McapReader

        return McapReader(path)
    if start.startswith(_ZIP) and path.suffix == ".npz":
        from armload_identification.recording.formats.numpy_reader import NumpyReader

        return NumpyReader(path)
    if start.startswith(_PARQUET) or (folder and (path / "meta" / "info.json").is_file()):
        require_extra(Extra.PARQUET, f"{path}: a Parquet table")
        from armload_identification.recording.formats.parquet_reader import ParquetReader

        return ParquetReader(path, options)
    named = options.columns is not None or options.log_columns is not None
    text = CsvReader(path, options) if start and (named or b"\x00" not in start) else None
    return open_extension(path) or text


def _start_of(path: Path) -> bytes:
    """The first bytes of a file, which must contain more than white space."""
    require_regular(path)
    with path.open("rb") as file:
        start = file.read(_START_BYTES)
        if not start.strip() and not any(rest.strip() for rest in iter(lambda: file.read(_START_BYTES), b"")):
            raise RecordingError(f"{path}: the file is empty. Give a recording with rows of numbers.")
    return start
