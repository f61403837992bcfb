"""Doubt of a torque that is sampled once per cycle: a share of the payload's inertial torque."""

from types import SimpleNamespace

import numpy as np
import pytest

from armload_identification.estimation.sampled_torque import sampling_doubt
from armload_identification.model.regressor import payload_regressor

pytestmark = pytest.mark.pure


@pytest.mark.parametrize(("interval_s", "share"), [(0.01, 0.003), (0.05, 0.003), (0.005, 0.00075), (0.001, 0.00003)])
def test_it_grows_with_the_square_of_the_cycle_up_to_ten_milliseconds(pinocchio_arm, interval_s, share):
    rng = np.random.default_rng(1)
    q, dq, ddq = rng.uniform(-1.0, 1.0, (3, 20, 6))
    chain, theta = pinocchio_arm.chain, pinocchio_arm.payload.theta
    rows = SimpleNamespace(position_rad=q, payload=payload_regressor(chain, q, dq, ddq))
    moving = payload_regressor(chain, q, dq, ddq) @ theta
    still = payload_regressor(chain, q, 0.0 * q, 0.0 * q) @ theta
    found = sampling_doubt(rows, chain, theta, interval_s)
    assert found.shape == (1, 20, 6)
    np.testing.assert_allclose(found[0], share * (moving - still))
