"""The criteria: against plain linear algebra, their derivatives, and parameters that an arm cannot excite."""

from __future__ import annotations

import numpy as np
import pytest

from armload_identification.excitation.information import Criterion, condition_number, named_criterion
from armload_identification.identification_errors import ExcitationError
from armload_identification.model.chain import Chain, pose_from_xyz_rpy
from armload_identification.model.payload import InertialParameters
from armload_identification.model.regressor import payload_regressor

pytestmark = pytest.mark.pure

PAYLOAD = InertialParameters.from_center_of_mass(3.0, [0.03, -0.2, 0.08], np.diag([0.03, 0.02, 0.01]))
HEAVY = InertialParameters.from_center_of_mass(9.0, [0.1, 0.0, 0.3], np.diag([0.3, 0.2, 0.1]))
FLAT = InertialParameters.from_center_of_mass(1.0, [0.0, 0.3, 0.02], np.diag([0.05, 0.01, 0.06]))
SET = (PAYLOAD, HEAVY, FLAT)
PERIOD_S = 10.0
NAMES = ("a-optimal", "a-optimal-mean", "a-optimal-max", "d-optimal", "condition-number")


def a_optimal(arm: Chain, noise: np.ndarray, payload: InertialParameters = PAYLOAD) -> Criterion:
    return named_criterion("a-optimal", arm, noise, payload)


def chain(n: int = 4) -> Chain:
    rng = np.random.default_rng(7)
    return Chain.from_origins(
        rng.uniform(-0.4, 0.4, (n, 3)),
        rng.uniform(-3, 3, (n, 3)),
        rng.normal(size=(n, 3)),
        pose_from_xyz_rpy([0.1, 0.2, 0.0], [0.3, 0.2, 0.1]),
        [0.0, 0.0, -9.81],
    )


def states(n: int = 4, samples: int = 40) -> np.ndarray:
    return np.random.default_rng(3).normal(size=(3, samples, n))


def covariance(arm: Chain, noise: np.ndarray, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray) -> np.ndarray:
    """Of a payload beside unknown changes of each joint's Coulomb friction, viscous friction and offset."""
    unknown = np.zeros((*q.shape, arm.n, 3))
    for joint in range(arm.n):
        speed = dq[:, joint]
        unknown[:, joint, joint] = np.column_stack([speed / np.hypot(speed, 0.05), speed, np.ones(len(q))])
    rows = np.concatenate([payload_regressor(arm, q, dq, ddq), unknown.reshape(*q.shape, -1)], axis=2)
    rows *= np.sqrt(PERIOD_S * 100.0 / len(q)) / noise[:, None]  # number of samples at 100 Hz
    inverse = np.linalg.inv(np.linalg.qr(rows.reshape(-1, rows.shape[2]), mode="r"))
    return np.asarray((inverse @ inverse.T)[:10, :10])


def test_a_optimal_is_the_sum_of_squared_relative_standard_deviations():
    arm, noise = chain(), np.array([2.0, 1.0, 0.5, 3.0])
    deviation = np.sqrt(np.diag(covariance(arm, noise, *states())))
    scale = np.maximum(np.abs(PAYLOAD.theta), 3.0 * np.array([1, 0.1, 0.1, 0.1, *[0.01] * 6]))
    cost = a_optimal(arm, noise, PAYLOAD).cost(*states(), PERIOD_S)
    assert cost == pytest.approx(np.sum((deviation / scale) ** 2), rel=1e-4)


def test_condition_number_is_that_of_the_stacked_regressor():
    arm = chain()
    q, dq, ddq = states()
    expected = np.linalg.cond(payload_regressor(arm, q, dq, ddq).reshape(-1, 10))
    assert condition_number(arm).cost(q, dq, ddq, PERIOD_S) == pytest.approx(expected, rel=1e-8)


def test_the_robust_criteria_are_the_mean_and_the_greatest_over_the_set():
    arm, noise = chain(), np.array([2.0, 1.0, 0.5, 3.0])
    motion = states()
    each = [a_optimal(arm, noise, payload).cost(*motion, PERIOD_S) for payload in SET]
    mean, greatest = (named_criterion(f"a-optimal-{over}", arm, noise, PAYLOAD, SET) for over in ("mean", "max"))
    assert mean.cost(*motion, PERIOD_S) == pytest.approx(np.mean(each))
    assert greatest.cost(*motion, PERIOD_S) == pytest.approx(max(each))
    smooth, _ = greatest.cost_and_slope(*motion, PERIOD_S)
    assert max(each) * (1.0 - 1e-12) <= smooth <= 1.023 * max(each)  # rounding: the payloads are far apart


