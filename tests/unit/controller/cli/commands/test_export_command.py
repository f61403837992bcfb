"""`armload export`: its files, existing files in their place, and its messages."""

from __future__ import annotations

import contextlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from armload_controller.analysis.robot_export import Exported
from armload_controller.control_errors import ExportError
from armload_controller.export.export_files import write_files
from armload_controller.export.format_registry import ExportFormat
from armload_identification.files.payload_file import write_payload
from armload_identification.model.payload import PARAMETER_NAMES

pytestmark = pytest.mark.pure

TWO = {"a.h": "header\n", "a.c": "source\n"}
ONE = {"a.txt": "text\n"}


@pytest.fixture
def export(armload, tmp_path, make_subject):
    """Run the command on a payload file of the prbt; exceptions are passed on."""

    def export(*words, undetermined=(), robot="prbt"):
        path = tmp_path / "payload.toml"
        payload = make_subject("prbt").payload
        known = np.array([name not in undetermined for name in PARAMETER_NAMES])
        write_payload(path, replace(payload, determined=known))
        return armload("export", robot, path, *words, columns=300)

    return export


@pytest.mark.parametrize("export_format", sorted(set(ExportFormat) - {ExportFormat.THRESHOLDS}))
def test_every_format_writes_files_and_says_so(export, tmp_path, monkeypatch, export_format):
    monkeypatch.setenv("CFLAGS", "-O0")  # for compiled formats
    folder = tmp_path / "new" / "folder"
    result = export("--format", export_format, "--output", folder)
    assert result.exit_code == 0, result.output
    written = sorted(folder.iterdir())
    assert len(written) == {"c": 4, "hal": 2, "ros2": 2, "franka": 2}.get(export_format, 1)
    assert sorted(result.output.splitlines()) == [f"written: {path}" for path in written]
    again = export("--format", export_format, "--output", folder)
    assert sorted(again.output.splitlines()) == [f"unchanged: {path}" for path in written]


def test_thresholds_need_a_calibration(export, tmp_path):
    result = export("--format", "thresholds", "--output", tmp_path / "out")
    assert isinstance(result.exception, ExportError)
    assert "Give --calibration FILE" in str(result.exception)
    assert not (tmp_path / "out").exists()


def test_without_output_the_files_go_where_one_stands(export, tmp_path):
    with contextlib.chdir(tmp_path):
        assert export("--format", "ur").exit_code == 0
    assert (tmp_path / "prbt_payload.script").read_text().splitlines()[-1].startswith("set_target_payload(2.7, ")


def test_a_single_text_goes_into_the_file_named(export, tmp_path):
    assert export("--format", "abb", "--output", tmp_path / "load.mod").exit_code == 0
    assert "PERS loaddata prbt_load" in (tmp_path / "load.mod").read_text()


def test_the_operator_reads_what_is_not_determined(export, tmp_path):
    result = export("--format", "kuka", "--output", tmp_path, undetermined=("ixx", "iyz"))
    assert "note: not determined: ixx, iyz; the exported file states what is written for them" in result.output


def test_the_operator_reads_of_another_configuration(export, tmp_path):
    result = export("--format", "kuka", "--output", tmp_path, robot="ur10e")
    assert (
        f"note: {tmp_path / 'payload.toml'} was identified with another robot file than the present one of ur10e"
        in result.output
    )


def test_single_precision_is_for_c_and_says_what_it_costs(export, tmp_path):
    result = export("--format", "c", "--float", "--output", tmp_path)
    assert "note: Single precision: torque within " in result.output
    assert "typedef float armload_prbt_real;" in (tmp_path / "armload_prbt.h").read_text()
    refused = export("--format", "kuka", "--float")
    assert "can only be used with the format c, not with kuka" in str(refused.exception)


def test_nothing_is_written_without_the_centre_of_mass(export, tmp_path):
    result = export("--format", "c", "--output", tmp_path / "out", undetermined=("cy",))
    assert isinstance(result.exception, ExportError)
    assert str(result.exception).startswith(f"{tmp_path / 'payload.toml'}: not determined: cy; ")
    assert not (tmp_path / "out").exists()


def test_an_unknown_format_is_refused_with_the_known_ones(export):
    result = export("--format", "staubli")
    assert result.exit_code == 2
    for export_format in ExportFormat:
        assert f"'{export_format}'" in result.output


def test_a_file_with_another_content_is_in_the_way_of_all(tmp_path):
    (tmp_path / "a.c").write_text("somebody's\n")
    with pytest.raises(ExportError, match=r"a\.c: already exists with different content; remove it, or give another"):
        write_files(TWO, tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["a.c"]
    assert (tmp_path / "a.c").read_text() == "somebody's\n"


def test_a_file_with_the_same_content_is_left_alone(tmp_path):
    (tmp_path / "a.c").write_text(TWO["a.c"])
    before = (tmp_path / "a.c").stat().st_mtime_ns
    assert write_files(TWO, tmp_path) == {tmp_path / "a.h": True, tmp_path / "a.c": False}
    assert (tmp_path / "a.c").stat().st_mtime_ns == before


def test_a_folder_may_have_a_suffix(tmp_path):
    folder = tmp_path / "run.2"
    folder.mkdir()
    assert write_files(ONE, folder) == {folder / "a.txt": True}
    assert write_files(TWO, tmp_path / "run.3") == {tmp_path / "run.3" / name: True for name in TWO}


def test_a_file_where_a_folder_is_needed_is_an_error_that_names_it(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(ExportError, match=r"file: cannot be written: (File exists|Not a directory)"):
        write_files(TWO, tmp_path / "file")


def test_a_rotation_is_for_load_data(export, tmp_path):
    refused = export("--format", "c", "--flange-rpy-rad", "0", "0", "1", "--output", tmp_path)
    assert "can only be used with abb, fanuc, franka, kuka, ur, yaskawa, not with c" in str(refused.exception)
    turned = export("--format", "ur", "--flange-rpy-rad", "0", "0", "1.5708", "--output", tmp_path)
    assert turned.exit_code == 0, turned.output
    text = (tmp_path / "prbt_payload.script").read_text()
    assert text.splitlines()[-1].startswith("set_target_payload(2.7, [-0.012, -0.031, 0.094], ")
    assert "turned by roll, pitch, yaw = 0, 0, 1.5708 rad" in " ".join(text.replace("#", "").split())


def test_generated_code_has_the_users_licence(export, tmp_path):
    assert export("--format", "c", "--licence", "MIT OR BSD-3-Clause", "--output", tmp_path).exit_code == 0
    for path in tmp_path.glob("armload*"):
        assert "SPDX-License-Identifier: MIT OR BSD-3-Clause\n" in path.read_text()
    refused = export("--format", "c", "--licence", "MIT */ int x", "--output", tmp_path / "other")
    assert isinstance(refused.exception, ExportError)
    assert "the licence 'MIT */ int x' is no SPDX expression" in str(refused.exception)


def test_what_was_exported_prints_as_a_table():
    done = Exported("er50", "c", {Path("a.c"): True, Path("b.h"): False}, ("ixx is not determined",))
    assert repr(done).splitlines()[2:] == ["a.c   written", "b.h   unchanged", "ixx is not determined"]
