"""The numbers of this room by what turns at them, and torque and its derivatives written out."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from armload_identification.estimation.arm_rows import ArmRows, _without_holes, close_rows, motion_with_rows, row_window
from armload_identification.estimation.arm_terms import (
    LAWS,
    arm_terms,
    friction_change,
    own_friction,
    payload_term,
    recorder_delay,
    wide_payload,
)
from armload_identification.estimation.contradicted_gains import _named_from, _noticeable
from armload_identification.estimation.elastic_joints import elastic_torque
from armload_identification.estimation.normal_equations import (
    GroupState,
    joined_columns,
    struck_samples,
    torque_at,
    torque_derivatives,
)
from armload_identification.estimation.payload_change import _greatest, _slow_change, _times
from armload_identification.estimation.payload_from_posterior import gear_asymmetry, model_doubts
from armload_identification.estimation.physical_consistency import (
    WRITTEN_MARGIN,
    _ball,
    _interior,
    make_physical,
    nearest_possible,
)
from armload_identification.estimation.problem import DIFFERENCE_AND_MEAN, Group, Noise, RunRows
from armload_identification.estimation.residual_spectrum import _summed
from armload_identification.estimation.run_drift import RunDrift
from armload_identification.estimation.solve import _clipped_rms, _integrated, _Solver, clipped_rms, solve
from armload_identification.estimation.term_kinds import Scope, Term
from armload_identification.identification_errors import EstimationError, RecordingError
from armload_identification.model.chain import Chain
from armload_identification.model.joint_states import JointStates
from armload_identification.model.payload import InertialParameters
from armload_identification.signals.motion import Motion

pytestmark = pytest.mark.pure


# Rows ------------------------------------------------------------------------------------------------------------


def motion(lasts_s, interval_s=0.01, *, periodic=False):
    count = round(lasts_s / interval_s)
    nothing = np.zeros(1)
    return Motion(
        time_s=interval_s * np.arange(count),
        periodic=periodic,
        states=JointStates(*np.zeros((3, count, 1))),
        raw_nm=np.zeros((count, 1)),
        torque_nm=np.zeros((count, 1)),
        valid=np.ones(count, dtype=bool),
        noise_nm=nothing,
        averaged_noise_nm=nothing,
        noise_source="",
        smoothing_loss=nothing,
        periods=1,
        position_fit_rad=nothing,
        began_s=0.0,
    )


@pytest.mark.parametrize(("lasts_s", "row_s"), [(20.0, 0.1), (149.0, 0.1), (300.0, 0.2), (450.0, 0.3)])
def test_rows_are_a_tenth_of_a_second_apart_and_at_most_1500(lasts_s, row_s):
    window = row_window(motion(lasts_s))
    assert np.diff(window.middle) * 0.01 == pytest.approx(row_s)
    assert window.half_s == 0.16
    assert window.middle[0] >= 16, "a whole window"
    assert np.diff(row_window(motion(20.0), spacing=3).middle)[0] == 30


@pytest.mark.parametrize(("period_s", "row_s", "half_s"), [(2.0, 0.02, 0.064), (5.0, 0.05, 0.16), (12.0, 0.1, 0.16)])
def test_a_period_has_at_least_a_hundred_rows_where_two_are_compared(period_s, row_s, half_s):
    close = close_rows(motion(period_s, periodic=True))
    assert 0.01 * np.diff(close.middle)[0] == pytest.approx(row_s)
    assert close.half_s == pytest.approx(half_s)
    assert np.diff(close_rows(motion(period_s)).middle)[0] == 10


@pytest.mark.parametrize("rounding", [-1e-9, 0.0, 1e-9])
def test_the_last_digits_of_the_interval_change_no_window(rounding):
    """0.16 s are 16 samples of 10 ms; 0.1 s are two and a half of 40 ms, of which two are taken."""
    window = row_window(motion(20.0, 0.01 * (1.0 + rounding)))
    assert window.offset.size == 33
    assert np.diff(row_window(motion(20.0, 0.04 * (1.0 + rounding))).middle)[0] == 2


def given_run(lasts_s, interval_s, *, periodic=False):
    recording = SimpleNamespace(source=SimpleNamespace(path="a.mcap"))
    return SimpleNamespace(motion=motion(lasts_s, interval_s, periodic=periodic), recording=recording)


def test_three_seconds_of_motion_are_required_unless_they_are_a_period():
    assert motion_with_rows(given_run(3.01, 0.01)).valid.all()
    assert motion_with_rows(given_run(2.0, 0.01, periodic=True)).valid.all()
    with pytest.raises(RecordingError, match=r"a\.mcap: 3\.0 s of motion, expected 3 s or more"):
        motion_with_rows(given_run(2.99, 0.01))


def test_samples_a_tenth_of_a_second_apart_are_holes():
    assert motion_with_rows(given_run(9.9, 0.099)).valid.all()
    assert not motion_with_rows(given_run(10.1, 0.101)).valid.any()


@pytest.mark.parametrize(("first", "missing", "holes"), [(50, 9, 0), (50, 10, 10), (-4, 9, 0), (-4, 10, 10)])
def test_a_hole_of_a_period_is_longer_than_a_tenth_of_a_second(first, missing, holes):
    """Nine phases of 0.01 s without a sample have neighbours 0.1 s apart, also across the end of the period."""
    valid = np.ones(100, dtype=bool)
    valid[np.arange(first, first + missing)] = False
    assert np.count_nonzero(~_without_holes(valid, 0.01)) == holes


# Blows, noise and weights ----------------------------------------------------------------------------------------

TIME_S = 0.1 * np.arange(200)


@pytest.mark.parametrize(
    ("sizes", "struck"),
    [([8.1, 4.1], 9), ([7.9, 7.9], 0), ([8.1, 3.9], 0), ([-8.1, -4.1], 9), ([8.1], 9), ([7.9], 0)],
)
def test_a_blow_is_beyond_eight_deviations_on_a_joint_and_four_on_another(sizes, struck):
    """What is within 0.4 s of it is left out, nine rows."""
    size = np.zeros((200, len(sizes)))
    size[100] = sizes
    assert np.count_nonzero(struck_samples(size, TIME_S)) == struck


@pytest.mark.parametrize(("blows", "struck"), [(2, 18), (3, 0)])
def test_blows_in_more_than_a_tenth_of_a_run_are_none(blows, struck):
    size = np.zeros((200, 1))
    size[30 : 30 + 30 * blows : 30] = 9.0
    assert np.count_nonzero(struck_samples(size, TIME_S)) == struck


def state_of(residual, weight=1.0):
    """A group of one run of one axis."""
    residual = np.atleast_1d(np.asarray(residual, dtype=float))[None, :, None]
    count = residual.shape[1]
    group = SimpleNamespace(
        time_s=0.1 * np.arange(count), weight=np.full((count, 1), weight), noises=slice(0, 1), first_noise=0
    )
    state = GroupState(group, (), np.eye(1), np.zeros(0, dtype=int), np.zeros(0, dtype=int))
    state.residual_nm = residual
    return state


@pytest.mark.parametrize(("size", "trust"), [(2.9, 1.0), (3.0, 1.0), (6.0, 0.25), (12.0, 1.0 / 16.0)])
def test_a_group_beyond_three_deviations_counts_as_if_it_had_three(size, trust):
    state = state_of([2.0 * size, -2.0 * size])
    state.judge(np.array([[2.0]]), blows=False)
    assert state.trust == pytest.approx(trust)
    assert not state.struck.any()
    assert state.relative_residual(np.array([[2.0]]))[0, 0] == pytest.approx(size)


def test_an_outlying_row_weighs_as_the_root_of_two_over_its_deviations():
    state = state_of([3.0, 8.0, 99.0], 0.5)
    state.struck[2], state.trust = True, 0.25
    plain = 0.5 * 0.5 / (1.0 * np.sqrt(4.0))
    given = np.array([[1.0]]), np.array([[4.0]])
    assert state.row_weights(*given, robust=False)[0, :, 0] == pytest.approx([plain, plain, 0.0])
    assert state.row_weights(*given, robust=True)[0, :, 0] == pytest.approx([plain, plain / np.sqrt(2.0), 0.0])


def test_outliers_are_clipped_at_three_deviations_by_the_median():
    found, bound = _clipped_rms(np.array([1.0, -1.0] * 50 + [100.0]))
    assert bound == pytest.approx(3.0 / 0.6744898)
    assert found == pytest.approx(np.sqrt((100.0 + bound**2) / 101.0))
    state = state_of([1.0, -1.0] * 10 + [50.0])
    state.group.weight[-1, 0] = 0.29
    assert clipped_rms(state, np.array([True]))[0] == pytest.approx(1.0)
    state.group.weight[-1, 0] = 0.31
    assert clipped_rms(state, np.array([True]))[0] > 1.0
    assert np.isnan(clipped_rms(state, np.array([False]))).all()


@pytest.mark.parametrize(
    ("values", "rows"),
    [
        ([1.0, 1.0, *[0.0] * 9], 2.0),
        ([1.0, 0.04, *[0.0] * 9], 1.0),
        ([1.0, 0.06, *[0.0] * 9], 1.0 + 0.12 / 1.0036),
        ([1.0, -1.0] * 9, 1.0),
        ([0.0] * 9, 1.0),
        ([9.0, 9.0, *[0.0] * 9], 2.0),
    ],
)
def test_rows_correlate_up_to_where_a_twentieth_is_left(values, rows):
    assert _integrated([np.array(values)], 5.0) == pytest.approx(rows)


def test_rows_correlate_over_at_most_25_lags():
    """Of 1000 equal values, 1 - l / 1000 for each lag up to 24."""
    assert _integrated([np.ones(1000)], 2.0) == pytest.approx(1.0 + 2.0 * (24.0 - 300.0 / 1000.0))
    assert _integrated([np.ones(500), -np.ones(500)], 2.0) == pytest.approx(1.0 + 2.0 * (24.0 - 300.0 / 500.0))


def solver_of(count=8, weight=0.31, absorbed=0.0, noise=None):
    """The solver after rows of +-2 N m, 1 N m before."""
    state, noise = state_of(np.zeros(count), weight), noise or Noise.unknown(np.array([9.0]))
    solver = SimpleNamespace(_problem=SimpleNamespace(noise=noise), _least=np.atleast_2d(noise.least_nm))
    solver._least_correlation = 2.0 * noise.least_correlation.sum(axis=1, keepdims=True) - 1.0
    solver._residual, solver._noise, solver._correlation = (np.ones((1, 1)) for _ in range(3))
    solver._absorbed = np.array([[absorbed]])
    part = 2.0 * (-1.0) ** np.arange(count)[:, None]
    _Solver._weigh_axis(solver, 0, 0, [(state, part)])
    return solver


def weighed(**options):
    """Noise and residual of its axis."""
    solver = solver_of(**options)
    return solver._noise[0, 0], solver._residual[0, 0]


def test_noise_is_that_of_eight_moving_rows_or_more_less_what_is_absorbed():
    assert weighed() == pytest.approx((2.0, 2.0))
    assert weighed(count=7) == (1.0, 1.0)
    assert weighed(weight=0.29) == (1.0, 1.0)
    assert weighed(absorbed=4.0)[0] == pytest.approx(2.0 / np.sqrt(0.5))
    assert weighed(absorbed=7.9)[0] == pytest.approx(2.0 / np.sqrt(0.25))
    assert weighed(noise=Noise.unknown(np.array([1.5]))) == (1.5, 1.5)
    assert weighed(noise=Noise.unknown(np.array([9.0]), 3.0)) == (3.0, 2.0)


def test_rows_correlate_at_least_as_those_of_their_samples():
    assert solver_of()._correlation[0, 0] == 1.0
    of_samples = Noise.unknown(np.array([9.0]), 0.1, np.array([[1.0, 0.5, 0.25]]))
    assert solver_of(noise=of_samples)._correlation[0, 0] == pytest.approx(1.0 + 2.0 * 0.75)


# Iteration -------------------------------------------------------------------------------------------------------


@pytest.fixture
def iterated(monkeypatch):
    """Steps until the end, and how noise was weighed, where every step moves the unknowns by as much."""

    def iterated(moved, *, adapts=True, **options):
        weighed = []

        class Fake:
            def __init__(self, problem):
                pass

            def step(self):
                return moved

            def weigh(self, *, rough):
                weighed.append(rough)

            def posterior(self, steps):
                return steps

            def start_from(self, other):
                weighed.append(other)

        monkeypatch.setattr("armload_identification.estimation.solve._Solver", Fake)
        return solve(SimpleNamespace(adapts=adapts, shared_size=3, groups=[1]), **options), weighed

    return iterated


def test_a_fit_settles_at_a_twentieth_of_a_deviation_once_its_priors_have(iterated):
    assert iterated(0.049) == (7, [True] * 5 + [False] * 2)
    assert iterated(0.049, adapts=False) == (1, [True])
    assert iterated(0.049, start="other") == (8, ["other", False])
    assert iterated(0.051, rough=True) == (100, [True] * 5 + [False] * 5)
    with pytest.raises(EstimationError, match=r"within 100 steps .*still change by 0\.051 .*; 3 unknowns, 1 runs"):
        iterated(0.051)


# Priors ----------------------------------------------------------------------------------------------------------

ARM = Chain.from_origins(
    [[0.0, 0.0, 0.3], [0.4, 0.3, 0.0]], np.zeros((2, 3)), [[0, 0, 1.0], [0, 1.0, 0]], np.eye(4), [0.0, 0.0, -10.0]
)


def test_priors_are_ten_times_what_would_explain_the_torque_and_shares_of_it():
    """Torque of 4 and 9 N m, at 2 rad/s and 3 rad/s2; the arm reaches 0.3 + 0.5 + 0.1 m."""
    ones = np.array([[1.0, -1.0], [-1.0, 1.0]])
    rows = SimpleNamespace(effort_nm=ones * [4.0, 9.0], velocity_rad_s=2.0 * ones, axis_acceleration_rad_s2=3.0 * ones)
    base = np.zeros(20, dtype=bool)
    base[[0, 1, 14]] = True
    layout = SimpleNamespace(chain=ARM, base=base, peak_rad_s=np.array([2.0, 2.0]))
    terms = {term.name: term for term in arm_terms([rows], layout)}
    level, mass = np.array([4.0, 9.0]), 10.0 * 9.0 / (10.0 * 0.9)
    expected = {
        "log_h": (np.zeros(2), np.full(2, 0.05)),
        "links": (np.zeros(3), mass * np.array([1.0, 0.9, 0.81])),
        "rotors": (0.25 * level / 3.0, level / 3.0),
        "load": (np.full(2, 0.05), np.full(2, 0.05)),
        "coulomb": (np.zeros(2), 10.0 * level),
        "viscous": (np.zeros(2), 10.0 * level / 2.0),
        "root": (np.zeros(2), 10.0 * level / np.sqrt(2.0)),
        "delay": (np.zeros(1), [0.02]),
        "tilt": (np.zeros(2), np.full(2, np.pi / 360.0)),
        "payload": (np.zeros(10), mass * np.array([1.0] + [0.5] * 3 + [0.25] * 6)),
    }
    for name, (mean, deviation) in expected.items():
        np.testing.assert_allclose(terms[name].mean, mean)
        np.testing.assert_allclose(terms[name].deviation, deviation)
    np.testing.assert_allclose(wide_payload([rows], ARM).deviation, expected["payload"][1])
    np.testing.assert_allclose(recorder_delay().deviation, [0.005])


def test_friction_changes_by_shares_of_the_friction_at_half_the_greatest_speed():
    """10 + 2 sqrt(1) + 3 N m at 1 rad/s; of no friction a hundredth of the torque."""
    term = friction_change(np.array([4.0, 400.0]), np.array([2.0, 4.0]))
    np.testing.assert_allclose(
        term.deviation, [0.018 * 0.04, 0.018 * 4, 0.055 * 0.04, 0.055 * 2, 0.0055 * 0.04, 0.0055 * 4]
    )
    arm = {"coulomb": np.array([10.0, 0.0]), "root": np.array([2.0, 0.0]), "viscous": np.array([3.0, 0.0])}
    np.testing.assert_allclose(term.rescaled(arm)[[0, 2, 4]], [0.018 * 15, 0.055 * 15, 0.0055 * 15])
    assert term.pooled.tolist() == [0, 0, 1, 1, 2, 2]
    assert term.freedom == 20.0


def test_a_gain_is_named_from_twice_its_deviation_or_3_percent_and_four_deviations_of_the_fit():
    """Eight, if the fit says less than twice what was assumed."""
    assumed = np.array([0.01, 0.02, 0.02, 0.02, 0.02])
    deviation = np.array([0.001, 0.001, 0.015, 0.039, 0.041])
    named = np.array([0.03, 0.04, 0.06, 4 * 0.039, 8 * 0.041])
    np.testing.assert_allclose(_named_from(deviation, assumed), named)
    trial = SimpleNamespace(deviation=deviation)
    np.testing.assert_allclose(_noticeable(trial, assumed), named + 1.28 * deviation)


def test_gears_lose_differently_by_six_tenths_of_the_square_of_what_they_lose():
    np.testing.assert_allclose(gear_asymmetry(np.array([0.1, 0.2])), [0.006, 0.024])


@pytest.mark.parametrize(("runs", "usual_nm"), [(1, 3.0), (2, 1.0)])
def test_half_of_what_fits_worse_than_in_the_calibration_is_lasting(runs, usual_nm):
    """5 N m where 3 are usual: 4, of which half is a share of the torque; of a pair three times as much is usual."""
    rows = SimpleNamespace(effort_nm=np.array([[20.0], [-20.0]]))
    groups = [SimpleNamespace(runs=[SimpleNamespace(rows=rows)] * runs)]
    posterior = SimpleNamespace(problem=SimpleNamespace(groups=groups), noise_nm=np.array([[5.0]]))
    found = model_doubts(posterior, SimpleNamespace(noise_nm=np.array([usual_nm])))
    np.testing.assert_allclose(found, [[[2.0], [-2.0]]])


# Drift -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("log_factor", "usual", "heard", "allowed"),
    [
        (0.01, 0.001, True, (0.01 + 1.645 * 0.003) / 1.959964),
        (-0.01, 0.0, True, (0.01 + 1.645 * 0.003) / 1.959964),
        (0.009, 0.001, True, (0.009 + 1.645 * 0.003) / 1.959964),
        (0.009, 0.0, True, 0.0),
        (0.005, 0.001, True, np.hypot(0.1 * 0.005, np.sqrt(0.1) * 0.003)),
        (0.01, 0.001, False, np.hypot(0.1 * 0.01, np.sqrt(0.1) * 0.003)),
    ],
)
def test_a_drift_beyond_what_is_usual_is_allowed_for_as_a_whole(log_factor, usual, heard, allowed):
    """0.3 % and 0.1 % are 0.316 %: 1 % is 3.2 of them, 0.9 % 2.8 and 0.5 % 1.6."""
    drift = RunDrift(log_factor, 0.003, usual, heard)
    assert drift.size == pytest.approx(abs(log_factor) / 0.00316228)
    assert drift.allowed == pytest.approx(allowed, rel=1e-6)


def test_a_drift_is_told_from_three_deviations_on():
    assert RunDrift(0.0094, 0.003).notes() == []
    assert RunDrift(0.01, 0.003, heard=False).notes() == []
    (note,) = RunDrift(-0.01, 0.003).notes()
    assert "drifted by -1.0 +- 0.6 %" in note


# Torque and its derivatives --------------------------------------------------------------------------------------

COUNT, N, LINKS = 7, 2, 3
COUPLING = np.array([[1.0, 0.0], [0.5, 1.0]])


@pytest.fixture
def rows():
    rng = np.random.default_rng(5)
    sizes = {"links": LINKS, "payload": 10}
    given = {name: rng.normal(size=(COUNT, N)) for name in ArmRows.__dataclass_fields__ if name != "time_s"}
    for name, size in sizes.items():
        given[name] = rng.normal(size=(COUNT, N, size))
        given[f"{name}_moved"] = rng.normal(size=(COUNT, 3, N, size))
    return ArmRows(time_s=0.1 * np.arange(COUNT), **given)


@pytest.fixture
def placed():
    """All terms of an arm with a payload, one after the other."""
    sizes = {"log_h": N, "links": LINKS, "rotors": N, "load": N, "coulomb": N, "viscous": N, "root": N}
    sizes |= {"delay": 1, "tilt": 2}
    terms = [Term(name, Scope.ARM, LAWS[name], np.zeros(k), np.ones(k), "") for name, k in sizes.items()]
    terms += [payload_term(np.zeros(10), np.ones(10), ""), own_friction(np.ones(3 * N), "")]
    starts = np.cumsum([0, *(term.mean.size for term in terms)])
    places = [slice(*starts[i : i + 2]) for i in range(len(terms))]
    return tuple(zip(terms, places, strict=True))


def test_the_torque_is_what_loads_gears_friction_and_rotors_make_of_it(rows, placed):
    x = 0.3 * np.random.default_rng(6).normal(size=placed[-1][1].stop)
    of = {term.name: x[place] for term, place in placed}
    carried = np.zeros((COUNT, N))
    for name, values in (("links", of["links"]), ("payload", of["payload"])):
        moved = np.concatenate([of["delay"], of["tilt"]])
        carried += getattr(rows, name) @ values
        carried += np.einsum("s,tsjk,k->tj", moved, getattr(rows, f"{name}_moved"), values)
    changes = of["friction change"].reshape(3, N)
    friction = rows.direction * (of["coulomb"] + of["load"] * np.abs(carried) + changes[0])
    friction += rows.velocity_rad_s * (of["viscous"] + changes[1]) + rows.root * of["root"] + changes[2]
    rotors = rows.axis_acceleration_rad_s2 + of["delay"][0] * rows.axis_jerk_rad_s3
    expected = np.exp(of["log_h"]) * ((carried + friction) @ COUPLING + rotors * of["rotors"])
    np.testing.assert_allclose(torque_at(rows, placed, x, COUPLING).predicted_nm, expected)


def test_derivatives_are_those_of_the_torque(rows, placed):
    x = 0.3 * np.random.default_rng(7).normal(size=placed[-1][1].stop)
    found = torque_derivatives(torque_at(rows, placed, x, COUPLING), placed, COUPLING)
    slope = np.zeros((COUNT, N, x.size))
    for axis, (columns, place) in enumerate(found):
        assert len(set(place.tolist())) == place.size
        slope[:, axis, place] = columns
    for unknown, step in enumerate(1e-6 * np.eye(x.size)):
        ahead, behind = (torque_at(rows, placed, x + side * step, COUPLING).predicted_nm for side in (1.0, -1.0))
        np.testing.assert_allclose(slope[:, :, unknown], (ahead - behind) / 2e-6, atol=1e-7)


def test_columns_of_runs_are_laid_over_each_other_by_their_unknowns():
    one, two = np.array([[1.0, 2.0]]), np.array([[3.0, 4.0]])
    joined, place = joined_columns([(one, np.array([5, 2])), (two, np.array([2, 7]))])
    assert place.tolist() == [2, 5, 7]
    assert joined.tolist() == [[[2.0, 1.0, 0.0]], [[3.0, 0.0, 4.0]]]


# A change of the payload -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("edge_s", [1.0, 4.0])
def test_a_change_is_found_at_one_of_forty_times_with_its_size(edge_s):
    """Rows of unit weight, whose residual is that of a change at one of the times."""
    rng = np.random.default_rng(8)
    time_s = 0.1 * np.arange(200)
    rows = SimpleNamespace(payload=rng.normal(size=(200, N, 10)))
    delta = np.array([0.5, -0.2, 0.1, 0.3])
    times_s = edge_s + np.arange(40) * (19.9 - 2.0 * edge_s) / 39.0
    per_unit = np.einsum("tjk,ja->kta", rows.payload[:, :, :4], COUPLING)
    residual = np.einsum("kta,k,t->ta", per_unit, delta, time_s >= times_s[25])

    def beside(columns):
        flat = columns.reshape(len(columns), -1)
        return flat @ residual.ravel(), flat @ flat.T

    found = SimpleNamespace(beside=beside, problem=SimpleNamespace(coupling=COUPLING))
    tried_s = _times(time_s, edge_s, edge_s)
    assert tried_s == pytest.approx(times_s)
    per_joint = np.moveaxis(rows.payload[:, :, :4], 2, 0)
    change = _greatest(found, per_joint, time_s >= tried_s[:, None], tried_s, np.ones((1, 200, N)))
    assert change.at_s == pytest.approx(times_s[25])
    np.testing.assert_allclose(change.change, delta, rtol=1e-6)
    # Beside a constant torque: the columns without their share of it.
    columns = (per_unit * (time_s >= times_s[25])[None, :, None]).reshape(4, -1)
    columns -= columns.mean(axis=1, keepdims=True)
    information = columns @ columns.T
    assert change.statistic == pytest.approx(delta @ information @ delta, rel=1e-6)
    np.testing.assert_allclose(change.deviation, np.sqrt(np.diag(np.linalg.inv(information))), rtol=1e-6)
    assert not _times(time_s, 9.96, 9.96).size, "19.9 s are less than twice that"
    assert not _times(time_s[:0], 0.0, 0.0).size
    assert _greatest(found, per_joint, np.zeros((0, 200)), np.zeros(0), np.ones((1, 200, N))) is None


def test_friction_that_changes_evenly_is_zero_in_the_middle():
    rows = SimpleNamespace(
        time_s=np.array([2.0, 4.0, 6.0]), direction=np.ones((3, 1)), velocity_rad_s=np.full((3, 1), 2.0)
    )
    columns, nothing = _slow_change(rows, np.zeros((3, 1)))
    assert nothing is None
    np.testing.assert_allclose(columns[:, :, 0], [[-0.5, 0.0, 0.5], [-1.0, 0.0, 1.0], [-0.5, 0.0, 0.5]])


# Spectra ---------------------------------------------------------------------------------------------------------


def test_a_spectrum_is_averaged_over_half_of_a_bins_number_and_at_most_eight_on_either_side():
    """Mirrored at zero, cut off at the last bin."""
    widths = _summed(np.ones(40))
    half = [1, 1, 1, 1, 2, 2, 3, 3, 4, 4, 5, 5, 6, 6, 7, 7, *[8] * 24]
    assert widths.tolist() == [1 + h + min(h, 39 - k) for k, h in enumerate(half)]
    assert _summed(np.array([1.0, 10.0, 100.0])).tolist() == [21.0, 111.0, 110.0]
    assert _summed(np.array([7.0])).tolist() == [7.0]


def test_the_transposed_sum_is_over_the_bins_in_whose_windows_each_is():
    one, other = np.random.default_rng(9).normal(size=(2, 40))
    assert one @ _summed(other) == pytest.approx(_summed(one, transposed=True) @ other)


def drift_of(information, pull, noise=1.0, arm=True):
    torque = SimpleNamespace(predicted_nm=np.ones((2, 1)), joints=[], gain=np.ones(1))
    state = SimpleNamespace(torque=[torque], coupling=np.eye(1))
    posterior = SimpleNamespace(
        groups=[state],
        x=np.zeros(1),
        noise_nm=np.array([[noise]]),
        beside=lambda *_, errors: (np.array(pull), np.array(information)) if (errors is None) is not arm else None,
    )
    posterior.problem = SimpleNamespace(groups=[])
    return posterior, SimpleNamespace(noise_nm=np.ones(1), errors=np.ones((1, 1))) if arm else None


@pytest.mark.parametrize(
    ("information", "pull", "found"),
    [
        ([[1e6, 0.0], [0.0, 0.0]], [-500.0, 7.0], (0.0005, 0.001)),
        ([[1e4, 5e3], [5e3, 5e3]], [-40.0, 10.0], (40.0 * 1.5e-4 + 10.0 * 1e-4, 1.5e-4**0.5)),
    ],
)
def test_a_drift_is_found_beside_two_percent_of_friction(monkeypatch, information, pull, found):
    """2500 of information about the friction's common factor."""
    monkeypatch.setattr("armload_identification.estimation.run_drift._friction_nm", lambda *_: np.ones((2, 1)))
    drift = RunDrift.of(*drift_of(information, pull))
    assert (drift.log_factor, drift.deviation) == pytest.approx(found)
    assert (drift.usual, drift.heard) == (0.001, True)
    assert RunDrift.of(*drift_of(information, pull, 2.9)).heard
    assert not RunDrift.of(*drift_of(information, pull, 3.1)).heard
    nominal = RunDrift.of(*drift_of(information, pull, 9.0, arm=False))
    assert (nominal.usual, nominal.heard) == (0.0, True)


