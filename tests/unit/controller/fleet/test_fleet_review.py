"""Suspicious arms of a fleet: the change made to an arm is named, and no other."""

import re
from dataclasses import replace
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest
from scipy.stats import norm, t

from armload_controller.fleet.arm_runs import IN_FUTURE, ArmRun, Quantity, QuantityKind
from armload_controller.fleet.fleet_review import Anomaly, review_fleet
from armload_controller.fleet.report.fleet_report import MOST_SUSPICIOUS, render_arm_history, render_fleet_report

FIRST = datetime(2026, 3, 1, 22, tzinfo=UTC)
ARMS, NIGHTS = 12, 14
MASS, CENTER = Quantity(QuantityKind.MASS, "gripper"), Quantity(QuantityKind.CENTER_X, "gripper")
GAINS = tuple(Quantity(QuantityKind.GAIN, f"joint{joint}") for joint in (1, 2, 3))
FRICTIONS = tuple(Quantity(QuantityKind.FRICTION, f"joint{joint}") for joint in (1, 2, 3))
SPREAD = {MASS: 0.01, CENTER: 0.001} | dict.fromkeys(GAINS, 0.004) | dict.fromkeys(FRICTIONS, 0.3)
NOISE = {MASS: 0.008, CENTER: 0.001} | dict.fromkeys(GAINS, 0.003) | dict.fromkeys(FRICTIONS, 0.0)
USUAL = {MASS: 4.0, CENTER: 0.05} | dict.fromkeys(GAINS, 0.0) | dict.fromkeys(FRICTIONS, 9.0)
OF_ARM = {MASS: 0.01, CENTER: 0.001} | dict.fromkeys(GAINS, 0.01) | dict.fromkeys(FRICTIONS, 1.0)
"""Usual differences between arms."""


def fleet(seed=3, **changes):
    """Runs of all arms, night by night; `changes` by arm: first night, quantity and amount, or for one night only."""
    rng = np.random.default_rng(seed)
    runs = []
    for number in range(ARMS):
        arm = f"cell{number:02d}"
        level = {quantity: USUAL[quantity] + OF_ARM[quantity] * rng.normal() for quantity in USUAL}
        for night in range(NIGHTS):
            figures = {}
            for quantity in USUAL:
                off = sum(
                    size
                    for changed, first, last, size in changes.get(arm, ())
                    if changed == quantity and first <= night < last
                )
                value = level[quantity] + off + SPREAD[quantity] * rng.normal()
                figures[quantity] = (value, NOISE[quantity])
            runs.append(ArmRun(arm, "er50", FIRST + timedelta(days=night), f"{arm}/{night}.mcap", "", figures))
    return runs


def page_of(review, acknowledged=None):
    """The report; every suspicious arm whose findings are not acknowledged needs attention."""
    known = acknowledged or {}
    needing = [arm.arm for arm in review.arms if arm.suspicions and arm.arm not in known]
    return render_fleet_report(review, known, needing)


def test_what_all_runs_of_an_arm_share_does_not_hide_a_change(monkeypatch):
    """Stated deviations that are mostly of nominal gains; successive runs show what scatters."""
    monkeypatch.setitem(NOISE, GAINS[1], 0.023)
    (found,) = (arm for arm in review_fleet(fleet(cell04=[(GAINS[1], 7, 99, 0.03)])).arms if arm.suspicions)
    assert (found.arm, found.suspicions[0].cause, found.suspicions[0].quantity) == ("cell04", Anomaly.CHANGE, GAINS[1])
    few = [run for run in fleet(cell04=[(GAINS[1], 7, 99, 0.03)]) if run.arm in {"cell03", "cell04"}]
    assert not any(arm.suspicions for arm in review_fleet(few).arms), "two arms are too few to replace it"


@pytest.fixture(scope="module")
def review():
    """One arm with each fault, the most serious first."""
    runs = fleet(
        cell03=[(FRICTIONS[1], 7, 99, 4.0)],
        cell05=[(MASS, 0, 99, 0.4)],
        cell07=[(CENTER, 6, 7, 0.03)],
    )
    damaged = [replace(run, problem="loaded.mcap is damaged", figures={}) for run in runs if run.arm == "cell09"][-2:]
    runs = [run for run in runs if run.recording not in {run.recording for run in damaged}]
    return review_fleet([*runs, *damaged])


