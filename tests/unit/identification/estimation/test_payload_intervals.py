"""Intervals: their coverage with white and coloured noise, and undetermined parameters."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.stats import t as student

from armload_identification.estimation.payload_intervals import _share_of_possible, quantify, student_half_width
from armload_identification.estimation.physical_consistency import make_physical
from armload_identification.estimation.problem import Noise
from armload_identification.estimation.residual_spectrum import FREEST
from armload_identification.model.payload import PARAMETER_NAMES, InertialParameters, derived
from armload_identification.model.regressor import payload_regressor
from tests.payload_rows import SAMPLES, STEP_S, exactly, payload_of, white

pytestmark = pytest.mark.pure


def coloured(rng, samples, memory_s):
    """(samples, 6) noise of unit variance: 70 % white, 30 % with an exponential memory."""
    decay = np.exp(-STEP_S / memory_s)
    drive = rng.normal(size=(samples + 500, 6)) * np.sqrt(1.0 - decay**2)
    slow = lfilter([1.0], [1.0, -decay], drive, axis=0)[500:]
    return np.sqrt(0.7) * rng.normal(size=(samples, 6)) + np.sqrt(0.3) * slow


@pytest.mark.parametrize(
    ("periods", "memory_s"),
    [
        pytest.param(1, None, id="1-white", marks=pytest.mark.long),
        pytest.param(1, 0.3, id="1-slow", marks=pytest.mark.long),
        pytest.param(3, None, id="3-white", marks=pytest.mark.long),
        pytest.param(3, 0.5, id="3-slow"),
    ],
)
def test_95_percent_intervals_cover(regressor, pinocchio_arm, periods, memory_s):
    """One period with noise to be estimated, three with noise that is known and white, which it is not."""
    truth, _ = derived(pinocchio_arm.payload)
    noise_nm = 4.0 * pinocchio_arm.noise_nm / np.sqrt(periods)
    given = None if periods == 1 else Noise.given(noise_nm, np.ones(6))
    covered, textbook = [], []
    for seed in range(100):
        rng = np.random.default_rng(seed)
        length = periods * SAMPLES
        noise = rng.normal(size=(length, 6)) if memory_s is None else coloured(rng, length, memory_s)
        noise = (noise * pinocchio_arm.noise_nm * 4.0).reshape(periods, SAMPLES, 6).mean(axis=0)
        found = payload_of(regressor, regressor @ pinocchio_arm.payload.theta + noise, given)
        reported = quantify(found, make_physical(found))
        covered.append(np.abs(reported.values - truth) <= reported.half_width_95)
        weighted = (regressor / noise_nm[:, None]).reshape(-1, 10)
        naive = 1.96 * np.sqrt(np.diag(np.linalg.inv(weighted.T @ weighted)))
        textbook.append(np.abs(found.theta - pinocchio_arm.payload.theta) <= naive)
    share = np.mean(covered, axis=0)
    assert 0.92 <= share.mean() <= 0.98, share
    assert share.min() >= 0.85, share
    if memory_s is not None:
        assert np.mean(textbook) < 0.8


def test_half_widths_are_the_quantiles_of_students_distribution():
    freedom = np.array([[1.0, 1.01, 1.5, 2.0], [2.7, 10.0, FREEST, np.inf]])
    np.testing.assert_allclose(student_half_width(freedom), student.ppf(0.975, freedom), rtol=1e-7)


def test_the_quantile_is_students_with_the_freedom_that_the_variances_scatter_by(regressor, pinocchio_arm):
    """The variance of a variance estimate with f degrees of freedom is 2/f of its square; few bins determine the
    mass's, so f is small."""
    variances, freedoms = [], []
    for seed in range(100):
        noise = np.random.default_rng(seed).normal(size=(SAMPLES, 6)) * pinocchio_arm.noise_nm
        torque = regressor @ pinocchio_arm.payload.theta + noise
        found = payload_of(regressor, torque)
        reported = quantify(found, InertialParameters(found.theta))
        quantile = reported.half_width_95[0] / np.sqrt(reported.covariance[0, 0])
        quantile /= _share_of_possible(found, InertialParameters(found.theta))[0]
        assert quantile == pytest.approx(student.ppf(0.975, reported.degrees_of_freedom[0]), rel=1e-6)
        assert quantile > 1.98
        variances.append(reported.covariance[0, 0])
        freedoms.append(reported.degrees_of_freedom[0])
    scatter = 2.0 * np.mean(variances) ** 2 / np.var(variances)
    assert np.median(freedoms) == pytest.approx(scatter, rel=0.35)


