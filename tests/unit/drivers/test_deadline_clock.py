"""When frames are due, on a clock of the test."""

import pytest

from armload_drivers.deadline_clock import DeadlineClock


class Time:
    def __init__(self):
        self.now_s = 10.0

    def __call__(self):
        return self.now_s

    def sleep(self, time_s):
        self.now_s += time_s


def test_deadlines_are_absolute_and_missed_ones_are_skipped():
    time = Time()
    clock = DeadlineClock(time, time.sleep)
    clock.begin(0.004)
    assert clock.next() == (pytest.approx(10.004), 0)
    time.now_s += 0.003
    assert clock.next() == (pytest.approx(10.008), 0)
    time.now_s += 0.009
    due_s, skipped = clock.next()
    assert skipped == 2
    assert due_s == pytest.approx(10.020)