def test_a_fleet_in_which_nothing_happens_is_not_suspicious():
    named = sum(len(arm.suspicions) for seed in range(4) for arm in review_fleet(fleet(seed)).arms)
    assert named == 0


def test_few_runs_are_no_reason_for_suspicion():
    for nights in (1, 2, 4):
        early = [run for run in fleet(11) if run.recorded < FIRST + timedelta(days=nights)]
        assert sum(len(arm.suspicions) for arm in review_fleet(early).arms) == 0


def test_each_trouble_is_named_and_nothing_else(review):
    found = {arm.arm: arm.suspicions for arm in review.arms if arm.suspicions}
    assert set(found) == {"cell03", "cell05", "cell07", "cell09"}
    change = found["cell03"][0]
    assert (change.cause, change.quantity) == (Anomaly.CHANGE, FRICTIONS[1])
    assert re.fullmatch(r"friction of joint2 is 1[0-9.]+ N m since 2026-03-08, [0-9.]+ N m before", change.text)
    stranger = found["cell05"][0]
    assert (stranger.cause, stranger.quantity) == (Anomaly.STRANGER, MASS)
    assert re.fullmatch(r"mass of gripper is 4\.4\d kg, that of 11 twins 4\.0\d kg", stranger.text)
    outlier = found["cell07"][0]
    assert (outlier.cause, outlier.quantity) == (Anomaly.OUTLIER, CENTER)
    assert re.search(r"x of gripper was [78]\d mm on 2026-03-07, [45]\d mm in the neighbouring runs", outlier.text)
    (silence,) = found["cell09"]
    assert silence.cause is Anomaly.SILENCE
    assert silence.text == "the 2 latest recordings gave no result: loaded.mcap is damaged"


def test_a_quantity_without_a_unit_has_no_spaces_in_its_place():
    residual, gripper = Quantity(QuantityKind.RESIDUAL, "joint  1"), Quantity(QuantityKind.MASS, "gripper , old")
    names = {GAINS[0]: residual, MASS: gripper}
    faults = {"cell05": [(GAINS[0], 0, 99, 0.4), (MASS, 0, 99, 0.4)], "cell07": [(GAINS[0], 7, 99, 0.4)]}
    faults |= {"cell09": [(GAINS[0], 6, 7, 0.4)]}
    runs = [
        replace(run, figures={names[q]: (1.0 + v, noise) for q, (v, noise) in run.figures.items() if q in names})
        for run in fleet(**faults)
    ]
    found = {arm.arm: " / ".join(found.text for found in arm.suspicions) for arm in review_fleet(runs).arms}
    assert re.search(r"residual over noise of joint  1 is 1\.\d+, that of 11 twins \d\.\d+( /|$)", found["cell05"])
    assert re.search(r"mass of gripper , old is 5\.\d+ kg, that of 11 twins 5\.\d+ kg( /|$)", found["cell05"])
    assert re.search(r"of joint  1 is 1\.\d+ since 2026-03-08, \d\.\d+ before( /|$)", found["cell07"])
    assert re.search(r"of joint  1 was 1\.\d+ on 2026-03-07, \d\.\d+ in the neighbouring", found["cell09"])


def test_the_most_suspicious_come_first_and_recordings_without_result_are_listed(review):
    sizes = [arm.deviations for arm in review.arms]
    assert sizes == sorted(sizes, reverse=True)
    assert sizes[4:] == [0.0] * (ARMS - 4)
    assert [run.recording for run in review.problems] == ["cell09/13.mcap", "cell09/12.mcap"]
    (arm,) = (arm for arm in review.arms if arm.arm == "cell09")
    assert (arm.runs, arm.without_result) == (NIGHTS, 2)


def test_masses_of_payloads_without_a_name_are_not_compared():
    runs = fleet(cell05=[(MASS, 0, 99, 0.4)])
    nameless = [
        replace(
            run, figures={replace(q, of="") if q.kind is QuantityKind.MASS else q: v for q, v in run.figures.items()}
        )
        for run in runs
    ]
    assert not any(arm.suspicions for arm in review_fleet(nameless).arms)


def test_arms_of_another_model_are_no_twins():
    runs = [replace(run, model="prbt") if run.arm == "cell05" else run for run in fleet(cell05=[(MASS, 0, 99, 0.4)])]
    assert not any(arm.suspicions for arm in review_fleet(runs).arms)


def later(runs, days):
    return [replace(run, recorded=run.recorded + timedelta(days=days)) for run in runs]


def of_arms(runs, *names):
    return [run for run in runs if run.arm in names]


