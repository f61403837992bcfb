"""The evidence of a family of explanations, against Gaussian densities, and what explains a payload and a push."""

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from armload_identification.contact.arm_memory import RememberedState
from armload_identification.contact.contact_levels import DECISION_STEP_S, STEP_S
from armload_identification.contact.force_rows import ForceRows
from armload_identification.contact.load_or_push import _fits as fits
from armload_identification.contact.load_or_push import assess
from armload_identification.contact.something_acts import ResidualNoise
from armload_identification.model.regressor import payload_regressor

pytestmark = pytest.mark.pure

K, N, M = 5, 2, 3


@pytest.fixture
def problem():
    rng = np.random.default_rng(1)
    root = rng.normal(size=(K * N, K * N))
    noise = root @ root.T + np.eye(K * N)
    return rng.normal(size=(K, N, M)), noise, rng.normal(size=K * N), rng.uniform(0.0, 1.0, size=(4, K))


def test_the_evidence_is_the_mean_likelihood_ratio_of_unknown_to_nothing(problem):
    """With unknowns of variance one the residual has covariance N + H H', in each window with its shares of H."""
    columns, noise, residual, shares = problem
    found = fits(columns, np.linalg.inv(noise), residual, shares)
    nothing = multivariate_normal.logpdf(residual, cov=noise)
    ratios = []
    for share in shares:
        tall = (share[:, None, None] * columns).reshape(K * N, M)
        ratios.append(multivariate_normal.logpdf(residual, cov=noise + tall @ tall.T) - nothing)
    assert found.logarithm == pytest.approx(np.log(np.mean(np.exp(ratios))))
    assert found.best == int(np.argmax(ratios))


def test_the_best_window_gives_the_unknowns_and_their_covariance(problem):
    columns, noise, residual, shares = problem
    inverse = np.linalg.inv(noise)
    found = fits(columns, inverse, residual, shares)
    tall = (shares[found.best][:, None, None] * columns).reshape(K * N, M)
    covariance = np.linalg.inv(np.eye(M) + tall.T @ inverse @ tall)
    np.testing.assert_allclose(found.covariance, covariance)
    np.testing.assert_allclose(found.b, covariance @ tall.T @ inverse @ residual)


def test_very_unlikely_windows_do_not_overflow(problem):
    columns, noise, residual, shares = problem
    found = fits(columns, np.linalg.inv(noise), 1e3 * residual, shares)
    assert np.isfinite(found.logarithm)


@pytest.mark.parametrize("seed", range(3))
def test_the_jacobian_is_the_slope_of_the_flange(pinocchio_arm, seed):
    chain = pinocchio_arm.chain
    position = np.random.default_rng(seed).uniform(-2.0, 2.0, chain.n)
    slope = chain.jacobian(position)
    for joint, step in enumerate(1e-6 * np.eye(chain.n)):
        ahead, behind = (chain.forward(position + side * step)[-1] for side in (1.0, -1.0))
        np.testing.assert_allclose(slope[:3, joint], (ahead - behind)[:3, 3] / 2e-6, atol=1e-8)
        turning = (ahead - behind)[:3, :3] @ chain.forward(position)[-1][:3, :3].T / 2e-6
        np.testing.assert_allclose(slope[3:, joint], [turning[2, 1], turning[0, 2], turning[1, 0]], atol=1e-8)


# Rows in which something happens at a time ---------------------------------------------------------------------------

SECONDS, ONSET_S, UNTIL_S = 3.0, 1.5, 2.0
FORCE_ON_ARM_N = np.array([30.0, -20.0, 10.0])


@pytest.fixture
def explained(pinocchio_arm):
    """What explains rows of a moving arm with a payload since `ONSET_S`, or a push until `UNTIL_S`."""

    def explained(event, *, until_s=UNTIL_S, mass=1.0):
        rng, chain = np.random.default_rng(7), pinocchio_arm.chain
        time_s = np.arange(0.0, SECONDS, STEP_S)
        state = pinocchio_arm.trajectory(3, period_s=10.0).evaluate(time_s)
        regressor = payload_regressor(chain, state.position_rad, state.velocity_rad_s, state.acceleration_rad_s2)
        columns = np.concatenate([regressor, np.zeros((time_s.size, chain.n, 3 * chain.n))], axis=2)
        residual = 0.3 * rng.normal(size=(time_s.size, chain.n))
        if event == "payload":
            residual += np.where(time_s >= ONSET_S, mass, 0.0)[:, None] * regressor[:, :, 0]
            residual += np.where(time_s >= ONSET_S, 0.1 * mass, 0.0)[:, None] * regressor[:, :, 3]
        elif event == "push":
            inside = (time_s >= ONSET_S) & (time_s < until_s)
            for k in np.flatnonzero(inside):
                residual[k] -= FORCE_ON_ARM_N @ chain.jacobian(state.position_rad[k])[:3]
        still = np.zeros_like(residual)
        if event == "hung on":
            weight = payload_regressor(chain, state.position_rad, still, still)[:, :, 0]
            residual += np.where((time_s >= ONSET_S) & (time_s < until_s), mass, 0.0)[:, None] * weight
        rows = ForceRows(time_s, state.position_rad, residual, columns, still, still, still + 1.0, still)
        unknowns = columns.shape[2]
        known = RememberedState(0.0, np.zeros(unknowns), 1e-6 * np.eye(unknowns))
        variance = np.full(chain.n, 0.3**2 * STEP_S / DECISION_STEP_S)
        return assess(rows, known, ResidualNoise(variance, 0.1 * variance), chain, ONSET_S + 0.1)

    return explained


def test_a_payload_that_stays_is_told_from_a_push_with_its_onset(explained):
    found = explained("payload")
    assert found.odds > 10.0
    assert found.evidence > found.push_evidence
    assert found.payload_since_s == pytest.approx(ONSET_S, abs=2.0 * DECISION_STEP_S)


@pytest.mark.parametrize("until_s", [UNTIL_S, np.inf])
def test_a_push_has_its_force_and_its_time(explained, until_s):
    found = explained("push", until_s=until_s)
    assert found.odds < -10.0
    begin_s, end_s = found.push_s
    assert begin_s == pytest.approx(ONSET_S, abs=DECISION_STEP_S)
    assert end_s == (np.inf if until_s == np.inf else pytest.approx(until_s, abs=DECISION_STEP_S))
    np.testing.assert_allclose(found.force_n, FORCE_ON_ARM_N, atol=4.0 * found.force_deviation_n.max())
    assert (found.force_deviation_n > 0.0).all()
    assert (found.force_deviation_n < 5.0).all()


def test_who_hangs_on_the_flange_pulls_it_in_the_direction_of_gravity(explained, pinocchio_arm):
    found = explained("hung on", mass=4.0)
    weight_n = 4.0 * pinocchio_arm.chain.gravity_m_s2
    np.testing.assert_allclose(found.force_n, weight_n, atol=4.0 * found.force_deviation_n.max())
    assert found.force_n @ weight_n > 0.0


def test_where_nothing_happens_there_is_no_evidence(explained):
    found = explained("nothing")
    assert found.evidence < 3.0
    assert found.push_evidence < 3.0


@pytest.mark.parametrize(("mass", "possible"), [(-1.0, False), (1.0, True)])
def test_an_arm_without_a_payload_cannot_drop_one(explained, mass, possible):
    assert (explained("payload", mass=mass).odds > -np.inf) is possible
