"""Joint states as cycles: joints by name, other publishers, other orders, restarts, and what is of no use."""

from __future__ import annotations

from itertools import count, islice

import numpy as np
import pytest

pytest.importorskip("cyclonedds", reason="needs the extra ros2")

from armload_drivers.driver_errors import BusError
from armload_drivers.feeds.joint_state_feed import JointStateCycles, joint_state_cycles
from armload_drivers.feeds.ros2_messages import Header, JointState, Stamp

NAMES = ("shoulder", "elbow", "wrist")
START_NS = 1_700_000_000_123_456_789


def message(stamp_ns, names=NAMES, position=(1.0, 2.0, 3.0), effort=(10.0, 20.0, 30.0)):
    return JointState(Header(Stamp(*divmod(stamp_ns, 10**9)), ""), list(names), list(position), [], list(effort))


def test_joints_are_found_by_name_in_any_order():
    states = JointStateCycles(NAMES, current=True)
    first = states.take(message(START_NS), 0.0)
    turned = message(START_NS + 4_000_000, ("wrist", "gripper", "elbow", "shoulder"), (3, 9, 2, 1), (30, 90, 20, 10))
    second = states.take(turned, 0.004)
    for cycle in (first, second):
        assert cycle.enabled
        assert cycle.feedback.position_rad.tolist() == [1.0, 2.0, 3.0]
        assert cycle.feedback.current_a.tolist() == [10.0, 20.0, 30.0]
        assert cycle.feedback.torque_nm is None
    assert (first.feedback.time_s, second.feedback.time_s) == (0.0, 0.004)
    assert states.stamp_ns(second.feedback.time_s) == START_NS + 4_000_000


def test_effort_is_torque_unless_stated():
    feedback = JointStateCycles(NAMES, current=False).take(message(START_NS), 0.0).feedback
    assert feedback.current_a is None
    assert feedback.torque_nm.tolist() == [10.0, 20.0, 30.0]


def test_messages_of_other_joints_are_counted_and_of_no_use():
    states = JointStateCycles(NAMES, current=False)
    assert states.take(message(START_NS, ("finger",), (1.0,), (1.0,)), 0.0) is None
    assert (states.of_others, states.other_names) == (1, ("finger",))


@pytest.mark.parametrize(
    "values", [{"effort": ()}, {"position": (1.0, 2.0)}, {"effort": (1.0, np.nan, 2.0)}, {"position": (np.inf, 0, 0)}]
)
def test_messages_without_position_and_effort_of_each_joint_are_counted(values):
    states = JointStateCycles(NAMES, current=False)
    assert states.take(message(START_NS, **values), 0.0) is None
    assert states.incomplete == 1


def lost_of(intervals_ns, reported=0):
    """Lost messages of each cycle; the last one comes with what the middleware reported."""
    states, stamps = JointStateCycles(NAMES, current=False), START_NS + np.cumsum([0, *intervals_ns])
    told = [0] * len(intervals_ns) + [reported]
    cycles = [states.take(message(int(stamp)), 0.0, lost) for stamp, lost in zip(stamps, told, strict=True)]
    return [cycle.lost for cycle in cycles]


def test_a_gap_between_regular_stamps_is_a_loss():
    regular = [4_000_000, 4_400_000, 3_600_000] * 20
    assert lost_of([*regular, 40_000_000, 4_000_000]) == [0] * 61 + [9, 0]
    assert lost_of([*regular, 40_000_000, 4_000_000], reported=9) == [0] * 61 + [9, 0], "the same loss"
    assert lost_of([*regular, 40_000_000, 4_000_000], reported=11) == [0] * 61 + [9, 2]


def test_a_pause_or_an_irregular_publisher_is_none():
    assert sum(lost_of([*[4_000_000] * 60, 1_500_000_000, 4_000_000])) == 0
    assert sum(lost_of([4_000_000, 12_000_000] * 40)) == 0
    assert sum(lost_of([4_000_000, 40_000_000])) == 0, "nothing is usual yet"


def test_a_publisher_that_goes_on_at_a_lower_rate_loses_nothing_any_more():
    """Fifty gaps in a row are its rate; one message at the former rate between them, and they are losses."""
    lost = lost_of([*[4_000_000] * 60, *[8_000_000] * 200])
    assert lost == [0] * 61 + [1] * 50 + [0] * 150
    torn = [*[8_000_000] * 49, 4_000_000]
    assert sum(lost_of([*[4_000_000] * 60, *torn * 3])) == 3 * 49


