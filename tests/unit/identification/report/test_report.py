"""The report: what a reader sees, in a self-contained page."""

from __future__ import annotations

import json
import re
from collections import Counter
from contextlib import contextmanager
from dataclasses import replace
from html.parser import HTMLParser
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from markupsafe import escape

from armload_identification.identification_errors import IdentificationError, ReportError
from armload_identification.model.mass_center import MassCenterCovariance
from armload_identification.model.payload import InertialParameters, Provenance
from armload_identification.numerals import align, decimals_for, numeral, scientific
from armload_identification.pipeline.identification_result import payload_result
from armload_identification.pipeline.payload_identification import identify_runs
from armload_identification.pipeline.payload_validation import judge, validate_runs
from armload_identification.recording.run_format import LATENESS_ATTACHMENT, RUN_ATTACHMENT
from armload_identification.report.figures import joint_figures
from armload_identification.report.figures.center_figure import center_views
from armload_identification.report.figures.joint_figures import thin_out, torque_figure
from armload_identification.report.page import _typeset, rendered, write_page
from armload_identification.report.payload_in_words import headline, parameter_rows
from armload_identification.report.report import render_report
from armload_identification.report.reported_payload import ReportedPayload
from armload_identification.report.verdict_box import verdict_box
from armload_identification.verdict.payload_verdict import known_payload
from armload_identification.verdict.tolerance import Tolerance

pytestmark = pytest.mark.pure

NAMES = ("base", "shoulder", "elbow", "wrist_1", "wrist_2", "wrist_3")
NO_BREAK = "\N{NO-BREAK SPACE}"
MINUS = "\N{MINUS SIGN}"


class Page(HTMLParser):
    """The parts of a page that tests need."""

    def __init__(self, text):
        super().__init__()
        self.tags, self.attributes, self.rows, self.text, self.titles = [], [], [], "", []
        self.section, self.inside = "", []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        self.attributes += attrs
        self.inside.append(tag)
        if tag == "section":
            self.section = dict(attrs)["id"]
        elif tag == "tr":
            self.rows.append((self.section, []))
        elif tag in ("td", "th"):
            self.rows[-1][1].append("")

    def handle_endtag(self, tag):
        while self.inside and self.inside.pop() != tag:
            pass

    def handle_data(self, data):
        if "style" in self.inside:
            return
        self.text += data
        if "title" in self.inside and "svg" in self.inside:
            self.titles.append(data)
        elif {"td", "th"} & set(self.inside):
            self.rows[-1][1][-1] += data.strip()

    def table(self, section):
        return [cells for where, cells in self.rows if where == section]


def subject(identification, truth=None, **changes):
    arm = SimpleNamespace(**({"name": "test arm", "description": "six joints", "joint_names": NAMES} | changes))
    payload = payload_result(identification, Provenance("0.1.0", "c" * 64, {}))
    return ReportedPayload(arm, payload, identification, truth=truth)


def report_of(about, fitted, validation=None):
    return render_report(replace(about, fitted=fitted, validation=validation), "2026-01-02 03:04")


def number(text):
    return float(text.replace(MINUS, "-"))


@pytest.fixture(scope="module")
def clear(pair, pinocchio_arm):
    """Everything is determined."""
    return identify_runs(*pair, pinocchio_arm.chain, pinocchio_arm.transmission)


@pytest.fixture(scope="module")
def noisy(pinocchio_arm):
    """Not everything is determined, and the plain estimate is impossible."""
    trajectory = pinocchio_arm.trajectory()
    runs = [pinocchio_arm.run(trajectory, load, seed=seed, noise=60.0) for load, seed in ((True, 51), (False, 52))]
    return identify_runs(*runs, pinocchio_arm.chain, pinocchio_arm.transmission)


@pytest.fixture(scope="module")
def validation(pair, clear, pinocchio_arm):
    return validate_runs(pair, pinocchio_arm.chain, pinocchio_arm.transmission, subject(clear).payload)


