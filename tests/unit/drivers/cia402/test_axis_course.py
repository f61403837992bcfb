"""An axis that leaves its predicted course, and what must not be taken for it."""

import math
from itertools import product

import numpy as np
import pytest

from armload_drivers.cia402.axis_course import AxisCourse, axis_courses, loop_lost
from armload_drivers.cia402.process_data.drive_units import ArmUnits

COUNTS, SPEED, ACCELERATION, WINDOW, LIMIT, CYCLE_S = 1e6, 2.0, 6.0, 0.2, 1000.0, 0.004
LAG_S = 0.04


def course(**changes):
    given = {"window_rad": WINDOW, "effort_limit": LIMIT, "cycle_s": CYCLE_S} | changes
    made = AxisCourse(COUNTS, SPEED, ACCELERATION, **given)
    made.begin(0)
    return made


def follow(made, targets_rad, positions_rad, effort=0, elapsed_s=CYCLE_S):
    """Feed targets and positions until the axis is lost; the number of samples, and the reason."""
    efforts = effort if np.ndim(effort) else [effort] * len(targets_rad)
    for sample, (target, position, each) in enumerate(zip(targets_rad, positions_rad, efforts, strict=True)):
        made.follow(round(target * COUNTS), round(position * COUNTS), round(each), elapsed_s)
        if made.lost:
            return sample, made.lost
    return None, ""


def lagging(targets_rad, lag_s=LAG_S):
    """The positions of a first-order lag."""
    positions, here = [], 0.0
    for target in targets_rad:
        positions.append(here)
        here += (target - here) * (1.0 - math.exp(-CYCLE_S / lag_s))
    return np.array(positions)


def swing(seconds=4.0, amplitude=0.3, period_s=1.0):
    """Targets of a swing whose speed begins at zero; its greatest is 1.9 rad/s."""
    t = np.arange(0.0, seconds, CYCLE_S)
    return amplitude * (1.0 - np.cos(2.0 * math.pi * t / period_s))


@pytest.mark.parametrize("lag_s", [0.004, 0.02, 0.04, 0.08])
@pytest.mark.parametrize("period_s", [1.0, 5.0])
def test_an_axis_that_follows_with_any_usual_lag_stays_on_its_course(lag_s, period_s):
    targets = swing(period_s=period_s)
    assert follow(course(), targets, lagging(targets, lag_s)) == (None, "")


@pytest.mark.parametrize("speed", [0.3, 1.0, 1.9])
def test_an_axis_that_turns_the_other_way(speed):
    targets = speed * CYCLE_S * np.arange(300)
    positions = lagging(targets)
    at = 200
    positions[at:] = 2.0 * positions[at - 1] - positions[at:]
    found, why = follow(course(), targets, positions)
    assert found - at < (0.04 / CYCLE_S if speed > 0.2 * SPEED else 0.4 / CYCLE_S)
    assert "are commanded" in why or "against its setpoints" in why


@pytest.mark.parametrize("way_rad", [0.05, -0.05, 0.01])
def test_a_position_that_jumps(way_rad):
    targets = np.zeros(50)
    positions = np.where(np.arange(50) >= 20, way_rad, 0.0)
    assert follow(course(), targets, positions)[0] == 20


def test_a_jump_within_the_margin_is_none():
    targets = np.zeros(50)
    margin_rad = 0.2 * SPEED * CYCLE_S
    assert follow(course(), targets, np.where(np.arange(50) >= 20, 0.9 * margin_rad, 0.0))[0] is None
    assert follow(course(), targets, np.where(np.arange(50) >= 20, 1.1 * margin_rad, 0.0))[0] == 20


@pytest.mark.parametrize("speed", [0.06, 0.5, 1.5])
def test_a_position_that_freezes_in_motion_is_found_in_the_second_sample(speed):
    targets = speed * CYCLE_S * np.arange(300)
    positions = lagging(targets)
    positions[200:] = positions[199]
    found, why = follow(course(), targets, positions)
    assert found - 200 <= 1
    assert "stopped dead" in why or "are commanded" in why


