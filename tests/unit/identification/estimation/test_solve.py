"""The one solve: terms with priors, combined rows, knowledge that is carried from problem to problem."""

from __future__ import annotations

from dataclasses import replace

import msgspec
import numpy as np
import pytest
from scipy.stats import f as fisher

from armload_identification.estimation.arm_rows import ArmLayout
from armload_identification.estimation.arm_terms import (
    CHANGES,
    DELAY,
    DRIFT,
    GAIN,
    LINKS,
    LOAD_FRICTION,
    PAYLOAD,
    ROTORS,
    TILT,
    effort_level,
)
from armload_identification.estimation.estimation_constants import Solver
from armload_identification.estimation.normal_equations import torque_at, torque_derivatives
from armload_identification.estimation.payload_intervals import student_half_width
from armload_identification.estimation.problem import DIFFERENCE_AND_MEAN, Group, Known, Noise, Problem, RunRows
from armload_identification.estimation.residual_spectrum import FREEST
from armload_identification.estimation.solve import solve
from armload_identification.estimation.term_kinds import Joint, Scope, Term
from armload_identification.identification_errors import EstimationError
from armload_identification.signals.load_signal import load_signal
from armload_identification.signals.recorded_run import Run
from tests.payload_rows import all_terms

pytestmark = pytest.mark.pure


@pytest.fixture(scope="module")
def rows(pinocchio_arm):
    """Rows of a loaded and an empty run of one motion, and the arm's layout."""
    arm = pinocchio_arm
    runs = [
        arm.run(arm.trajectory(3, period_s=10.0), load, seed=5 + load, load_friction=0.06) for load in (True, False)
    ]
    signal = load_signal(*(Run.of(run, arm.transmission) for run in runs))
    coupling = arm.transmission.coupling
    signals = [signal.loaded, signal.unloaded]
    layout = ArmLayout.of(signals, arm.chain, coupling)
    return [layout.rows(run, loaded=load) for run, load in zip(signals, (True, False), strict=True)], layout


@pytest.fixture(scope="module")
def problem(rows, pinocchio_arm):
    """The pair as a difference and a mean, with exact gains."""
    pair, layout = rows
    terms = [known_exactly(term) if term.name == GAIN else term for term in all_terms(pair, layout)]
    groups = [Group((RunRows(pair[0], "tool"), RunRows(pair[1])), DIFFERENCE_AND_MEAN)]
    return Problem(terms, groups, Noise.unknown(effort_level(pair)), pinocchio_arm.transmission.coupling)


@pytest.fixture(scope="module")
def found(problem):
    return solve(problem)


def known_exactly(term):
    return msgspec.structs.replace(term, deviation=np.zeros(term.mean.size))


FIXED = {GAIN, TILT, DELAY, LOAD_FRICTION}


def linear(terms, fixed):
    """The terms with priors as they are stated, and some of them known exactly."""
    return [
        known_exactly(term) if term.name in fixed else msgspec.structs.replace(term, rescaled=None, pooled=None)
        for term in terms
    ]


def test_a_pair_gives_its_payload(found, pinocchio_arm):
    truth = pinocchio_arm.payload.theta
    place = found.problem.place(PAYLOAD, "tool")
    deviation = np.sqrt(np.diag(found.covariance)[place])
    assert found.value(PAYLOAD, "tool")[0] == pytest.approx(truth[0], rel=5e-3)
    assert (np.abs(found.value(PAYLOAD, "tool") - truth) < 4.0 * deviation + 1e-3).all()
    np.testing.assert_allclose(found.value(LOAD_FRICTION)[1:4], 0.06, atol=0.01)


def test_what_both_runs_have_in_common_is_not_noise_of_the_difference(problem, found):
    """A torque that neither link nor friction explains, the same at each phase of both runs."""
    time_s = problem.groups[0].time_s
    common = 6.0 * np.sin(2.0 * np.pi * 0.7 * time_s)[:, None] * np.ones(6)
    runs = problem.groups[0].runs
    disturbed = [replace(run, rows=replace(run.rows, effort_nm=run.rows.effort_nm + common)) for run in runs]
    together = solve(replace(problem, groups=[Group(tuple(disturbed), DIFFERENCE_AND_MEAN)]))
    apart = solve(replace(problem, groups=[Group((run,)) for run in disturbed]))
    np.testing.assert_allclose(together.residual_nm[0], found.residual_nm[0], rtol=0.2)
    assert (together.residual_nm[1] > 10.0 * found.residual_nm[1]).all()
    mass = [solution.problem.place(PAYLOAD, "tool").start for solution in (together, apart)]
    assert together.bread[mass[0], mass[0]] < 0.2 * apart.bread[mass[1], mass[1]]


