"""The drawing of the centre of mass: its scale, its ellipse, and which views there are."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from armload_identification.report.figures import center_figure
from armload_identification.report.figures.center_figure import _correlation, _ellipse, _ruler_mm, center_views


def payload(center=(0.1, 0.02, -0.05), half=(0.004, 0.006, 0.010), known=(1, 1, 1), covariance=None):
    values = np.array([2.0, *center, *np.zeros(6)])
    widths = np.array([0.1, *half, *np.zeros(6)])
    return SimpleNamespace(
        values=values,
        interval_95=np.column_stack([values - widths, values + widths]),
        determined=np.array([1, *known, *[1] * 6], dtype=bool),
        mass_center=None if covariance is None else SimpleNamespace(total=covariance),
    )


@pytest.fixture
def views(monkeypatch):
    """What the drawings of a payload are made of."""
    monkeypatch.setattr(center_figure, "rendered", lambda _, **given: given)

    def views(given):
        return center_views(given)

    return views


def test_the_drawing_is_to_scale_with_a_quarter_of_room(views):
    """100 mm and 10 mm of the widest interval: 137.5 mm are half of 320 units."""
    (side, beside), (front, onto) = views(payload())
    assert (side, front) == ("From the side", "From the front, onto the flange")
    scale = 160.0 / 137.5
    assert (beside["name"], onto["name"]) == ("centre-zx", "centre-xy")
    assert (beside["x"], beside["y"]) == pytest.approx((160.0 - scale * 50.0, 160.0 - scale * 100.0))
    assert (onto["x"], onto["y"]) == pytest.approx((160.0 + scale * 100.0, 160.0 - scale * 20.0))
    assert onto["ellipse"] == pytest.approx((scale * 6.0, scale * 4.0, -90.0))
    assert beside["ellipse"] == pytest.approx((scale * 10.0, scale * 4.0, 0.0), abs=1e-9)
    assert onto["plate"] == pytest.approx((scale * 8.0, scale * 63.0))
    assert (onto["scale"], onto["ruler_mm"], onto["axes"]) == (pytest.approx(scale), 50.0, ("x", "y"))
    assert onto["title"].startswith("Centre of mass on the flange, from the front, onto the flange: x 100.0 ± 4.0")


def test_a_centre_near_the_flange_leaves_the_plate_in_the_drawing(views):
    (_, beside), _ = views(payload((0.01, 0.0, 0.02)))
    assert beside["scale"] == pytest.approx(160.0 / (1.25 * 0.75 * 63.0))


@pytest.mark.parametrize(
    ("known", "names"),
    [((1, 1, 1), ["zx", "xy"]), ((1, 1, 0), ["xy"]), ((1, 0, 1), ["zx"]), ((0, 1, 1), []), ((0, 0, 0), [])],
)
def test_a_view_has_two_coordinates_that_are_determined(views, known, names):
    assert [drawing["name"] for _, drawing in views(payload(known=known))] == [f"centre-{name}" for name in names]


def test_what_is_not_determined_does_not_set_the_scale(views):
    ((_, onto),) = views(payload((0.1, 0.02, 9.0), (0.004, 0.006, 5.0), (1, 1, 0)))
    assert onto["scale"] == pytest.approx(160.0 / (1.25 * 106.0))


@pytest.mark.parametrize(
    ("one", "other", "correlation", "ellipse"),
    [
        (3.0, 4.0, 0.0, (4.0, 3.0, 90.0)),
        (4.0, 3.0, 0.0, (4.0, 3.0, 0.0)),
        (2.0, 2.0, 0.5, (6.0**0.5, 2.0**0.5, 45.0)),
        (2.0, 2.0, -0.5, (6.0**0.5, 2.0**0.5, -45.0)),
    ],
)
def test_an_ellipse_has_the_width_and_height_of_the_intervals(one, other, correlation, ellipse):
    wide, high, turn = _ellipse(one, other, correlation)
    assert (wide, high) == pytest.approx(ellipse[:2])
    assert np.tan(np.radians(turn - ellipse[2])) == pytest.approx(0.0, abs=1e-9)


def test_the_correlation_is_that_of_the_coordinates_and_below_one():
    covariance = np.diag([1.0, 4.0, 9.0, 1.0])
    covariance[1, 2] = covariance[2, 1] = 3.0
    covariance[1, 3] = covariance[3, 1] = -2.0
    of = payload(covariance=covariance)
    assert _correlation(of, 0, 1) == pytest.approx(0.5)
    assert _correlation(of, 0, 2) == -0.999
    assert _correlation(payload(covariance=np.zeros((4, 4))), 0, 1) == 0.0
    assert _correlation(payload(), 0, 1) == 0.0


@pytest.mark.parametrize(
    ("reach_mm", "ruler_mm"), [(200.0, 100.0), (199.0, 50.0), (100.0, 50.0), (99.0, 20.0), (39.0, 10.0), (9.9, 2.0)]
)
def test_the_ruler_is_about_a_quarter_of_the_drawing_and_round(reach_mm, ruler_mm):
    assert _ruler_mm(reach_mm) == ruler_mm