@pytest.mark.parametrize(("silent", "expected"), [(False, 749), (True, 0)])
def test_seconds_that_a_slow_program_did_not_take_are_lost_but_a_pause_is_none(silent, expected):
    regular = [message(START_NS + 4_000_000 * k) for k in range(60)]
    after = [message(START_NS + 4_000_000 * k) for k in range(809, 812)]
    batches = [regular, [], after] if silent else [regular, after]
    played = Played(*batches)
    cycles = [cycle for cycle in islice(cycles_of(played, tick_s=5.0), 64) if cycle is not None]
    assert [cycle.lost for cycle in cycles] == [0] * 60 + [expected, 0, 0]


def test_a_clock_that_was_set_is_no_loss():
    states = JointStateCycles(NAMES, current=False)
    for k in range(60):
        states.take(message(START_NS + 4_000_000 * k), 0.004 * k)
    assert states.take(message(START_NS + 3_600_000_000_000), 0.24).lost == 0
    assert states.take(message(START_NS + 3_600_012_000_000), 0.25).lost == 2, "a pause is no usual interval"


def test_messages_that_are_not_later_are_dropped():
    states = JointStateCycles(NAMES, current=False)
    assert states.take(message(START_NS), 0.0) is not None
    assert states.take(message(START_NS), 0.1) is None
    assert states.take(message(START_NS - 500_000_000), 0.2) is None
    assert states.take(message(START_NS + 1), 0.3) is not None


def test_after_a_restart_with_another_clock_time_goes_on():
    states = JointStateCycles(NAMES, current=False)
    states.take(message(START_NS), 10.0)
    states.take(message(START_NS + 2_000_000_000), 12.0)
    again = states.take(message(5_000_000), 15.0)
    assert again.feedback.time_s == pytest.approx(5.0, abs=1e-6)
    assert states.take(message(9_000_000), 15.004).feedback.time_s == pytest.approx(5.004, abs=1e-6)
    assert states.stamp_ns(5.004) == pytest.approx(9_000_000, abs=2)


@pytest.mark.parametrize("apart_s", [4000.0, -5.0])
def test_two_publishers_with_clocks_of_their_own_are_refused(apart_s):
    states = JointStateCycles(NAMES, current=False)
    stamps = [START_NS + 10_000_000 * k + round(1e9 * apart_s) * (k % 2) for k in range(60)]
    with pytest.raises(BusError, match=r"changed to another clock 5 times within \d+ messages. Do two programs"):
        list(map(states.take, map(message, stamps), count(step=0.01)))


def test_one_stamp_far_in_the_future_moves_nothing():
    states = JointStateCycles(NAMES, current=False)
    stamps = [START_NS, START_NS + 10_000_000, 2**31 * 10**9 - 1, START_NS + 30_000_000, START_NS + 40_000_000]
    times = [states.take(message(stamp), 0.01 * k).feedback.time_s for k, stamp in enumerate(stamps)]
    assert times == pytest.approx([0.0, 0.01, 0.02, 0.03, 0.04], abs=1e-6)
    assert states.stamp_ns(0.04) == pytest.approx(stamps[-1], abs=1000)


class Played:
    """A subscription that gives lists of messages, then nothing."""

    def __init__(self, *batches, lost=()):
        self._batches, self._lost = iter(batches), iter(lost)

    def take(self, timeout_s):
        return next(self._batches, [])

    def newly_lost(self):
        return next(self._lost, 0)


def cycles_of(played, patience_s=3.0, tick_s=1.0):
    ticks = count(step=tick_s)
    states = JointStateCycles(NAMES, current=False)
    return joint_state_cycles(played, "/joint_states", states, patience_s, clock=lambda: float(next(ticks)))


def test_lost_samples_belong_to_the_next_cycle():
    played = Played([message(START_NS)], [message(START_NS + 5), message(START_NS + 6)], [], lost=(0, 3))
    found = list(islice(cycles_of(played), 4))
    assert [cycle and cycle.lost for cycle in found] == [0, 3, 0, None]


@pytest.mark.parametrize(
    ("batch", "text"),
    [
        ([], "nothing is published.*ROS_DOMAIN_ID"),
        ([message(START_NS, ("finger",), (1.0,), (1.0,))], "1 messages name other joints, the last one finger"),
        ([message(0)] * 61, "60 messages have a header stamp that is not later.*must set header.stamp"),
        ([message(START_NS, effort=())], "not a position and an effort for each.*joint_state_broadcaster"),
    ],
)
def test_what_is_missing_is_said(batch, text):
    with pytest.raises(BusError, match=rf"^/joint_states: no usable message within 3 s.*{text}"):
        list(islice(cycles_of(Played(batch[:1], batch[1:])), 10))


def test_silence_after_the_first_cycle_is_no_error():
    found = list(islice(cycles_of(Played([message(START_NS)])), 30))
    assert found[0] is not None
    assert not any(found[1:])
