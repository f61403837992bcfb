"""`armload.export`: what it refuses, what it writes and says, and a calibrated arm as a description."""

from __future__ import annotations

import hashlib
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from armload_controller.analysis.robot_export import Exported, ExportOptions, export
from armload_controller.control_errors import ExportError
from armload_identification.calibration import possible_links
from armload_identification.files.payload_file import write_payload

pytestmark = pytest.mark.pure


@pytest.fixture
def payload(make_subject):
    return make_subject("prbt").payload


def test_files_are_written_once_and_listed(payload, tmp_path):
    first = export("prbt", payload, "ur", tmp_path)
    assert (first.robot, first.export_format, first.notes) == ("prbt", "ur", ())
    assert first.files == {tmp_path / "prbt_payload.script": True}
    assert export("prbt", payload, "ur", tmp_path).files == {tmp_path / "prbt_payload.script": False}
    rows = Exported("a", "c", {Path("new"): True, Path("old"): False}, ("note",)).table().rows
    assert rows == [("new", "written"), ("old", "unchanged")]


def test_the_files_name_their_source_by_path_and_digest(payload, tmp_path):
    path = tmp_path / "found.toml"
    write_payload(path, payload)
    (text,) = [file.read_text() for file in export("prbt", path, "ur", tmp_path / "a").files]
    assert hashlib.sha256(path.read_bytes()).hexdigest() in text
    assert str(path.name) in text
    (unnamed,) = [file.read_text() for file in export("prbt", payload, "ur", tmp_path / "b").files]
    assert hashlib.sha256(path.read_bytes()).hexdigest() in unnamed, "a payload's own text has the same digest"


@pytest.mark.parametrize(
    ("target", "options", "text"),
    [
        ("ur", ExportOptions(single=True), r"`single=`.*only be used with the format c, not with ur"),
        ("c", ExportOptions(flange_rpy_rad=(0.0, 0.0, 1.0)), r"`flange_rpy_rad=`.*abb.*not with c, which keeps"),
        ("c", "single", "options"),
    ],
)
def test_options_of_other_formats_are_refused(payload, tmp_path, target, options, text):
    with pytest.raises(Exception, match=text):
        export("prbt", payload, target, tmp_path / "out", options=options)
    assert not (tmp_path / "out").exists()


def test_options_of_a_format_are_used(payload, tmp_path):
    exported = export("prbt", payload, "c", tmp_path / "c", options=ExportOptions(single=True))
    assert any(" float " in path.read_text() or "float\n" in path.read_text() for path in exported.files)
    assert len(exported.notes) == 1
    assert "Single precision" in exported.notes[0]
    assert not export("prbt", payload, "c", tmp_path / "double").notes
    turned = export("prbt", payload, "ur", tmp_path / "ur", options=ExportOptions(flange_rpy_rad=(0.0, 0.0, 1.5708)))
    assert "[-0.012, -0.031, 0.094]" in next(iter(turned.files)).read_text()


def test_what_is_not_determined_or_from_another_robot_file_is_a_note(make_subject, payload, tmp_path):
    partly = make_subject("prbt", ("ixx", "iyz")).payload
    (note,) = export("prbt", partly, "kuka", tmp_path / "a").notes
    assert note == "not determined: ixx, iyz; the exported file states what is written for them"
    (note,) = export("ur10e", payload, "kuka", tmp_path / "b").notes
    assert "was identified with another robot file than the present one of ur10e" in note
    unrecorded = replace(payload, provenance=replace(payload.provenance, recordings_sha256={}))
    assert not export("ur10e", unrecorded, "kuka", tmp_path / "c").notes, "a data sheet is of no robot file"


def test_a_calibrated_arm_is_a_description_and_nothing_else(recorded_er50, tmp_path):
    file = recorded_er50 / "runs" / "today" / "arm.calibration.toml"
    with pytest.raises(ExportError, match="is an arm's calibration: expected mjcf or urdf"):
        export("er50", file, "ur", tmp_path)
    as_urdf, as_mjcf = (export("er50", file, target, tmp_path / target) for target in ("urdf", "mjcf"))
    assert as_urdf.notes[0].startswith("URDF cannot describe rotors and load-dependent friction;")
    assert as_mjcf.notes[0].startswith("MJCF cannot describe load-dependent friction;")
    for exported, root in ((as_urdf, "<robot"), (as_mjcf, "<mujoco")):
        (text,) = [" ".join(path.read_text().split()) for path in exported.files]
        assert root in text
        assert f"from {file.name}, sha256 {hashlib.sha256(file.read_bytes()).hexdigest()}" in text


@pytest.mark.parametrize("exact", [True, False])
def test_links_that_only_come_near_the_calibrated_ones_are_said_to(recorded_er50, tmp_path, monkeypatch, exact):
    file = recorded_er50 / "runs" / "today" / "arm.calibration.toml"
    found = possible_links.possible_links

    def near(chain, calibration):
        right = found(chain, calibration)
        return SimpleNamespace(**{**vars(right), "exact": exact, "off": 0.25, "left_nm": np.array([0.5, 0.125])})

    monkeypatch.setattr(possible_links, "possible_links", near)
    notes = export("er50", file, "urdf", tmp_path).notes
    expected = "those written differ by 0.25 standard deviations, 0.5, 0.12 N m RMS"
    assert [expected in note for note in notes] == ([False] if exact else [False, True])
