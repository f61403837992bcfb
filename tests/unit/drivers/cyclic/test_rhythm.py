"""Periods that are too short or too long, counted for the operator."""

import pytest

from armload_drivers.cyclic.rhythm import Rhythm

pytestmark = pytest.mark.pure


def noted(*times_s):
    rhythm = Rhythm("SYNC", 0.01)
    for time_s in times_s:
        rhythm.note(time_s)
    return rhythm


def test_regular_periods_and_whole_ones_that_are_left_out_are_no_news():
    assert noted().take() == noted(5.0).take() == ""
    assert noted(0.0, 0.01, 0.0219, 0.03, 0.06, 0.0701).take() == ""


def test_the_irregular_ones_are_counted_with_the_shortest_and_longest():
    rhythm = noted(0.0, 0.01, 0.017, 0.0307, 0.0407, 0.0537)
    assert rhythm.take() == ("3 of 5 periods of SYNC differ from 10 ms by more than a fifth (7.00 to 13.70 ms)")
    assert rhythm.take() == "", "only what is new since the last call"


def test_of_a_long_pause_only_its_remainder_counts():
    assert noted(0.0, 0.034).take().endswith("(10.00 to 14.00 ms)")
    assert noted(0.0, 0.026).take().endswith("(6.00 to 10.00 ms)")
    assert noted(0.0, 0.002).take().endswith("(2.00 to 10.00 ms)")


def test_the_first_time_after_a_start_or_a_set_back_ends_no_period():
    rhythm = noted(0.0, 0.01)
    rhythm.begin()
    rhythm.note(5.005)
    rhythm.note(5.015)
    rhythm.note(1.0)
    rhythm.note(1.0)
    rhythm.note(1.01)
    assert rhythm.take() == ""
    rhythm.note(1.017)
    assert not rhythm.take(), "the last time is forgotten too"
    rhythm.note(1.03)
    rhythm.note(1.0365)
    assert rhythm.take().startswith("1 of 1 periods")