@pytest.fixture
def without_curves(monkeypatch):
    """For tests of the text: the joints' curves take longest to draw."""
    for name in ("motion_figure", "torque_figure"):
        monkeypatch.setattr(joint_figures, name, lambda *args: "<svg></svg>")


@pytest.fixture(scope="module")
def full_text(clear, validation, pinocchio_arm):
    """A simulated commissioning with names that must be escaped in HTML."""
    names = ("<b>base</b>", "a & b", '"elbow"', "wrist_1", "$\\frac$", "手首\x1b[2J\u202e")
    about = subject(
        clear,
        name="<script>alert(1)</script>",
        description="url & <img src=x>",
        joint_names=names,
        truth=pinocchio_arm.payload,
    )
    marked = {RUN_ATTACHMENT: json.dumps({"simulated": True})}
    fitted, measured = (
        replace(runs, sources=tuple(replace(source, attachments=marked) for source in runs.sources))
        for runs in (clear, validation.measured)
    )
    return report_of(about, fitted, replace(validation, measured=measured))


@pytest.fixture(scope="module")
def full(full_text):
    return Page(full_text)


@contextmanager
def curves_of_one_joint():
    """Pages with the curves of the first joint only, which take longest to draw."""

    def of_one_joint(draw):
        return lambda *args: draw(*args) if args[-3] == 0 else "<svg></svg>"

    with pytest.MonkeyPatch.context() as patch:
        for name in ("motion_figure", "torque_figure"):
            patch.setattr(joint_figures, name, of_one_joint(getattr(joint_figures, name)))
        yield


@pytest.fixture(scope="module")
def bare_text(noisy):
    with curves_of_one_joint():
        return report_of(subject(noisy), noisy)


@pytest.fixture(scope="module")
def bare(bare_text):
    return Page(bare_text)


def test_the_sentence_states_mass_and_centre_with_intervals(clear):
    result = subject(clear).payload
    text = headline(result).replace(NO_BREAK, " ")
    mass = re.search(r"The payload weighs ([\d.]+) kg \(([\d.]+) to ([\d.]+) kg\)\.", text)
    reported = [number(part) for part in mass.groups()]
    np.testing.assert_allclose(
        reported, [result.values[0], *result.interval_95[0]], atol=0.5 * 10.0 ** -decimals(mass[1])
    )
    for axis, value, interval in zip("xyz", result.values[1:4], result.interval_95[1:4], strict=True):
        found = re.search(rf"{axis} = ([{MINUS}\d.]+) mm \(([{MINUS}\d.]+) to ([{MINUS}\d.]+) mm\)", text)
        reported = [1e-3 * number(part) for part in found.groups()]
        np.testing.assert_allclose(reported, [value, *interval], atol=0.5e-3 * 10.0 ** -decimals(found[1]))


def decimals(text):
    return len(text.partition(".")[2])


def test_the_sentence_says_what_is_not_determined(clear):
    result = subject(clear).payload

    def without(*unknown):
        known, interval = result.determined.copy(), result.interval_95.copy()
        known[list(unknown)], interval[list(unknown)] = False, np.nan
        return headline(replace(result, determined=known, interval_95=interval)).replace(NO_BREAK, " ")

    assert without(0).startswith("The mass of the payload is not determined by these data. Its centre")
    assert without(1, 3).endswith("Its position along x and z is not determined.")
    assert "x =" not in without(1, 3)
    assert without(0, 1, 2, 3) == (
        "The mass of the payload is not determined by these data. Its centre of mass is not determined."
    )
    assert not re.search("[0-9]", without(0, 1, 2, 3))


