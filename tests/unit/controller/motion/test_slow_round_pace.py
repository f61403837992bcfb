"""The pace of a slow round: the same path, at most a quarter of the rate and reduced speed, and no slower than that."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from armload_controller.config.robot import load_robot
from armload_controller.motion.paths import PhaseLimits, bound_phase
from armload_controller.motion.slow_round_pace import Pace, _pace_above, reduced_pace
from armload_identification.excitation.geometry.cartesian_speed import ArmPoints, SpeedLimit

PLANNED_SPEED_M_S, REDUCED_SPEED_M_S = 0.245, 0.25

ROBOT = load_robot("er50")
PATH = ROBOT.excitations["identification"].trajectory
POINTS = ArmPoints(ROBOT.chain, np.array([0.0, 0.0, 0.2]))
SPEED = SpeedLimit(POINTS, REDUCED_SPEED_M_S)
BOUNDS = bound_phase(PATH, ROBOT.limits.motion)
PACED, PHASE = reduced_pace(PATH, BOUNDS, SPEED)


@settings(max_examples=60, deadline=None)
@example([1.0, 1.0, 11.0, 1.0, 1.0, 1.0, 1.0, 1.0], 1.4375)
@given(st.lists(st.floats(1.0, 50.0), min_size=8, max_size=8), st.floats(-50.0, 50.0))
def test_the_new_phase_and_the_paths_belong_together(slowness, path_s):
    pace = Pace(3.0, np.array(slowness))
    phase_s = pace.phase_of(path_s)
    found, rate, _, _ = pace.evaluate(np.array(phase_s))
    assert float(found) == pytest.approx(path_s, abs=1e-9)
    assert min(slowness) * (1 - 1e-9) <= 1.0 / float(rate) <= max(slowness) * (1 + 1e-9)
    assert pace.phase_of(path_s + 3.0) - phase_s == pytest.approx(pace.lasts_s)


@pytest.mark.parametrize("samples", [8, 16, 64])
@pytest.mark.parametrize("seed", range(3))
def test_between_samples_the_slowness_keeps_to_its_bounds_which_are_close(samples, seed):
    """Closer with more samples: by the square of their distance for w, by the distance itself for w'."""
    pace = Pace(3.0, np.random.default_rng(seed).uniform(2.0, 5.0, 8))
    least, first, second = pace.bounds(samples)
    fine = 100
    knots_s = np.linspace(0.0, 3.0, samples * fine + 1)
    _, rate, change, third = pace.evaluate(np.array([pace.phase_of(path_s) for path_s in knots_s[:-1]]))
    w, slope = 1.0 / rate, -change / rate**3
    bend = (3.0 * slope**2 - third / rate**5) / w

    def of_intervals(values):
        values = np.append(values, values[0])
        return np.array([values[fine * k : fine * k + fine + 1] for k in range(samples)])

    step_s = 3.0 / samples
    np.testing.assert_allclose(second, np.abs(of_intervals(bend)).max(axis=1), rtol=1e-3, atol=1e-3)
    true_first = np.abs(of_intervals(slope)).max(axis=1)
    assert (first >= true_first - 1e-9).all()
    assert (first <= true_first + second * step_s / 2.0 + 1e-9).all()
    true_least = of_intervals(w).min(axis=1)
    assert (least <= true_least + 1e-9).all()
    assert (least >= true_least - second * step_s**2 / 8.0 - 1e-9).all()
    g, of_first, of_second = pace.rates
    assert (rate.max(), np.abs(change).max(), np.abs(third).max()) <= (g, of_first, of_second)
    assert g == pytest.approx(rate.max(), rel=1e-4)
    assert of_first == pytest.approx(np.abs(change).max(), rel=0.05)


