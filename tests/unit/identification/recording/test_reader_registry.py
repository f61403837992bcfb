"""The reader of a file by its first bytes, and what is said of files that none reads."""

from __future__ import annotations

import sys
from types import SimpleNamespace

import pytest

from armload_identification.identification_errors import ExtraMissing, RecordingError
from armload_identification.recording import reader_registry
from armload_identification.recording.reader_registry import reader_of
from armload_identification.recording.reading_options import ReadingOptions
from armload_identification.recording.run_format import MAGIC

pytestmark = pytest.mark.pure

FORMATS = "armload_identification.recording.formats"
OPTIONS = ReadingOptions()
ROS_2 = MAGIC + b"\x01" + bytes(8) + b"\x04\x00\x00\x00ros2" + b"rest"
OWN = MAGIC + b"\x01" + bytes(8) + b"\x04\x00\x00\x00none" + b"rest"


def made_by(reader):
    return SimpleNamespace(name=reader, kind=reader.removesuffix("Reader").lower())


@pytest.fixture
def opened(tmp_path, monkeypatch):
    """The name of the reader of a file with some bytes, or of a folder with some files."""
    for module, reader in (
        ("ros_reader", "RosReader"),
        ("mcap_reader", "McapReader"),
        ("numpy_reader", "NumpyReader"),
        ("parquet_reader", "ParquetReader"),
    ):
        made = SimpleNamespace(**{reader: lambda *given, reader=reader: made_by(reader)})
        monkeypatch.setitem(sys.modules, f"{FORMATS}.{module}", made)
    monkeypatch.setattr(reader_registry, "CsvReader", lambda *given: made_by("CsvReader"))

    def opened(name, content, options=OPTIONS):
        path = tmp_path / name
        if isinstance(content, bytes):
            path.write_bytes(content)
        for inside in content if not isinstance(content, bytes) else ():
            (path / inside).parent.mkdir(parents=True, exist_ok=True)
            (path / inside).touch()
        return reader_of(path, options).name

    return opened


@pytest.mark.parametrize(
    ("name", "content", "reader"),
    [
        ("a.mcap", OWN, "McapReader"),
        ("a.mcap", ROS_2, "RosReader"),
        ("a.db3", b"SQLite format 3\x00rest", "RosReader"),
        ("a.bag", b"#ROSBAG V2.0\n", "RosReader"),
        ("bag", ["a.db3"], "RosReader"),
        ("bag", ["a.mcap.zstd"], "RosReader"),
        ("set", ["meta/info.json"], "ParquetReader"),
        ("a.any", b"PAR1rest", "ParquetReader"),
        ("a.npz", b"PK\x03\x04rest", "NumpyReader"),
        ("a.csv", b"t,q1\n", "CsvReader"),
        ("a.csv", b" " * 5000 + b"t,q1\n", "CsvReader"),
    ],
)
def test_a_file_is_read_by_its_first_bytes(opened, name, content, reader):
    assert opened(name, content) == reader


@pytest.mark.parametrize(
    ("name", "content", "text"),
    [
        ("a.xlsx", b"PK\x03\x04\x00\x00", "a file of unknown format. Give a recording made by armload, a ROS bag"),
        ("folder", ["other.txt"], "a folder of unknown format."),
        ("a.csv", b"", "the file is empty. Give a recording with rows of numbers."),
        ("a.csv", b" \n" * 5000, "the file is empty."),
    ],
)
def test_a_file_that_nobody_reads_is_named(opened, name, content, text):
    with pytest.raises(RecordingError) as caught:
        opened(name, content)
    assert f"{name}: {text}" in str(caught.value)


@pytest.mark.parametrize("key", ["columns", "log_columns"])
def test_named_columns_make_a_table_of_a_file_with_zero_bytes(opened, key):
    assert opened("a.log", b"t,q1\n\x00", ReadingOptions(**{key: object()})) == "CsvReader"


def test_only_data_sets_have_episodes(opened):
    assert opened("set", ["meta/info.json"], ReadingOptions(episode=0)) == "ParquetReader"
    with pytest.raises(RecordingError, match=r"a\.mcap: has no episodes, unlike a LeRobot data set\. Omit `episode=`"):
        opened("a.mcap", OWN, ReadingOptions(episode=0))


@pytest.mark.parametrize(
    ("library", "content", "what", "extra"),
    [
        ("rosbags", ROS_2, "a ROS bag needs rosbags", "ros"),
        ("pyarrow", b"PAR1", "a Parquet table needs PyArrow", "parquet"),
    ],
)
def test_a_library_that_is_missing_is_named_with_its_extra(opened, monkeypatch, library, content, what, extra):
    monkeypatch.setitem(sys.modules, library, None)
    with pytest.raises(ExtraMissing) as caught:
        opened("a.bin", content)
    assert f"a.bin: {what}, which a plain installation does not include. Install it: pip install" in str(caught.value)
    assert str(caught.value).endswith(f"'armload[{extra}]'.")