def test_an_arm_that_is_no_longer_recorded_is_neither_assessed_nor_ranked():
    before = fleet(cell03=[(FRICTIONS[1], 7, 99, 4.0)], cell05=[(MASS, 0, 99, 0.4)])
    names = [f"cell{number:02d}" for number in range(ARMS)]
    gone = ("cell03", "cell05")
    stay = [name for name in names if name not in gone]
    for days, absent in ((30, set()), (31, set(gone))):
        found = review_fleet([*of_arms(before, *gone), *later(of_arms(before, *stay), days)])
        assert {arm.arm for arm in found.absent} == absent
        assert {arm.arm for arm in found.arms if arm.suspicions} == {*gone} - absent
        assert len(found.arms) + len(found.absent) == ARMS
    (first, second) = found.absent
    assert (first.model, first.runs, first.latest) == ("er50", NIGHTS, FIRST + timedelta(days=NIGHTS - 1))
    page = page_of(found, {"cell03": "acknowledged until 2026-12-31: scrapped"})
    assert "10 arms</h1>" in page
    assert "acknowledged until 2026-12-31: scrapped" in page
    assert "; 2 more arms without a recent recording</p>" in page
    assert re.findall(r'rowheader">(\w+)</th>', page[page.index("<h2>No recent recording") :]) == [*gone]
    assert "<dt>No recent recording</dt>" in page
    assert second.arm not in page[: page.index("<h2>No recent recording")]


def test_a_missing_recording_has_no_date_that_makes_the_others_old():
    runs = fleet()
    missing = replace(runs[-1], recorded=FIRST + timedelta(days=300), problem="no such file", figures={})
    assert not review_fleet([*runs, missing]).absent
    assert not review_fleet([replace(runs[0], problem="damaged", figures={}), missing]).absent


def test_an_arm_that_is_recorded_rarely_is_not_absent_before_twice_its_interval():
    nightly, (run, *_) = fleet(), of_arms(fleet(4), "cell01")
    for age, absent in ((181, True), (179, False)):
        rare = [replace(run, arm="rare", recorded=FIRST + timedelta(days=90 * quarter)) for quarter in range(3)]
        rest = later(nightly, 180 + age - NIGHTS + 1)
        found = review_fleet([*rare, *rest])
        assert ("rare" in {arm.arm for arm in found.absent}) is absent


def test_arms_that_are_no_longer_recorded_are_no_twins_and_their_problems_are_not_listed():
    old = [replace(run, arm=f"old {run.arm}") for run in fleet()]
    heavy = {f"cell{number:02d}": [(MASS, 0, 99, 0.4)] for number in range(4)}
    new = later(of_arms(fleet(**heavy), *heavy), 60)
    found = review_fleet([replace(old[0], recording="none", problem="cut short", figures={}), *old, *new])
    assert {arm.arm for arm in found.arms} == set(heavy)
    assert not any(arm.suspicions for arm in found.arms)
    levels = {arm.arm: float(np.median(arm.figures[MASS].values[-5:])) for arm in found.arms}
    for arm in found.arms:
        others = [level for name, level in levels.items() if name != arm.arm]
        assert arm.figures[MASS].twins == pytest.approx(np.median(others)), "the three that are there"
    assert not found.problems


def test_one_recording_is_a_fleet_too():
    (run,) = (run for run in fleet() if run.recording == "cell00/0.mcap")
    (arm,) = review_fleet([run]).arms
    assert not arm.suspicions
    assert arm.figures[MASS].values.tolist() == [run.figures[MASS][0]]
    page = page_of(review_fleet([run]))
    assert "No arm is suspicious." in page
    assert "1 recording up to" in page
    friction = run.figures[max(FRICTIONS, key=lambda quantity: run.figures[quantity][0])][0]
    shown = re.findall(r"(\d+\.\d+)\N{NO-BREAK SPACE}N\N{NO-BREAK SPACE}m", page)
    assert [len(number) for number in shown] == [5]  # not the nine decimals of a spread that is unknown
    assert float(shown[0]) <= round(friction, 3)


def test_the_page_shows_the_most_suspicious_with_charts_and_all_arms(review):
    page = page_of(review)
    assert "4 of 12 arms should be inspected." in page
    names = re.findall(r'<h2 class="small">\d+\. (\w+), er50</h2>', page)
    assert names == [arm.arm for arm in review.arms[:4]]
    assert len(names) <= MOST_SUSPICIOUS
    assert page.count('id="chart-') >= len(names)
    assert page.count('<th scope="row" role="rowheader">cell') == ARMS
    assert page.count('<tr><th scope="row">cell09') == 2
    assert "loaded.mcap is damaged" in page
    assert "http" not in page.replace("http-equiv", "")


