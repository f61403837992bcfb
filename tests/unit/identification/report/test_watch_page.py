"""The page of a watch: no empty figure, no minus sign before zero."""

import numpy as np
import pytest

from armload_identification.report.watch_report import WatchedJoint, WatchHistory, write_watch_report

WIDE_KG, NARROW_KG = 0.5, 0.05


@pytest.mark.parametrize(("width_kg", "figures"), [(WIDE_KG, 0), (NARROW_KG, 1)])
def test_a_mass_that_is_never_known_has_no_figure(tmp_path, width_kg, figures):
    moments = np.arange(4.0)
    history = WatchHistory(
        robot="er50",
        description="an arm",
        watched="socketcan:can0",
        armload_version="1.2",
        time_s=moments,
        mass_kg=0.01 * moments,
        half_width_95_kg=np.full(4, width_kg),
        known=np.ones(4, dtype=bool),
        events=(),
        joints=(WatchedJoint("elbow", 12.0, -0.001, 0.4, 0), WatchedJoint("wrist", 12.0, -1.5, 0.4, 3)),
    )
    write_watch_report(tmp_path / "shift.html", history)
    page = (tmp_path / "shift.html").read_text("utf-8")
    assert page.count("<figure") == figures
    assert ("The mass is not shown" in page) == (not figures)
    assert '<td class="num">0.00</td>' in page
    assert '<td class="num">\N{MINUS SIGN}1.50</td>' in page