@pytest.mark.parametrize("name", [GAIN, LINKS, ROTORS, LOAD_FRICTION, DELAY, TILT, PAYLOAD])
def test_derivatives_are_those_of_the_torque(rows, pinocchio_arm, name):
    pair, layout = rows
    terms = all_terms(pair, layout)
    problem = Problem(
        terms,
        [Group((RunRows(pair[0], "tool"),))],
        Noise.unknown(effort_level(pair)),
        pinocchio_arm.transmission.coupling,
    )
    mean, deviation = problem.prior()
    x = mean + 0.1 * deviation * np.random.default_rng(1).normal(size=mean.size)
    placed = problem.acting(0)[0]
    at = torque_at(pair[0], placed, x, problem.coupling)
    derivatives = list(torque_derivatives(at, placed, problem.coupling))
    place = problem.place(name, "tool" if name == PAYLOAD else "")
    for unknown in range(place.start, place.stop)[:3]:
        step = 1e-6 * np.maximum(deviation[unknown], 1e-3) * (np.arange(x.size) == unknown)
        ahead, behind = (
            torque_at(pair[0], placed, x + sign * step, problem.coupling).predicted_nm for sign in (1.0, -1.0)
        )
        numeric = (ahead - behind) / (2.0 * step[unknown])
        for axis in range(6):
            columns, where = derivatives[axis]
            column = columns[:, where == unknown].sum(axis=1)
            np.testing.assert_allclose(column, numeric[:, axis], atol=1e-4 * np.abs(numeric).max() + 1e-9)


def test_the_posterior_of_one_run_is_the_prior_of_the_next(rows, pinocchio_arm, problem):
    """Two runs one after the other give what both give at once."""
    pair, _ = rows
    noise = Noise.given(0.05 * effort_level(pair), np.ones(6))
    terms = linear(problem.terms, FIXED)
    coupling = pinocchio_arm.transmission.coupling
    loaded, empty = Group((RunRows(pair[0], "tool"),)), Group((RunRows(pair[1]),))
    both = solve(Problem(terms, [loaded, empty], noise, coupling))
    first = solve(Problem(terms, [empty], noise, coupling))
    free = [term.name for term in terms if term.scope is Scope.ARM and term.name not in FIXED]
    places = np.concatenate([np.arange(first.problem.shared_size)[first.problem.place(name)] for name in free])
    precision = np.linalg.inv(first.bread[np.ix_(places, places)])
    known = Known(tuple((name, "") for name in free), precision, precision @ first.x[places])
    later = [
        msgspec.structs.replace(term, deviation=np.full(term.mean.size, np.inf)) if term.name in free else term
        for term in terms
    ]
    then = solve(Problem(later, [loaded], noise, coupling, [known]))
    place, place_then = both.problem.place(PAYLOAD, "tool"), then.problem.place(PAYLOAD, "tool")
    deviation = np.sqrt(np.diag(both.bread)[place])
    np.testing.assert_allclose(np.sqrt(np.diag(then.bread)[place_then]), deviation, rtol=5e-3)
    assert (np.abs(then.x[place_then] - both.x[place]) < 0.01 * deviation).all()


def test_added_torque_moves_the_unknowns_as_the_response_says(problem, rows, pinocchio_arm):
    pair, _ = rows
    noise = Noise.given(0.05 * effort_level(pair), np.ones(6))
    terms = linear(problem.terms, FIXED)
    coupling = pinocchio_arm.transmission.coupling
    added = 0.1 * np.random.default_rng(2).normal(size=pair[0].effort_nm.shape)
    before = solve(Problem(terms, [Group((RunRows(pair[0], "tool"),))], noise, coupling))
    more = replace(pair[0], effort_nm=pair[0].effort_nm + added)
    after = solve(Problem(terms, [Group((RunRows(more, "tool"),))], noise, coupling))
    of_shared = before.response(added[None])
    deviation = np.sqrt(np.diag(before.bread))
    moved = after.x[: before.problem.shared_size] - before.x[: before.problem.shared_size]
    assert (np.abs(moved - of_shared[:, 0]) < 1e-2 * deviation + 1e-9).all()


