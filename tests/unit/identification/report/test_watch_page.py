"""The page of a watch: no empty figure, no minus sign before zero, names stay names."""

from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest
from matplotlib.axes import Axes

from armload_identification.report import watch_report
from armload_identification.report.watch_report import WatchedJoint, WatchHistory, watch_svg, write_watch_report


def history_of(mass_kg, half_width_95_kg, known):
    """A watch of some moments."""
    moments = np.arange(float(len(mass_kg)))
    joints = (WatchedJoint("elbow", 12.0, -0.001, 0.4, 0), WatchedJoint("wrist", 12.0, -1.5, 0.4, 3))
    return WatchHistory(
        robot="er50",
        description="an arm",
        watched="socketcan:can0",
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


HOSTILE = "<script>alert(1)</script>\"'>--><!--&]]>\x1b[2J\x00\u202e\u2028\ufffe`<i>`"
"""Quotes, ends of elements and comments, control characters, a turn of the direction, and code."""


def parts_of(page):
    """Elements with the names of their attributes, and the whole text of a page."""
    parser, found, texts = HTMLParser(), [], []
    parser.handle_starttag = lambda tag, attributes: found.append((tag, *(name for name, _ in attributes)))
    parser.handle_comment = lambda text: found.append(("comment",))
    parser.handle_data = texts.append
    parser.feed(page)
    return found, "".join(texts)


def test_names_stay_names_on_a_page_and_in_its_figure(tmp_path):
    """A control character in a name ended a report with a figure in a traceback."""
    plain = replace(history_of([1.0, 1.1], [0.1, 0.1], [True, True]), robot="a `b`", description="c `d`")
    named = replace(plain, robot=HOSTILE, description=HOSTILE, watched=HOSTILE)
    named = replace(named, joints=tuple(replace(joint, name=HOSTILE) for joint in plain.joints))
    pages = []
    for number, history in enumerate((plain, named)):
        write_watch_report(tmp_path / f"{number}.html", history)
        pages.append((tmp_path / f"{number}.html").read_text("utf-8"))
    (usual, _), (elements, text) = map(parts_of, pages)
    assert [one for one in elements if one != ("code",)] == [one for one in usual if one != ("code",)]
    assert "<script>alert(1)</script>" in text
    assert "\\u001b[2J\\u0000\\u202e\\u2028\\ufffe" in text
    assert not {"\x1b", "\x00", "\u202e", "\u2028", "\ufffe"} & set(pages[1])
    figure = watch_svg(plain, HOSTILE.replace("<i>", ""), HOSTILE)
    assert {"script", "i"}.isdisjoint(tag for tag, *_ in parts_of(figure)[0])


@pytest.mark.parametrize(("share", "told"), [(2.9, False), (3.1, True), (-2.9, False), (-3.1, True)])
def test_friction_far_from_what_is_usual_is_told(tmp_path, monkeypatch, share, told):
    given = {}
    monkeypatch.setattr(watch_report, "rendered", lambda template, **content: given.update(content) or "")
    joint = WatchedJoint("wrist", 12.0, share * 0.4, 0.4, 0)
    write_watch_report(tmp_path / "shift.html", replace(history_of([1.0], [0.1], [True]), joints=(joint,)))
    assert given["far"] == ([joint] if told else [])