@pytest.mark.parametrize("order", range(3))
def test_derivatives_to_the_new_phase_are_those_of_finite_differences(order):
    names = ("position_rad", "velocity_rad_s", "acceleration_rad_s2", "jerk_rad_s3")
    phase_s = np.linspace(-20.0, 150.0, 301)
    step = 1e-4
    ahead, behind = (getattr(PACED.evaluate(phase_s + side * step), names[order]) for side in (1.0, -1.0))
    expected = getattr(PACED.evaluate(phase_s), names[order + 1])
    np.testing.assert_allclose((ahead - behind) / (2.0 * step), expected, atol=1e-5)


def test_the_arm_is_nowhere_on_another_path():
    s, *_ = PACED.pace.evaluate(np.linspace(0.0, PACED.pace.lasts_s, 1001))
    assert np.all(np.diff(s) > 0.0)
    assert (s[0], s[-1]) == pytest.approx((0.0, PATH.period_s))
    np.testing.assert_array_equal(
        PACED.evaluate(50.0).position_rad, PATH.evaluate(PACED.pace.evaluate(50.0)[0]).position_rad
    )


def test_no_point_is_fast_and_the_rate_is_a_quarter_at_most():
    phase_s = np.linspace(0.0, PACED.pace.lasts_s, 20001)
    state = PACED.evaluate(phase_s)
    speed = POINTS.speeds(state.position_rad, state.velocity_rad_s).max(axis=1)
    rate = PACED.pace.evaluate(phase_s)[1]
    assert speed.max() <= PLANNED_SPEED_M_S
    assert rate.max() <= 0.25
    # It is at one of the two limits nearly all the time, as far as the joints' limits permit.
    assert np.mean((speed > 0.95 * PLANNED_SPEED_M_S) | (rate > 0.95 * 0.25)) > 0.8


def test_the_paths_phase_keeps_to_its_bounds_whatever_the_new_phase_does():
    """At the worst-case speed, acceleration and jerk of the new phase, everywhere on the round."""
    _, g, second, third = PACED.pace.evaluate(np.linspace(0.0, PACED.pace.lasts_s, 20001))
    alpha, beta = PHASE.acceleration_1_s, PHASE.jerk_1_s2
    assert (np.abs(second) + g * alpha).max() <= BOUNDS.acceleration_1_s
    assert (np.abs(third) + 3.0 * np.abs(second) * alpha + g * beta).max() <= BOUNDS.jerk_1_s2
    assert (second.max(), third.max()) <= PACED.pace.rates[1:]


@pytest.mark.parametrize(("acceleration", "jerk"), [(0.01, 1e-4), (1e-3, 100.0), (1.0, 1e-6)])
def test_where_the_joints_allow_no_varying_pace_it_is_a_constant_one(acceleration, jerk):
    tight = PhaseLimits(acceleration * BOUNDS.acceleration_1_s, jerk * BOUNDS.jerk_1_s2)
    paced, phase = reduced_pace(PATH, tight, SPEED)
    _, g, second, third = paced.pace.evaluate(np.linspace(0.0, paced.pace.lasts_s, 101))
    assert np.ptp(g) < 1e-12
    assert np.abs([second, third]).max() < 1e-9
    assert g[0] * phase.acceleration_1_s == pytest.approx(tight.acceleration_1_s)
    assert paced.pace.lasts_s > PACED.pace.lasts_s


def test_an_arm_that_is_never_fast_goes_at_a_quarter():
    slow = replace(PATH, base_frequency_hz=0.02 * PATH.base_frequency_hz)
    paced, _ = reduced_pace(slow, bound_phase(slow, ROBOT.limits.motion), SPEED)
    assert paced.pace.lasts_s == pytest.approx(4.0 * slow.period_s)


@pytest.mark.parametrize(("name", "most_s"), [("er50", 150.0), ("prbt", 55.0)])
def test_the_shipped_arms_rounds_are_short(name, most_s):
    robot = load_robot(name)
    for excitation in robot.excitations.values():
        path = excitation.trajectory
        bounds = bound_phase(path, robot.limits.motion)
        paced, _ = reduced_pace(path, bounds, robot.motion_constraints.reduced_speed)
        assert paced.pace.lasts_s < most_s