def test_an_arm_without_any_result_has_no_charts_and_its_reasons_do_not_repeat_the_file():
    run = replace(fleet()[0], recording="a.mcap", problem="a.mcap: the file is truncated", figures={})
    page = page_of(review_fleet([run]))
    assert "1 of 1 arm should be inspected." in page
    assert "<figure" not in page
    assert "control limits, three standard deviations" not in page
    assert "<td>the file is truncated</td>" in page


def test_the_chart_of_a_single_result_shows_its_day():
    good, bad = fleet()[:2]
    page = page_of(review_fleet([good, replace(bad, problem="truncated", figures={})]))
    assert set(re.findall(r">(\d\d [A-Z][a-z]{2})<", page)) <= {"01 Mar", "02 Mar"}
    assert "01 Mar" in page


def test_what_recordings_say_is_text_on_the_page():
    runs = [replace(run, arm="<script>", problem="<b>", figures={}) for run in fleet()[:1]]
    page = page_of(review_fleet(runs))
    assert "<script>" not in page
    assert "&lt;b&gt;" in page


def test_one_recording_with_a_date_far_ahead_makes_no_other_arm_old():
    """A CSV without a date that was copied today, or a recording by a wrong clock."""
    runs = fleet(cell03=[(FRICTIONS[1], 7, 99, 4.0)])
    last = next(run for run in reversed(runs) if run.arm == "cell01")
    for dated_by in ("file", "recording"):
        odd = replace(last, recording="copy.csv", recorded=FIRST + timedelta(days=400), dated_by=dated_by)
        found = review_fleet([*runs, odd])
        assert not found.absent
        assert {arm.arm for arm in found.arms if arm.suspicions} == {"cell03"}
        assert [run.recording for run in found.odd] == ["copy.csv"]
        page = page_of(found)
        assert "<h2>Odd dates</h2>" in page
        assert f"2027-04-05, {dated_by}</td>" in page
    assert not review_fleet(runs).odd
    by_file = replace(last, recording="clock.csv", dated_by=IN_FUTURE)
    assert [run.recording for run in review_fleet([*runs, by_file]).odd] == ["clock.csv"]


def test_dates_of_files_do_not_count_beside_stated_ones():
    stated = of_arms(fleet(), "cell00", "cell01", "cell02")
    copied = [
        replace(run, recorded=FIRST + timedelta(days=300 + i), dated_by="file")
        for i, run in enumerate(of_arms(fleet(), "cell04", "cell05", "cell06"))
    ]
    found = review_fleet([*stated, *copied])
    assert not found.absent
    assert {run.arm for run in found.odd} == {"cell04", "cell05", "cell06"}


def test_a_recording_without_a_result_is_not_measured_in_deviations(review):
    (silent,) = (arm for arm in review.arms if arm.arm == "cell09")
    assert [found.sentence for found in silent.suspicions] == [
        "the 2 latest recordings gave no result: loaded.mcap is damaged"
    ]
    page = page_of(review, {"cell09": "acknowledged until 2026-12-31: the reader is repaired"})
    assert "Acknowledged until 2026-12-31: the reader is repaired" in page
    assert "3 of 12 arms should be inspected." in page
    assert "The findings of 1 are acknowledged." in page
    everything = page_of(review, {arm.arm: "acknowledged until 2026-12-31: known" for arm in review.arms})
    assert "No arm needs attention." in everything
    assert "The findings of 4 are acknowledged." in everything


def test_the_history_of_an_arm_has_all_its_charts(review):
    (arm,) = (arm for arm in review.arms if arm.arm == "cell03")
    page = render_arm_history(arm, "acknowledged until 2026-12-31: a new gear is ordered")
    titles = re.findall(r"cell03: (.*) over the runs\.</title>", page)
    assert titles == [str(quantity) for quantity in (FRICTIONS[1], MASS, CENTER, *GAINS, FRICTIONS[0], FRICTIONS[2])]
    assert "Friction of joint2 is " in page
    assert "a new gear is ordered" in page
    assert "No recording has a result." in render_arm_history(replace(arm, figures={}, suspicions=()))


