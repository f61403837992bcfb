"""How late cycles were: by the computer's clock, or by that of servos in virtual time."""

import pytest

from armload_controller.cycle.lateness import UP_TO_MS, Lateness


def test_each_cycle_is_counted_by_its_delay_after_the_one_before():
    times_s = iter([0.0, 0.01, 0.0203, 0.03, 0.1, 5.0, 5.01])
    late = Lateness(0.01, lambda: next(times_s))
    for _ in range(5):
        late.note(0.0)
    late.begin()  # the drives were off: what follows is not late
    late.note(0.0)
    late.note(0.0)
    found = late.counted()
    assert found["up_to_ms"] == UP_TO_MS
    assert dict(zip((*UP_TO_MS, None), found["cycles"], strict=True)) == {
        **dict.fromkeys(UP_TO_MS, 0), 0.1: 3, 0.5: 1, None: 1,
    }  # fmt: skip
    assert found["greatest_ms"] == pytest.approx(60.0)


def test_in_virtual_time_the_servos_clock_counts():
    late = Lateness(0.01, None)
    for servos_s in (0.0, 0.01, 0.04):
        late.note(servos_s)
    assert late.counted()["greatest_ms"] == pytest.approx(20.0)


def test_a_run_without_cycles_has_no_histogram():
    late = Lateness(0.01, None)
    late.note(0.0)
    assert late.counted() == {}


def test_a_delay_is_in_the_bin_up_to_the_next_of_the_rounded_decades():
    """Edges 0.1, 0.2, 0.5, 1, 2, 5, 10, 20 and 50 ms: one delay just below and one just above each."""
    edges_ms = [0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0]
    late = Lateness(0.01, None)
    now_s = 0.0
    late.note(now_s)
    for edge_ms in edges_ms:
        for share in (0.99, 1.01):
            now_s += 0.01 + 1e-3 * share * edge_ms
            late.note(now_s)
    found = late.counted()
    assert found["cycles"] == [1, *[2] * 8, 1]
    assert list(found["up_to_ms"]) == edges_ms
    assert found["greatest_ms"] == pytest.approx(50.5)