@pytest.mark.parametrize("phase_rad", [0.0, 0.5, 2.0])
def test_a_pace_of_many_knots_takes_less_than_one_percent_longer_than_the_speed_requires(phase_rad):
    needed = 4.0 + np.sin(np.linspace(0.0, 2.0 * np.pi, 2048, endpoint=False) * 3.0 + phase_rad)
    pace = _pace_above(needed, 10.0, 256)
    assert (pace.bounds(2048)[0] >= needed).all()
    assert 40.0 < pace.lasts_s < 40.4


class Known(Pace):
    """A pace with given bounds between samples, or given rates."""

    def bounds(self, samples):
        assert samples == 2048
        return np.array([2.0, 1.0]), np.array([0.5, 0.2]), np.array([0.4, 0.1])


def test_rates_are_the_greatest_derivatives_of_the_paths_phase():
    """1/w; w'/w^3 of 0.0625 and 0.2; 3 w'^2/w^5 + w''/w^4 of 0.0484 and 0.22."""
    assert Known(3.0, np.ones(8)).rates == pytest.approx((1.0, 0.2, 0.22))


@pytest.mark.parametrize(
    ("rates", "expected"),
    [
        ((0.25, 0.1, 0.2), (3.6, 34.88)),  # (1 - 0.1) / 0.25; (10 - 0.2 - 3 0.1 3.6) / 0.25
        ((0.25, 0.5, 0.2), (2.0, 27.2)),  # (1 - 0.5) / 0.25; (10 - 0.2 - 3 0.5 2) / 0.25
        ((0.25, 0.501, 0.2), None),
        ((0.25, 0.1, 3.92), (3.6, 20.0)),
        ((0.25, 0.1, 3.921), None),
    ],
)
def test_half_of_the_phases_acceleration_and_jerk_may_be_used_by_a_varying_pace(monkeypatch, rates, expected):
    monkeypatch.setattr(Known, "rates", property(lambda pace: rates), raising=False)
    found = Known(3.0, np.ones(8)).within(PhaseLimits(1.0, 10.0))
    if expected is None:
        assert found is None
    else:
        assert (found.acceleration_1_s, found.jerk_1_s2) == pytest.approx(expected)


def test_a_constant_pace_is_a_stretched_path():
    pace = Pace(4.0, np.full(8, 2.5))
    assert pace.lasts_s == pytest.approx(10.0)
    s, first, second, third = pace.evaluate(np.array([-2.5, 0.0, 1.0, 12.5]))
    np.testing.assert_allclose(s, [-1.0, 0.0, 0.4, 5.0], atol=1e-12)
    np.testing.assert_allclose(first, 0.4)
    np.testing.assert_allclose([second, third], 0.0, atol=1e-12)
    least, slope, bend = pace.bounds(16)
    np.testing.assert_allclose([least, slope, bend], np.outer([2.5, 0.0, 0.0], np.ones(16)), atol=1e-12)


def test_one_coefficient_has_four_sixths_of_its_weight_at_its_knot_and_one_sixth_beside_it():
    """The cubic B-spline: at knot k + 2 of coefficient k; w' = 0 there and 1/2 per knot beside, w'' = -2 per knot^2."""
    slowness = np.ones(8)
    slowness[1] = 7.0
    pace = Pace(8.0, slowness)
    phases = np.array([pace.phase_of(float(knot)) for knot in (1, 2, 3, 4, 5)])
    _, first, second, third = pace.evaluate(phases)
    w = 1.0 / first
    np.testing.assert_allclose(w, [1.0, 2.0, 5.0, 2.0, 1.0])
    slope = -second * w**3
    np.testing.assert_allclose(slope, [0.0, 3.0, 0.0, -3.0, 0.0], atol=1e-12)
    np.testing.assert_allclose((3.0 * slope**2 - third * w**5) / w, [0.0, 6.0, -12.0, 6.0, 0.0], atol=1e-9)
    assert pace.lasts_s == pytest.approx(7.0 + 7.0), "the mean of the coefficients, 14 / 8, over 8 s"
