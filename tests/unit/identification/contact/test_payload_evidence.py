"""The look for another payload: what changes with the motion, where the mean of no window is far from zero."""

import numpy as np
import pytest

from armload_identification.contact.arm_memory import RememberedState
from armload_identification.contact.contact_levels import SUSPECT
from armload_identification.contact.force_rows import ForceRows
from armload_identification.contact.load_or_push import payload_evidence
from armload_identification.contact.something_acts import ResidualNoise, acting

N, COUNT, SINCE_S = 3, 120, 0.6
NOISE = ResidualNoise(np.full(N, 0.01), np.full(N, 0.04))
NOTHING = RememberedState(0.0, np.zeros(10 + 3 * N), 1e-12 * np.eye(10 + 3 * N))


def rows(change, seed=1):
    """Rows of 20 ms in which the payload's torque swings, and the payload changes at `SINCE_S`."""
    rng, time_s = np.random.default_rng(seed), 0.02 * np.arange(COUNT)
    columns = np.zeros((COUNT, N, 10 + 3 * N))
    columns[:, :, 0] = np.sin(2.0 * np.pi * time_s / 0.8)[:, None]
    residual = rng.normal(0.0, 0.1, (COUNT, N)) + change * columns[:, :, 0] * (time_s > SINCE_S)[:, None]
    return ForceRows(
        time_s,
        np.zeros((COUNT, N)),
        residual,
        columns,
        np.zeros((COUNT, N)),
        np.zeros((COUNT, N)),
        np.ones((COUNT, N)),
        np.ones((COUNT, N)),
    )


def evidence(found):
    return payload_evidence(found, NOTHING, NOISE, float(found.time_s[-1]))


def test_a_light_payload_is_evident_before_any_window_shows_it():
    found = rows(0.4)
    assert all(acting(found.part(slice(k)), NOTHING, NOISE)[0] < 1.0 for k in range(1, COUNT + 1))
    assert evidence(found) > SUSPECT


@pytest.mark.parametrize("seed", range(5))
def test_noise_is_no_payload(seed):
    assert evidence(rows(0.0, seed)) < 0.0


def test_a_joint_that_has_just_started_is_no_payload():
    found = rows(0.0)
    found.columns[-5:, 0, 1] = 100.0
    found.residual_nm[-5:, 0] = 4.0
    assert evidence(found) > SUSPECT
    found.doubt_nm[-10:-5, 0] = 5.0
    assert evidence(found) < 0.0


def test_too_few_rows_are_no_evidence():
    assert evidence(rows(0.4).part(slice(-10, None))) == -np.inf
