"""Data frames take the same way as tables in files."""

from __future__ import annotations

import numpy as np
import pytest

import armload
from armload_identification.identification_errors import RecordingError

TIME_S = 0.01 * np.arange(300)
ANGLE = 3.0 * TIME_S[:, None] + np.arange(2)
TABLE = {
    "time [ms]": 1e3 * TIME_S,
    **{f"J{i + 1} pos [deg]": np.rad2deg(np.sin(ANGLE[:, i])) for i in range(2)},
    **{f"J{i + 1} torque": np.cos(ANGLE[:, i]) for i in range(2)},
}


class Frame:
    """What every frame has: names of columns, and columns by name."""

    def __init__(self, table):
        self._table, self.columns = table, list(table)

    def __getitem__(self, name):
        return self._table[name]


def assert_read(read):
    np.testing.assert_allclose(read.time_s, TIME_S, atol=1e-9)
    np.testing.assert_allclose(read.position_rad, np.sin(ANGLE), atol=1e-12)
    np.testing.assert_allclose(read.torque_nm, np.cos(ANGLE), atol=1e-12)
    assert read.source.kind == "frame"
    assert read.source.rows_read == len(TIME_S)


def test_a_frame_is_read_as_a_table_is():
    read = armload.read_recording(Frame(TABLE))
    assert_read(read)
    assert read.source.sha256 == armload.read_recording(Frame(TABLE)).source.sha256


class Dated(Frame):
    """A frame of pandas with times as its index, which has no name."""

    index = np.round(1e6 * TIME_S).astype("timedelta64[us]")

    def reset_index(self, names):
        return Frame({names: self.index, **self._table})


def test_an_index_of_times_is_the_time():
    without = {name: values for name, values in TABLE.items() if name != "time [ms]"}
    assert_read(armload.read_recording(Dated(without)))


def test_columns_and_units_can_be_given():
    anonymous = Frame(dict(zip("abcde", TABLE.values(), strict=True)))
    assert_read(armload.read_recording(anonymous, columns="time[ms]=a position[deg]=b,c torque=3-4"))
    with pytest.raises(RecordingError, match="no time column"):
        armload.read_recording(anonymous)
    with pytest.raises(RecordingError, match="no column 'x'"):
        armload.read_recording(anonymous, columns="time=x position=b,c torque=3-4")


def test_text_is_refused_and_names_the_column():
    with pytest.raises(RecordingError, match="column J1 torque has no numbers"):
        armload.read_recording(Frame({**TABLE, "J1 torque": np.array(["much"] * len(TIME_S))}))


@pytest.mark.parametrize("library", ["pandas", "polars"])
def test_frames_of_libraries(library):
    assert_read(armload.read_recording(pytest.importorskip(library).DataFrame(TABLE)))


def test_an_index_of_dates_is_the_time():
    pandas = pytest.importorskip("pandas")
    index = pandas.DatetimeIndex(np.datetime64("2026-01-02") + (1e9 * TIME_S).astype("timedelta64[ns]"), name="stamp")
    read = armload.read_recording(pandas.DataFrame({k: v for k, v in TABLE.items() if k != "time [ms]"}, index=index))
    np.testing.assert_allclose(np.diff(read.time_s), np.diff(TIME_S), atol=1e-6)


@pytest.mark.parametrize("unit", ["ms", "us", "ns"])
def test_durations_are_seconds(unit):
    """As polars' columns of durations; their numbers were taken as they are."""
    per_s = {"ms": 1e3, "us": 1e6, "ns": 1e9}[unit]
    elapsed = np.round(per_s * TIME_S).astype(np.int64).astype(f"timedelta64[{unit}]")
    read = armload.read_recording(Frame({"t": elapsed, **{k: v for k, v in TABLE.items() if k != "time [ms]"}}))
    np.testing.assert_allclose(read.time_s, TIME_S, atol=1e-9)
