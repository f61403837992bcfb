"""What a solution says of its unknowns, against one dense matrix of all rows and priors."""

from __future__ import annotations

from dataclasses import replace

import msgspec
import numpy as np
import pytest

from armload_identification.estimation.arm_rows import ArmLayout
from armload_identification.estimation.arm_terms import (
    DELAY,
    FRICTION_CHANGE,
    GAIN,
    LINKS,
    LOAD_FRICTION,
    PAYLOAD,
    TILT,
    effort_level,
)
from armload_identification.estimation.posterior import Posterior
from armload_identification.estimation.problem import Group, Noise, Problem, RunRows
from armload_identification.estimation.residual_spectrum import FREEST
from armload_identification.estimation.solve import solve
from armload_identification.signals.recorded_run import Run
from tests.payload_rows import all_terms

pytestmark = pytest.mark.pure

FIXED = {GAIN, TILT, DELAY, LOAD_FRICTION}


@pytest.fixture(scope="module")
def found(pinocchio_arm) -> Posterior:
    """A linear problem: a loaded and an empty run, with the noise given and some terms known exactly."""
    arm, coupling = pinocchio_arm, pinocchio_arm.transmission.coupling
    runs = [arm.run(arm.trajectory(3, period_s=10.0), load, seed=5 + load, periods=1) for load in (True, False)]
    signals = [Run.of(run, arm.transmission).over_time for run in runs]
    layout = ArmLayout.of(signals, arm.chain, coupling)
    pair = [layout.rows(run, loaded=load) for run, load in zip(signals, (True, False), strict=True)]
    terms = [
        msgspec.structs.replace(term, deviation=np.zeros(term.mean.size))
        if term.name in FIXED
        else msgspec.structs.replace(term, rescaled=None, pooled=None)
        for term in all_terms(pair, layout)
    ]
    groups = [Group((RunRows(pair[0], "tool"),)), Group((RunRows(pair[1]),))]
    noise = Noise.given(0.05 * effort_level(pair), np.linspace(1.0, 2.0, 6))
    return solve(Problem(terms, groups, noise, coupling))


class Dense:
    """All free unknowns, shared ones first, with rows (m, u), residual (m,), axis and group of each row."""

    def __init__(self, found, without_group=None):
        problem = found.problem
        self.shared = np.flatnonzero(problem.free[: problem.shared_size])
        owns = [np.arange(problem.size)[problem.own(group)] for group in (0, 1)]
        owns = [own[problem.free[own]] for own in owns]
        self.at = np.concatenate([self.shared, *owns])
        columns, target = [], []
        for group in (0, 1):
            places = np.concatenate([np.arange(self.shared.size), np.searchsorted(self.at, owns[group])])
            for rows in found.weighted_rows[group]:
                if group == without_group:
                    continue
                block = np.zeros((len(rows.target), self.at.size))
                block[:, places[rows.place]] = rows.rows
                columns.append(block)
                target.append(rows.target)
        self.rows, self.target = np.vstack(columns), np.concatenate(target)
        mean, deviation = problem.prior()
        self.precision = deviation[self.at] ** -2.0
        self.off = (mean - found.x)[self.at]
        self.unit = 1.0 / np.sqrt(np.sum(self.rows**2, axis=0) + self.precision)

    def solve(self, right):
        """The inverse information times something; scaled, so that rounding matters less."""
        scaled = self.rows * self.unit
        information = scaled.T @ scaled + np.diag(self.precision * self.unit**2)
        return self.unit[:, None] * np.linalg.solve(information, self.unit[:, None] * right)

    @property
    def covariance(self):
        return self.solve(np.eye(self.at.size))

    def step(self):
        """From the solution's values to those that these rows alone give."""
        return self.solve((self.rows.T @ self.target + self.precision * self.off)[:, None])[:, 0]


@pytest.fixture(scope="module")
def dense(found):
    return Dense(found)


def close(actual, expected, deviation, share=2e-4):
    """Within a small share of the standard deviations."""
    assert (np.abs(actual - expected) < share * deviation).all()


def test_a_solution_is_one(dense):
    deviation = np.sqrt(np.diag(dense.covariance))
    close(dense.step(), 0.0, deviation, 1e-2)


