"""The calibration file and the table of runs: round trip, and errors that name the wrong entry."""

from __future__ import annotations

from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

from armload_identification.estimation.arm_terms import TILT, places_of
from armload_identification.files.calibration_file import (
    format_calibration,
    is_calibration,
    parse_calibration,
    read_calibration,
    write_calibration,
)
from armload_identification.files.run_table import parse_run_table, read_run_table
from armload_identification.identification_errors import CalibrationFileError, RunTableError

pytestmark = pytest.mark.pure


@pytest.fixture(scope="module")
def text(calibration):
    return format_calibration(calibration)


def test_the_file_gives_back_the_same_calibration(calibration, text, tmp_path):
    path = tmp_path / "arm.calibration.toml"
    write_calibration(path, calibration)
    back = read_calibration(path)
    assert path.read_text() == text == format_calibration(back)
    for field in fields(calibration):
        one, other = getattr(calibration, field.name), getattr(back, field.name)
        if isinstance(one, np.ndarray):
            np.testing.assert_array_equal(other, one)
    assert back.left_out == (("lost.csv", 'it is "gone"'),)
    assert back.provenance == calibration.provenance
    assert back.payloads[0].weighed_kg == calibration.payloads[0].weighed_kg
    np.testing.assert_array_equal(back.body.links, calibration.body.links)
    np.testing.assert_array_equal(back.body.root_nm, calibration.body.root_nm)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("[gains]", "[gain]", "gains is missing"),
        ("gain = [", "gain = [-", "gains.gain .* expected numbers above 0"),
        ("nominal = [12.0, ", "nominal = [", "gains.nominal"),
        ("half_width_95 = [", "half_width_95 = [1", "gains.half_width_95 .* calibrate again instead of editing"),
        ('effort = "current"', 'effort = "force"', "arm.effort .* expected torque or current"),
        ("torque_delay_s = ", "torque_delay_ms = ", "torque_delay_s is missing"),
        ("tilt_rad = [", "tilt_rad = [0.0, ", "body.tilt_rad"),
        ("reversal_speed_rad_s = [", "reversal_speed_rad_s = [-", "above 0"),
        ("covariance = [\n    [", "covariance = [\n    [-", "uncertainty.covariance"),
        ("struck = 0", "struck = 0\ncolour = 3", "colour"),
    ],
)
def test_a_wrong_file_is_refused_by_key(text, old, new, said):
    assert old in text
    with pytest.raises(CalibrationFileError, match=said):
        parse_calibration(text.replace(old, new, 1))


def test_the_covariance_has_a_row_for_every_unknown_of_the_arm(calibration, text):
    of = places_of(calibration.body.base)
    assert calibration.covariance.shape == (of[TILT].stop, of[TILT].stop)
    less = replace(calibration, covariance=calibration.covariance[:-1, :-1])
    with pytest.raises(CalibrationFileError, match=rf"uncertainty\.covariance .* {of[TILT].stop}"):
        parse_calibration(format_calibration(less))


def test_deviations_are_found_where_the_layout_puts_them(calibration):
    of = places_of(calibration.body.base)
    numbered = replace(calibration, covariance=np.diag(np.arange(of[TILT].stop) ** 2.0))
    # The order of existing files.
    parts = ("log_h", "links", "rotors", "load", "coulomb", "viscous", "root", "delay", "tilt")
    assert [of[name].start for name in parts] == [0, *(of[name].stop for name in parts[:-1])]
    for name in parts:
        np.testing.assert_array_equal(numbered.deviation(name), np.arange(of[TILT].stop)[of[name]])
    np.testing.assert_array_equal(numbered.gain_deviation, numbered.deviation("log_h"))
    assert numbered.place("links") == of["links"]


def test_a_file_that_is_not_there_is_named(tmp_path):
    with pytest.raises(CalibrationFileError, match=r"none\.toml: cannot be read"):
        read_calibration(tmp_path / "none.toml")


@pytest.mark.parametrize("content", [b"a = " + b"[" * 9000, b"a = ", b"\xff", b"[arm]\n", b"[arm]\n[gains]\n"])
def test_whether_a_file_is_a_calibration_is_no_error(content, tmp_path):
    path = tmp_path / "unknown.toml"
    path.write_bytes(content)
    assert is_calibration(path) is (content == b"[arm]\n[gains]\n")
    assert not is_calibration(tmp_path)
    assert not is_calibration(tmp_path / "none.toml")


def test_a_table_of_runs():
    rows = parse_run_table(
        "recording, mounting, mass_kg, payload\na.mcap,,,\n\n# by hand\nsub/b.csv, disc, 2.805\nc.csv,tool,,t.toml\n",
        "runs.csv",
        Path("/data"),
    )
    assert [row.recording for row in rows] == [Path("/data/a.mcap"), Path("/data/sub/b.csv"), Path("/data/c.csv")]
    assert [row.mounting for row in rows] == ["", "disc", "tool"]
    assert [row.mass_kg for row in rows] == [None, 2.805, None]
    assert rows[2].payload == Path("/data/t.toml")
    dated = "recording,mounting,mass_kg,recorded\na,,,2026-03-01\nb,,,2026-03-01T08:30\nc,,,\n"
    recorded = [row.recorded for row in parse_run_table(dated, "runs.csv", Path())]
    assert recorded == ["2026-03-01T00:00:00", "2026-03-01T08:30:00", ""]


@pytest.mark.parametrize(
    ("table", "said"),
    [
        ("", "the header must name recording, mounting, mass_kg"),
        ("recording,mounting,mass\n", "'mass'.* recorded; the nearest is 'mass_kg'"),
        ("recording;mounting;mass_kg\na;;\n", "line 1 .* separated by semicolons; expected commas"),
        ("recording,mounting,mass_kg\n", "the table has no rows"),
        ("recording,mounting,mass_kg\n,disc,2\n", "line 2, recording"),
        ("recording,mounting,mass_kg\na,disc,heavy\n", "line 2, mass_kg is 'heavy': expected a number above 0"),
        ("recording,mounting,mass_kg\na,disc,nan\n", "line 2, mass_kg"),
        ("recording,mounting,mass_kg\na,,2.8\n", "line 2, mounting .* must name its mounting"),
        ("recording,mounting,mass_kg\na,,\na,,\n", "each recording once"),
        ("recording,mounting,mass_kg\na,disc,2.8\nb,disc,2.9\n", "expected 2.8 as in another row"),
        ("recording,mounting,mass_kg\na,disc,2.8,x,y\n", "line 2 .* expected 3 columns"),
    ],
)
def test_a_table_that_makes_no_sense_is_refused_by_line(table, said):
    with pytest.raises(RunTableError, match=said):
        parse_run_table(table, "runs.csv", Path())


def test_a_table_that_is_not_there_is_named(tmp_path):
    with pytest.raises(RunTableError, match="cannot be read"):
        read_run_table(tmp_path / "none.csv")


def test_a_very_long_cell_of_a_table_of_runs_names_the_table(tmp_path):
    """Beyond the limit of the csv module, whose error was a traceback."""
    table = tmp_path / "runs.csv"
    table.write_text(f"recording,mounting,mass_kg\n{'x' * 140_000},,\n")
    with pytest.raises(RunTableError, match=r"runs\.csv") as caught:
        read_run_table(table)
    assert len(str(caught.value)) < 1000