PLATE = InertialParameters.from_center_of_mass(2.0, [0.05, 0.0, 0.1], np.diag([0.010, 0.015, 0.02499]))


def test_errors_that_leave_no_possible_body_do_not_widen_intervals(regressor, pinocchio_arm):
    """A plate, whose inertia in its plane is at the limit: narrower intervals, which hold as often as they say."""
    truth, _ = derived(PLATE)
    noise_nm = 20.0 * pinocchio_arm.noise_nm
    held, shares = [], []
    for seed in range(100):
        noise = np.random.default_rng(seed).normal(size=(SAMPLES, 6)) * noise_nm
        found = payload_of(regressor, regressor @ PLATE.theta + noise, Noise.given(noise_nm, np.ones(6)))
        body = make_physical(found)
        reported = quantify(found, body)
        free = np.sqrt(found.spread(derived(body)[1])[0]) * student_half_width(reported.degrees_of_freedom)
        shares.append(reported.half_width_95 / free)
        held.append(np.abs(reported.values - truth) <= reported.half_width_95)
    assert np.max(shares) <= 1.0
    assert np.median(shares, axis=0)[0] > 0.95
    assert np.median(shares, axis=0)[4:].min() < 0.9
    assert 0.93 <= np.mean(held) <= 0.98, np.mean(held, axis=0)
    assert np.mean(held, axis=0).min() >= 0.85, np.mean(held, axis=0)


def test_an_estimate_far_from_every_possible_body_keeps_its_intervals(regressor, pinocchio_arm):
    """What its errors do not explain is not known to be small."""
    impossible = InertialParameters.from_center_of_mass(2.0, [0.05, 0.0, 0.1], np.diag([0.05, 0.05, 0.3]))
    noise_nm = 0.2 * pinocchio_arm.noise_nm
    found = payload_of(regressor, regressor @ impossible.theta, Noise.given(noise_nm, np.ones(6)))
    body = make_physical(found)
    assert np.linalg.norm(found.root @ (body.theta - found.theta)) > 20.0
    np.testing.assert_array_equal(_share_of_possible(found, body), 1.0)


def test_derivatives_of_what_is_reported_are_right(pinocchio_arm):
    body = pinocchio_arm.payload
    values, slope = derived(body)
    np.testing.assert_allclose(values[:4], [body.mass_kg, *body.center_of_mass_m])
    for k in range(10):
        step = np.zeros(10)
        step[k] = 1e-6
        up, _ = derived(InertialParameters(body.theta + step))
        down, _ = derived(InertialParameters(body.theta - step))
        np.testing.assert_allclose(slope[:, k], (up - down) / 2e-6, atol=1e-8)


def test_determined_is_what_design_says(regressor, pinocchio_arm):
    rng = np.random.default_rng(1)
    body = pinocchio_arm.payload
    unit = np.array([body.mass_kg] + [0.1] * 3 + [body.mass_kg * 0.01] * 6)
    seen = set()
    for level in (0.2, 1.0, 20.0, 2000.0):
        noise = level * pinocchio_arm.noise_nm * rng.normal(size=(SAMPLES, 6))
        given = Noise.given(level * pinocchio_arm.noise_nm, np.ones(6))
        found = payload_of(regressor, regressor @ body.theta + noise, given)
        reported = quantify(found, InertialParameters(np.concatenate([body.theta[:1], found.theta[1:]])))
        np.testing.assert_array_equal(reported.determined, reported.half_width_95 <= 0.2 * unit)
        np.testing.assert_allclose(reported.interval_95.mean(axis=1), reported.values)
        assert reported.undetermined_names == tuple(np.array(PARAMETER_NAMES)[~reported.determined])
        seen.add(int(reported.determined.sum()))
    assert {0, 10} <= seen
    assert len(seen) > 2


def test_what_the_motion_does_not_excite_has_no_interval(pinocchio_arm):
    """Only the last joint moves, about a vertical axis fixed in space: mass and most of the rest remain unknown."""
    rng = np.random.default_rng(2)
    t = np.arange(SAMPLES) * STEP_S
    state = np.zeros((3, SAMPLES, 6))
    omega = 2.0 * np.pi / (SAMPLES * STEP_S)
    for k in (1, 2, 3):
        state[0, :, 5] += np.sin(k * omega * t)
        state[1, :, 5] += k * omega * np.cos(k * omega * t)
        state[2, :, 5] -= (k * omega) ** 2 * np.sin(k * omega * t)
    last = payload_regressor(pinocchio_arm.chain, *state)[:, 5:]
    body = pinocchio_arm.payload
    found = payload_of(last, last @ body.theta + 0.2 * rng.normal(size=(SAMPLES, 1)), exactly(1, 0.2))
    assert found.rank < 10
    reported = quantify(found, body)
    assert reported.half_width_95[0] == np.inf
    assert not reported.determined[0]
    assert np.isfinite(reported.covariance).all()