def test_the_table_shows_the_digits_that_the_interval_justifies(full, clear, pinocchio_arm):
    rows = full.table("parameters")[1:]
    assert len(rows) == 10
    result = subject(clear).payload
    truth = np.concatenate(
        [
            [pinocchio_arm.payload.mass_kg],
            pinocchio_arm.payload.center_of_mass_m,
            pinocchio_arm.payload.inertia_about_com[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]],
        ]
    )
    factor = [100.0 / truth[0]] + [1e3] * 3 + [1.0] * 6
    assert result.determined[:4].all()
    for i in np.flatnonzero(result.determined):
        _, _, unit, estimate, low, high, _, true, error, covered = rows[i]
        assert unit == ("kg" if i == 0 else "m" if i < 4 else f"kg{NO_BREAK}m²")
        unit_of_last = 10.0 ** -decimals(estimate)
        half_width = 0.5 * (result.interval_95[i, 1] - result.interval_95[i, 0])
        assert 9.5 <= half_width / unit_of_last < 99.5
        reported = [number(estimate), number(low), number(high)]
        np.testing.assert_allclose(reported, [result.values[i], *result.interval_95[i]], atol=0.501 * unit_of_last)
        assert number(true) == pytest.approx(truth[i], abs=0.501 * unit_of_last)
        off, _, error_unit = error.partition(NO_BREAK)
        assert error_unit == ("%" if i == 0 else "mm" if i < 4 else unit)
        exact = factor[i] * (result.values[i] - truth[i])
        assert number(off) == pytest.approx(exact, abs=0.501 * 10.0 ** -decimals(off))
        inside = result.interval_95[i, 0] <= truth[i] <= result.interval_95[i, 1]
        assert covered == ("yes" if inside else "no")


def test_what_is_not_determined_has_no_number(bare, noisy, pinocchio_arm):
    known = noisy.uncertainty.determined
    assert known.any()
    assert not known.all()
    rows = bare.table("parameters")[1:]
    for cells, determined in zip(rows, known, strict=True):
        assert (cells[3] == "not determined") == (not determined)
        assert bool(re.search("[0-9]", "".join(cells))) == determined
    rows = parameter_rows(subject(noisy).payload, noisy.uncertainty.half_width_95, pinocchio_arm.payload)
    for row, determined in zip(rows, known, strict=True):
        assert (row["limit_share"] <= 1.0) == determined
        if not determined:
            # the truth is shown, but an error next to it would reveal the estimate
            assert row["truth"].text
            assert row["error"] == row["estimate"].text == ""
            assert row["covered"] is None


def test_plain_and_reported_are_both_shown_where_they_differ(bare, full, noisy):
    assert "physically impossible" in bare.text
    rows = bare.table("possible")[1:]
    assert len(rows) == noisy.uncertainty.determined.sum()
    mass = rows[0]
    assert number(mass[3]) == pytest.approx(noisy.plain_parameters.mass_kg, abs=0.6 * 10.0 ** -decimals(mass[3]))
    assert number(mass[4]) == pytest.approx(noisy.parameters.mass_kg, abs=0.6 * 10.0 ** -decimals(mass[4]))
    assert "is physically possible and is reported unchanged" in full.text
    assert full.table("possible") == []


def test_every_note_is_shown_and_the_gravest_comes_first(bare, noisy, without_curves):
    for note in noisy.notes:
        assert re.sub("<.*?>", "", str(_typeset(note[1:]))) in bare.text
    blind = subject(noisy)
    blind = replace(blind, payload=replace(blind.payload, determined=np.zeros(10, bool)))
    text = Page(report_of(blind, noisy)).text
    assert "requires mass and centre of mass, and mass, cx, cy and cz are not determined." in text
    assert 0 < text.index("Do not use this payload for feed-forward") < text.index(noisy.notes[0][1:60])


