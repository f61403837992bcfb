"""Files appear complete or not at all."""

import errno
import os
import stat

import pytest

from armload_identification.storage.replace_file import replace_file


def test_an_earlier_file_is_replaced_and_keeps_its_permissions(tmp_path):
    path = tmp_path / "payload.toml"
    path.write_text("old")
    path.chmod(0o640)
    replace_file(path, "new ä")
    assert path.read_bytes() == "new ä".encode()
    assert stat.S_IMODE(path.stat().st_mode) == 0o640
    assert [p.name for p in tmp_path.iterdir()] == ["payload.toml"]


def test_a_new_file_has_the_permissions_of_any_new_file(tmp_path):
    replace_file(tmp_path / "ours", b"1")
    (tmp_path / "theirs").write_bytes(b"1")
    assert (tmp_path / "ours").stat().st_mode == (tmp_path / "theirs").stat().st_mode


def test_a_link_stays_a_link(tmp_path):
    (tmp_path / "there").mkdir()
    target, link = tmp_path / "there" / "real.toml", tmp_path / "link.toml"
    target.write_text("old")
    link.symlink_to(target)
    replace_file(link, "new")
    assert link.is_symlink()
    assert target.read_text() == "new"


def test_the_earlier_file_stays_where_the_new_one_does_not_reach_the_disk(tmp_path, monkeypatch):
    path = tmp_path / "payload.toml"
    path.write_text("old")

    def full(descriptor):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OSError, match="No space left"):
        replace_file(path, "new")
    assert path.read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["payload.toml"]


def test_the_content_is_on_the_disk_before_the_name_is(tmp_path, monkeypatch):
    """A crash between the two must not leave an empty file under the name."""
    path, order = tmp_path / "payload.toml", []
    fsync = os.fsync

    def noted(descriptor):
        order.append((path.exists(), stat.S_ISDIR(os.fstat(descriptor).st_mode)))
        fsync(descriptor)

    monkeypatch.setattr(os, "fsync", noted)
    replace_file(path, "new")
    assert order == [(False, False), (True, True)]


def test_a_pipe_is_written_to_and_not_replaced(tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    try:
        replace_file(pipe, "text")
        assert os.read(reader, 100) == b"text"
    finally:
        os.close(reader)
    assert stat.S_ISFIFO(pipe.stat().st_mode)
