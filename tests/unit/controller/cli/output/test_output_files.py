"""Places of results are checked before any work, and what is there is not lost."""

from dataclasses import replace
from pathlib import Path

import pytest

from armload_controller.cli.output.output_files import (
    make_folder,
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
    require_replaceable(file, payload(**new))
    write_payload(file, payload(**there))
    if not refused:
        require_replaceable(file, payload(**new))
        return
    with pytest.raises(CommissioningError) as caught:
        require_replaceable(file, payload(**new))
    assert str(caught.value) == (
        f"{file} holds another payload (2.700 kg, from {', '.join(there)}): give another --output, or --force to "
        "replace it"
    )


def test_what_is_no_payload_is_not_replaced(tmp_path, payload):
    file = tmp_path / "notes.toml"
    file.write_text("a = 1")
    with pytest.raises(CommissioningError, match=r"notes\.toml already exists and is not a payload file \(.*--force$"):
        require_replaceable(file, payload(a="1"))
