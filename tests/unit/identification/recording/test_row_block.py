"""Rows of a table: its units, and a time in two columns."""

from __future__ import annotations

import numpy as np
import pytest

from armload_identification.recording.row_block import RowBlock

pytestmark = pytest.mark.pure


def test_nanoseconds_are_added_to_the_seconds_and_units_are_converted():
    columns = {"time_s": np.array([[3.0, 5e8], [4.0, 25e7]]), "position_rad": np.array([[90.0], [180.0]])}
    rows = RowBlock.of_columns(columns, {"position_rad": np.pi / 180.0})
    assert rows.time_s.tolist() == [3.5, 4.25]
    np.testing.assert_allclose(rows.position_rad, [[np.pi / 2.0], [np.pi]])
    assert (rows.n, rows.size, rows.effort) == (1, 2, None)
