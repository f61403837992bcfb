"""Files appear complete or not at all."""

import errno
import os
import re
import resource
import stat
from pathlib import Path

import numpy as np
import pytest

import armload_controller
import armload_identification
from armload_identification.excitation.excitation_file import read_excitation, write_excitation
from armload_identification.excitation.fourier import Excitation, FourierTrajectory
from armload_identification.identification_errors import ExcitationFileError
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


def test_on_a_full_disk_the_earlier_file_stays(tmp_path):
    """A limit on the file's size makes the kernel reject writes, as on a full disk."""
    path = tmp_path / "excitation.toml"
    small, large = (
        Excitation(FourierTrajectory(0.1, np.zeros(6), np.ones((6, k)), np.ones((6, k))), 3) for k in (1, 99)
    )
    write_excitation(path, small)
    limit = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, limit[1]))
    try:
        with pytest.raises(ExcitationFileError, match=r"excitation\.toml.*cannot be written: File too large"):
            write_excitation(path, large)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limit)
    assert read_excitation(path).trajectory.harmonics == 1
    assert [p.name for p in tmp_path.iterdir()] == ["excitation.toml"]


def test_every_result_is_written_whole():
    """No module of identification or controller writes a result in any other way.

    Files that grow during a run are appended to: recordings, decisions, the journal of a fleet's rows. Generated
    sources are compiled, and compressed bags unpacked, in a temporary folder.
    """
    direct = re.compile(r"write_text\(.*utf|\.write_text\(|\.write_bytes\(|open\(.*[\"'][wxa]b?\+?[\"']")
    found = {
        str(file.relative_to(Path(package.__path__[0])))
        for package in (armload_identification, armload_controller)
        for file in Path(package.__path__[0]).rglob("*.py")
        if any(direct.search(line) and ">>>" not in line for line in file.read_text().splitlines())
    }
    growing = {"cycle/run_recorder.py", "session/decision_log.py", "fleet/row_store.py"}
    temporary = {"export/compiled_library.py", "recording/formats/ros_reader.py"}
    assert found == {"storage/replace_file.py", *temporary, *growing}