def test_d_optimal_is_the_volume_of_the_errors_and_does_not_know_the_payload():
    arm, noise = chain(), np.array([2.0, 1.0, 0.5, 3.0])
    one, other = states(), 1.5 * states()
    costs = {}
    for name, motion in (("one", one), ("other", other)):
        for payload in SET:
            costs[name, payload.mass_kg] = named_criterion("d-optimal", arm, noise, payload).cost(*motion, PERIOD_S)
        scale = np.maximum(np.abs(PAYLOAD.theta), 3.0 * np.array([1, 0.1, 0.1, 0.1, *[0.01] * 6]))
        determinant = np.linalg.slogdet(covariance(arm, noise, *motion) / np.outer(scale, scale))[1]
        assert costs[name, 3.0] == pytest.approx(np.exp(determinant / 10.0), rel=1e-4)
    ratios = [costs["one", p.mass_kg] / costs["other", p.mass_kg] for p in SET]
    np.testing.assert_allclose(ratios, ratios[0], rtol=1e-6)


def criteria() -> list[Criterion]:
    arm = chain()
    return [named_criterion(name, arm, np.ones(4), PAYLOAD, SET) for name in NAMES] + [condition_number(arm.head(2))]


@pytest.mark.parametrize("criterion", criteria(), ids=[*NAMES, "condition of two joints"])
def test_the_slope_is_the_finite_difference_of_the_cost(criterion):
    x = states(criterion.chain.n)
    cost, slope = criterion.cost_and_slope(*x, PERIOD_S)
    if criterion.name not in ("a-optimal-max", "condition-number"):  # which are replaced by smooth ones
        assert cost == pytest.approx(criterion.cost(*x, PERIOD_S), rel=1e-12)
    rng = np.random.default_rng(5)
    for order in range(3):
        direction = np.zeros_like(x)
        direction[order] = rng.normal(size=x[0].shape)
        ahead, behind = (criterion.cost_and_slope(*(x + s * 1e-6 * direction), PERIOD_S)[0] for s in (1, -1))
        assert np.sum(slope * direction) == pytest.approx((ahead - behind) / 2e-6, rel=1e-5)


def test_what_the_arm_cannot_show_is_left_out():
    # One joint about the vertical: only the inertia about its axis appears in the torque.
    upright = Chain.from_modified_dh([[0.0, 0.0, 0.0, 0.0]], np.eye(4), [0.0, 0.0, -9.81])
    criterion = a_optimal(upright, np.array([1.0]), PAYLOAD)
    assert criterion.rank == 1
    q, dq, ddq = states(1)
    friction = np.hstack([dq / np.hypot(dq, 0.05), dq, np.ones_like(dq)])
    left = ddq - friction @ np.linalg.lstsq(friction, ddq)[0]
    expected = 1.0 / np.sum(left**2 * PERIOD_S * 100.0 / len(q))
    scale = max(PAYLOAD.theta[6], 3.0 * 0.01)
    assert criterion.cost(q, dq, ddq, PERIOD_S) == pytest.approx(expected / scale**2, rel=1e-4)
    # The same joint lying on its side also shows two first moments.
    lying = Chain.from_modified_dh([[0.0, 0.0, 0.0, 0.0]], np.eye(4), [9.81, 0.0, 0.0])
    assert condition_number(lying).rank == 3
    assert condition_number(chain(3)).rank == 10


def test_a_motion_that_shows_too_little_costs_infinitely_much():
    criterion = condition_number(chain())
    still = np.zeros((20, 4))
    cost, slope = criterion.cost_and_slope(still, still, still, PERIOD_S)
    assert cost == np.inf
    assert not slope.any()


def test_a_payload_or_noise_that_makes_no_sense_is_refused():
    with pytest.raises(ExcitationError, match="torque_noise_nm"):
        a_optimal(chain(), np.array([1.0, 1.0, 0.0, 1.0]), PAYLOAD)
    with pytest.raises(ExcitationError, match="torque_noise_nm"):
        a_optimal(chain(), np.ones(3), PAYLOAD)
    with pytest.raises(ExcitationError, match="mass"):
        a_optimal(chain(), np.ones(4), InertialParameters(np.zeros(10)))
    with pytest.raises(ExcitationError, match="criterion is 'best'; expected one of a-optimal, a-optimal-mean"):
        named_criterion("best", chain(), np.ones(4), PAYLOAD)
    with pytest.raises(ExcitationError, match="a-optimal-max needs a set of payloads"):
        named_criterion("a-optimal-max", chain(), np.ones(4), PAYLOAD)
