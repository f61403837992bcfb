"""Uncertain gains: estimated where the data contradict them, with errors that are never hidden."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from armload_identification.estimation.uncertainty import derived
from armload_identification.pipeline.payload_identification import identify
from armload_identification.pipeline.payload_validation import gains_to_compare_by
from armload_identification.verdict.agreement import Known, Outcome, compare_known
from armload_identification.verdict.tolerance import Tolerance
from benchmarks.arms.sagging_panda import PAYLOAD, Effects, SaggingPanda, chain, nominal_transmission

OFF = 0.05
WRONG = 3


@pytest.fixture(scope="module")
def panda():
    return SaggingPanda(Effects(noise=0.2))


@pytest.fixture(scope="module")
def found(panda):
    """Identify a seed's pair, by default with nominal gains of one; those results are cached."""

    @cache
    def pair(seed, off, joint):
        return panda.pair(seed, np.where(np.arange(7) == joint, off, 0.0), with_phase=True)

    @cache
    def by_nominal(seed, off, joint):
        return identify(*pair(seed, off, joint), chain(), nominal_transmission(exact=False))

    def found(seed, off=0.0, transmission=None, joint=WRONG):
        if transmission is None:
            return by_nominal(seed, off, joint)
        return identify(*pair(seed, off, joint), chain(), transmission)

    return found


@pytest.mark.parametrize(("joint", "off"), [(WRONG, OFF), (1, -OFF)])
def test_a_gain_that_is_off_is_named_with_its_size(found, joint, off):
    """Joint 2 carries most of the payload: while its gain is fixed, the residual looks like noise."""
    result = found(1, off, joint=joint)
    assert np.flatnonzero(result.gains.contradicted).tolist() == [joint]
    assert abs(result.gains.log_gain[joint] - np.log1p(off)) < result.gains.half_width_95[joint]
    assert result.gains.half_width_95[joint] < OFF
    (note,) = [note for note in result.notes if "contradict" in note]
    assert f"joint {joint + 1}" in note
    size = np.expm1(result.gains.log_gain[joint])
    assert f"it is {100.0 * abs(size):.1f} % {'higher' if size > 0.0 else 'lower'} than assumed" in note
    held = np.abs(result.uncertainty.values - PAYLOAD.values) <= result.uncertainty.half_width_95
    assert held[:4].all()


@pytest.mark.parametrize(
    "off", [-0.2, 0.2, *(pytest.param(off, marks=pytest.mark.long) for off in (-0.1, -0.05, 0.05, 0.1))]
)
@pytest.mark.parametrize("joint", [1, WRONG])
def test_a_larger_error_is_named_as_a_smaller_one_is(found, joint, off):
    """The residual of a fixed gain grows with its error: judged against it, 10 % on joint 2 would remain undetected."""
    gains = found(1, off, joint=joint).gains
    assert np.flatnonzero(gains.contradicted).tolist() == [joint]
    assert abs(gains.log_gain[joint] - np.log1p(off)) < gains.half_width_95[joint]
    assert (gains.noticeable[~gains.contradicted] < 0.055).all()


def test_the_next_suspect_is_tried_where_one_is_as_assumed(panda):
    """Fixed, joint 4 looks worse than joint 2, whose error is three times as large; free, joint 4 is as assumed."""
    log_gain = np.array([0.0, np.log(1.12), 0.0, np.log(1.038), 0.0, 0.0, 0.0])
    pair = panda.pair(1, np.expm1(log_gain), with_phase=True)
    gains = identify(*pair, chain(), nominal_transmission(exact=False)).gains
    assert np.flatnonzero(gains.contradicted).tolist() == [1]
    assert not gains.beyond.any()
    assert (np.abs(gains.log_gain - log_gain) < gains.half_width_95).all()


def test_more_gains_off_than_can_be_judged_are_reported(panda):
    """Three of seven: the data do not show which are right, and the third keeps its prior."""
    off = np.array([0.0, -0.12, 0.12, 0.12, 0.0, 0.0, 0.0])
    result = identify(*panda.pair(1, off, with_phase=True), chain(), nominal_transmission(exact=False))
    assert np.flatnonzero(result.gains.contradicted).tolist() == [2, 3]
    assert np.flatnonzero(result.gains.beyond).tolist() == [1]
    (note,) = [note for note in result.notes if "more than a third" in note]
    assert note.startswith("The data contradict the drive gains of joints 2 to 4.")


@pytest.mark.parametrize("seed", range(3))
def test_exact_gains_raise_no_alarm(found, seed):
    result = found(seed)
    assert not result.gains.contradicted.any()
    assert not result.gains.beyond.any()
    assert not any("contradict" in note for note in result.notes)
    assert (np.abs(result.gains.log_gain) <= result.gains.half_width_95).all()