def test_the_covariance_of_independent_rows(found, dense):
    s = dense.shared.size
    covariance = dense.covariance[:s, :s]
    deviation = np.sqrt(np.diag(covariance))
    close(found.bread[np.ix_(dense.shared, dense.shared)], covariance, np.outer(deviation, deviation), 1e-3)
    exact = np.setdiff1d(np.arange(found.problem.shared_size), dense.shared)
    assert exact.size
    assert not found.bread[exact].any()
    assert not found.covariance[exact].any()


def test_the_part_of_it_that_is_of_the_priors_alone(found, dense):
    """Priors of all unknowns, also of the runs' own: H^-1 P H^-1."""
    s = dense.shared.size
    covariance = dense.solve(dense.precision[:, None] * dense.covariance)[:s, :s]
    deviation = np.sqrt(np.diag(dense.covariance)[:s])
    close(found._by_priors, covariance, np.outer(deviation, deviation), 1e-6)
    own = dense.solve(np.where(np.arange(dense.at.size) < s, 0.0, dense.precision)[:, None] * dense.covariance)[:s, :s]
    assert np.abs(own / np.outer(deviation, deviation)).max() > 1e-3


def test_combinations_of_shared_and_own_unknowns(found, dense):
    s, own = dense.shared.size, found.problem.own_size
    rng = np.random.default_rng(1)
    for group, place in ((0, slice(s, s + own)), (1, slice(s + own, s + 2 * own))):
        at = np.r_[0:s, place]
        deviation = np.sqrt(np.diag(dense.covariance))[at]
        combined = rng.normal(size=(3, s + own)) / deviation
        contrast = np.ones((3, found.problem.size))
        contrast[:, : found.problem.shared_size] = 0.0
        contrast[:, dense.shared], contrast[:, found.problem.own(group)] = np.split(combined, [s], axis=1)
        expected = combined @ dense.covariance[np.ix_(at, at)] @ combined.T
        actual = found.joint_covariance(contrast, group)
        np.testing.assert_allclose(actual, expected, rtol=2e-3, atol=2e-3 * np.diag(expected).max())


@pytest.mark.parametrize("group", [0, 1])
def test_added_torque_moves_the_shared_unknowns(found, dense, group):
    rows = found.problem.groups[group].runs[0].rows
    added = np.random.default_rng(2).normal(size=(2, *rows.effort_nm.shape))
    parts = [(added[:, :, each.axis] * each.weight).T for each in found.weighted_rows[group]]
    other = [np.zeros((len(each.target), 2)) for each in found.weighted_rows[1 - group]]
    stacked = np.vstack([*parts, *other] if group == 0 else [*other, *parts])
    moved = dense.solve(dense.rows.T @ stacked)
    deviation = np.sqrt(np.diag(dense.covariance))[:, None]
    before = [np.zeros((2, *other.runs[0].rows.effort_nm.shape)) for other in found.problem.groups[:group]]
    of_shared, s = found.response(*before, added), dense.shared.size
    close(of_shared[dense.shared], moved[:s], deviation[:s] + np.abs(moved[:s]), 1e-3)
    assert of_shared.shape == (found.problem.shared_size, 2)


@pytest.mark.parametrize("groups", [(0,), (1,), (0, 1)])
def test_further_unknowns_are_estimated_beside_all_others(found, dense, groups):
    """The Schur complement of the normal equations with further columns."""
    rng, further = np.random.default_rng(3), []
    torque = []
    for group in (0, 1):
        rows = found.problem.groups[group].runs[0].rows
        added = rng.normal(size=(2, *rows.effort_nm.shape)) * (group in groups)
        further += [(added[:, :, each.axis] * each.weight).T for each in found.weighted_rows[group]]
        if group in groups:
            torque.append(added)
    columns = np.vstack(further)
    gradient, information = found.beside(*torque, first=groups[0])
    np.testing.assert_allclose(gradient, columns.T @ dense.target, rtol=1e-9)
    expected = columns.T @ columns - columns.T @ dense.rows @ dense.solve(dense.rows.T @ columns)
    np.testing.assert_allclose(information, expected, rtol=1e-3, atol=1e-3 * np.diag(expected).max())


