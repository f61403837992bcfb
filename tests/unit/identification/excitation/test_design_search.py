"""The parts of a start: scaled variables, the Lagrangian and its slope, durations, and the way back into the limits."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from armload_identification.excitation.design_envelope import Envelope, ExcitationLimits
from armload_identification.excitation.design_search import PeriodRange, Search, SearchSettings, SlowRound
from armload_identification.excitation.fourier import FourierTrajectory
from armload_identification.excitation.geometry.cartesian_speed import ArmPoints, SpeedLimit
from armload_identification.excitation.geometry.workspace import Workspace
from armload_identification.excitation.information import named_criterion
from armload_identification.excitation.torque_limits import TorqueLimits
from armload_identification.identification_errors import ExcitationError
from armload_identification.model.chain import Chain
from armload_identification.model.payload import InertialParameters

pytestmark = pytest.mark.pure

# Two joints about parallel horizontal axes, half a metre apart; the tool is another half metre away.
ARM = Chain.from_modified_dh([[0.0, 0.0, 0.0, 0.0], [0.0, 0.5, 0.0, 0.0]], np.eye(4), [0.0, -9.81, 0.0])
PAYLOAD = InertialParameters.from_center_of_mass(2.0, [0.1, 0.05, 0.0], 0.02 * np.eye(3))
LIMITS = ExcitationLimits(
    np.array([-1.0, -9.0]), np.array([3.0, 9.0]), np.array([0.5, 100.0]), np.full(2, 1e3), np.full(2, 1e4)
)
TIP = SpeedLimit(ArmPoints(ARM, np.array([0.5, 0.0, 0.0])), 0.25)


def envelope(limits: ExcitationLimits = LIMITS) -> Envelope:
    strong = TorqueLimits.from_share(ARM, np.zeros(2), PAYLOAD, np.full(2, 1e4))
    return Envelope(limits, strong, Workspace(ARM))


ONE = PeriodRange(8.0, 8.0, 8.0)


def search(periods: PeriodRange = ONE, slow: SlowRound | None = None, limits: ExcitationLimits = LIMITS) -> Search:
    criterion = named_criterion("a-optimal", ARM, np.ones(2), PAYLOAD)
    return Search(criterion, envelope(limits), SearchSettings(2, periods, 0, 1, slow))


def path(offset, sine, frequency_hz: float = 0.125) -> FourierTrajectory:
    """A motion of both joints with one sine each."""
    sin = np.column_stack([sine, np.zeros(2)])
    return FourierTrajectory(frequency_hz, np.array(offset, dtype=float), sin, np.zeros((2, 2)))


@pytest.mark.parametrize(
    ("periods", "allowed"),
    [
        ((2.0, 2.0, 2.0), True),
        ((1e-3, 2.0, 1e-3), True),
        ((2.0, 5.0, 5.1), False),
        ((0.0, 5.0, 1.0), False),
        ((2.0, 1.9, 1.0), False),
        ((2.0, np.inf, 1.0), False),
    ],
)
def test_a_range_of_periods_has_two_ends_above_zero_and_a_step_up_to_the_longest(periods, allowed):
    if allowed:
        assert PeriodRange(*periods).longest_s == periods[1]
    else:
        with pytest.raises(ExcitationError, match="expected 0 < shortest <= longest"):
            PeriodRange(*periods)


def test_settings_are_numbers_above_zero():
    for harmonics, restarts in ((0, 1), (1, 0)):
        with pytest.raises(ExcitationError, match="expected"):
            SearchSettings(harmonics, PeriodRange(20.0, 20.0, 20.0), 0, restarts)


def test_a_variable_of_one_is_half_a_range_or_the_amplitude_that_reaches_the_speed_limit():
    """Of joint 1 0.5 rad/s over 2 pi/8 s, 0.637 rad and half of it; of joint 2 half the range, 9 rad."""
    one = search(PeriodRange(4.0, 16.0, 0.5))
    x = np.append(np.ones(10), 0.0)
    found = one._trajectory(x)
    assert found.period_s == pytest.approx(8.0)
    np.testing.assert_allclose(found.offset_rad, [1.0 + 2.0, 0.0 + 9.0])
    np.testing.assert_allclose(found.sin_rad, [[0.6366, 0.3183], [9.0, 9.0]], atol=1e-4)
    np.testing.assert_allclose(found.cos_rad, found.sin_rad)
    assert one._trajectory(np.append(np.ones(10), one._half_span)).period_s == pytest.approx(4.0)
    assert one._trajectory(np.append(np.ones(10), -one._half_span)).period_s == pytest.approx(16.0)


def test_the_grid_has_the_states_of_the_motion():
    one = search(PeriodRange(4.0, 16.0, 0.5))
    x = np.random.default_rng(1).normal(size=11)
    states, motion = one._states(x), one._trajectory(x)
    count = states.shape[1]
    assert count == 24 * 2, "samples per harmonic"
    np.testing.assert_allclose(states, motion.evaluate(np.arange(count) * motion.period_s / count), atol=1e-9)


def test_the_lagrangian_is_the_logarithm_of_the_cost_and_what_its_multipliers_ask_with_its_slope():
    one = search(PeriodRange(4.0, 16.0, 0.5), SlowRound(TIP, 0.25, 30.0))
    rng = np.random.default_rng(3)
    x = 0.3 * rng.normal(size=11)
    states = one._states(x)
    multipliers = rng.uniform(0.0, 0.5, (states.shape[1], one._envelope.rows))
    reserve, penalty = rng.uniform(0.0, 0.4, one._envelope.rows), 0.7
    value, slope, cost = one._lagrangian(x, multipliers, reserve, penalty)
    active = np.maximum(0.0, multipliers + 0.7 * (one._envelope.excess(states) + reserve))
    lasts_s = one._duration(states, 8.0 / np.exp(x[-1]))[0]
    expected = np.log(cost) + np.log(lasts_s) + (np.sum(active**2) - np.sum(multipliers**2)) / 1.4
    assert value == pytest.approx(expected, rel=1e-12)
    assert 0 < np.count_nonzero(active) < active.size
    for place in range(11):
        step = np.zeros(11)
        step[place] = 1e-6
        ahead, behind = (one._lagrangian(x + sign * step, multipliers, reserve, penalty)[0] for sign in (1, -1))
        assert slope[place] == pytest.approx((ahead - behind) / 2e-6, rel=2e-4, abs=1e-4)
    still = one._lagrangian(np.zeros(11), multipliers, reserve, penalty)
    assert (still[0], still[2]) == (np.inf, np.inf)
    assert not still[1].any()


def test_a_slow_round_takes_as_long_as_its_speed_limit_and_rate_require():
    """Joint 1 at 1 rad/s with the arm stretched: the tool at 1 m/s, four times the limit; at rest rate 0.5 counts."""
    assert search()._duration(np.zeros((4, 6, 2)), 8.0)[:2] == (1.0, 0.0)
    one = search(slow=SlowRound(TIP, 0.5, 30.0))
    states = np.zeros((4, 6, 2))
    lasts_s, slowly_s, slope = one._duration(states, 8.0)
    assert (lasts_s, slowly_s) == pytest.approx((46.0, 16.0))
    assert not slope.any()
    states[1, :3, 0] = [1.0, -1.0, 0.4]
    lasts_s, slowly_s, slope = one._duration(states, 8.0)
    assert (lasts_s, slowly_s) == pytest.approx((30.0 + 8.0 / 6.0 * (4.0 + 4.0 + 3 * 2.0 + 2.0), 8.0 / 6.0 * 16.0))
    np.testing.assert_allclose(slope[1, :, 0], [8.0 / 6.0 * 4.0, -8.0 / 6.0 * 4.0, 0.0, 0.0, 0.0, 0.0], atol=1e-12)


@pytest.mark.parametrize(("period_s", "expected_s"), [(7.93, 8.0), (8.0, 8.0), (8.01, 8.1), (8.0 + 1e-10, 8.0)])
def test_the_period_becomes_the_next_longer_multiple_of_the_step(period_s, expected_s):
    found = search(PeriodRange(4.0, 16.0, 0.1))._with_period_in_steps(path([1.0, 0.0], [0.1, 0.1], 1.0 / period_s))
    assert found.period_s == pytest.approx(expected_s, rel=1e-12)


@pytest.mark.parametrize(
    ("amplitude", "share"),
    [(0.9, 1.0), (1.01, 0.99), (1.00005, 0.9999), (1.1, 0.865), (3.0, 0.5444)],
)
def test_a_motion_is_made_smaller_until_all_limits_hold_but_not_below_half(amplitude, share):
    """Beyond by 10 %: less by 2, 4, 6, 9 and, as 1.1 x 0.91 is still too much, by half of that more, 13.5 %.

    The last before half is 45.6 %.
    """
    motion = path([1.0, 0.0], [0.0, 9.0 * amplitude])
    smaller, worst = search(limits=replace(LIMITS, velocity_max_rad_s=np.full(2, 1e3)))._shrunk_within_limits(motion)
    assert bool(worst.max() <= 0.0) is (amplitude < 2.0)
    assert smaller.sin_rad[1, 0] / motion.sin_rad[1, 0] == pytest.approx(share, abs=1e-4)
    np.testing.assert_array_equal(smaller.offset_rad, motion.offset_rad)


def begun_nearby(motion: FourierTrajectory, limits: ExcitationLimits = LIMITS, **slow) -> FourierTrajectory:
    one = search(limits=limits, **slow)
    around = motion.offset_rad - one._middle
    x = np.column_stack([around, motion.sin_rad, motion.cos_rad]) / one._scale
    return one._begun_nearby(np.append(x.ravel(), 0.0))


def test_a_motion_begins_where_the_way_from_the_middle_is_shortest_and_without_whole_turns():
    """Joint 2 turns by 1.5 sin(w t) about 2 pi + 0.3: nearest to 0 at sin = -0.2, whose sample is one of 48."""
    motion = path([1.0, 2.0 * np.pi + 0.3], [0.1, 1.5])
    np.testing.assert_allclose(begun_nearby(motion).offset_rad, motion.offset_rad)
    found = begun_nearby(motion, slow=SlowRound(TIP, 0.25, 30.0))
    np.testing.assert_allclose(found.offset_rad, [1.0, 0.3])
    before, after = (one.period(48).position_rad - [1.0, 0.0] for one in (motion, found))
    before[:, 1] -= 2.0 * np.pi
    way = TIP.points.speeds(after + np.array([1.0, 0.0]), after).max(axis=1)
    assert way[0] == pytest.approx(way.min())
    assert way[0] < 0.5 * way[24]
    behind = [np.abs(np.roll(before, -start, axis=0) - after).max() for start in range(48)]
    assert min(behind) < 1e-9, "the same path"


def test_whole_turns_stay_if_a_limit_forbids_the_other_place():
    """From 4.8 to 9.3 rad about 7.8; a turn back begins at -1.5 rad, below the range of joint 2."""
    motion = replace(path([1.0, 7.795], [0.1, 2.0]), cos_rad=np.array([[0.0, 0.0], [0.0, 1.0]]))
    for least, offset in ((0.0, 7.795), (-1.6, 7.795 - 2.0 * np.pi)):
        limits = replace(LIMITS, position_min_rad=np.array([-1.0, least]), position_max_rad=np.array([3.0, 9.3]))
        limits = replace(limits, velocity_max_rad_s=np.full(2, 100.0))
        found = begun_nearby(motion, limits, slow=SlowRound(TIP, 0.25, 30.0))
        assert found.offset_rad[1] == pytest.approx(offset)


def test_the_cost_of_a_motion_is_that_of_its_samples_over_its_period():
    one = search()
    motion = path([1.0, 0.0], [0.4, 0.8])
    criterion = named_criterion("a-optimal", ARM, np.ones(2), PAYLOAD)
    state = motion.evaluate(np.arange(48) / 6.0)
    assert one.cost_of(criterion, motion) == pytest.approx(criterion.cost(*state[:3], 8.0))


def test_a_start_ends_within_the_limits_and_scores_the_cost_times_the_duration_of_its_run():
    slow = search(PeriodRange(4.0, 16.0, 0.5), SlowRound(TIP, 0.25, 30.0))
    attempt = slow.run(np.random.SeedSequence(2))
    motion = attempt.trajectory
    assert motion.period_s / 0.5 == pytest.approx(round(motion.period_s / 0.5))
    assert envelope().worst(motion).max() <= -1e-6
    state = motion.evaluate(np.arange(48) * motion.period_s / 48)
    lasts_s = slow._duration(np.stack(state[:2]), motion.period_s)[0]
    assert attempt.score == pytest.approx(attempt.cost * motion.period_s / 8.0 * lasts_s)
    assert attempt.history[-1] == pytest.approx(attempt.cost, rel=0.05)
    assert (attempt.excess, attempt.problem) == (0.0, "")