@pytest.mark.parametrize(("pull", "refined"), [(-1.4e3, False), (-1.5e3, True)])
def test_a_drift_beyond_one_deviation_is_refined(monkeypatch, pull, refined):
    """0.1 % of deviation and 0.1 % that is usual are 0.141 %."""
    room = "armload_identification.estimation.run_drift"
    monkeypatch.setattr(f"{room}._friction_nm", lambda *_: np.ones((2, 1)))
    monkeypatch.setattr(f"{room}.replace", lambda one, **_: one if isinstance(one, RunDrift) else None)
    again, _ = drift_of([[1e6, 0.0], [0.0, 0.0]], [-200.0, 0.0])
    solved = []
    monkeypatch.setattr(f"{room}.solve", lambda *_, **__: solved.append(1) or again)
    RunDrift.of(*drift_of([[1e6, 0.0], [0.0, 0.0]], [pull, 0.0]))
    assert bool(solved) is refined


def test_gears_give_way_by_two_milliradians_at_the_usual_torque(monkeypatch):
    """Of joints with 4 and 10 N m; what rows say of the first counts for a third of its square."""
    room = "armload_identification.estimation.elastic_joints"
    lag = np.stack([np.full((3, 2), 1.0), np.full((3, 2), 2.0)])
    monkeypatch.setattr(f"{room}._lag_torque", lambda *_: lag)
    rows = SimpleNamespace(effort_nm=np.array([[4.0, 10.0], [-4.0, -10.0]]))
    group = Group((RunRows(rows),))
    found = SimpleNamespace(problem=SimpleNamespace(groups=[group], mountings=()), value=lambda *_: np.zeros(2))
    body = SimpleNamespace(coupling=np.eye(2))
    found.beside = lambda *_: (np.zeros(2), np.zeros((2, 2)))
    (torque,) = elastic_torque(found, None, body)
    np.testing.assert_allclose(torque, [0.002 / 4.0 * lag[0], 0.002 / 10.0 * lag[1]])
    found.beside = lambda *_: (np.array([3e6, 0.0]), np.diag([12e6, 0.0]))
    (torque,) = elastic_torque(found, None, body)
    # Information 4e6 by the prior: 1/16e6, of which 3e6 are 0.1875.
    np.testing.assert_allclose(torque[0], np.sqrt(1.0 / 16e6 + 0.1875**2 / 3.0) * lag[0])
    found.problem.groups = [Group((RunRows(rows), RunRows(rows)), DIFFERENCE_AND_MEAN)]
    assert not elastic_torque(found, None, body)[0].any(), "both runs lag alike"