def test_further_unknowns_are_estimated_beside_errors_of_known_ones(found):
    """The links are held; the same with one more column for each independent error of theirs, of prior 1."""
    place = found.problem.place(LINKS)
    deviation = np.sqrt(np.diag(found.bread)[place])
    terms = [
        msgspec.structs.replace(term, mean=found.value(LINKS) + 0.1 * deviation, deviation=0.01 * deviation)
        if term.name == LINKS
        else term
        for term in found.problem.terms
    ]
    held = solve(replace(found.problem, terms=terms))
    dense, state = Dense(held), held.groups[0].torque[0]
    added = np.stack([state.predicted_nm, np.random.default_rng(4).normal(size=state.predicted_nm.shape)])
    further = [(added[:, :, each.axis] * each.weight).T for each in held.weighted_rows[0]]
    further += [np.zeros((len(each.target), 2)) for each in held.weighted_rows[1]]
    errors = np.zeros((3, place.stop))
    errors[:, place] = np.random.default_rng(5).normal(size=(3, deviation.size)) * deviation
    of_free = np.pad(errors, ((0, 0), (0, held.problem.shared_size - place.stop)))[:, dense.shared]
    columns = np.hstack([np.vstack(further), dense.rows[:, : dense.shared.size] @ of_free.T])
    information = columns.T @ columns - columns.T @ dense.rows @ dense.solve(dense.rows.T @ columns)
    information[2:, 2:] += np.eye(3)
    answer = np.linalg.solve(information[2:, 2:], information[2:, :2])
    expected, gradient = information[:2, :2] - information[:2, 2:] @ answer, columns.T @ dense.target
    pull, actual = held.beside(added, errors=errors)
    np.testing.assert_allclose(actual, expected, rtol=1e-3, atol=1e-3 * np.diag(expected).max())
    np.testing.assert_allclose(pull, gradient[:2] - answer.T @ gradient[2:], rtol=1e-2, atol=0.1)
    assert actual[0, 0] < 0.99 * information[0, 0]


def test_without_a_group_the_others_and_the_priors_remain(found):
    rest = Dense(found, without_group=0)
    change = rest.step()[: rest.shared.size]
    actual = found.change_without(0)[rest.shared]
    deviation = np.sqrt(np.diag(rest.covariance))[: rest.shared.size]
    close(actual, change, deviation, 1e-2)


def test_values_are_by_name_mounting_and_run(found, pinocchio_arm):
    assert found.value(PAYLOAD, "tool")[0] == pytest.approx(pinocchio_arm.payload.mass_kg, rel=0.02)
    own = found.problem.place(FRICTION_CHANGE, (1, 0))
    np.testing.assert_array_equal(found.value(FRICTION_CHANGE, (1, 0)), found.x[own])
    assert own.start >= found.problem.own(1).start
    assert found.delay_s == pytest.approx(found.value(DELAY)[0])


def test_residuals_relative_to_the_noise(found):
    """The model is exact: about 1 per row that is not near a reversal."""
    for group in (0, 1):
        state = found.groups[group]
        relative = state.residual_nm[0] * state.group.weight / found.noise_nm[0]
        np.testing.assert_allclose(found.deviates(group), np.sqrt(np.mean(relative**2, axis=0)), rtol=1e-9)


def correlation_of(covariance):
    size = np.sqrt(np.diag(covariance))
    return covariance / np.outer(size, size)


def test_the_spread_of_a_mass_is_of_the_size_of_white_noise_plus_priors(found):
    """White residuals: the local spectrum finds their variance, times what was assumed of their correlation."""
    place = found.problem.place(PAYLOAD, "tool")
    contrast = np.zeros((2, found.problem.shared_size))
    contrast[0, place.start] = contrast[1, place.start + 1] = 1.0
    variance, freedom = found.spread(contrast)
    assert (variance > 0.0).all()
    assert (freedom >= 1.0).all()
    assert (freedom <= FREEST).all()
    both, joint = found.joint_spread(contrast)
    np.testing.assert_allclose(np.diag(both), variance)
    spectral = found.covariance[place.start : place.start + 2, place.start : place.start + 2]
    np.testing.assert_allclose(correlation_of(both), correlation_of(spectral))
    assert 1.0 <= joint <= FREEST
    doubled, same = found.spread(2.0 * contrast)
    np.testing.assert_allclose(doubled, 4.0 * variance)
    np.testing.assert_allclose(same, freedom)
