"""Arrays from another package's function: what they may be, and how what they may not be is refused."""

from pathlib import Path

import numpy as np
import pytest

from armload_identification.identification_errors import RecordingError
from armload_identification.recording.formats import extension_reader
from armload_identification.recording.formats.extension_reader import ExtensionReader, open_extension
from armload_identification.recording.reader import ReadingAccount
from tests.three_joints import POSITION, TIME, TORQUE


@pytest.fixture
def path(tmp_path):
    path = tmp_path / "run.TRC"
    path.write_bytes(b"abc")
    return path


def read(path, function):
    account = ReadingAccount()
    return list(ExtensionReader(path, function, "traces 1.2").blocks(account)), account


def test_the_arrays_become_rows_with_the_hash_of_the_file(path):
    (block,), account = read(path, lambda _: {"time_s": TIME, "position_rad": POSITION.tolist(), "torque_nm": TORQUE})
    np.testing.assert_array_equal(block.time_s, TIME)
    np.testing.assert_array_equal(block.position_rad, POSITION)
    np.testing.assert_array_equal(block.torque_nm, TORQUE)
    assert block.current_a is None
    assert account.rows_read == len(TIME)
    assert account.remarks == ("read by traces 1.2",)
    assert not account.truncated
    assert account.sha256.startswith("ba7816bf"), "SHA-256 of abc"


def broken(_):
    raise KeyError("header")


@pytest.mark.parametrize(
    ("function", "text"),
    [
        (broken, "cannot be read by traces 1.2: KeyError: 'header'"),
        (lambda _: {"time_s": "no"}, "cannot be read by traces 1.2: ValueError: "),
        (lambda _: {}, "traces 1.2 gave nothing; expected time_s (N,), position_rad (N, n), and the same shape for"),
        (lambda _: {"time_s": TIME, "torque_nm": TORQUE}, "traces 1.2 gave time_s, torque_nm; expected"),
        (lambda _: {"time_s": TIME, "position_rad": POSITION, "speed": TIME}, "gave time_s, position_rad, speed;"),
        (lambda _: {"time_s": TIME[:-1], "position_rad": POSITION}, "traces 1.2: time_s has shape"),
    ],
)
def test_anything_else_is_refused_with_file_and_package(path, function, text):
    with pytest.raises(RecordingError) as caught:
        read(path, function)
    assert str(caught.value).startswith(f"{path}: ")
    assert text in str(caught.value)


@pytest.mark.parametrize(
    ("name", "asked"), [("run.TRC", "trc"), ("run.csv", None), ("run.MCAP", None), ("run", None), ("folder.trc", None)]
)
def test_only_files_of_other_suffixes_are_given_to_a_package(tmp_path, monkeypatch, name, asked):
    (tmp_path / "folder.trc").mkdir()
    names = []
    monkeypatch.setattr(extension_reader, "extension", lambda group, name, own: names.append(name))
    assert open_extension(tmp_path / name) is None
    assert names == ([asked] if asked else [])


@pytest.mark.parametrize("provided", [print, 5])
def test_what_a_package_provides_must_be_a_function(monkeypatch, provided):
    monkeypatch.setattr(extension_reader, "extension", lambda *_: (provided, "traces 1.2"))
    if provided is print:
        assert open_extension(Path("run.TRC")).kind == "trc"
        return
    with pytest.raises(RecordingError, match=r"run\.TRC: traces 1\.2 provides 5 for \.trc files, expected a function"):
        open_extension(Path("run.TRC"))
