"""The page of a watch: no empty figure, no minus sign before zero."""

import numpy as np
import pytest
from matplotlib.axes import Axes

from armload_identification.report.watch_report import WatchedJoint, WatchHistory, watch_svg, write_watch_report


def history_of(mass_kg, half_width_95_kg, known):
    """A watch of some moments."""
    moments = np.arange(float(len(mass_kg)))
    joints = (WatchedJoint("elbow", 12.0, -0.001, 0.4, 0), WatchedJoint("wrist", 12.0, -1.5, 0.4, 3))
    return WatchHistory(
        robot="er50",
        description="an arm",
        watched="socketcan:can0",
        armload_version="1.2",
        time_s=moments,
        mass_kg=np.array(mass_kg),
        half_width_95_kg=np.array(half_width_95_kg),
        known=np.array(known),
        events=(),
        joints=joints,
    )


@pytest.mark.parametrize(("known", "figures"), [(False, 0), (True, 1)])
def test_a_mass_that_is_never_known_has_no_figure(tmp_path, known, figures):
    write_watch_report(tmp_path / "shift.html", history_of([0.01, 0.02], [0.5, 0.5], [known, known]))
    page = (tmp_path / "shift.html").read_text("utf-8")
    assert page.count("<figure") == figures
    assert ("The mass is not shown" in page) == (not figures)
    assert '<td class="num">0.00</td>' in page
    assert '<td class="num">\N{MINUS SIGN}1.50</td>' in page


@pytest.mark.parametrize("size", [0.1, 1.0, 100.0])
@pytest.mark.parametrize("carried", [0.0, 1.5])
def test_intervals_are_drawn_by_the_size_of_the_arm(monkeypatch, size, carried):
    """The beginning, with an interval of forty times the later ones, is left out, whatever the arm weighs."""
    drawn = []
    monkeypatch.setattr(Axes, "fill_between", lambda _axes, time_s, low, high, **_style: drawn.append(high - low))
    widths = size * np.array([np.nan, 2.0, 0.12, 0.05, 0.06])
    watch_svg(history_of(np.full(5, carried * size), widths, [False, True, True, True, True]), "mass", "a title")
    np.testing.assert_array_equal(np.isfinite(drawn[0]), [False, False, True, True, True])