def test_the_joint_table_has_noise_and_residual_of_both_runs(full, clear, validation):
    for section, noise, residual, cells_per_row in (
        ("identification", clear.signal.noise_nm, clear.residual_rms_nm, 9),
        ("validation", validation.signal.noise_nm, validation.residual_rms_nm, 10),
    ):
        rows = full.table(section)[1:]
        assert [len(cells) for cells in rows] == [cells_per_row] * 6
        np.testing.assert_allclose([number(cells[3]) for cells in rows], noise, atol=0.00501)
        np.testing.assert_allclose([number(cells[4]) for cells in rows], residual, atol=0.00501)
        np.testing.assert_allclose([number(cells[5]) for cells in rows], residual / noise, atol=0.00501)
    scales = validation.verdict.of_payload
    for cells, determined, scale in zip(full.table("validation")[1:], scales.determined, scales.scale, strict=True):
        value, _, width = cells[6].partition(" ± ")
        assert bool(width) == determined
        if determined:
            assert number(value) == pytest.approx(scale, abs=5.01e-4)


def test_the_first_screen_has_the_verdict_and_what_is_wrong(clear, validation, pinocchio_arm, without_curves):
    right = verdict_box(validation, NAMES)
    assert (right.kind, right.title) == ("passed", "Right within the tolerance")
    payload = subject(clear).payload
    wrong = replace(payload, model=InertialParameters(1.5 * payload.model.theta))
    failed = judge(validation.measured, pinocchio_arm.chain, known_payload(wrong), Tolerance())
    box = verdict_box(failed, NAMES)
    assert (box.kind, box.title) == ("failed", "Wrong")
    excess_kg = wrong.model.mass_kg - validation.measured.parameters.mass_kg
    assert box.text.startswith(f"The payload's mass is {excess_kg:.3f} kg (33.3 %) too high.")
    assert "too high" in box.text
    for name, disagrees in zip(NAMES, failed.verdict.of_payload.disagree, strict=True):
        assert (f"{name} 0.6" in box.text) == disagrees
    vague = replace(payload, mass_center=None, interval_95=payload.interval_95 + np.array([-1.0, 1.0]))
    unclear = verdict_box(judge(validation.measured, pinocchio_arm.chain, known_payload(vague), Tolerance()), NAMES)
    assert (unclear.kind, unclear.title) == ("missing", "Cannot tell")
    page = Page(report_of(subject(clear), clear, failed))
    assert 0 < page.text.index("Wrong.") < page.text.index("too high") < page.text.index("Physical consistency")


@pytest.fixture
def views(clear):
    """The drawings of a payload with given half widths, correlation and undetermined values."""

    def views(half_m=(0.01, 0.02, 0.005), correlation=0.0, unknown=()):
        payload = subject(clear).payload
        known, interval = payload.determined.copy(), payload.interval_95.copy()
        interval[1:4] = payload.values[1:4, None] + np.outer(half_m, [-1.0, 1.0])
        known[list(unknown)], interval[list(unknown)] = False, np.nan
        covariance = np.diag([1.0, *half_m]) ** 2
        covariance[1, 2] = covariance[2, 1] = correlation * half_m[0] * half_m[1]
        center = MassCenterCovariance(covariance, 50.0)
        return payload, center_views(replace(payload, determined=known, interval_95=interval, mass_center=center))

    return views


def drawn(view):
    """Pixels per millimetre, the dot, and the ellipse's semi-axes and rotation."""
    dot = [float(v) for v in re.search(r'<circle cx="([\d.]+)" cy="([\d.]+)" r="3.5"', view[1]).groups()]
    ellipse = re.search(r'rx="([\d.]+)" ry="([\d.]+)" transform="rotate\((-?[\d.]+)', view[1])
    length, scale = re.search(r"h([\d.]+)m0 -4v8.*?>(\d+)", view[1]).groups()
    return float(length) / float(scale), np.array(dot), [float(v) for v in ellipse.groups()]