def test_a_fleet_prints_as_a_table_and_in_a_notebook(review):
    first, *_ = str(review).splitlines()[1:]
    assert first.split()[:4] == [review.arms[0].arm, "er50", str(review.arms[0].runs), "2026-03-14"]
    assert review.arms[0].suspicions[0].sentence in first
    assert review._repr_html_().count("<tr>") == 1 + ARMS


def arm_runs(arm, values, noise=0.0, quantity=FRICTIONS[0], days=0):
    """An arm's runs of one quantity, night by night."""
    return [
        ArmRun(arm, "er50", FIRST + timedelta(days=days + night), f"{arm}/{night}", "", {quantity: (float(v), noise)})
        for night, v in enumerate(values)
    ]


def test_the_centre_of_a_chart_is_the_median_of_seven_runs_and_it_shows_a_hundred():
    (arm,) = review_fleet(arm_runs("a", range(1, 10))).arms
    assert arm.figures[FRICTIONS[0]].center == 4.0
    (arm,) = review_fleet(arm_runs("a", range(1, 102))).arms
    assert arm.figures[FRICTIONS[0]].values.tolist() == list(range(2, 102))
    assert (arm.runs, arm.figures[FRICTIONS[0]].center) == (101, 5.0)


@pytest.mark.parametrize(("twins", "compared"), [(2, False), (3, True)])
def test_three_twins_or_more_are_compared_by_the_median_of_their_five_latest_runs(twins, compared):
    runs = [run for n in range(twins + 1) for run in arm_runs(f"{n}", [0, 0, n + 5, n + 6, n + 7, n + 8, n + 9])]
    arms = {arm.arm: arm.figures[FRICTIONS[0]].twins for arm in review_fleet(runs).arms}
    if compared:
        assert [arms[name] for name in "0123"] == [9.0, 9.0, 8.0, 8.0]
    else:
        assert set(arms.values()) == {None}


def test_a_stranger_differs_by_more_than_its_twins_do_with_the_freedom_of_their_number():
    """Levels 0 to 10: the middle is 5 and the median distance 3, as of a standard deviation of 4.448."""
    runs = [run for n in range(11) for run in arm_runs(f"twin{n}", [n] * 3)]
    (arm,) = (arm for arm in review_fleet([*runs, *arm_runs("odd", [80.0] * 3)]).arms if arm.suspicions)
    (found,) = arm.suspicions
    assert found.text == "friction of joint1 is 80 N m, that of 11 twins 5 N m"
    away = 75.0 / (3.0 / 0.6744898 * np.sqrt(1.0 + 0.5 * np.pi / 11.0))
    assert found.deviations == pytest.approx(norm.isf(t.sf(away, 3.7)), rel=1e-6)
    # Twelve comparisons have a false alarm in one report of a hundred.
    limit = t.isf(0.005 / 12.0, 3.7) / away * 75.0
    for off, named in ((0.99 * limit, []), (1.01 * limit, ["odd"])):
        arms = review_fleet([*runs, *arm_runs("odd", [5.0 + off] * 3)]).arms
        assert [arm.arm for arm in arms if arm.suspicions] == named


@pytest.mark.parametrize("runs", [1, 2, 4])
def test_a_level_is_as_uncertain_as_the_median_of_its_runs(runs):
    """Of three runs or more it is 1.25 times as uncertain as a mean; the noise is 0.3, and the twins do not differ."""
    twins = [run for n in range(11) for run in arm_runs(f"{n}", [5.0] * runs, 0.3)]
    width = 0.3 / np.sqrt(runs) * (np.sqrt(0.5 * np.pi) if runs > 2 else 1.0)
    limit = t.isf(0.005 / 12.0, 3.7) * width * np.sqrt(1.0 + 0.5 * np.pi / 11.0)
    for off, named in ((0.98 * limit, []), (1.02 * limit, ["odd"])):
        found = review_fleet([*twins, *arm_runs("odd", [5.0 + off] * runs, 0.3)]).arms
        assert [arm.arm for arm in found if arm.suspicions] == named


@pytest.mark.parametrize(("first", "named"), [(6, ["odd"]), (5, [])])
def test_fifty_successive_runs_show_how_little_of_the_stated_noise_scatters(first, named):
    """Ten arms of six runs have 50 pairs."""
    sizes = {"odd": 6, "0": first} | {f"{n}": 6 for n in range(1, 9)}
    runs = [run for arm, size in sizes.items() for run in arm_runs(arm, [5.5 if arm == "odd" else 5.0] * size, 0.3)]
    assert [arm.arm for arm in review_fleet(runs).arms if arm.suspicions] == named