def test_the_spread_of_a_runs_own_friction_is_that_of_the_runs(problem, monkeypatch):
    """Both runs have the same friction, so that less than the stated spread is found, but not none."""
    careful = solve(problem)
    terms = [msgspec.structs.replace(term, freedom=0.02) if term.pooled is not None else term for term in problem.terms]
    problem = replace(problem, terms=terms)
    found = solve(problem)
    own = problem.own(0)
    assert (careful.deviation[own] > found.deviation[own]).all()
    stated = problem.prior(found.x)[1][problem.own(0)][: CHANGES * 6]
    estimated = found.deviation[problem.own(0)][: CHANGES * 6]
    factor = (estimated / stated).reshape(CHANGES, 6)
    assert (factor[0] < 0.7).all()
    assert (factor > 0.01).all()
    np.testing.assert_allclose(factor, factor[:, :1] * np.ones(6), rtol=0.01)
    assert (found.change_deviation >= stated).all(), "what a few runs of an hour show is no bound for other days"
    assert DRIFT.size == CHANGES


def test_the_noise_is_corrected_for_what_the_unknowns_absorbed(problem, rows):
    """White noise on a model that is exact: its size is found although a third of the rows is absorbed."""
    pair, _ = rows
    terms = linear(problem.terms, {term.name for term in problem.terms if term.scope is Scope.ARM})
    given = Problem(
        terms,
        [Group((RunRows(run, "tool" if number == 0 else ""),)) for number, run in enumerate(pair)],
        problem.noise,
        problem.coupling,
    )
    x = given.prior()[0]
    rng, noise_nm = np.random.default_rng(3), 0.3
    groups = []
    for index, group in enumerate(given.groups):
        exact = torque_at(group.runs[0].rows, given.acting(index)[0], x, given.coupling).predicted_nm
        noisy = replace(group.runs[0].rows, effort_nm=exact + noise_nm * rng.normal(size=exact.shape))
        groups.append(Group((replace(group.runs[0], rows=noisy),)))
    found = solve(replace(given, groups=groups))
    weight = np.concatenate([group.weight for group in groups])
    moving = weight > Solver.moving
    expected = noise_nm * np.sqrt(np.sum((weight * moving) ** 2, axis=0) / moving.sum(axis=0))
    np.testing.assert_allclose(found.noise_nm[0], expected, rtol=0.2)


def test_a_new_term_is_a_law_and_a_line(problem):
    """A cable that pulls a joint towards the middle of its travel: the example of CONTRIBUTING."""

    def drag(rows, carried_nm):
        return rows.position_rad[None], None

    cable = Term("cable", Scope.ARM, Joint(drag), np.zeros(6), np.full(6, 20.0), "a tube of a robot of this size")
    runs = tuple(
        replace(run, rows=replace(run.rows, effort_nm=run.rows.effort_nm + 7.0 * run.rows.position_rad * np.eye(6)[3]))
        for run in problem.groups[0].runs
    )
    found = solve(replace(problem, terms=[*problem.terms, cable], groups=[Group(runs, DIFFERENCE_AND_MEAN)]))
    deviation = np.sqrt(np.diag(found.covariance)[found.problem.place("cable")])
    assert abs(found.value("cable")[3] - 7.0) < 4.0 * deviation[3]
    assert deviation[3] < 1.0


def test_a_fit_that_does_not_settle_is_an_error_unless_a_rough_one_suffices(problem, monkeypatch):
    monkeypatch.setattr(Solver, "settled", -1.0)
    with pytest.raises(EstimationError, match=r"does not converge within 3 steps .* Add runs with other motions"):
        solve(problem, steps=3)
    assert solve(problem, rough=True, steps=3).steps == 3


def test_a_blow_counts_for_nothing(problem, found):
    """Unless it is in both runs: then it is what the model lacks."""
    group = problem.groups[0]
    hit = (group.time_s > 4.0) & (group.time_s < 4.2)
    blow = np.where(hit[:, None], 40.0 * found.noise_nm[0], 0.0)
    hit_runs = [replace(run, rows=replace(run.rows, effort_nm=run.rows.effort_nm + blow)) for run in group.runs]
    struck = solve(replace(problem, groups=[Group((hit_runs[0], group.runs[1]), DIFFERENCE_AND_MEAN)]))
    assert struck.groups[0].struck[hit].all()
    both = solve(replace(problem, groups=[Group(tuple(hit_runs), DIFFERENCE_AND_MEAN)]))
    assert not both.groups[0].struck.any()
    deviation = np.sqrt(np.diag(found.covariance)[found.problem.place(PAYLOAD, "tool")])
    assert (np.abs(struck.value(PAYLOAD, "tool") - found.value(PAYLOAD, "tool")) < deviation).all()