def test_rows_that_are_left_out_take_their_share_of_the_precision(regressor, pinocchio_arm):
    """White noise of known size, every other half second left out: the robust covariance is the textbook's."""
    used = np.repeat((np.arange(SAMPLES) // 25 % 2 == 0)[:, None], 6, axis=1).astype(float)
    rows = (regressor / pinocchio_arm.noise_nm[:, None])[used[:, 0] > 0.0].reshape(-1, 10)
    textbook = np.diag(np.linalg.inv(rows.T @ rows))
    ratio = []
    for seed in range(10):
        noise = np.random.default_rng(seed).normal(size=(SAMPLES, 6)) * pinocchio_arm.noise_nm
        torque = regressor @ pinocchio_arm.payload.theta + noise
        found = payload_of(regressor, torque, white(pinocchio_arm), weight=used)
        ratio.append(np.diag(quantify(found, InertialParameters(found.theta)).covariance) / textbook)
    assert 0.85 <= np.mean(ratio) <= 1.25, np.mean(ratio)


def test_variances_are_at_least_those_of_samples_that_overlapping_rows_share(regressor, pinocchio_arm):
    """Rows that a fit explains without any residual: the variance is that of the least noise and its correlation."""
    faded = np.array([1.0, 0.6, 0.2])
    torque = regressor @ pinocchio_arm.payload.theta
    least = replace(white(pinocchio_arm), least_correlation=faded[None])
    found = payload_of(regressor, torque, least)
    rows = regressor / pinocchio_arm.noise_nm[:, None]
    answer = np.linalg.solve(np.einsum("tjk,tjl->kl", rows, rows), np.moveaxis(rows, 2, 0).reshape(10, -1))
    answer = answer.reshape(10, SAMPLES, 6)
    expected = np.einsum("ktj,ltj->kl", answer, answer)
    for lag in (1, 2):
        expected += 2.0 * faded[lag] * np.einsum("ktj,ltj->kl", answer[:, lag:], answer[:, :-lag])
    variance, freedom = found.spread(np.eye(10))
    np.testing.assert_allclose(variance, np.diag(expected), rtol=0.01)
    np.testing.assert_allclose(np.diag(found.covariance), variance)
    np.testing.assert_allclose(freedom, FREEST)


def test_residuals_beyond_the_least_noise_count_as_far_as_chance_does_not_explain_them(regressor, pinocchio_arm):
    """Noise of four times the least: as if none were stated. Of 0.7 to 1.1 times: from the least on, hardly more."""
    truth = regressor @ pinocchio_arm.payload.theta
    least = Noise.given(pinocchio_arm.noise_nm, np.ones(6))
    free = replace(least, least_nm=np.full(6, 1e-12))
    sampled = np.diag(payload_of(regressor, truth, least).covariance)
    above = []
    for seed in range(20):
        noise = np.random.default_rng(seed).normal(size=(SAMPLES, 6)) * pinocchio_arm.noise_nm
        both = (payload_of(regressor, truth + 4.0 * noise, of).spread(np.eye(10)) for of in (least, free))
        for found, expected in zip(*both, strict=True):
            np.testing.assert_allclose(found, expected, rtol=1e-9)
        for size in (0.7, 1.0, 1.1):
            made = [payload_of(regressor, truth + size * noise, of) for of in (least, free)]
            (stated, freedom), (alone, _) = (found.spread(np.eye(10)) for found in made)
            least_only = stated <= sampled * (1.0 + 1e-9)
            np.testing.assert_allclose(freedom[least_only], FREEST, rtol=1e-3)
            assert (stated >= sampled * (1.0 - 1e-9)).all()
            assert (stated <= 1.1 * np.maximum(sampled, alone)).all()
            above.append((size, np.median(stated / sampled)))
    assert np.mean([share for size, share in above if size == 0.7]) == pytest.approx(1.0, abs=0.02)
    assert np.median([share for size, share in above if size == 1.0]) < 1.05
    assert 1.02 < np.mean([share for size, share in above if size == 1.1]) < 1.6


def test_a_covariance_that_cannot_be_inverted_narrows_nothing():
    found = SimpleNamespace(theta=PLATE.theta, rank=10, covariance=np.full((10, 10), np.nan))
    np.testing.assert_array_equal(_share_of_possible(found, PLATE), 1.0)
