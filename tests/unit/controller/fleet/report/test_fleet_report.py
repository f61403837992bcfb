"""The pages of many arms: latest values with their digits, which charts are shown, and what is counted."""

from dataclasses import replace
from datetime import UTC, datetime, timedelta
from types import SimpleNamespace

import numpy as np
import pytest

from armload_controller.fleet.arm_runs import Quantity, QuantityKind
from armload_controller.fleet.fleet_review import ArmReview, FigureReview, FleetReview
from armload_controller.fleet.report import fleet_report
from armload_controller.fleet.report.fleet_report import (
    MOST_SUSPICIOUS,
    render_arm_history,
    render_fleet_report,
)
from armload_identification.numerals import NO_BREAK

BEGUN = datetime(2026, 3, 1, tzinfo=UTC)
MASS, HEAVY = Quantity(QuantityKind.MASS, "box"), Quantity(QuantityKind.MASS, "")
GAIN, FRICTION = Quantity(QuantityKind.GAIN, "j2"), Quantity(QuantityKind.FRICTION, "j3")
CENTER = Quantity(QuantityKind.CENTER_X, "box")


def figure(quantity, last, deviation, off=0.0):
    """A quantity whose latest value is `last`, `off` from its level."""
    chart = SimpleNamespace(values=np.array([0.0, off]), deviation=np.array([1.0, deviation]))
    return FigureReview(quantity, (BEGUN, BEGUN + timedelta(days=1)), np.array([1.0, last]), 0.0, chart, None)


def arm(name="a", figures=(), suspicions=(), runs=3, day=0):
    return ArmReview(
        name, "er50", runs, 0, BEGUN + timedelta(days=day), {each.quantity: each for each in figures}, suspicions
    )


@pytest.fixture
def page(monkeypatch):
    """What is given to a page; charts and strips are their quantities."""
    monkeypatch.setattr(fleet_report, "rendered", lambda template, package, **content: content)
    monkeypatch.setattr(fleet_report, "chart_figure", lambda figure, name, title: f"{name}|{title}")
    monkeypatch.setattr(fleet_report, "strip", lambda figure: f"strip of {figure.quantity}")

    def page(*arms, acknowledged=None, needing=(), **others):
        review = FleetReview(tuple(arms), others.get("absent", ()), others.get("problems", ()), others.get("odd", ()))
        return render_fleet_report(review, acknowledged or {}, needing)

    return page


def shown(page, *figures):
    ((_, cells),) = page(arm(figures=figures))["rows"]
    return [text.replace(NO_BREAK, " ") for _, text, _ in cells]


@pytest.mark.parametrize(
    ("each", "text"),
    [
        (figure(MASS, 4.20341, 0.01), "box: 4.203 kg"),
        (figure(HEAVY, 4.20341, 0.1), "4.20 kg"),
        (figure(HEAVY, 4.20341, 1e-9), "4.203 kg"),
        (figure(GAIN, 0.0213, 0.004), "j2: +2.13 %"),
        (figure(FRICTION, 9.1234, 0.3), "j3: 9.12 N m"),
    ],
)
def test_the_latest_value_has_the_digits_that_its_scatter_justifies(page, each, text):
    assert text in shown(page, each)


def test_a_kind_that_was_never_determined_is_empty_and_of_several_the_one_that_is_most_off_is_shown(page):
    cells = shown(page, figure(MASS, 4.2, 0.01, off=0.02), figure(HEAVY, 1.0, 0.1, off=-0.5))
    assert cells[1:] == ["", ""]
    assert cells[0] == "1.00 kg", "five deviations, not two"


def test_three_charts_of_a_suspicious_arm_the_suspected_ones_first(page):
    suspicion = SimpleNamespace(quantity=FRICTION)
    about_all = SimpleNamespace(quantity=None)
    figures = [figure(each, 1.0, 0.1) for each in (MASS, CENTER, GAIN, FRICTION)]
    found = page(arm("a", figures, (about_all, suspicion)), arm("b", figures))
    ((one, charts),) = found["panels"]
    assert one.arm == "a"
    assert charts == [
        "chart-1-1|a: friction of j3 over the runs.",
        "chart-1-2|a: mass of box over the runs.",
        "chart-1-3|a: gain of j2 over the runs.",
    ]


def test_arms_are_counted_and_only_the_most_suspicious_have_panels(page):
    suspicion = (SimpleNamespace(quantity=None),)
    many = [arm(f"a{k}", suspicions=suspicion, runs=k, day=k) for k in range(MOST_SUSPICIOUS + 2)]
    gone = arm("gone", day=99)
    found = page(*many, arm("fine"), needing={"a1", "fine"}, absent=(gone,))
    assert (found["arms"], found["suspicious"], found["to_inspect"]) == (MOST_SUSPICIOUS + 3, MOST_SUSPICIOUS + 2, 1)
    assert found["runs"] == sum(range(MOST_SUSPICIOUS + 2)) + 3
    assert found["latest"] == "2026-06-08"
    assert len(found["panels"]) == MOST_SUSPICIOUS


def test_recordings_without_a_result_say_why_once(page):
    problem = SimpleNamespace(arm="a", recording="x.mcap", problem="x.mcap: too slow")
    found = page(arm(), problems=(problem,) * 60)
    assert found["problems"][0] == ("a", "x.mcap", "too slow")
    assert (len(found["problems"]), found["without_result"]) == (50, 60)


def test_the_page_of_an_arm_has_all_charts_in_the_order_of_the_kinds(page):
    figures = [figure(each, 1.0, 0.1) for each in (FRICTION, GAIN, MASS)]
    found = render_arm_history(replace(arm("a", figures), suspicions=(SimpleNamespace(quantity=GAIN),)), "known")
    assert [chart.split("|")[1].split(" over")[0] for chart in found["charts"]] == [
        "a: gain of j2", "a: mass of box", "a: friction of j3"
    ]  # fmt: skip
    assert found["acknowledged"] == "known"


def test_ten_arms_have_panels_and_fifty_odd_dates_are_listed(page):
    many = [arm(f"a{k}", suspicions=(SimpleNamespace(quantity=None),)) for k in range(12)]
    found = page(*many, odd=tuple(range(60)))
    assert [one.arm for one, _ in found["panels"]] == [f"a{k}" for k in range(10)]
    assert found["odd"] == tuple(range(50))


@pytest.mark.parametrize(("deviation", "text"), [(1e-9, "12.35 kg"), (0.004, "12.346 kg"), (3.0, "12.3 kg")])
def test_a_value_without_scatter_has_four_digits(page, deviation, text):
    assert shown(page, figure(HEAVY, 12.3456, deviation))[0] in {text, text.replace("12.346", "12.35")}