def test_gains_that_a_pair_cannot_judge_are_named():
    """With the arm's full noise, joint 1, whose axis is vertical, hardly shows the payload."""
    result = identify(*SaggingPanda().pair(0, with_phase=True), chain(), nominal_transmission(exact=False))
    assert (result.gains.noticeable[1:6] < 0.06).all()
    (note,) = [note for note in result.notes if "cannot check" in note]
    assert re.search(r"joint 1 \(up to \d+ %\):", note)


@pytest.mark.long
def test_a_limit_holds_whatever_the_error():
    """With three times the noise joint 1 is measured poorly: only errors beyond the limit are reported."""
    panda = SaggingPanda(Effects(noise=3.0))

    def upright_off(seed, off):
        pair = panda.pair(seed, np.where(np.arange(7) == 0, off, 0.0), with_phase=True)
        return identify(*pair, chain(), nominal_transmission(exact=False))

    within, beyond, unlimited = upright_off(2, 0.2), upright_off(2, 0.8), upright_off(0, 0.2)
    assert not within.gains.contradicted.any()
    assert np.flatnonzero(beyond.gains.contradicted).tolist() == [0]
    assert np.log(1.2) < beyond.gains.noticeable[0] < 1.15 * within.gains.noticeable[0] < np.log(1.6)
    assert any(
        f"joints 1 (up to {100.0 * np.expm1(within.gains.noticeable[0]):.0f} %)" in note for note in within.notes
    )
    limited, at_all = (note for note in unlimited.notes if "cannot check the drive gain of" in note)
    assert "of joint 7 (up to 17 %): only a larger error is reported" in limited
    assert "of joint 1 at all: even an error of 50 % may go unreported." in at_all


def test_gains_that_are_known_are_not_fitted(found):
    assert found(1, transmission=nominal_transmission(exact=True)).gains is None


def test_the_scale_stays_what_was_assumed(found):
    """All gains 1 % higher: the data cannot show it, the mass is 1 % higher and its interval as wide."""
    higher = replace(nominal_transmission(exact=False), gain_nm_a=np.full(7, 1.01))
    one, other = found(1), found(1, transmission=higher)
    assert other.parameters.mass_kg / one.parameters.mass_kg == pytest.approx(1.01, abs=2e-4)
    np.testing.assert_allclose(other.gains.log_gain, one.gains.log_gain, atol=1e-3)


def test_what_another_gain_does_is_in_the_slopes(found):
    """2 % on one assumed gain changes the values by 2 % of its slope; all gains together change only the mass."""
    nominal = nominal_transmission(exact=False)
    one = found(1)
    slope = derived(one.parameters)[1][:4] @ one.gains.slope[:10]
    for axis in (1, WRONG):
        gain = np.ones(7)
        gain[axis] = np.exp(0.02)
        other = found(1, transmission=replace(nominal, gain_nm_a=gain))
        change = (other.parameters.values - one.parameters.values)[:4] / 0.02
        np.testing.assert_allclose(slope[:, axis], change, rtol=0.15, atol=0.006)
    np.testing.assert_allclose(slope.sum(axis=1), [PAYLOAD.mass_kg, 0, 0, 0], atol=0.01)


def test_held_at_the_gains_that_were_found_the_payload_is_the_same(found):
    """So a second pair can be compared with the first by common gains; fixed gains have their full slope."""
    one = found(1)
    nominal, share = nominal_transmission(exact=False), one.mass_center
    same = found(1, transmission=nominal.held_at(share.gain_nm_a, share.gain_covariance))
    assert same.gains is None
    assert same.mass_center.same_gains_as(share)
    deviation = np.sqrt(np.diag(share.measured))
    assert (np.abs(same.parameters.values - one.parameters.values)[:4] < 0.5 * deviation).all()
    for axis in (1, WRONG):
        gain = share.gain_nm_a.copy()
        gain[axis] *= np.exp(0.001)
        other = found(1, transmission=nominal.held_at(gain, share.gain_covariance))
        change = (other.parameters.values - same.parameters.values)[:4] / 0.001
        np.testing.assert_allclose(same.mass_center.gain_slope[:, axis], change, rtol=0.2, atol=0.01)
    for each in (share, same.mass_center):
        np.testing.assert_allclose(each.gain_slope.sum(axis=1), [PAYLOAD.mass_kg, 0, 0, 0], atol=0.02)
    whole = share.measured + share.from_gains
    assert one.uncertainty.half_width_95[0] == pytest.approx(1.96 * np.sqrt(whole[0, 0]), rel=0.1)


def test_a_second_pair_is_compared_by_the_gains_of_the_first(found):
    """With gains estimated from each pair, their noise is in the difference too."""
    first, nominal = found(1, OFF), nominal_transmission(exact=False)
    alone, compared = found(2, OFF), found(2, OFF, gains_to_compare_by(first.mass_center, nominal))
    judged = Known(first.parameters, first.mass_center)
    by_own, by_one = (
        compare_known(judged, Known(second.parameters, second.mass_center), Tolerance()) for second in (alone, compared)
    )
    assert by_one.outcome is Outcome.RIGHT
    assert by_one.noticeable_kg < 0.7 * by_own.noticeable_kg