def test_an_axis_that_stops_because_its_setpoints_do_has_not_stopped_dead():
    """With a hard feed-forward it may stand in the very next sample, as when the master is late."""
    targets = np.minimum(0.3 * CYCLE_S * np.arange(300), 0.3 * CYCLE_S * 200)
    assert follow(course(), targets, targets)[0] is None


def test_a_cycle_without_setpoints_is_allowed_for():
    """A late master: the setpoints stand still for two cycles in which the drive sends no feedback either."""
    made, fast = course(), 1.9
    targets = fast * CYCLE_S * np.arange(60)
    assert follow(made, targets, targets)[0] is None
    here = round(targets[-1] * COUNTS)
    made.follow(here, here, 0, 3.0 * CYCLE_S)
    assert not made.lost


def test_an_axis_that_friction_holds_at_a_reversal_is_not_frozen():
    targets = swing()
    positions = lagging(targets)
    still = (np.abs(np.gradient(targets, CYCLE_S)) < 0.4) & (np.arange(len(targets)) > 60)
    held = positions.copy()
    for sample in range(1, len(held)):
        step = positions[sample] - positions[sample - 1]
        held[sample] = held[sample - 1] + (
            0.1 * step if still[sample] else step + 0.1 * (positions[sample] - held[sample - 1])
        )
    assert follow(course(), targets, held)[0] is None


def test_an_axis_that_stands_while_its_setpoints_go_on_is_stuck():
    targets = 0.05 * CYCLE_S * np.arange(1000)
    found, why = follow(course(), targets, np.zeros(1000))
    assert targets[found] == pytest.approx(0.4 * WINDOW, abs=1e-3)
    assert "not changed by a single count" in why


@pytest.mark.parametrize(("moved", "samples"), [(0, 0.06 / CYCLE_S), (20, 3)])
def test_an_axis_that_is_pushed_with_its_greatest_torque_and_stands(moved, samples):
    """At once if it moved before; an axis at rest may be held by static friction for some time."""
    targets = 0.02 * CYCLE_S * np.arange(200)
    effort = np.clip(10.0 * np.arange(200), 0.0, 950.0)
    found, why = follow(course(), targets, targets.clip(max=targets[moved]), effort)
    assert found == 90 + samples - 1
    assert "greatest torque" in why


def test_holding_a_load_at_the_torque_limit_is_no_fault():
    made = course()
    made.slow_down()
    assert follow(made, np.zeros(200), np.zeros(200), 950)[0] is None
    weaker = course(effort_limit=math.inf)
    assert follow(weaker, 0.02 * CYCLE_S * np.arange(200), np.zeros(200), 10**6)[0] is None


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_a_slow_motion_against_the_setpoints(way):
    """Within the margin of speeds; a reported direction that is wrong while the drive follows the right one."""
    targets = way * 0.15 * CYCLE_S * np.arange(300)
    found, why = follow(course(), targets, -targets)
    assert "against its setpoints" in why
    assert 2.0 * way * targets[found] == pytest.approx(0.2 * WINDOW, abs=2e-3)


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_in_a_stop_an_axis_may_take_its_time_but_must_slow_down(way):
    fast = 1.8
    for deceleration, lost in ((2.0, False), (0.0, True)):
        made = course()
        targets = way * fast * CYCLE_S * np.arange(100)
        assert follow(made, targets, lagging(targets))[0] is None
        made.slow_down()
        t = CYCLE_S * np.arange(1, 400)
        braking_s = np.minimum(t, fast / deceleration) if deceleration else t
        positions = lagging(targets)[-1] + way * (fast * braking_s - 0.5 * deceleration * braking_s**2)
        found, why = follow(made, np.full(399, targets[-1]), positions)
        assert (found is not None) is lost
        if lost:
            assert 0.1 < t[found] < 0.5
            assert "are commanded" in why


def test_in_a_stop_an_axis_must_not_turn_back_nor_run_away():
    for way, speed in product((1.0, -1.0), (-0.9, 2.6)):
        made = course()
        targets = way * 1.8 * CYCLE_S * np.arange(100)
        follow(made, targets, lagging(targets))
        made.slow_down()
        here = lagging(targets)[-1]
        assert follow(made, [0.0], [here + way * speed * CYCLE_S])[0] == 0


