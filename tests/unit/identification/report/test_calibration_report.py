"""The report of a calibration: the numbers of its tables, with a calibration whose numbers are chosen."""

from dataclasses import replace

import numpy as np
import pytest
from msgspec import structs

from armload_identification.identification_errors import ReportError
from armload_identification.numerals import NO_BREAK
from armload_identification.report import calibration_report as module
from armload_identification.report.calibration_report import render_calibration_report
from armload_identification.results.calibrated_arm import CalibratedArm

NAMES = ("a", "b", "c", "d", "e", "f")


@pytest.fixture
def shown(monkeypatch):
    """What is given to the page, and to its figures."""
    figures = []
    monkeypatch.setattr(module, "rendered", lambda template, **content: content)
    monkeypatch.setattr(module, "gains_figure", lambda *values: figures.append(values) or "")
    monkeypatch.setattr(module, "drift_figure", lambda *values, dated: figures.append((*values, dated)) or "")

    def shown(calibration):
        figures.clear()
        return render_calibration_report(calibration, "an arm", NAMES), figures

    return shown


def plain(text):
    return text.replace(NO_BREAK, " ").replace("\u2212", "-")


def test_the_page_has_the_table_that_is_printed_and_a_figure_of_the_changes(chosen, shown):
    page, ((change, width, determined, title), *_) = shown(chosen)
    assert page["joints"] == CalibratedArm("an arm", NAMES, chosen).table()
    np.testing.assert_allclose(change, 0.02)
    np.testing.assert_allclose(width, 0.02 * 10.2 / 10.0, rtol=0.03)
    assert determined == [True] * 6
    assert "6 joints" in title


def test_delay_and_tilt_have_their_intervals(chosen, shown):
    page, _ = shown(chosen)
    assert plain(page["delay"]) == "2.0 ± 19.6 ms"
    assert page["tilt"] == "tilted by 5.00 ± 1.12°"
    level, _ = shown(replace(chosen, tilt_rad=np.radians([0.3, 0.4])))
    assert level["tilt"] == "level within 1.12°"


def test_payloads_have_mass_and_centre_or_none(chosen, shown):
    payload = structs.replace(
        chosen.payloads[0], mounting="box", weighed_kg=np.nan, theta=np.array([4.0, 0.4, -0.2, 0.0, *np.zeros(6)])
    )
    payload = structs.replace(payload, deviation=np.full(10, 0.01))
    nothing = structs.replace(payload, theta=np.zeros(10), weighed_kg=2.5)
    page, _ = shown(replace(chosen, payloads=(payload, nothing)))
    (name, weighed, mass, center), (_, known, _, none) = page["payloads"]
    assert (name, weighed, plain(mass), plain(center)) == ("box", "not weighed", "4.000 ± 0.020", "100.0, -50.0, 0.0")
    assert known == "2.5"
    assert "100" not in none


def test_friction_is_drawn_by_day_if_all_runs_state_theirs(chosen, shown):
    runs = [
        structs.replace(chosen.runs[0], recorded=day, friction_changes=np.full((3, 6), change))
        for day, change in (("2026-03-02T10:00", 0.1), ("2026-03-05T09:00", -0.2), ("2026-03-02T11:00", 0.3))
    ]
    _, (_, first, *_) = shown(replace(chosen, runs=tuple(runs)))
    places, change, usual, joint, title, dated = first
    assert (joint, dated) == (0, True)
    np.testing.assert_allclose(24.0 * (places - places[0]), [0.0, 71.0, 1.0], atol=1e-6)
    speed = chosen.middle_speed_rad_s[0]
    np.testing.assert_allclose(change, np.array([0.1, -0.2, 0.3]) * (1.0 + speed))
    assert usual == pytest.approx(chosen.usual_change_nm[0])
    assert "joint 1 (a)" in title
    for recorded in (("2026-03-02", ""), ("2026-03-02", "2026-03-02"), ("yesterday", "2026-03-02")):
        runs = tuple(structs.replace(chosen.runs[0], recorded=day) for day in recorded)
        _, (_, first, *_) = shown(replace(chosen, runs=runs))
        assert (list(first[0]), first[-1]) == ([1.0, 2.0], False)


def test_a_runs_residual_is_relative_to_that_of_all(chosen, shown):
    run = structs.replace(chosen.runs[0], residual_rms_nm=np.full(6, 0.75))
    page, _ = shown(replace(chosen, runs=(run,)))
    ((_, ratio),) = page["runs"]
    np.testing.assert_allclose(ratio, 1.5)


def test_names_fit_the_joints_and_the_page_is_whole(chosen):
    with pytest.raises(ReportError, match="5 joint names for 6 joints"):
        render_calibration_report(chosen, "an arm", NAMES[:5])
    page = render_calibration_report(chosen, "an arm <b>", NAMES)
    assert page.count("<svg") >= 7
    assert "an arm &lt;b&gt;" in page
    text = plain(page)
    assert '<th scope="row">2 b</th><td class="num">10</td><td class="num">10.2</td><td class="num">1.96 %</td>' in text
    assert "Gains determined: 6 of 6" in text
    assert "N m/A" in text
