"""Fading of torque offsets to zero."""

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from armload_drivers.cia402.process_data.offset_fade import OffsetFade

OFFSET_FADE_S = 0.15

pytestmark = pytest.mark.pure


@given(
    st.lists(st.integers(-32767, 32767), min_size=1, max_size=7),
    st.sampled_from([0.001, 0.004, 0.01, 0.02, 0.1, 0.5]),
)
def test_even_steps_one_way_to_zero_within_the_time(permille, cycle_s):
    fade = OffsetFade(permille, cycle_s)
    steps = [tuple(permille)]
    for _ in range(round(OFFSET_FADE_S / cycle_s) + 2):
        if fade.done:
            break
        steps.append(tuple(fade.next()))
    assert fade.done
    cycles = len(steps) - 1
    assert steps[-1] == (0,) * len(permille)
    assert cycles * cycle_s <= OFFSET_FADE_S + cycle_s
    for before, after in pairwise(steps):
        for first, old, new in zip(permille, before, after, strict=True):
            assert abs(new - old) <= abs(first) / cycles + 1
            assert abs(new) <= abs(old)
            assert new * first >= 0
    assert fade.next() == [0] * len(permille)


def test_without_offsets_there_is_nothing_to_wait_for():
    assert OffsetFade([0, 0], 0.01).done


@pytest.mark.parametrize(("cycle_s", "offsets"), [(0.05, [20, 10, 0]), (0.04, [22, 15, 8, 0]), (0.15, [0]), (1.0, [0])])
def test_steps_are_equal_parts_of_150_milliseconds(cycle_s, offsets):
    """30 per mille: 0.15 s are three cycles of 50 ms, four of 40 ms (22.5 rounds to even), and one of any longer."""
    fade, found = OffsetFade([30], cycle_s), []
    while not fade.done:
        found += fade.next()
    assert found == offsets
