"""The time axis of control charts: dates, times and seconds."""

from datetime import UTC, datetime, timedelta

import numpy as np
import pytest
from matplotlib.figure import Figure

from armload_identification.report.figures.control_chart_axes import days_of, draw_dates

FIRST = datetime(2026, 3, 1, 10, tzinfo=UTC)


@pytest.mark.parametrize(
    ("spacing_s", "pattern"),
    [(7.0, "10:00:"), (200.0, "10:"), (36_000.0, "01 Mar\n"), (864_000.0, "\n2026")],
    ids=["simulated commissioning", "commissioning", "day", "month"],
)
def test_labels_differ_and_are_no_more_precise_than_necessary(spacing_s, pattern):
    place = days_of([FIRST + timedelta(seconds=spacing_s * run) for run in range(4)])
    axes = Figure().add_subplot()
    axes.plot(place, np.zeros(4))
    draw_dates(axes, place)
    low, high = axes.get_xlim()
    labels = [axes.xaxis.get_major_formatter()(tick, 0) for tick in axes.get_xticks() if low <= tick <= high]
    assert len(labels) > 1
    assert len(set(labels)) == len(labels)
    assert any(pattern in label for label in labels)
    assert (labels[0].count(":") == 2) == (spacing_s < 60.0)
