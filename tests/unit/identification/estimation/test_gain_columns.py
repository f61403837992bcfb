"""Gains that are not exactly known: found where the data contradict them, and no error of theirs is hidden."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from armload_identification.pipeline.payload_identification import identify
from benchmarks.sagging_panda import PAYLOAD, Effects, SaggingPanda, chain, nominal_transmission

pytestmark = pytest.mark.pure

OFF = 0.05
WRONG = 3


@pytest.fixture(scope="module")
def panda():
    return SaggingPanda(Effects(noise=0.2))


def found(panda, seed, error, transmission=None):
    return identify(
        *panda.pair(seed, error, with_phase=True), chain(), transmission or nominal_transmission(exact=False)
    )


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_gain_that_is_off_is_named_with_its_size(panda, sign):
    error = np.zeros(7)
    error[WRONG] = sign * OFF
    result = found(panda, 1, error)
    assert np.flatnonzero(result.gains.contradicted).tolist() == [WRONG]
    assert abs(result.gains.log_gain[WRONG] - np.log1p(error[WRONG])) < result.gains.half_width_95[WRONG]
    assert result.gains.half_width_95[WRONG] < OFF
    (note,) = [note for note in result.notes if "contradict" in note]
    assert "joint 4" in note
    assert f"{np.expm1(result.gains.log_gain[WRONG]):+.1%}" in note
    held = np.abs(result.uncertainty.values - PAYLOAD.values) <= result.uncertainty.half_width_95
    assert held[:4].all()


@pytest.mark.parametrize("seed", range(3))
def test_exact_gains_raise_no_alarm(panda, seed):
    result = found(panda, seed, None)
    assert not result.gains.contradicted.any()
    assert not any("contradict" in note for note in result.notes)
    assert (np.abs(result.gains.log_gain) <= result.gains.half_width_95).all()


def test_gains_that_are_known_are_not_fitted(panda):
    assert found(panda, 1, None, nominal_transmission(exact=True)).gains is None


def test_the_scale_stays_what_was_assumed(panda):
    """All gains 1 % higher: nothing in the data says so, the mass is 1 % higher and its interval as wide."""
    nominal = nominal_transmission(exact=False)
    one, other = (found(panda, 1, None, replace(nominal, gain_nm_a=gain * np.ones(7))) for gain in (1.0, 1.01))
    assert other.parameters.mass_kg / one.parameters.mass_kg == pytest.approx(1.01, abs=2e-4)
    np.testing.assert_allclose(other.gains.log_gain, one.gains.log_gain, atol=1e-3)


def test_the_share_of_the_gains_is_what_another_gain_does(panda):
    """2 % on one assumed gain move mass and centre of mass by 2 % of the slope, and all together the mass alone."""
    nominal = nominal_transmission(exact=False)
    one = found(panda, 1, None)
    for axis in (1, WRONG):
        gain = np.ones(7)
        gain[axis] = np.exp(0.02)
        other = found(panda, 1, None, replace(nominal, gain_nm_a=gain))
        change = (other.parameters.values - one.parameters.values)[:4] / 0.02
        np.testing.assert_allclose(one.mass_center.gain_slope[:, axis], change, rtol=0.15, atol=0.006)
    np.testing.assert_allclose(one.mass_center.gain_slope.sum(axis=1), [PAYLOAD.mass_kg, 0, 0, 0], atol=0.01)
    whole = one.mass_center.measured + one.mass_center.from_gains
    assert one.uncertainty.half_width_95[0] == pytest.approx(1.96 * np.sqrt(whole[0, 0]), rel=0.05)
