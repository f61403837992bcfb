"""Exported files: written, left alone, or none at all."""

import pytest

from armload_controller.control_errors import ExportError
from armload_controller.export.export_files import write_files

pytestmark = pytest.mark.pure


def test_files_are_written_into_a_folder_that_is_created(tmp_path):
    found = write_files({"a.c": "int a;\n", "b.bin": b"\xff"}, tmp_path / "new" / "out")
    assert found == {tmp_path / "new" / "out" / "a.c": True, tmp_path / "new" / "out" / "b.bin": True}
    assert (tmp_path / "new" / "out" / "a.c").read_bytes() == b"int a;\n"
    assert (tmp_path / "new" / "out" / "b.bin").read_bytes() == b"\xff"


def test_a_single_file_may_be_given_by_its_path(tmp_path):
    assert write_files({"a.c": "x"}, tmp_path / "mine.c") == {tmp_path / "mine.c": True}
    assert write_files({"a.c": "x"}, tmp_path / "folder") == {tmp_path / "folder" / "a.c": True}
    (tmp_path / "v1.0").mkdir()
    assert write_files({"a.c": "x"}, tmp_path / "v1.0") == {tmp_path / "v1.0" / "a.c": True}
    assert set(write_files({"a.c": "x", "b.c": "y"}, tmp_path / "two.c")) == {
        tmp_path / "two.c" / "a.c",
        tmp_path / "two.c" / "b.c",
    }


def test_the_same_content_is_left_alone_and_another_prevents_all(tmp_path):
    write_files({"a.c": "x"}, tmp_path)
    before = (tmp_path / "a.c").stat().st_mtime_ns
    assert write_files({"a.c": "x", "b.c": "y"}, tmp_path) == {tmp_path / "a.c": False, tmp_path / "b.c": True}
    assert (tmp_path / "a.c").stat().st_mtime_ns == before
    with pytest.raises(ExportError, match=r"a\.c.*already exists with different content"):
        write_files({"c.c": "z", "a.c": "other"}, tmp_path)
    assert not (tmp_path / "c.c").exists()
    (tmp_path / "d.c").mkdir()
    with pytest.raises(ExportError, match=r"d\.c.*cannot be read"):
        write_files({"d.c": "z"}, tmp_path)


def test_a_folder_that_cannot_be_created_is_named(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(ExportError, match=r"file.*cannot be written"):
        write_files({"a.c": "x", "b.c": "y"}, tmp_path / "file" / "below")
