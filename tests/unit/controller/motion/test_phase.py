"""The phase: pause, resume, override and stop change only its rate."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from armload_controller.motion.joint_limits import MotionLimits, check_setpoints
from armload_controller.motion.leg_interpolator import LegInterpolator
from armload_controller.motion.motion_control import MotionControl, OperatorStop
from armload_controller.motion.phase import PhaseState, Segment, ramp_to_grid, ramp_to_rate
from armload_controller.motion.setpoints import plan_measured, plan_slow
from armload_identification.excitation.fourier import Excitation, FourierTrajectory
from armload_identification.excitation.geometry.cartesian_speed import ArmPoints, SpeedLimit
from armload_identification.model.chain import Chain, pose_from_xyz_rpy
from tests.planned_leg import plan_leg

N = 2
CYCLE_S = 0.01
LIMITS = MotionLimits(
    joint_names=("base", "elbow"),
    position_min_rad=np.full(N, -2.0),
    position_max_rad=np.full(N, 2.0),
    velocity_max_rad_s=np.full(N, 1.0),
    acceleration_max_rad_s2=np.full(N, 4.0),
    jerk_max_rad_s3=np.full(N, 400.0),
    following_error_rad=np.full(N, 0.05),
)
PATH = FourierTrajectory(0.5, np.array([0.2, -0.2]), np.array([[0.1], [0.08]]), np.array([[0.05], [0.1]]))
CHAIN = Chain.from_origins(
    np.array([[0.0, 0.0, 0.2], [0.5, 0.0, 0.0]]),
    np.zeros((N, 3)),
    np.array([[0.0, 0.0, 1.0]] * N),
    pose_from_xyz_rpy([1.5, 0.0, 0.0], [0.0, 0.0, 0.0]),
    np.array([0.0, 0.0, -9.81]),
)
POINTS = ArmPoints(CHAIN, np.zeros(3))
"""Points of an arm so long that its slow round is at less than a quarter of the rate."""
MEASURED = plan_measured(Excitation(PATH, 2), LIMITS, CYCLE_S)
SLOW = plan_slow(Excitation(PATH, 2), MEASURED, SpeedLimit(POINTS, 0.25))
CYCLES_IN_PERIODS = 400


def stream(leg, requests, most=20_000):
    """All rows of a leg; each request is made before the row with its number."""
    control = MotionControl()
    source = LegInterpolator(leg, CYCLE_S, control)
    rows = []
    while len(rows) < most:
        for request in requests.get(len(rows), ()):
            request(control)
        row = source.next_reference()
        if row is None:
            return rows
        rows.append(row)
    pytest.fail("the stream does not end")


def assert_continuous(rows, leg=MEASURED):
    """Check that rows stay within the limits and on the path, never go back, and have no jumps."""
    position, velocity, acceleration = (
        np.array([getattr(row, name) for row in rows])
        for name in ("position_rad", "velocity_rad_s", "acceleration_rad_s2")
    )
    check_setpoints(position, velocity, acceleration, LIMITS)
    s, rate, gain = np.array([(r.state.phase_s, r.state.rate, r.state.acceleration_1_s) for r in rows]).T
    assert rate.min() >= -1e-9
    assert rate.max() <= 1.0 + 1e-9
    np.testing.assert_allclose(position, leg.path.evaluate(s).position_rad, atol=1e-12)
    bounds = leg.bounds
    np.testing.assert_allclose(np.diff(s), (rate[1:] + rate[:-1]) / 2 * CYCLE_S, atol=bounds.jerk_1_s2 * CYCLE_S**3)
    assert np.abs(np.diff(rate)).max() <= bounds.acceleration_1_s * CYCLE_S * 1.001
    assert np.abs(np.diff(gain)).max() <= bounds.jerk_1_s2 * CYCLE_S * 1.001


def pause(control):
    control.pause()


def resume(control):
    control.resume()


def speed(share):
    return lambda control: control.set_speed(share)


def stop(control):
    control.stop(OperatorStop("enough"))


def test_undisturbed_the_stream_is_the_plan():
    for leg in (SLOW, MEASURED):
        plan = plan_leg(leg, CYCLE_S)
        rows = stream(leg, {})
        np.testing.assert_array_equal([row.position_rad for row in rows], plan.position_rad[1:])
        np.testing.assert_array_equal([row.acceleration_rad_s2 for row in rows], plan.acceleration_rad_s2[1:])
        assert tuple(row.segment for row in rows) == plan.segment[1:]


def test_after_a_pause_the_measured_periods_stay_on_the_grid():
    rows = stream(MEASURED, {200: [pause], 400: [resume]})
    assert_continuous(rows)
    standing = [row.state.phase_s for row in rows[330:400]]
    assert np.ptp(standing) < 1e-12
    assert all(row.segment is Segment.SLOW for row in rows[200:401])
    phases = np.array([row.state.phase_s for row in rows if row.segment is Segment.PERIODS])
    grid = np.round(phases / CYCLE_S)
    np.testing.assert_allclose(phases, grid * CYCLE_S, atol=1e-12)
    assert len(set(grid)) == len(grid)
    assert grid[-1] == CYCLES_IN_PERIODS
    lost = CYCLES_IN_PERIODS - len(grid)
    ramp = MEASURED.start_s / -CYCLE_S
    assert 0 < lost <= 2 * ramp + 3


def test_override_slows_down_what_is_not_measured_then_and_back():
    rows = stream(MEASURED, {150: [speed(0.3)], 500: [speed(1.0)]})
    assert_continuous(rows)
    rates = np.array([row.state.rate for row in rows])
    np.testing.assert_allclose(rates[260:500], 0.3, atol=1e-9)
    assert all((row.segment is Segment.PERIODS) <= (row.state.rate == 1.0) for row in rows)
    assert rows[-2].segment is Segment.RAMP_DOWN


def test_a_run_that_begins_slow_ends_slow():
    rows = stream(MEASURED, {0: [speed(0.5)]})
    assert_continuous(rows)
    assert max(row.state.rate for row in rows) <= 0.5 + 1e-9
    assert rows[-1].state.phase_s > CYCLES_IN_PERIODS * CYCLE_S
    assert Segment.PERIODS not in {row.segment for row in rows}


def test_the_slow_round_obeys_the_override_and_still_ends_where_the_measured_begins():
    rows = stream(SLOW, {100: [speed(0.5)], 600: [pause], 700: [resume, speed(1.0)]})
    assert_continuous(rows, SLOW)
    assert rows[-1].state.phase_s == pytest.approx(SLOW.end_s, abs=1e-9)
    fast = POINTS.speeds(*(np.array([getattr(row, key) for row in rows]) for key in ("position_rad", "velocity_rad_s")))
    assert fast.max() <= 0.25
    assert {row.segment for row in rows} == {Segment.SLOW}


@pytest.mark.parametrize("at", [0, 3, 40, 120, 399, 520, 560])
def test_a_stop_ends_at_rest_on_the_path(at):
    rows = stream(MEASURED, {at: [stop]})
    assert len(rows) <= at + 120
    if rows:
        assert_continuous(rows)
        assert abs(rows[-1].state.rate) < 1e-9


def test_a_stop_while_paused_ends_at_once():
    rows = stream(MEASURED, {200: [pause], 400: [stop]})
    assert len(rows) == 400


def test_stop_is_final():
    control = MotionControl()
    stop(control)
    control.stop(OperatorStop("later"))
    control.resume()
    assert str(control.goal.stop) == "enough"
    assert LegInterpolator(SLOW, CYCLE_S, control).next_reference() is None


@settings(max_examples=40, deadline=None)
@given(
    st.lists(
        st.tuples(st.integers(1, 700), st.sampled_from([pause, resume, speed(0.01), speed(0.4), speed(1.0)])),
        max_size=8,
    ),
    st.sampled_from([SLOW, MEASURED]),
)
def test_whatever_is_asked_in_whatever_order(requests, leg):
    """After all requests the arm is resumed at full speed, and the leg ends."""
    table = {}
    for at, request in requests:
        table.setdefault(at, []).append(request)
    table.setdefault(701, []).extend([resume, speed(1.0)])
    rows = stream(leg, table)
    assert_continuous(rows, leg)
    assert abs(rows[-1].state.rate) < 1e-6


@settings(max_examples=100, deadline=None)
@given(st.floats(0.001, 0.999), st.floats(-1.0, 1.0), st.floats(0.0, 3.0))
def test_ramps_onto_the_grid_end_on_it(rate, share, phase_s):
    bounds = MEASURED.bounds
    most = min(bounds.acceleration_1_s, np.sqrt(2 * bounds.jerk_1_s2 * min(rate, 1.0 - rate)))
    state = PhaseState(phase_s, rate, share * most)
    for _ in range(3):
        ramp = ramp_to_grid(state, bounds, CYCLE_S)
        assert max(ramp.row(i).rate for i in range(ramp.cycles + 1)) <= 1.0 + 1e-9
        assert ramp.cycles * CYCLE_S < 1.3
        state = ramp.end
        if state.rate > 0.999:
            break
    assert state.rate == pytest.approx(1.0)
    assert state.phase_s / CYCLE_S == pytest.approx(round(state.phase_s / CYCLE_S), abs=1e-6)


def test_a_ramp_to_a_rate_takes_whole_cycles():
    ramp = ramp_to_rate(PhaseState(0.0, 0.0, 0.0), 1.0, MEASURED.bounds, CYCLE_S)
    assert ramp.end.rate == pytest.approx(1.0)
    assert ramp.end.acceleration_1_s == pytest.approx(0.0, abs=1e-9)


def test_a_leg_says_how_much_of_it_is_done():
    source = LegInterpolator(MEASURED, CYCLE_S, MotionControl())
    whole = MEASURED.end_s - MEASURED.start_s
    assert (source.done, whole > 0.0) == (0.0, True)
    found = []
    while (row := source.next_reference()) is not None:
        assert source.done == pytest.approx(min((row.state.phase_s - MEASURED.start_s) / whole, 1.0), abs=1e-9)
        found.append(source.done)
    assert found[-1] == 1.0