def test_an_outlier_is_compared_with_two_runs_on_either_side_and_a_change_with_the_runs_before():
    values = [9.02, 9.00, 9.06, 9.06, 9.00, 9.04, 9.50, 9.02, 9.08, 9.06, 9.00, 9.04, 9.02, 9.06]
    (arm,) = review_fleet(arm_runs("a", values)).arms
    (found,) = arm.suspicions
    assert found.text == "friction of joint1 was 9.50 N m on 2026-03-07, 9.03 N m in the neighbouring runs"
    assert found.sentence == f"{found.text} ({found.deviations:.0f} standard deviations)"
    (arm,) = review_fleet(arm_runs("a", [9.0, 9.2] * 4 + [12.0, 12.2] * 4)).arms
    (found,) = arm.suspicions
    assert found.text == "friction of joint1 is 12.1 N m since 2026-03-09, 9.1 N m before"


@pytest.mark.parametrize(
    ("count", "deviations", "text"),
    [
        (1, 3.0, "the latest recording gave no result: cut"),
        (2, 6.0, "the 2 latest recordings gave no result: cut"),
        (40, 99.0, "the 40 latest recordings gave no result: cut"),
    ],
)
def test_each_recording_without_a_result_adds_three_deviations(count, deviations, text):
    runs = arm_runs("a", [9.0] * (count + 1))
    runs = [runs[0], *(replace(run, problem="cut", figures={}) for run in runs[1:])]
    if count == 2:
        runs.insert(1, replace(runs[1], recording="before"))
        runs[2] = replace(runs[0], recorded=runs[2].recorded)
        runs.append(replace(runs[1], recorded=runs[-1].recorded + timedelta(days=1)))
    (found,) = review_fleet(runs).arms[0].suspicions
    assert (found.deviations, found.text, found.quantity) == (deviations, text, None)


@pytest.mark.parametrize(
    ("arms", "late", "absent"), [(3, 1, 2), (4, 1, 0), (4, 2, 2), (8, 1, 0), (8, 2, 6), (9, 2, 0), (9, 3, 6)]
)
def test_the_fleets_date_is_what_a_quarter_of_its_arms_and_at_least_two_have_reached(arms, late, absent):
    """Of up to three arms it is the latest."""
    runs = [run for n in range(arms) for run in arm_runs(f"{n}", [9.0], days=60 if n < late else 0)]
    found = review_fleet(runs)
    assert len(found.absent) == absent
    assert len(found.odd) == (0 if absent else late)


def test_what_scatters_between_runs_is_their_steps_less_the_stated_noise():
    """Steps of 0.5, of a normal variable of 0.7413; noise of 0.3 is 0.4243 of a difference."""
    runs = arm_runs("a", [9.0, 9.5] * 4, 0.3)
    (arm,) = review_fleet(runs).arms
    usual = np.sqrt(0.5 * ((0.5 / 0.6744898) ** 2 - 0.18))
    chart = arm.figures[FRICTIONS[0]].chart
    expected = np.sqrt((5.0 * usual**2 + 7.0 * max(0.5 * (0.25 - 0.18), 0.0)) / 12.0)
    np.testing.assert_allclose(chart.deviation, np.hypot(0.3, expected))
    doubt = np.sqrt(0.5 * np.pi / 7.0) * np.hypot(0.3, usual)
    np.testing.assert_allclose(chart.limit, 3.0 * np.hypot(chart.deviation, doubt))


def test_a_change_is_as_large_as_it_is_improbable():
    (arm,) = review_fleet(arm_runs("a", [9.0, 9.2] * 4 + [12.0, 12.2] * 4)).arms
    chart = arm.figures[FRICTIONS[0]].chart
    (change,) = chart.changes
    assert arm.suspicions[0].deviations == pytest.approx(min(3.0 / change.deviation, 99.0))
    assert 1.0 < arm.suspicions[0].deviations < 99.0
    steady = [9.02, 9.00, 9.06, 9.06, 9.00, 9.04, 9.50, 9.02, 9.08, 9.06, 9.00, 9.04, 9.02, 9.06]
    (arm,) = review_fleet(arm_runs("a", steady)).arms
    chart = arm.figures[FRICTIONS[0]].chart
    assert arm.suspicions[0].deviations == pytest.approx((9.50 - 9.03) / chart.deviation[6])