def test_the_change_without_a_group_is_that_of_a_fit_without_it(problem, rows):
    pair, _ = rows
    noise = Noise.given(0.05 * effort_level(pair), np.ones(6))
    bare = [
        msgspec.structs.replace(term, mean=0.0 * term.mean) if term.name == ROTORS else term for term in problem.terms
    ]
    terms = linear(bare, FIXED | {LINKS, ROTORS})
    groups = [Group((RunRows(run, "tool"),)) for run in (pair[0], pair[0].only(pair[0].time_s < 5.0))]
    more = replace(groups[1].runs[0].rows, effort_nm=1.01 * groups[1].runs[0].rows.effort_nm)
    groups[1] = Group((RunRows(more, "tool"),))
    both = solve(Problem(terms, groups, noise, problem.coupling))
    alone = solve(Problem(terms, groups[:1], noise, problem.coupling))
    place = both.problem.place(PAYLOAD, "tool")
    change = (alone.x - both.x[: alone.x.size])[place]
    deviation = np.sqrt(np.diag(alone.bread)[place])
    assert (np.abs(both.change_without(1)[place] - change) < 0.05 * np.abs(change) + 0.01 * deviation).all()


def test_the_spread_is_that_of_many_runs(problem, rows):
    """White noise on an exact model: over 60 seeds the values scatter as each posterior says, and 95 % of the
    intervals hold."""
    pair, _ = rows
    terms = linear(problem.terms, FIXED | {LINKS, ROTORS})
    noise_nm = 0.1 * effort_level(pair)
    given = Problem(terms, [Group((RunRows(pair[0], "tool"),))], Noise.given(noise_nm, np.ones(6)), problem.coupling)
    truth = given.prior()[0]
    truth[given.place(PAYLOAD, "tool")] = [3.0, 0.1, -0.2, 0.3, 0.1, 0.1, 0.1, 0.0, 0.0, 0.0]
    exact = torque_at(pair[0], given.acting(0)[0], truth, given.coupling).predicted_nm
    place = given.place(PAYLOAD, "tool")
    contrast = np.eye(given.shared_size)[place]
    errors, variances, held, joint = [], [], [], []
    for seed in range(60):
        noise = np.random.default_rng(seed).normal(size=exact.shape) * noise_nm
        weight = np.where(pair[0].weight > 0.0, 1.0, 0.0)
        noisy = replace(pair[0], effort_nm=exact + noise, weight=weight)
        found = solve(replace(given, groups=[Group((RunRows(noisy, "tool"),))]))
        variance, freedom = found.spread(contrast)
        whole, whole_freedom = found.joint_spread(contrast[:4])
        error = found.value(PAYLOAD, "tool") - truth[place]
        errors.append(error)
        variances.append(variance)
        held.append(np.abs(error) < student_half_width(freedom) * np.sqrt(variance))
        size = error[:4] @ np.linalg.solve(whole, error[:4])
        joint.append(size < 4.0 * whole_freedom / (whole_freedom - 3.0) * fisher.ppf(0.95, 4, whole_freedom - 3.0))
    ratio = np.sqrt(np.mean(np.square(errors), axis=0) / np.mean(variances, axis=0))
    assert 0.85 < ratio.mean() < 1.15, ratio
    assert 0.92 <= np.mean(held) <= 0.98, np.mean(held, axis=0)
    assert np.mean(joint) >= 0.86, np.mean(joint)


def test_a_spread_by_priors_alone_has_all_freedom(problem):
    """A joint's law that no row shows: its deviation stays the prior's."""

    def nothing(rows, carried_nm):
        return np.zeros((1, *rows.effort_nm.shape)), None

    unseen = Term("unseen", Scope.ARM, Joint(nothing), np.zeros(6), np.full(6, 3.0), "test")
    found = solve(replace(problem, terms=[*problem.terms, unseen]))
    variance, freedom = found.spread(np.eye(found.problem.shared_size)[found.problem.place("unseen")])
    np.testing.assert_allclose(variance, 9.0, rtol=1e-6)
    np.testing.assert_array_equal(freedom, FREEST)
