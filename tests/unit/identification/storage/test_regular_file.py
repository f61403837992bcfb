"""Paths of the user: files are read; anything that could block or never end is rejected at once."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from armload_identification.files.payload_file import read_payload
from armload_identification.files.run_table import read_run_table
from armload_identification.identification_errors import IdentificationError
from armload_identification.recording.file_reading import read_recording_file
from armload_identification.recording.reading_options import ReadingOptions
from armload_identification.storage.regular_file import read_whole
from tests.recording_files import table_columns

pytestmark = pytest.mark.pure


def test_a_file_is_read_to_its_bound(tmp_path):
    path = tmp_path / "a"
    path.write_bytes(b"12345")
    assert read_whole(path, 5) == b"12345"
    with pytest.raises(OSError, match="larger than 4 bytes"):
        read_whole(path, 4)
    (tmp_path / "link").symlink_to(path)
    assert read_whole(tmp_path / "link") == b"12345"


@pytest.fixture(params=["pipe", "endless", "folder", "absent"])
def no_file(request, tmp_path) -> tuple[Path, str]:
    path = tmp_path / "there"
    if request.param == "pipe":
        os.mkfifo(path)
    elif request.param == "folder":
        path.mkdir()
    elif request.param == "endless":
        path = Path("/dev/zero")
    said = {"folder": "Is a directory", "absent": "No such file or directory"}
    return path, said.get(request.param, "a pipe or device, not a regular file")


@pytest.mark.parametrize(
    "read",
    [
        read_payload,
        read_run_table,
        read_recording_file,
        lambda path: read_recording_file(path, ReadingOptions(table_columns(0, [1]))),
    ],
)
def test_pipes_devices_and_folders_are_refused_at_once(no_file, read):
    path, said = no_file
    with pytest.raises(OSError, match=said):
        read_whole(path)
    if path.is_dir() and read not in {read_payload, read_run_table}:
        said = "a folder of unknown format"
    with pytest.raises(IdentificationError, match=said) as caught:
        read(path)
    assert str(path) in str(caught.value)