def test_a_suspect_axis_that_stands_is_lost_and_one_that_moves_or_has_no_setpoints_is_not():
    made = course()
    targets = 0.02 * CYCLE_S * np.arange(30)
    follow(made, targets, np.zeros(30))
    made.suspect()
    assert "not as expected" in made.lost
    for positions, wanted in ((targets, targets), (np.zeros(30), np.zeros(30))):
        sound = course()
        follow(sound, wanted, positions)
        sound.suspect()
        assert not sound.lost


def test_the_first_reason_stays_until_it_begins_anew():
    made = course()
    made.leave("first")
    made.leave("second")
    assert made.lost == "first"
    made.begin(5)
    assert not made.lost


def test_courses_of_coupled_axes_have_the_limits_that_their_joints_allow(arm_settings):
    arm = arm_settings()
    courses = axis_courses(arm, ArmUnits(arm))
    inverse = np.abs(np.linalg.inv(arm.coupling))
    counts = arm.drives[0].counts_per_rad
    steps = [each.step for each in courses]
    assert steps == pytest.approx(inverse @ np.full(3, 2.0) * arm.cycle_s * counts + 1.0, rel=1e-5)
    assert "0.0200 rad are possible" in str(courses[0].too_far("elbow", 10**6))


def test_the_error_says_what_an_axis_without_a_brake_does(arm_settings):
    braked, bare = arm_settings().drives[0], arm_settings(has_brake=False).drives[0]
    assert "its brake engages" in str(loop_lost(braked, "quick stop", "why"))
    assert "has no brake (has_brake) and falls" in str(loop_lost(bare, "quick stop", "why"))


@pytest.mark.parametrize("speed", [1.0, -1.0])
def test_a_stop_begins_as_late_as_a_loop_may_lag(speed):
    """At constant speed the axis is off its course when the ramp has fallen by the margin, and not before."""
    made = course()
    targets = speed * CYCLE_S * np.arange(100)
    assert follow(made, targets, targets)[0] is None
    made.slow_down()
    here = targets[-1] + speed * CYCLE_S * np.arange(1, 200)
    found, why = follow(made, here, here)
    falls_s = 0.2 * SPEED / (0.25 * ACCELERATION)
    assert found * CYCLE_S == pytest.approx(0.1 + falls_s, abs=3 * CYCLE_S)
    assert "are commanded" in why


def test_a_single_sample_without_a_change_is_no_standstill():
    made = course()
    targets = 0.3 * CYCLE_S * np.arange(51)
    follow(made, targets, [*targets[:-1], targets[-2]])
    made.suspect()
    assert not made.lost, "although the setpoint moved by more than proves a standstill"


def test_feedback_that_comes_early_makes_no_axis_faster():
    """The time of a SYNC is stamped with some jitter; the axis has moved for a whole cycle."""
    made = course()
    targets = np.minimum(1.0 * CYCLE_S * np.arange(110), 1.0 * CYCLE_S * 100)
    positions = lagging(targets)
    assert follow(made, targets[:102], positions[:102])[0] is None
    assert follow(made, targets[102:103], positions[102:103], elapsed_s=0.3 * CYCLE_S)[0] is None


def test_an_axis_that_stood_because_its_setpoints_came_late_has_not_left_its_course():
    made, fast = course(), 1.9
    targets = fast * CYCLE_S * np.arange(61)
    assert follow(made, targets[:60], targets[:60])[0] is None
    assert follow(made, targets[60:], targets[59:60], elapsed_s=3.0 * CYCLE_S)[0] is None


def test_an_axis_that_slows_down_before_it_stands_has_not_stopped_dead():
    """Friction has brought it to rest; its setpoints go on, but not yet far."""
    speeds = np.concatenate([np.full(50, 0.3), [0.2, 0.1], np.zeros(30)])
    targets, positions = 0.3 * CYCLE_S * np.arange(1, 83), CYCLE_S * np.cumsum(speeds)
    assert follow(course(), targets, positions)[0] is None
    dead = np.where(np.arange(82) < 50, positions, positions[49])
    assert "stopped dead" in follow(course(), targets, dead)[1]


