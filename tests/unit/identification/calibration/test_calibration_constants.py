"""The numbers of this room by what turns at them, with fits that are known by hand."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from armload_identification.calibration.calibrate_arm import HALVES, WEIGHED_WITHIN, _Calibration, _distinct
from armload_identification.calibration.calibration_result import ArmCalibration
from armload_identification.calibration.mounting_mistakes import most_trials, refuse_other_mounting
from armload_identification.calibration.other_motions import doubtful_share
from armload_identification.calibration.run_contradictions import (
    ArmKnowledge,
    _Carried,
    _payload_text,
    _scaled,
    explain,
)
from armload_identification.calibration.run_health import _RunFit
from armload_identification.calibration.session_gains import SessionGains, _factor_in
from armload_identification.estimation.base_tilt import tilt_axes
from armload_identification.estimation.prior_knowledge import KnownPayload
from armload_identification.estimation.problem import Group, Problem, RunRows
from armload_identification.identification_errors import EstimationError
from armload_identification.model.chain import Chain
from armload_identification.model.joint_states import JointStates
from armload_identification.model.other_mountings import directions

pytestmark = pytest.mark.pure

ROOM = "armload_identification.calibration"
DOWN = np.array([0.0, 0.0, -9.81])
ARM = Chain.from_origins(np.full((2, 3), 0.3), np.zeros((2, 3)), [[0, 0, 1.0], [0, 1.0, 0]], np.eye(4), DOWN)


# Other mountings -------------------------------------------------------------------------------------------------


def test_an_arm_on_the_floor_may_hang_from_the_ceiling_or_from_four_walls():
    found = directions(DOWN)
    assert next(iter(found)) == "on the ceiling, gravity_m_s2 = [0.0, 0.0, 9.81]"
    assert sum(how.startswith("on a wall") for how in found) == len(found) - 1 == 4
    assert {tuple(gravity / 9.81) for gravity in found.values()} == {
        (0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, -1.0, 0.0)
    }  # fmt: skip
    tilted = 9.81 * np.array([0.0, np.sin(np.radians(25.0)), -np.cos(np.radians(25.0))])
    assert len(directions(tilted)) == 5, "as configured to 26 degrees"
    assert len(directions(9.81 * np.array([0.0, np.sin(np.radians(27.0)), -np.cos(np.radians(27.0))]))) == 6
    assert "on the floor, gravity_m_s2 = [0.0, 0.0, -9.81]" in directions(-DOWN)


def mounted(configured, best=None, turned=None, least=1.0):
    """What is refused, and trials beside the arm as configured: shares as configured, of the best mounting, turned."""

    trials = []

    def shares(chain, turn):
        trials.append(turn)
        if isinstance(turn, partial):
            joint = int(np.argmin(np.diag(turn.keywords["joints"] + turn.keywords["torques"])))
            both = (turn.keywords["joints"] < 0.0).any() + 2 * (turn.keywords["torques"] < 0.0).any()
            return np.log(np.full(2, (turned or {}).get((joint, both), least)))
        if np.allclose(chain.gravity_m_s2, DOWN):
            return np.log(np.array(configured))
        return np.log(np.full(2, best if chain.gravity_m_s2[2] > 0.0 and best is not None else least))

    try:
        refuse_other_mounting(shares, ARM, np.eye(2), np.array([True, True]))
    except EstimationError as error:
        return str(error), len(trials) - 1
    return "", len(trials) - 1


def test_a_residual_of_less_than_a_fortieth_is_not_examined():
    assert mounted([0.024, 0.024]) == ("", 0)
    assert mounted([0.026, 0.026]) == ("", 5)
    assert most_trials(ARM) == 1 + 5 + 6


def test_another_mounting_is_named_if_the_residual_is_smaller_by_three_tenths_of_its_logarithm():
    text, trials = mounted([0.15, 0.15], best=0.15 * np.exp(-0.31))
    assert "the residual is 1.4 times smaller if it is mounted on the ceiling, gravity_m_s2" in text
    assert trials == 5
    assert mounted([0.15, 0.15], best=0.15 * np.exp(-0.29)) == ("", 5)


@pytest.mark.parametrize(
    ("configured", "best", "trials"),
    [([0.19, 0.19], 0.1, 5), ([0.05, 0.21], 0.1, 11), ([0.21, 0.21], 0.024, 5), ([0.21, 0.21], 0.026, 11)],
)
def test_joints_are_turned_if_a_fifth_is_left_of_one_and_no_mounting_explains_it(configured, best, trials):
    assert mounted(configured, best=best)[1] == trials


@pytest.mark.parametrize(
    ("turned", "said"),
    [
        (
            {(1, 3): 0.1},
            "joint 2 is inverted .* smaller with its position and effort inverted. Invert its axis",
        ),
        ({(0, 1): 0.1}, "joint 1 is inverted .* smaller with its position inverted. Set the drive's polarity"),
        ({(0, 2): 0.1}, "smaller with its effort inverted. Set the drive's polarity"),
        ({(0, 2): 0.3 * np.exp(-0.31)}, "is 1.4 times smaller"),
        ({(0, 2): 0.3 * np.exp(-0.29)}, None),
    ],
)
def test_a_turned_joint_is_named_with_its_remedy(turned, said):
    text, _ = mounted([0.3, 0.3], turned=turned)
    assert re.search(said, text) if said else text == ""


def test_a_turned_joint_must_be_better_than_any_mounting():
    text, _ = mounted([0.3, 0.3], best=0.1, turned={(0, 3): 0.11})
    assert "the arm is not mounted as in its configuration" in text
    text, _ = mounted([0.3, 0.3], best=0.1, turned={(0, 3): 0.09})
    assert "joint 1 is inverted" in text


# A run that contradicts the others -------------------------------------------------------------------------------


def carried(mass_kg, center_m=(0.0, 0.0, 0.1), deviation=0.001):
    theta = np.array([mass_kg, *(mass_kg * np.array(center_m)), *np.zeros(6)])
    return _Carried(theta, deviation**2 * np.eye(10))


@pytest.mark.parametrize(
    ("mass_kg", "stated_kg", "elsewhere", "said"),
    [
        (2.0, 2000.0 * np.exp(0.29), None, "mass_kg was entered in grams"),
        (2.0, 2000.0 * np.exp(0.31), None, "it carries nothing"),
        (0.049, None, None, "it carries nothing"),
        (0.051, None, None, "it carries 0.051 kg, not nothing"),
        (0.089, 2.0, None, "it carries nothing"),
        (0.091, 2.0, None, "it carries 0.091 kg, not 2.000 kg"),
        (2.0, 3.0, carried(2.11), "it carries 2.000 kg, not 2.110 kg as in the other runs of 'tool'"),
        (2.0, 3.0, carried(2.10, (0.0, 0.0, 0.2)), "mounted differently, with the centre of mass 100 mm from where"),
        (2.0, 3.0, carried(2.005), "the inertia of its payload differs"),
        (2.0, 3.0, carried(2.006), "it carries 2.000 kg, not 2.006 kg"),
    ],
)
def test_a_payload_is_compared_with_what_was_stated_and_with_other_runs(mass_kg, stated_kg, elsewhere, said):
    """Grams within a factor of 1.35; nothing up to 50 g and 2 % of what was stated; the same mass within 5 %."""
    assert said in _payload_text(carried(mass_kg), "tool", stated_kg, elsewhere)


def test_a_centre_is_elsewhere_beyond_four_deviations():
    """1 g m of the moment of 1 kg is 1 mm; both have it, so that 4 deviations are 5.66 mm."""
    for off_m, said in ((0.0056, "the inertia of its payload"), (0.0057, "is mounted differently")):
        here, there = (carried(1.0, (x_m, 0.0, 0.0)) for x_m in (0.0, off_m))
        for one in (here, there):
            one.covariance[0, 0] = 1e-8
        assert said in _payload_text(here, "tool", None, there)


def trial(off, rows=None, predicted=0.0):
    return SimpleNamespace(
        deviates=lambda _: np.atleast_1d(np.asarray(off, dtype=float)),
        problem=SimpleNamespace(groups=[rows]),
        groups=[SimpleNamespace(torque=[SimpleNamespace(predicted_nm=predicted)])],
    )


@pytest.fixture
def explained(monkeypatch):
    """The sentence for a run that is off by as much, as another payload, and with the best of other mistakes."""

    def explained(off, payload, other, among_all=1.0, gross=True):
        found = [(trial(payload), "a payload"), (trial(99.0), "bad"), (trial(other), "a mistake")]
        monkeypatch.setattr(f"{ROOM}.run_contradictions._mistakes", lambda *_: iter(found))
        monkeypatch.setattr(f"{ROOM}.run_contradictions._fitted_to_run", lambda *_, **__: trial([0.5, off]))
        arm = SimpleNamespace(fit=SimpleNamespace(problem=SimpleNamespace(mountings=("tool",))))
        return explain(arm, None, "tool", None, among_all=among_all, gross=gross)

    return explained


@pytest.mark.parametrize(
    ("off", "payload", "other", "said"),
    [
        (20.0, 7.9, 5.6, "; it fits if a payload"),
        (20.0, 7.9, 5.5, "; it fits if a mistake"),
        (20.0, 99.0, 7.9, "; it fits if a mistake"),
        (20.0, 99.0, 8.1, ", and no usual mistake explains this"),
        (5.0, 99.0, 3.9, "; it fits if a mistake"),
        (5.0, 99.0, 4.1, ", and no usual mistake explains this"),
    ],
)
def test_a_mistake_explains_a_run_if_four_deviations_or_four_tenths_are_left(explained, off, payload, other, said):
    """Another payload is preferred unless a mistake leaves less than 0.7 of it."""
    reason = explained(off, payload, other)
    assert reason.startswith(f"joint 2 is off by {off:.0f} times the noise of the other runs{said}")
    assert explained(off, payload, other, gross=False) == (reason if "fits" in said else None)


@pytest.mark.parametrize(("off", "said"), [(3.9, False), (4.1, True)])
def test_a_run_within_four_times_the_noise_of_the_others_does_not_contradict_them(explained, off, said):
    """But one whose stated mass the data override is far from them in the fit of all."""
    assert (explained(off, 1.0, 99.0) is not None) is said
    assert (explained(1.0, 1.0, 99.0, among_all=off) is not None) is said


@dataclass
class Run:
    raw_nm: np.ndarray

    def with_torque_times(self, matrix):
        return Run(self.raw_nm @ matrix)


def scaled(monkeypatch, reported, off=9.0):
    """The text for an axis that reports a multiple of a torque of +-2 N m, as often as it was fitted."""
    fitted = []

    def fit(arm, run, mounting):
        fitted.append(arm.drift)
        rows = SimpleNamespace(weight=np.ones((4, 1)), effort_nm=run.raw_nm[None])
        return trial(off, rows, 2.0 * (-1.0) ** np.arange(4)[:, None])

    monkeypatch.setattr(f"{ROOM}.run_contradictions._fitted_to_run", fit)
    arm = ArmKnowledge(None, SimpleNamespace(chain=SimpleNamespace(n=1), coupling=np.eye(1)))
    return _scaled(arm, Run(reported * 2.0 * (-1.0) ** np.arange(4)[:, None]), "tool")[1], fitted


@pytest.mark.parametrize(
    ("reported", "off", "said"),
    [
        (1.5, 9.0, "joint 1 reports 1.50 times its effort"),
        (1.5, 3.9, "nothing is changed"),
        (1.5, 4.1, "joint 1 reports 1.50 times"),
        (1.04, 9.0, "joint 1 reports 1.04 times"),
        (1.02, 9.0, "nothing is changed"),
        (-0.71, 9.0, "the sign of joint 1's effort is flipped"),
        (-0.69, 9.0, "joint 1 reports -0.69 times"),
        (0.011, 9.0, "joint 1 reports 0.01 times"),
    ],
)
def test_an_axis_reports_a_multiple_of_its_effort_beyond_3_percent(monkeypatch, reported, off, said):
    text, drifts = scaled(monkeypatch, reported, off)
    assert said in text
    assert drifts == [0.01] * 3 + [1.0], "with friction that hardly varies"


@pytest.mark.parametrize(("mounting", "known"), [("tool", None), ("other", 3.0)])
def test_a_run_is_fitted_with_its_stated_mass_unless_other_runs_carry_the_same(monkeypatch, mounting, known):
    asked = []
    monkeypatch.setattr(f"{ROOM}.run_contradictions._mistakes", lambda *_: [(trial(1.0), "a"), (trial(1.0), "b")])
    monkeypatch.setattr(
        f"{ROOM}.run_contradictions._fitted_to_run", lambda *_, mass_kg: asked.append(mass_kg) or trial(9.0)
    )
    arm = SimpleNamespace(fit=SimpleNamespace(problem=SimpleNamespace(mountings=("tool",))))
    assert "it fits if a" in explain(arm, None, mounting, 3.0, among_all=1.0, gross=False)
    assert asked == [known]


# Gains of a session ----------------------------------------------------------------------------------------------


def test_the_prior_is_stated_or_the_scatter_of_sessions_or_one_percent():
    known, unknown = (SimpleNamespace(session_drift=drift) for drift in (0.002, None))
    assert SessionGains.assumed(known, 0.03).deviation == 0.03
    assert SessionGains.assumed(known).deviation == pytest.approx(np.hypot(0.002, 0.001))
    assert SessionGains.assumed(unknown).deviation == 0.01


@pytest.mark.parametrize(
    ("found", "deviation", "expected", "said"),
    [
        (0.01, 0.005, (0.008 + 1.645 * 0.0044721) / 1.959964, ""),
        (-0.001, 0.005, 0.0044721, ""),
        (0.016, 0.005, (0.0128 + 1.645 * 0.0044721) / 1.959964, ""),
        (0.018, 0.005, (0.0144 + 1.645 * 0.0044721) / 1.959964, ", which alone indicates +1.8 %"),
    ],
)
def test_what_a_motion_says_of_a_drift_is_allowed_for_and_told_if_it_is_certain(found, deviation, expected, said):
    """With the prior of 1 %, four fifths of it with a deviation of 0.447 %."""
    left = SessionGains(0.0, 0.01, "as stated").beside(found, deviation)
    assert (left.log_factor, left.deviation) == (0.0, pytest.approx(expected, rel=1e-4))
    assert left.origin == f"from 1 %, as stated, and from the run itself{said}"
    measured = SessionGains(0.02, 0.003, "measured")
    assert measured.beside(found, deviation) is measured


@pytest.mark.parametrize(("said", "told"), [(0.0043, False), (-0.0051, True)])
def test_a_motion_that_contradicts_the_prior_counts_alone(said, told):
    """Of sessions that seem to differ by 0.1 %: 0.51 % with a deviation of 0.13 % is 3.1 deviations of both."""
    left = SessionGains(0.0, 0.001, "as stated").beside(said, 0.0013)
    found, deviation = (said, 0.0013) if told else (0.3717 * said, 0.00079262)
    assert left.deviation == pytest.approx((abs(found) + 1.645 * deviation) / 1.959964, rel=1e-3)
    assert (left.origin == "the run indicates -0.5 %, which contradicts 0.1 %, as stated") is told


def test_a_run_of_the_session_is_such_a_motion(monkeypatch):
    monkeypatch.setattr(f"{ROOM}.session_gains._factor_in", lambda *_: (0.009, 0.005))
    assumed = SessionGains(0.0, 0.01, "as stated")
    assert assumed.within(None, None, loaded=True) == assumed.beside(0.009, 0.005)


@pytest.mark.parametrize(("prior", "left", "floor"), [(0.01, 0.0037139, 0.003), (0.001, 9.7014e-4, 0.001)])
def test_a_reference_leaves_three_tenths_of_a_percent_at_most(monkeypatch, prior, left, floor):
    monkeypatch.setattr(f"{ROOM}.session_gains._factor_in", lambda *_: (0.012, 0.004))
    run = SimpleNamespace(source=SimpleNamespace(path=SimpleNamespace(name="ref.mcap")))
    found = SessionGains(0.0, prior, "").measured(run, None, None)
    share = prior**2 / (prior**2 + 0.004**2)
    assert (found.log_factor, found.deviation) == (
        pytest.approx(0.012 * share),
        pytest.approx(np.hypot(left, floor), rel=1e-4),
    )
    assert found.origin == "measured by ref.mcap"


@pytest.mark.parametrize(("carried", "given"), [(KnownPayload(), "errors"), (None, None)])
def test_the_factor_is_found_in_three_linearisations_from_the_rows(monkeypatch, carried, given):
    """Rows that say 2 % with a deviation of 0.5 %, and 20 % as what is possible."""
    information, times, beside = 0.005**-2.0, [], []

    def times_matrix(matrix):
        times.append(float(np.log(matrix[0, 0])))
        return SimpleNamespace(now=times[-1], groups=[SimpleNamespace(runs=[SimpleNamespace(rows=None)])])

    @dataclass
    class Problem:
        now: float
        groups: list

        def knowing(self, _):
            return self

    def solve(problem, *, rough):
        def said(_, *, errors):
            beside.append(errors)
            return np.array([information * (problem.now - 0.02)]), np.array([[information]])

        return SimpleNamespace(
            groups=[SimpleNamespace(torque=[SimpleNamespace(predicted_nm=np.zeros((1, 1)))])], beside=said
        )

    run = SimpleNamespace(motion=SimpleNamespace(with_torque_times=times_matrix))
    monkeypatch.setattr(f"{ROOM}.session_gains.usable_runs", lambda *_: [run])
    monkeypatch.setattr(f"{ROOM}.session_gains.single_problem", lambda now, *_: Problem(now.now, now.groups))
    monkeypatch.setattr(f"{ROOM}.session_gains.solve", solve)
    calibration = SimpleNamespace(
        known_arm=SimpleNamespace(effort=None, errors="errors"),
        level=lambda _: None,
        transmission=lambda _: SimpleNamespace(coupling=None),
    )
    found, deviation = _factor_in(None, (calibration, SimpleNamespace(n=1), None), carried)
    free = 0.02 * information / (information + 0.2**-2.0)
    assert (found, deviation) == (pytest.approx(free), pytest.approx(np.hypot(0.005, 0.001)))
    assert times == pytest.approx([0.0, free, free])
    assert beside == 3 * [given]


def test_the_note_has_the_factor_or_what_a_percent_would_change():
    found = SessionGains(np.log(1.012), 0.004, "measured by a").note(2.0, 0.1)
    assert "is corrected: +1.20 +- 0.78 % (measured by a)" in found
    assumed = SessionGains(0.0, 0.01, "as stated").note(2.0, -0.1)
    assert "one standard deviation is 1 % (as stated); a drift of 1 % would change the mass by 5.0 %" in assumed
    assert assumed.endswith("measures it: `--reference` / `StatedDrift(reference=...)`.")


# One run of a calibrated arm -------------------------------------------------------------------------------------


def fit_over(lasts_s, *, periodic=False, rows_s=0.1, weight=0.31):
    """A fit whose friction is the number of rows of a window."""
    time_s = 5.0 + np.arange(0.0, lasts_s, rows_s)
    one = SimpleNamespace(time_s=time_s, weight=np.full((time_s.size, 1), weight))
    one.only = lambda kept: SimpleNamespace(size=np.count_nonzero(kept), weight=one.weight[kept])
    return SimpleNamespace(
        _rows=one,
        _calibration=SimpleNamespace(n=1),
        _found=SimpleNamespace(groups=[SimpleNamespace(acting=[[]])]),
        _motion=SimpleNamespace(periodic=periodic),
        _friction="friction",
        _middle=None,
        _solved=lambda terms, rows: rows.size,
    )


@pytest.fixture(autouse=True)
def counted(monkeypatch):
    monkeypatch.setattr(f"{ROOM}.run_health._estimated", lambda size, *_: (np.array([float(size)]), np.array([0.5])))


@pytest.mark.parametrize(
    ("lasts_s", "windows"), [(179.0, None), (180.2, 3), (239.0, 3), (240.2, 4), (1800.2, 30), (3600.0, 30)]
)
def test_friction_over_time_has_three_to_thirty_windows_of_a_minute(lasts_s, windows):
    course = _RunFit._course(fit_over(lasts_s))
    if windows is None:
        assert course is None
        return
    length_s = lasts_s - 0.1
    assert course.friction_nm.shape == (windows, 1)
    np.testing.assert_allclose(course.friction_nm, lasts_s * 10.0 / windows, atol=1.5)
    np.testing.assert_allclose(course.elapsed_s, 5.0 + (np.arange(windows) + 0.5) * length_s / windows, atol=0.2)
    assert course.noise_nm.max() == 0.5
    assert _RunFit._course(fit_over(lasts_s, periodic=True)) is None


@pytest.mark.parametrize(("rows_s", "weight", "known"), [(3.3, 0.31, False), (2.95, 0.31, True), (2.95, 0.29, False)])
def test_a_window_with_twenty_rows_of_a_moving_joint_shows_its_friction(rows_s, weight, known):
    course = _RunFit._course(fit_over(185.0, rows_s=rows_s, weight=weight))
    assert bool(np.isfinite(course.friction_nm).all()) is known


def test_what_errors_of_the_calibration_leave_is_their_torque_less_what_the_unknowns_take_up():
    """Two rows count; of 3 and 4 N m the other unknown takes up 1 N m each, and the second row weighs a half."""
    columns, weight = np.array([[6.0, 2.0], [8.0, 2.0], [0.0, 0.0]]), np.array([2.0, 2.0, 0.0])
    weighted = SimpleNamespace(axis=0, rows=columns, weight=weight, place=np.array([0, 1]))
    problem = SimpleNamespace(free=np.array([True, False, True]))
    found = SimpleNamespace(problem=problem, weighted_rows=[[weighted]])
    rows = SimpleNamespace(weight=np.array([[1.0], [0.5], [1.0]]))
    fit = SimpleNamespace(_found=found, _rows=rows, _errors=np.array([[1.0, 99.0, -1.0]]), _noise_nm=np.ones(1))
    left = _RunFit._left_nm(fit)
    assert left == pytest.approx([np.sqrt((2.0**2 + 1.5**2) / 3.0)])


def test_another_motion_has_each_joint_at_another_time_of_the_run():
    """Three joints a quarter of the run apart; every second of 600 samples; 95 % of errors of 1 and 2 N m in 10 N m."""
    seen = []
    ramp = np.tile(np.arange(600.0)[:, None], 3)
    run = SimpleNamespace(states=JointStates(ramp, ramp, ramp), interval_s=0.01)
    calibration = SimpleNamespace(
        body=SimpleNamespace(torque=lambda level, *states: seen.append(states) or np.full((300, 3), 10.0)),
        independent_errors=np.eye(2),
        torque_changes=lambda level, states, apart_s, torque: (
            seen.append(apart_s) or np.stack([np.full((300, 3), 1.0), np.full((300, 3), 2.0)])
        ),
    )
    share = doubtful_share(calibration, None, run)
    np.testing.assert_allclose(share, 1.959964 * np.sqrt(5.0) / 10.0, rtol=1e-6)
    position = seen[0][0]
    assert position.shape == (300, 3)
    assert position[0].tolist() == [0.0, 450.0, 300.0]
    assert position[1].tolist() == [2.0, 452.0, 302.0]
    assert seen[1] == pytest.approx(0.02)


# A calibration's runs --------------------------------------------------------------------------------------------


def used(name="a.mcap", mounting="", weight=1.0, rows=10, effort_nm=5.0):
    """A run whose two joints move in all of its rows."""
    of_rows = SimpleNamespace(weight=np.full((rows, 2), weight), effort_nm=np.full((rows, 2), -effort_nm))
    given = SimpleNamespace(mounting=mounting, recording=SimpleNamespace(source=SimpleNamespace(path=name)))
    return SimpleNamespace(name=name, given=given, rows=SimpleNamespace(rows=of_rows), motion=name)


def calibrating(*runs, **changes):
    base = {"_used": list(runs), "_chain": ARM, "_moves": np.array([True, True]), "_weighed": {}}
    made = SimpleNamespace(**(base | {"_layout": SimpleNamespace(base=np.ones(20, dtype=bool))} | changes))
    for name in ("_rows_and_least", "_refuse_too_little"):
        setattr(made, name, partial(getattr(_Calibration, name), made))
    return made


def test_three_rows_of_moving_joints_are_needed_for_each_unknown():
    """Of two joints 7 kinds, 20 of the links, a delay and two tilts; 10 of a payload, and 6 of each run."""
    arm = 7 * 2 + 20 + 1 + 2
    runs = [used(weight=0.31), used(weight=0.29), used(mounting="tool", rows=5)]
    assert calibrating()._rows_and_least(runs) == (20 + 10, 3 * (arm + 10 + 18 - 2 * 1))


def test_a_calibration_of_too_few_rows_is_refused():
    least = 3 * (6 * 2 + 20 + 1 + 2 + 6)
    calibrating(used(rows=-(-least // 2)))._refuse_too_little()
    with pytest.raises(EstimationError, match=rf"{least // 3} unknowns, at least {least} are required"):
        calibrating(used(rows=(least - 1) // 2))._refuse_too_little()


@pytest.mark.parametrize(("effort_nm", "refused"), [(4.9, True), (4.91, False)])
def test_a_mass_that_no_joint_can_hold_a_tenth_of_a_metre_away_is_in_grams(effort_nm, refused):
    """5 kg take 4.905 N m."""
    weighed = {"tool": SimpleNamespace(mass_kg=5.0)}
    made = calibrating(used(), used(mounting="tool", effort_nm=effort_nm), _weighed=weighed)
    if refused:
        with pytest.raises(EstimationError, match=r"said to weigh 5 kg, which 0\.1 m from a joint take 4\.91 N m"):
            _Calibration._refuse_other_units(made)
    else:
        _Calibration._refuse_other_units(made)
    beside = calibrating(used(mounting="tool", effort_nm=1.0), used(mounting="tool"), _weighed=weighed)
    _Calibration._refuse_other_units(beside)


@pytest.mark.parametrize(("deviations", "warned"), [(4.9, False), (5.1, True)])
def test_friction_five_deviations_off_is_a_cold_gear(deviations, warned):
    change = np.array([0.1, 0.2, 0.1, 0.1 * deviations, 9.0, 9.0])
    fit = SimpleNamespace(value=lambda *_: change, change_deviation=np.full(6, 0.1))
    found = list(_Calibration._friction_warnings(calibrating(used()), fit))
    assert bool(found) is warned
    assert not warned or found[0].startswith("a.mcap: the friction of joint 2 is 5 standard deviations")


@pytest.mark.parametrize(("share", "warned"), [(0.119, False), (0.121, True)])
def test_joints_of_which_an_eighth_is_uncertain_on_other_motions_are_named(monkeypatch, share, warned):
    shares = {"a": np.array([0.0, share]), "b": np.array([0.05, 0.01])}
    monkeypatch.setattr(f"{ROOM}.calibrate_arm.doubtful_share", lambda found, level, run: shares[run])
    made = calibrating(used("a"), used("b"))
    found = list(_Calibration._motion_warnings(made, SimpleNamespace(level=lambda _: None)))
    assert bool(found) is warned
    assert not warned or "the predicted torque of joint 2 (12 %)" in found[0]


def mass_warnings(entered_kg, others_kg, deviation_kg, within=WEIGHED_WITHIN):
    """What is said of a weighed mass, where all other data say another one."""
    scale = (within * entered_kg) ** -2.0
    information = (deviation_kg / HALVES) ** -2.0
    mean = (scale * entered_kg + information * others_kg) / (scale + information)
    problem = SimpleNamespace(mountings=("tool",), place=lambda *_: slice(1, 11))
    fit = SimpleNamespace(problem=problem, x=np.array([0.0, mean]), bread=np.diag([1.0, 1.0 / (scale + information)]))
    weighed = {"tool": SimpleNamespace(mass_kg=entered_kg, whole=None)}
    return list(_Calibration._mass_warnings(calibrating(_weighed=weighed), fit))


@pytest.mark.parametrize(("off", "warned"), [(2.4, False), (2.6, True), (-2.6, True)])
def test_a_weighed_mass_disagrees_with_all_other_data_beyond_two_and_a_half_deviations(off, warned):
    """50 g, and what a scale is wrong by."""
    others_kg = 5.0 + off * np.hypot(0.05, WEIGHED_WITHIN * 5.0)
    found = mass_warnings(5.0, others_kg, 0.05)
    assert bool(found) is warned
    assert not warned or f"5.000 kg was entered, all other data give {others_kg:.3f} +- 0.100 kg" in found[0]


@pytest.mark.parametrize(
    ("deviates", "quieter", "rows", "share", "explained", "left_out"),
    [
        ([1.0, 2.1], (1.0, 1.9), 99, 0.1, False, []),
        ([1.0, 2.1], (1.0, 2.1), 99, 0.1, False, ["b"]),
        ([1.0, 3.9], (1.0, 1.0), 99, 0.1, False, []),
        ([1.0, 4.1], (1.0, 1.0), 99, 0.1, False, ["b"]),
        ([4.1, 3.0], (1.0, 1.0), 99, 0.1, False, ["a"]),
        ([1.0, 4.1], (1.0, 1.0), 0, 0.1, False, []),
        ([1.0, 5.0], (1.0, 1.0), 99, 0.0101, False, ["b"]),
        ([1.0, 5.0], (1.0, 1.0), 99, 0.0099, False, []),
        ([1.0, 5.0], (1.0, 1.0), 99, 0.0099, True, ["b"]),
        ([1.0, 0.9], (1.0, 2.1), 99, 0.1, False, ["b"]),
        ([1.0, 0.9], (2.1, 4.3), 99, 0.1, False, ["b"]),
        ([1.0, 0.9], (2.1, 4.1), 99, 0.1, False, []),
        ([1.0, 4.1], (2.1, 4.1), 99, 0.1, False, ["b"]),
        ([1.0, 0.9], (1.9, 1.9), 99, 0.1, False, []),
        ([1.0, 0.9], (1.0, 2.1), 0, 0.1, False, []),
    ],
)
def test_a_run_is_left_out_if_it_contradicts_the_others_or_makes_them_twice_as_quiet(
    monkeypatch, deviates, quieter, rows, share, explained, left_out
):
    """By four deviations. Of two runs that contradict each other either could be left out: it must be clear which.
    Without a mistake that explains it, by 5 % of a torque.
    """

    def fitted(runs):
        both = len(runs) > 1
        sizes = [deviates["ab".index(run.name)] for run in runs] if both else [1.0]
        noise_nm = np.array([1.0 if both else 1.0 / quieter["ba".index(runs[0].name)]])
        return SimpleNamespace(
            groups=[None] * len(runs), noise_nm=noise_nm, deviates=lambda index: np.array([sizes[index]])
        )

    made = calibrating(
        *(used(name) for name in "ab"),
        _left_out=[],
        _done=0,
        _before_fit=9,
        _total=11,
        _progress=lambda done, total: None,
        _hides_one=lambda fit: True,
        _fitted=fitted,
        _noise_share=lambda fit: np.array([share if len(fit.groups) > 1 else 0.0]),
        _reason=lambda run, _, among_all, gross: "reason" if explained or gross else None,
        _noise_warnings=lambda _: [],
        _mass_warnings=lambda _: [],
        _friction_warnings=lambda _: [],
        _motion_warnings=lambda _: ("moves",),
        _refuse_other_units=lambda: None,
        _refuse_other_mounting=lambda: None,
        _refuse_other_columns=lambda: None,
        _named=lambda fit, *_: Named(("named",)),
    )
    made._without_worst = partial(_Calibration._without_worst, made)
    made._refuse_too_little, made._rows_and_least = (lambda: None), (lambda _: (rows, 50))
    for run in made._used:
        run.given.recording.source.sha256 = run.name
    found = _Calibration.result(made, "arm", Named(()))
    assert made._left_out == [(name, "it contradicts the other runs: reason") for name in left_out]
    assert found.warnings == ("named", "moves")
    assert [run.name for run in made._used] == [name for name in "ab" if name not in left_out]


@pytest.mark.parametrize(
    ("count", "off", "hidden", "tried"),
    [(12, 1.0, True, 12), (12, 1.0, False, 0), (13, 1.0, True, 0), (13, 1.9, True, 0), (13, 2.1, True, 1)],
    ids=str,
)
def test_up_to_twelve_runs_are_left_out_one_by_one_and_of_more_the_worst_from_two_deviations_on(
    count, off, hidden, tried
):
    left = []

    def fitted(runs):
        left.append(next(name for name in "abcdefghijklm" if name not in [run.name for run in runs]))
        return SimpleNamespace(noise_nm=np.array([1.0]))

    made = calibrating(*(used(name) for name in "abcdefghijklm"[:count]), _fitted=fitted, _hides_one=lambda fit: hidden)
    made._rows_and_least = lambda _: (99, 50)
    fit = SimpleNamespace(
        groups=[None] * count, noise_nm=np.array([1.0]), deviates=lambda index: np.array([off if index == 3 else 0.9])
    )
    assert _Calibration._without_worst(made, fit) is None
    assert len(left) == tried
    assert not left or left[0] == "d"


@dataclass(frozen=True, eq=False)
class Weighted:
    """Rows with weights alone."""

    weight: np.ndarray

    def weighted(self, factor):
        return Weighted(self.weight * factor)


@pytest.mark.parametrize(("factor", "hides", "fits"), [(1.51, True, 2), (1.49, False, 3)])
def test_a_run_may_hide_if_a_joint_is_half_as_quiet_again_without_it(monkeypatch, factor, hides, fits):
    """One of three runs, the second, whose rows do not count then; no further one is tried."""
    tried = []

    def solved(problem, **_):
        tried.append([float(group.runs[0].rows.weight.sum()) for group in problem.groups])
        return SimpleNamespace(noise_nm=np.array([[2.0, 1.0 / (factor if len(tried) == 2 else 1.0)]]))

    monkeypatch.setattr(f"{ROOM}.calibrate_arm.solve", solved)
    problem = Problem([], [Group((RunRows(Weighted(np.ones((4, 2)))),))] * 3, None, np.eye(2))
    fit = SimpleNamespace(problem=problem, noise_nm=np.array([[2.0, 1.0]]))
    advanced = []
    made = calibrating(_chain=SimpleNamespace(n=2), _advance=lambda: advanced.append(1))
    assert _Calibration._hides_one(made, fit) is hides
    assert tried[:2] == [[0.0, 8.0, 8.0], [8.0, 0.0, 8.0]]
    assert len(tried) == len(advanced) == fits


@pytest.mark.parametrize(("share", "warned"), [(0.119, False), (0.121, True)])
def test_joints_of_which_an_eighth_remains_unexplained_are_named(share, warned):
    noise = SimpleNamespace(greatest_nm=np.array([2.0, 10.0]))
    fit = SimpleNamespace(noise_nm=np.array([[2.0, 10.0 * share]]), problem=SimpleNamespace(noise=noise))
    made = calibrating(_moves=np.array([False, True]))
    made._noise_share = partial(_Calibration._noise_share, made)
    found = list(_Calibration._noise_warnings(made, fit))
    assert bool(found) is warned
    assert not warned or found[0].startswith("part of the torque of joint 2 (12 %) remains unexplained")


@dataclass(frozen=True)
class Named:
    warnings: tuple
    recordings_sha256: object = None


@pytest.mark.parametrize(
    ("paths", "names"),
    [
        (["x/a.csv", "x/b.csv"], ["a.csv", "b.csv"]),
        (["x/a.csv", "y/a.csv"], ["x/a.csv", "y/a.csv"]),
        (["u/x/a.csv", "v/x/a.csv"], ["u/x/a.csv", "v/x/a.csv"]),
        (["x/a.csv", "x/a.csv"], ["a.csv (1)", "a.csv (2)"]),
        ([], []),
    ],
)
def test_runs_are_called_by_enough_of_their_path(paths, names):
    assert _distinct([Path(path) for path in paths]) == names


# The calibrated arm ----------------------------------------------------------------------------------------------


def test_between_three_days_or_more_gains_drift_as_their_weighted_means():
    """Of the first day 0.01 and, four times as uncertain, 0.05; of the others 0.02 and 0.03."""
    runs = [("2026-03-01T08", 0.01, 1.0), ("2026-03-01T09", 0.05, 2.0), ("2026-03-02T08", 0.02, 1.0)]
    runs += [("2026-03-03T08", 0.03, 1.0), ("", 9.0, 1.0), ("2026-03-04", np.nan, 1.0)]
    made = SimpleNamespace(
        runs=[
            SimpleNamespace(recorded=recorded, effort_change=change, effort_change_deviation=deviation)
            for recorded, change, deviation in runs
        ]
    )
    drift = ArmCalibration.session_drift.fget
    assert drift(made) == pytest.approx(np.std([0.018, 0.02, 0.03], ddof=1))
    del made.runs[3]
    assert drift(made) is None


@pytest.mark.parametrize("tilt_rad", [(0.01, 0.0), (0.0, 0.02)])
def test_a_tilt_moves_gravity_along_its_axes(tilt_rad):
    """By as much as the angle, and so that the size remains."""
    level = ArmCalibration.level(SimpleNamespace(tilt_rad=np.array(tilt_rad)), ARM)
    axes = tilt_axes(DOWN)
    moved = level.gravity_m_s2 - DOWN
    np.testing.assert_allclose(axes @ moved / 9.81, np.sin(np.arctan(tilt_rad)), rtol=1e-6)
    assert np.linalg.norm(level.gravity_m_s2) == pytest.approx(9.81)