def test_the_centre_of_mass_is_drawn_to_scale_with_its_interval(views):
    payload, (side, front) = views()
    for view, across, up, half in ((side, 2, 0, (0.005, 0.01)), (front, 0, 1, (0.01, 0.02))):
        pixels, dot, (wide, high, turn) = drawn(view)
        centre = 1e3 * payload.values[1:4]
        np.testing.assert_allclose(dot, [160 + pixels * centre[across], 160 - pixels * centre[up]], atol=0.6)
        lengths = pixels * 1e3 * np.array(sorted(half, reverse=True))
        np.testing.assert_allclose([wide, high], lengths, rtol=0.02)
        assert abs(turn) == pytest.approx(90.0)
    assert "side" in side[0]
    assert "front" in front[0]


def test_the_ellipse_touches_the_intervals_whatever_the_correlation(views):
    _, (_, front) = views(correlation=0.8)
    pixels, _, (wide, high, turn) = drawn(front)
    angle = np.radians(-turn)
    reach = np.hypot([wide * np.cos(angle), wide * np.sin(angle)], [high * np.sin(angle), high * np.cos(angle)])
    np.testing.assert_allclose(reach, pixels * np.array([10.0, 20.0]), rtol=0.02)
    assert -90.0 < turn < 0.0 or 90.0 < turn < 180.0


def test_a_direction_that_is_not_determined_is_not_drawn(views):
    assert [view[0] for view in views(unknown=(2,))[1]] == ["From the side"]
    assert views(unknown=(1,))[1] == []


def test_the_page_says_what_to_do_next(clear, validation, pinocchio_arm, without_curves):
    about = subject(clear)
    payload = about.payload

    def first_step(about, validation):
        page = Page(report_of(about, clear, validation))
        return page.text.partition("What to do next")[2].strip().partition("\n")[0]

    assert "armload export" in first_step(about, validation)
    assert "another motion" in first_step(about, None)
    wrong = known_payload(replace(payload, model=InertialParameters(1.5 * payload.model.theta)))
    failed = judge(validation.measured, pinocchio_arm.chain, wrong, Tolerance())
    assert first_step(about, failed) == "Do not use this payload."
    unknown = replace(payload, determined=np.zeros(10, dtype=bool))
    assert first_step(replace(about, payload=unknown), None).startswith("Do not use this payload yet")
    page = Page(report_of(subject(clear), clear))
    assert page.text.index("What to do next") < page.text.index("record another motion") < page.text.index("Parameters")


def test_cells_name_their_column_where_the_heading_is_out_of_sight(full):
    labels = Counter(value for key, value in full.attributes if key == "data-label")
    assert labels["Estimate"] == sum("not determined" not in cells for cells in full.table("parameters")[1:])
    assert labels["Residual over noise"] == 12


def test_without_validation_and_truth_the_page_says_so_and_leaves_them_out(bare, full):
    assert "Not validated." in bare.text
    assert "Right within the tolerance." in full.text
    sections = [value for key, value in full.attributes if key == "id"]
    assert "validation" in sections
    assert "validation" not in [value for key, value in bare.attributes if key == "id"]
    assert "Truth" in full.table("parameters")[0]
    assert "Truth" not in bare.table("parameters")[0]
    assert "Simulated" in full.text
    assert "Simulated" not in bare.text


def test_provenance_is_complete(full, clear):
    for source in clear.sources:
        assert source.sha256 in full.text
        assert f"{source.rows_read} read, none dropped" in full.text
    assert "c" * 64 in full.text


def test_how_late_the_cycles_were_is_stated_if_recorded(clear):
    counted = {"up_to_ms": [0.1, 1.0], "cycles": [97, 0, 3], "greatest_ms": 7.25}
    late = replace(clear.sources[0], attachments={LATENESS_ATTACHMENT: json.dumps(counted)})
    said = rendered("recordings.html.j2", fitted=(late,), validating=(), named=()).replace("&nbsp;", " ")
    assert "<br>of 100 cycles 97 in time (to 0.1 ms), late: 3 by 1 to 7.25 ms<" in said