def test_an_axis_that_creeps_by_a_few_counts_may_be_held_by_friction_for_some_time():
    targets = 4.0 / COUNTS * np.arange(1, 61)
    positions = np.minimum(targets, targets[19])
    effort = np.where(np.arange(60) > 20, 950.0, 0.0)
    found, why = follow(course(), targets, positions, effort)
    assert found == 20 + 0.06 / CYCLE_S
    assert "greatest torque" in why


def test_an_axis_that_stops_at_once_when_it_shall_stop_has_not_stopped_dead():
    made = course()
    targets = 0.3 * CYCLE_S * np.arange(50)
    follow(made, targets, targets)
    made.slow_down()
    assert follow(made, np.full(20, targets[-1]), np.full(20, targets[-1]))[0] is None


def test_an_axis_that_stops_dead_right_before_a_stop_is_found_in_the_stop():
    """Its setpoints had gone on far enough, and go no further."""
    made = course()
    targets = 0.3 * CYCLE_S * np.arange(50)
    on = targets[-1] + 1.3 * 0.25 * 0.3 * CYCLE_S
    assert follow(made, [*targets, on], [*targets, targets[-1]])[0] is None
    made.slow_down()
    assert "stopped dead" in follow(made, [on], [targets[-1]])[1]


def test_an_axis_that_shall_stand_may_be_pushed():
    effort = np.where(np.arange(60) > 20, 950.0, 0.0)
    assert follow(course(), np.zeros(60), np.zeros(60), effort)[0] is None


def test_an_axis_that_is_pushed_in_a_stop_and_stands_is_lost():
    made = course()
    made.slow_down()
    found, why = follow(made, np.zeros(60), np.zeros(60), np.where(np.arange(60) > 20, 950.0, 0.0))
    assert found is not None
    assert "greatest torque" in why


@pytest.mark.parametrize("longest_s", [0.0, 0.03])
def test_an_uncertain_time_is_taken_at_its_longest(longest_s):
    """A late answer by SDO and then a quick one: nearly the same time, another position."""
    course = AxisCourse(1e5, 2.0, 5.0, window_rad=0.1, effort_limit=math.inf, cycle_s=0.01)
    course.begin(0)
    for cycle in range(1, 31):
        course.follow(1000 * cycle, 1000 * (cycle - 1), 0, 0.01)
    course.slow_down()
    course.follow(30000, 29000 + 3000, 0, 0.01, longest_s)
    assert bool(course.lost) is (longest_s == 0.0)


def stops_dead(last, before=None, goes_on=1.0):
    """Where and why an axis is lost that moves at `last` rad/s, before that at `before`, and then not at all."""
    speeds = np.concatenate([np.full(40, last if before is None else before), [last], np.zeros(20)])
    targets = np.cumsum(np.where(np.arange(61) < 41, speeds, goes_on * last)) * CYCLE_S
    return follow(course(), targets, np.cumsum(speeds) * CYCLE_S)


@pytest.mark.parametrize(
    ("changes", "dead"),
    [
        ({"last": 0.3, "before": 0.37}, True),  # lost less than a quarter of its speed before
        ({"last": 0.3, "before": 0.38}, False),
        ({"last": 0.3, "before": 0.23}, True),
        ({"last": 0.025}, True),  # 6 rad/s2 may take 0.024 rad/s in a cycle
        ({"last": 0.023}, False),
        ({"last": 0.3, "goes_on": 0.26}, True),
        ({"last": 0.3, "goes_on": 0.24}, False),
    ],
)
def test_an_axis_has_stopped_dead_in_two_samples_if_it_was_fast_and_even_and_shall_go_on(changes, dead):
    assert stops_dead(**changes) == ((42, stops_dead(0.3)[1]) if dead else (None, ""))
    assert "stopped dead" in stops_dead(0.3)[1]


@pytest.mark.parametrize(("counts", "found"), [(9, 41), (8, None)])
def test_a_speed_of_eight_counts_a_sample_may_look_like_a_standstill(counts, found):
    made = AxisCourse(1e4, SPEED, ACCELERATION, window_rad=WINDOW, effort_limit=LIMIT, cycle_s=CYCLE_S)
    made.begin(0)
    lost = []
    for sample in range(1, 45):
        made.follow(counts * sample, counts * min(sample, 40), 0, CYCLE_S)
        lost.append(bool(made.lost))
    assert (lost.index(True) if any(lost) else None) == found


