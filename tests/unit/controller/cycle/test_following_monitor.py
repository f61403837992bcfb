"""Distances to the target, ages and cycles of feedbacks: windows, counts, and their edges."""

from types import SimpleNamespace

import numpy as np
import pytest

from armload_controller.cycle.following_monitor import FollowingError, FollowingMonitor, LateCycle, StaleFeedback


def followed(cycle, position, target, *, skipped=0, missing=(False, False)):
    feedback = SimpleNamespace(
        time_s=0.01 * cycle, cycle=cycle, position_rad=np.array(position), skipped_cycles=skipped,
        missing=np.array(missing),
    )  # fmt: skip
    sent = None if target is None else SimpleNamespace(position_rad=np.array(target))
    return SimpleNamespace(feedback=feedback, sent=sent)


@pytest.fixture
def monitor():
    limits = SimpleNamespace(joint_names=("a", "b"), following_error_rad=np.array([0.125, 0.25]))
    monitor = FollowingMonitor(limits, 3)
    monitor.on_cycle(followed(100, [0.0, 0.0], None))
    return monitor


def test_a_window_belongs_to_what_is_allowed_and_the_worst_joint_is_named(monitor):
    monitor.on_cycle(followed(101, [0.0, 0.0], [0.125, -0.25]))
    with pytest.raises(FollowingError, match=r"^b: 0\.5000 rad behind its target, 0\.2500 rad allowed"):
        monitor.on_cycle(followed(102, [0.0, 0.5], [0.2, 0.0]))
    with pytest.raises(FollowingError, match=r"^a: nan"):
        monitor.on_cycle(followed(103, [np.nan, 0.0], [0.0, 0.0]))


def test_counts_are_those_of_the_run(monitor):
    for cycle in (101, 102, 105):
        monitor.on_cycle(followed(cycle, [0.0, 0.0], [0.01 * (cycle - 100), 0.0], skipped=2 * (cycle == 105)))
    monitor.on_cycle(followed(106, [0.0, 0.0], [0.0, -0.02], missing=(True, False)))
    counts = monitor.summary
    assert (counts.cycles, counts.skipped, counts.missing.tolist()) == (4, 2, [1.0, 0.0])
    assert counts.duration_s == pytest.approx(0.06)
    assert counts.following_error_rad == pytest.approx([0.05, 0.02])


def test_a_repeated_feedback_and_too_many_skipped_cycles_are_refused(monitor):
    with pytest.raises(StaleFeedback, match="cycle 100 was repeated"):
        monitor.on_cycle(followed(100, [0.0, 0.0], [0.0, 0.0]))
    monitor.on_cycle(followed(101, [0.0, 0.0], [0.0, 0.0], skipped=3))
    with pytest.raises(LateCycle, match="4 cycles skipped in a row, 3 allowed"):
        monitor.on_cycle(followed(102, [0.0, 0.0], [0.0, 0.0], skipped=4))