def test_dropped_rows_and_further_recordings_are_listed(clear, without_curves):
    lossy = replace(clear.sources[0], reasons={"not finite": 2, "truncated last row": 1}, truncated=True)
    about = subject(clear)
    more = {"loaded_validation.mcap": "d" * 64}
    about = replace(
        about, payload=replace(about.payload, provenance=replace(about.payload.provenance, validation_sha256=more))
    )
    page = report_of(about, replace(clear, sources=(lossy, clear.sources[1])))
    rows = Page(page).table("provenance")[1:]
    assert rows[0][2].endswith("3 dropped (2 not finite, 1 truncated last row)")
    assert ", ends early" in rows[0][1]
    assert " late" not in rows[0][2]
    assert rows[2][1].startswith("loaded_validation.mcap")
    assert rows[2][1].endswith("d" * 64)
    assert len(rows) == 3


def test_commands_are_set_as_code_and_foreign_text_in_them_stays_text(full_text, bare_text):
    assert "<code>armload calibrate</code>" in full_text + bare_text
    assert "`" not in re.sub(r"<svg.*?</svg>", "", full_text + bare_text, flags=re.DOTALL)
    assert _typeset("a `<b>` c") == "a <code>&lt;b&gt;</code> c"


def test_text_on_a_page_has_the_signs_of_print_and_commands_keep_theirs():
    said = _typeset("x -3.3 +- 4.5 mm (-1 %), joints 1-3, run-2 of 2026-02-03: `--seed -1` & <b>")
    minus, no_break = "\N{MINUS SIGN}", "\N{NO-BREAK SPACE}"
    numbers = f"x {minus}3.3 ± 4.5 mm ({minus}1{no_break}%), joints 1-3, run-2 of 2026-02-03"
    assert said == numbers + ": <code>--seed -1</code> &amp; &lt;b&gt;"
    assert _typeset("x -3") == f"x {minus}3"


def test_foreign_text_stays_text(full, full_text):
    assert "script" not in full.tags
    assert "img" not in full.tags
    assert "<b>base" not in full_text
    for text in (
        "<script>alert(1)</script>",
        "url & <img src=x>",
        "<b>base</b>",
        "a & b",
        '"elbow"',
        "$\\frac$",
        "手首\\u001b[2J\\u202e",
    ):
        assert text in full.text
    assert not {"\x1b", "\u202e"} & set(full_text)


@given(
    st.lists(
        st.sampled_from(["<i>", "-->", "<!--", "]]>", "&lt;", "`", '"', "'", "\n", "\0", "\x1b[2J", "\u202e", "é"])
    )
)
def test_no_text_becomes_an_element_or_a_control_character(pieces):
    page = Page(f"<p>{escape(_typeset(''.join(pieces)))}</p>")
    assert set(page.tags) <= {"p", "code"}
    assert not {"\0", "\x1b", "\u202e"} & set(page.text)
    assert page.text.count("<i>") == pieces.count("<i>")


def test_the_page_needs_nothing_but_itself(full, full_text, bare_text):
    for text in (full_text, bare_text):
        assert not re.search(r"https?:|//[a-z]|@import|url\((?!#)", re.sub(r"<code>.*?</code>", "", text))
    assert not {"script", "link", "img", "iframe", "object", "base"} & set(full.tags)
    ids = Counter(value for key, value in full.attributes if key == "id")
    assert max(ids.values()) == 1
    for key, value in full.attributes:
        assert key not in ("src", "srcset", "data")
        if key == "href" or "url(" in (value or ""):
            target = re.fullmatch(r"(?:url\()?#([\w.-]+)\)?", value)
            assert target, (key, value)
            assert target[1] in ids


def test_every_figure_says_what_it_shows(full):
    assert len(full.titles) == full.tags.count("figure") == 20
    assert any("joint 2 (a & b)" in title for title in full.titles)
    assert all(len(title) > 20 for title in full.titles)