@pytest.mark.parametrize(
    ("first", "then", "lost"),
    [(0, 900, True), (0, 899, False), (705, 905, True), (706, 905, False), (-705, -905, True), (-706, -905, False)],
)
def test_an_axis_is_pushed_by_nine_tenths_of_its_torque_if_that_has_risen_by_a_fifth(first, then, lost):
    targets = 0.02 * CYCLE_S * np.arange(1, 61)
    found, why = follow(course(), targets, np.zeros(60), [first] + 59 * [then])
    assert (found, "greatest torque" in why) == ((15, True) if lost else (None, False))


@pytest.mark.parametrize(("share", "lost"), [(0.51, True), (0.49, False)])
def test_an_axis_goes_the_wrong_way_by_half_of_the_way_of_its_setpoints(share, lost):
    targets = 0.15 * CYCLE_S * np.arange(300)
    assert ("against its setpoints" in follow(course(), targets, -share * targets)[1]) is lost


def test_an_axis_goes_the_wrong_way_after_ten_milliradians():
    targets = 0.001 * np.arange(60)
    found, why = follow(course(window_rad=0.01), targets, -0.6 * targets)
    assert found == 12, "the first beyond 0.01 rad from the first that moved"
    assert "moved by 0.007 rad against its setpoints, which moved by 0.011 rad" in why


def test_a_wide_window_counts_as_what_the_axis_can_move_in_four_tenths_of_a_second():
    targets = 0.3 * CYCLE_S * np.arange(1000)
    found, why = follow(course(window_rad=10.0), targets, np.zeros(1000))
    assert targets[found] == pytest.approx(0.4 * (0.4 * SPEED), abs=0.3 * CYCLE_S)
    assert "its setpoints moved by 0.320 rad" in why or "its setpoints moved by 0.321 rad" in why


@pytest.mark.parametrize(("way_rad", "lost"), [(0.0009, False), (0.0011, True)])
def test_a_suspect_axis_stands_if_its_setpoints_have_moved_a_milliradian_without_it(way_rad, lost):
    made = course()
    follow(made, way_rad / 4.0 * np.arange(5), np.zeros(5))
    made.suspect()
    assert bool(made.lost) is lost


@pytest.mark.parametrize(("cycles", "lost"), [(1.4, True), (1.6, False)])
def test_after_one_and_a_half_cycles_the_setpoints_have_stood_still(cycles, lost):
    made = course()
    targets = 1.9 * CYCLE_S * np.arange(61)
    assert follow(made, targets[:60], targets[:60])[0] is None
    assert (follow(made, targets[60:], targets[59:60], elapsed_s=cycles * CYCLE_S)[0] is not None) is lost


def test_the_speed_of_late_is_forgotten_with_a_time_constant_of_a_tenth_of_a_second():
    """Setpoints stop at 1 rad/s; 0.9 rad/s is too fast when exp(-T / 0.1 s) < 0.9 - 0.4, from 69.3 ms = 17.3 cycles."""
    for sign in (1.0, -1.0):
        targets = sign * CYCLE_S * np.minimum(np.arange(1, 200), 100)
        positions = (
            sign * CYCLE_S * np.where(np.arange(1, 200) < 100, np.arange(1, 200), 100 + 0.9 * (np.arange(1, 200) - 100))
        )
        found, why = follow(course(), targets, positions)
        assert found == 99 + 18
        assert "are commanded" in why


def test_a_step_is_what_the_greatest_speed_allows_and_a_count():
    assert course().step == pytest.approx(2.0 * 0.004 * 1e6 * (1.0 + 1e-6) + 1.0, abs=1e-6)


@pytest.mark.parametrize(("effort", "lost"), [(2700, True), (2699, False), (-2700, True)])
def test_the_greatest_effort_of_an_axis_is_that_of_6072_in_per_mille(arm_settings, effort, lost):
    arm = arm_settings(max_torque_permille=3000)
    made = axis_courses(arm, ArmUnits(arm))[1]
    for sample in range(12):
        made.follow(sample, 0, 0 if sample == 0 else effort, arm.cycle_s)
    assert bool(made.lost) is lost
