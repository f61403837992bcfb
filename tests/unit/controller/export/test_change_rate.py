"""The shortest transition of a payload, against the torque of changes at many poses."""

import numpy as np
import pytest

from armload_controller.config.robot import load_robot
from armload_controller.export.c_code.change_rate import change_rate
from armload_identification.model.regressor import payload_regressor

RATE_NM_S = np.array([100.0, 200.0, 50.0, 20.0, 10.0, 5.0])


@pytest.fixture(scope="module", params=["er50", "prbt"])
def chain(request):
    return load_robot(request.param).chain


def slowest_s(columns_nm):
    """1.5 times the mean rate is the greatest, joint by joint and pose by pose."""
    return 1.5 * np.abs(columns_nm).max(axis=0) / RATE_NM_S


def payload_columns(chain):
    """Torque per unit of a payload's parameters at many poses at rest."""
    q = np.random.default_rng(1).uniform(-np.pi, np.pi, (3000, 6))
    return payload_regressor(chain, q, np.zeros_like(q), np.zeros_like(q))


def test_no_pose_needs_a_longer_transition_of_a_moment(chain):
    found = slowest_s(np.linalg.norm(payload_columns(chain)[:, :, 1:4], axis=2)).max()
    bound = change_rate(chain, RATE_NM_S)[1]
    assert bound / 1.05 < found <= bound * (1.0 + 1e-9)


def test_no_pose_needs_a_longer_transition_of_a_mass():
    """At the last frame's origin, which is the flange of er50."""
    chain = load_robot("er50").chain
    found = slowest_s(payload_columns(chain)[:, :, 0]).max()
    bound = change_rate(chain, RATE_NM_S)[0]
    assert bound / 2.5 < found <= bound * (1.0 + 1e-9)


def test_twice_the_rate_takes_half_the_time(chain):
    one, two = change_rate(chain, RATE_NM_S), change_rate(chain, 2.0 * RATE_NM_S)
    assert two == pytest.approx([0.5 * each for each in one])
    assert one[1] == pytest.approx(1.5 * 9.81 / 5.0, rel=1e-3)