def test_the_same_inputs_give_the_same_bytes(tmp_path, noisy, bare_text):
    path = tmp_path / "report.html"
    with curves_of_one_joint():
        write_page(path, report_of(subject(noisy), noisy))
    assert path.read_bytes() == bare_text.encode()


def test_a_page_that_cannot_be_written_is_an_error_with_its_path(tmp_path, noisy, without_curves):
    path = tmp_path / "missing" / "report.html"
    with pytest.raises(ReportError, match=r"missing/report\.html: the report cannot be written"):
        write_page(path, report_of(subject(noisy), noisy))
    assert issubclass(ReportError, IdentificationError)


def test_names_must_fit_the_joints(noisy):
    with pytest.raises(ReportError, match="3 joint names for recordings of 6 joints"):
        report_of(subject(noisy, joint_names=NAMES[:3]), noisy)


def test_long_recordings_make_no_long_pages(clear):
    signal = clear.signal
    times = 100
    loaded, unloaded = (
        replace(
            motion,
            time_s=np.arange(times * signal.loaded.time_s.size) * signal.loaded.interval_s,
            raw_nm=np.tile(motion.raw_nm, (times, 1)),
            torque_nm=np.tile(motion.torque_nm, (times, 1)),
            valid=np.tile(motion.valid, times),
        )
        for motion in (signal.loaded, signal.unloaded)
    )
    long = replace(signal, loaded=loaded, unloaded=unloaded)
    svg = torque_figure(long, np.tile(clear.predicted_nm, (times, 1)), 0, "long", "long")
    assert len(svg) < 120_000


@pytest.mark.parametrize("level", [0.0, 20.0, -20.0])
def test_thinning_keeps_what_stands_out_and_holes(level):
    rng = np.random.default_rng(5)
    time_s, values = np.arange(10_007.0), level + rng.normal(size=10_007)
    values[4321], values[10_006] = level + 9.0, level - 9.0
    values[6000:7000] = np.nan
    t, v = thin_out(time_s, values, 100)
    assert t.size <= 200
    assert (np.diff(t) > 0.0).all()
    np.testing.assert_array_equal(v, values[t.astype(int)])
    assert {4321.0, 10_006.0} <= set(t)
    assert np.isnan(v[(t > 6100) & (t < 6900)]).all()
    assert np.isfinite(v[(t < 6000) | (t > 7000)]).all()
    short = thin_out(time_s[:200], values[:200], 100)
    np.testing.assert_array_equal(short, (time_s[:200], values[:200]))


@pytest.mark.parametrize(
    ("half_width", "value", "expected"),
    [
        (0.083, 9.83, 3),
        (0.17, 9.84, 2),
        (0.0996, 1.0, 2),
        (0.994, 1.0, 2),
        (0.996, 1.0, 1),
        (12.0, 300.0, 0),
        (340.0, 3e4, 0),
        (1e-30, 1.0, 9),
        (0.0, 9.81, 5),
        (np.nan, 0.0, 0),
        (np.inf, 2.5, 5),
    ],
)
def test_two_significant_digits_of_the_half_width(half_width, value, expected):
    assert decimals_for(half_width, value) == expected


def test_numbers_are_printed_with_a_true_minus_and_points_under_each_other():
    assert numeral(-0.0004, 3) == "0.000"
    assert numeral(-1.25, 1) == f"{MINUS}1.2"
    assert numeral(0.25, 2, signed=True) == "+0.25"
    assert numeral(0.0, 2, signed=True) == "0.00"
    assert numeral(np.inf, 2) == "\N{INFINITY}"
    assert numeral(np.nan, 2) == "unknown"
    assert [n.pad_ch for n in align(["1.25", "10", "", "0.5"])] == [0.0, 2.5, 2.5, 1.0]
    assert scientific(-0.0123) == (f"{MINUS}1.2", f"{MINUS}2")
    assert scientific(-np.inf) == (f"{MINUS}\N{INFINITY}", "")
