"""Places of results are checked before any work, and what is there is not lost."""

from dataclasses import replace
from pathlib import Path

import pytest

from armload_controller.cli.output.output_files import (
    make_folder,
    require_apart,
    require_drawable,
    require_folder,
    require_replaceable,
    require_writable,
)
from armload_controller.control_errors import CommissioningError
from armload_identification import extras
from armload_identification.files.payload_file import write_payload
from armload_identification.identification_errors import ExtraMissing


@pytest.mark.parametrize("require", [require_folder, require_drawable])
def test_the_folder_of_a_result_is_made_and_nothing_else(tmp_path, require):
    require(None)
    require(tmp_path / "a" / "b" / "result.toml")
    assert list((tmp_path / "a" / "b").iterdir()) == []
    require(tmp_path / "a" / "b" / "result.toml")
    with pytest.raises(CommissioningError, match="is a folder: give the name of a file"):
        require(tmp_path / "a")


def test_a_file_in_the_place_of_a_folder_is_named(tmp_path):
    (tmp_path / "file").write_text("")
    for make in (lambda: require_folder(tmp_path / "file" / "x"), lambda: make_folder(tmp_path / "file")):
        with pytest.raises(CommissioningError, match=r"file cannot be created: .*; choose another output"):
            make()


def test_a_folder_without_room_for_a_file_is_named():
    with pytest.raises(CommissioningError, match=r"^/proc cannot be written to: .*; choose another output"):
        require_writable(Path("/proc"))


def test_a_device_is_written_to_although_no_file_can_be_created_beside_it(monkeypatch):
    monkeypatch.setattr("armload_controller.cli.output.output_files.require_writable", None)
    require_folder(Path("/dev/null"))


def test_a_picture_needs_the_library_for_drawing_and_nothing_does_without_one(tmp_path, monkeypatch):
    monkeypatch.setattr(extras, "find_spec", lambda _: None)
    require_drawable(None)
    with pytest.raises(ExtraMissing, match=r"report\.html needs Matplotlib"):
        require_drawable(tmp_path / "a" / "report.html")
    assert list(tmp_path.iterdir()) == []


@pytest.fixture
def payload(make_subject):
    """A payload from some recordings, given by name and hash."""

    def payload(**hashes):
        found = make_subject().payload
        return replace(found, provenance=replace(found.provenance, recordings_sha256=hashes))

    return payload


@pytest.mark.parametrize(
    ("there", "new", "refused"),
    [
        ({"a": "1", "b": "2"}, {"a": "1", "b": "2"}, False),
        ({"a": "1", "b": "2"}, {"renamed": "2"}, False),
        ({"a": "1"}, {"a": "1", "b": "2"}, True),
        ({"a": "1", "b": "2"}, {"a": "3"}, True),
    ],
)
def test_a_payload_replaces_only_one_from_the_same_recordings(tmp_path, payload, there, new, refused):
    file = tmp_path / "payload.toml"
    require_replaceable(file, new.values())
    write_payload(file, payload(**there))
    if not refused:
        require_replaceable(file, new.values())
        return
    with pytest.raises(CommissioningError) as caught:
        require_replaceable(file, new.values())
    assert str(caught.value) == (
        f"{file} holds another payload (2.700 kg, from {', '.join(there)}): give another --output, or --force to "
        "replace it"
    )


def test_what_is_no_payload_is_not_replaced(tmp_path):
    file = tmp_path / "notes.toml"
    file.write_text("a = 1")
    with pytest.raises(CommissioningError, match=r"notes\.toml already exists and is not a payload file \(.*--force$"):
        require_replaceable(file, ["1"])


@pytest.mark.parametrize(
    ("given", "names"),
    [
        ({"report": Path("a/../x"), "unloaded": Path("x")}, "--report, to be written, and as --unloaded"),
        ({"report": Path("x"), "output": Path("./x")}, "--output, to be written, and as --report"),
        ({"output": Path("new"), "record": Path("new")}, "--output, to be written, and as --record"),
        ({"picture": Path("x"), "validation": (Path("y"), Path("x"))}, "--picture, to be written, and as --validation"),
        ({"metrics": Path("x"), "runs": [Path("x")]}, "--metrics, to be written, and as --runs"),
        ({"decisions": Path("x"), "robot": "x"}, "--decisions, to be written, and as --robot"),
    ],
)
def test_a_file_to_be_written_is_no_other_file_of_the_command(tmp_path, monkeypatch, given, names):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a").mkdir()
    (tmp_path / "x").write_text("1")
    shown = {key: f"--{key}" for key in given}
    with pytest.raises(CommissioningError, match=f"is given as {names}: give another --"):
        require_apart(given, shown)
    others = {"robot": "er50", "output": Path("er50"), "report": None, "picture": Path("/dev/null"), "by": [2]}
    require_apart(others | {"metrics": Path("/dev/null")}, {})


@pytest.mark.parametrize("what", ["report", "picture"])
def test_a_report_or_a_picture_replaces_only_its_like(tmp_path, what):
    file = tmp_path / "there"
    file.write_text("time_s,joint_1_position_rad")
    with pytest.raises(CommissioningError, match=rf"there exists and is not armload's {what}: .* Give another --it,"):
        require_drawable(file, what, "--it")
    for own in ("", '<meta name="generator" content="armload 0.1"> Matplotlib'):
        file.write_text(own)
        require_drawable(file, what, "--it")
