"""The page of a watch: no empty figure, no minus sign before zero, names stay names."""

from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest
from matplotlib.axes import Axes

from armload_identification.report import watch_report
from armload_identification.report.watch_report import WatchHistory, watch_svg, write_watch_report


def joint_of(*row):
    return dict(zip(("name", "moving_s", "friction_nm", "usual_nm", "missing"), row, strict=True))


def history_of(mass_kg, half_width_95_kg, known):
    """A watch of some moments."""
    moments = np.arange(float(len(mass_kg)))
    joints = (joint_of("elbow", 12.0, -0.001, 0.4, 0), joint_of("wrist", 12.0, -1.5, 0.4, 3))
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
    named = replace(named, joints=tuple(joint | {"name": HOSTILE} for joint in plain.joints))
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
    joint = joint_of("wrist", 12.0, share * 0.4, 0.4, 0)
    write_watch_report(tmp_path / "shift.html", replace(history_of([1.0], [0.1], [True]), joints=(joint,)))
    assert given["far"] == ([joint] if told else [])


def watched_over(count, **changes):
    history = history_of(np.full(count, 2.0), np.full(count, 0.1), np.ones(count, dtype=bool))
    return replace(history, **changes)


@pytest.fixture
def axes_of(monkeypatch):
    """The axes of a watch's figure."""
    figures = []
    monkeypatch.setattr(watch_report, "inline_svg", lambda figure, *_: figures.append(figure))

    def axes_of(history):
        watch_svg(history, "mass", "a title")
        return figures.pop().axes[0]

    return axes_of


@pytest.mark.parametrize(("count", "drawn"), [(1999, 1999), (3999, 3999), (4000, 2000), (6001, 2001)])
def test_of_a_long_watch_every_kth_moment_is_drawn(axes_of, count, drawn):
    zero, mass = axes_of(watched_over(count)).lines
    assert len(mass.get_xdata()) == drawn
    assert (zero.get_ydata()[0], zero.get_linewidth(), mass.get_linewidth()) == (0.0, 0.7, 1.4)


def test_the_mass_is_within_its_interval_and_marked_events_have_a_line_and_their_text(axes_of):
    events = ((2.0, "grasped", True), (3.0, "push", False))
    axes = axes_of(watched_over(5, events=events))
    assert axes.figure.get_size_inches().tolist() == [7.0, 3.0]
    _, mass, line = axes.lines
    assert mass.get_xydata().tolist() == [[float(k), 2.0] for k in range(5)]
    (band,) = axes.collections
    assert np.ptp(band.get_paths()[0].vertices[:, 1]) == pytest.approx(0.2)
    assert (band.get_alpha(), band.get_linewidth()) == (0.25, 0)
    assert (list(line.get_xdata()), line.get_linewidth()) == ([2.0, 2.0], 0.9)
    (text,) = axes.texts
    assert (text.get_text(), text.xy, text.get_position()) == ("grasped", (2.0, 1.0), (3.0, -2.0))
    assert (text.get_rotation(), text.get_fontsize()) == (90.0, 7)
    assert axes.get_xlim() == (0.0, 4.0)


def test_a_single_moment_has_a_second_of_width(axes_of):
    assert axes_of(watched_over(1)).get_xlim() == (0.0, 1.0)


@pytest.mark.parametrize(
    ("widths", "drawn"),
    [([0.49, 0.51, 0.1], [True, False, True]), ([0.79, 0.81, 0.2], [True, False, True]), ([0.3, 0.4, 0.5], [True] * 3)],
)
def test_an_interval_is_drawn_up_to_a_quarter_of_the_range_or_four_times_the_narrowest(axes_of, widths, drawn):
    """The range includes zero: 2 kg."""
    _, mass = axes_of(history_of([2.0] * 3, widths, [True] * 3)).lines
    assert np.isfinite(mass.get_ydata()).tolist() == drawn


@pytest.mark.parametrize(("friction_nm", "far"), [(-1.19, 0), (-1.21, 1), (1.21, 1)])
def test_friction_beyond_three_usual_deviations_is_named(tmp_path, monkeypatch, friction_nm, far):
    pages = []
    monkeypatch.setattr(watch_report, "rendered", lambda _, **content: pages.append(content) or "")
    joints = (joint_of("elbow", 12.0, 0.0, 0.4, 0), joint_of("wrist", 12.0, friction_nm, 0.4, 3))
    write_watch_report(tmp_path / "shift.html", watched_over(3, joints=joints))
    assert [joint["name"] for joint in pages[0]["far"]] == ["wrist"] * far