def test_undetermined_directions_are_drawn_towards_a_ball_of_five_centimetres():
    """2 m r^2 of inertia about its centre; the start is wider by the square of its distance from the flange."""
    plain = InertialParameters.from_center_of_mass(3.0, [0.0, 1.0, 2.0], np.diag([1.0, 2.0, 3.0]))
    ball = _ball(plain)
    np.testing.assert_allclose(ball.values, [3.0, 0.0, 1.0, 2.0, *[0.015] * 3, 0.0, 0.0, 0.0], atol=1e-12)
    wide = InertialParameters(_interior(plain))
    np.testing.assert_allclose(wide.values, [3.0, 0.0, 1.0, 2.0, *[0.09] * 3, 0.0, 0.0, 0.0], atol=1e-12)


def test_a_possible_body_with_room_is_its_own_nearest_one():
    body = InertialParameters.from_center_of_mass(3.0, [0.0, 0.1, 0.2], 0.03 * np.eye(3))
    assert nearest_possible(body, np.eye(10)) is body
    flat = InertialParameters.from_center_of_mass(3.0, [0.0, 0.1, 0.2], np.diag([0.01, 0.01, 0.03]))
    found = nearest_possible(flat, np.eye(10))
    assert found.margin >= WRITTEN_MARGIN * (1.0 - 1e-9)
    np.testing.assert_allclose(found.theta[:7], flat.theta[:7], atol=0.01)
    assert found.theta[6] < flat.theta[6]


@pytest.mark.parametrize(("rank", "plain"), [(10, True), (10, False), (9, True)])
def test_an_estimate_is_reported_as_it_is_if_it_is_possible_and_determined(rank, plain):
    inertia = 0.03 * np.eye(3) if plain else np.diag([0.01, 0.01, 0.03])
    body = InertialParameters.from_center_of_mass(3.0, [0.0, 0.1, 0.2], inertia)
    root = np.diag([1e3] * 9 + [0.0 if rank == 9 else 1e3])
    found = make_physical(SimpleNamespace(theta=body.theta, rank=rank, root=root))
    assert bool((found.theta == body.theta).all()) is (rank == 10 and plain)
    assert found.margin >= WRITTEN_MARGIN * (1.0 - 1e-9)
    assert np.allclose(found.theta, body.theta) is plain
    with pytest.raises(EstimationError, match=r"the estimated mass is -3 kg, which is physically impossible"):
        make_physical(SimpleNamespace(theta=-body.theta, rank=10, root=root))
