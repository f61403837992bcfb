"""Physically possible links: the identified torque if any links have it, else the nearest that can exist."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from armload_identification.calibration import possible_links as module
from armload_identification.calibration.possible_links import possible_links
from armload_identification.estimation.arm_terms import LINKS
from armload_identification.identification_errors import EstimationError
from armload_identification.model.base_parameters import base_columns
from armload_identification.model.payload import InertialParameters
from armload_identification.model.regressor import body_regressor

pytestmark = pytest.mark.pure

N = 6


def states(count=400, seed=9):
    """Random states up to 1 rad/s and 1 rad/s2."""
    rng = np.random.default_rng(seed)
    return rng.uniform(-np.pi, np.pi, (count, N)), *rng.uniform(-1.0, 1.0, (2, count, N))


def identified(calibration, chain, links):
    """The calibration of an arm with these links, as base parameters."""
    base = base_columns(chain, np.eye(N))[: 10 * N]
    columns = body_regressor(chain, *states()).reshape(-1, 10 * N)
    theta = np.zeros(10 * N)
    theta[base] = np.linalg.lstsq(columns[:, base], columns @ links.ravel())[0]
    body = replace(calibration.body, links=theta.reshape(N, 10), base=base.reshape(N, 10))
    arm = replace(calibration, body=body, covariance=np.zeros((6 * N + int(base.sum()) + 3,) * 2))
    at = arm.place(LINKS)
    arm.covariance[at, at] = np.diag(np.linspace(0.01, 0.09, base.sum()) ** 2)
    return arm


@pytest.fixture
def links(any_body):
    """Links that can exist."""
    rng = np.random.default_rng(3)
    return np.array([any_body(rng).theta for _ in range(N)])


def test_the_torque_of_links_that_exist_is_met_exactly_by_possible_links(calibration, pinocchio_arm, links):
    chain = pinocchio_arm.chain
    arm = identified(calibration, chain, links)
    found = possible_links(chain, arm)
    assert found.exact
    assert found.off == 0.0
    assert found.left_nm.shape == (N,)
    assert found.left_nm.max() < 1e-8
    assert found.links.shape == (N, 10)
    assert all(InertialParameters(theta).is_physical for theta in found.links)
    columns = body_regressor(chain, *states(seed=1)).reshape(-1, 10 * N)
    np.testing.assert_allclose(columns @ found.links.ravel(), columns @ links.ravel(), atol=1e-8)
    again = possible_links(chain, arm)
    np.testing.assert_array_equal(again.links, found.links)


def test_of_the_many_links_with_one_torque_those_near_rods_are_chosen(calibration, pinocchio_arm, links):
    """A part that no torque shows may be anything: it must not make a link weigh tons, or nearly nothing."""
    found = possible_links(pinocchio_arm.chain, identified(calibration, pinocchio_arm.chain, links))
    assert (found.links[:, 0] > 0.05).all()
    assert found.links[:, 0].sum() < 10.0 * links[:, 0].sum()


def test_links_that_cannot_exist_become_the_nearest_that_can(calibration, pinocchio_arm, links):
    chain = pinocchio_arm.chain
    impossible = links.copy()
    impossible[5, 6] = -0.05  # the last link's inertia about its axis, which is identifiable
    arm = identified(calibration, chain, impossible)
    found = possible_links(chain, arm)
    assert not found.exact
    assert all(InertialParameters(theta).is_physical for theta in found.links)
    base = arm.body.base.ravel()
    columns = body_regressor(chain, *states(seed=1)).reshape(-1, 10 * N)
    moved = np.linalg.lstsq(columns[:, base], columns @ found.links.ravel())[0] - arm.body.links.ravel()[base]
    z = moved / arm.deviation(LINKS)
    assert found.off == pytest.approx(np.sqrt(np.mean(z**2)), rel=1e-3)
    left = (columns @ (found.links - arm.body.links).ravel()).reshape(-1, N)
    np.testing.assert_allclose(found.left_nm, np.sqrt(np.mean(left**2, axis=0)), rtol=0.3)


def test_where_firmer_links_cannot_be_computed_the_last_ones_serve(calibration, pinocchio_arm, links, monkeypatch):
    impossible = links.copy()
    impossible[5, 6] = -0.05
    arm = identified(calibration, pinocchio_arm.chain, impossible)
    best, nearest = possible_links(pinocchio_arm.chain, arm), module._nearest

    def possible_up_to(limit):
        weights = iter(module._WEIGHTS)

        def limited(*given):
            if next(weights) > limit:
                raise np.linalg.LinAlgError
            return nearest(*given)

        monkeypatch.setattr(module, "_nearest", limited)
        return possible_links(pinocchio_arm.chain, arm)

    found = possible_up_to(100.0)
    assert not found.exact
    assert best.off <= found.off < 1.2 * best.off + 0.1
    with pytest.raises(EstimationError, match="calibrate from more motion"):
        possible_up_to(1.0)
