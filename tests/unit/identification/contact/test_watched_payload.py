"""The payload is held while something acts; a push leaves no trace in it, and another payload is weighed anew."""

import numpy as np
import pytest

from armload_identification.contact import force_watch
from armload_identification.contact.contact_levels import LOOKS_S, OVER_S, SUSPECT
from armload_identification.contact.force_watch import Force, ForceEventKind
from armload_identification.contact.watched_payload import WatchedPayload
from armload_identification.pipeline.recursive_estimator import PayloadEstimator

FORCE_N = np.array([40.0, -30.0, 10.0])
BEGIN_S, END_S = 9.0, 9.7
ACTING, PAYLOAD, PUSH, OVER, NOTHING = ForceEventKind


def watched(moved, seconds, current):
    watch = WatchedPayload(*moved.watched_arm)
    watch.take(*moved.until(seconds, current))
    return watch


def plain(moved, seconds, current):
    estimator = PayloadEstimator(*moved.watched_arm)
    estimator.update_all(*moved.until(seconds, current))
    return estimator.estimate()


def test_without_a_force_the_estimate_is_the_estimators_own(moved):
    watch = watched(moved, 14.0, moved.empty)
    assert not watch.has_news
    assert np.array_equal(watch.estimate().theta, plain(moved, 14.0, moved.empty).theta)


def test_a_push_is_noticed_named_and_measured(moved):
    events = watched(moved, 12.0, moved.pushed(FORCE_N, BEGIN_S, END_S)).take_events()
    assert [event.kind for event in events] == [ACTING, PUSH, OVER]
    noticed, push, over = events
    assert -0.05 < noticed.time_s - moved.at(BEGIN_S) < 0.25
    assert noticed.joints.any()
    assert abs(push.since_s - moved.at(BEGIN_S)) < 0.2
    assert np.linalg.norm(push.assessment.force_n - FORCE_N) < 0.2 * np.linalg.norm(FORCE_N)
    assert abs(over.since_s - moved.at(END_S)) < 0.8
    assert over.time_s - over.since_s >= OVER_S


def test_the_payload_is_held_until_the_push_is_over(moved):
    current = moved.pushed(FORCE_N, BEGIN_S, END_S)
    before = plain(moved, BEGIN_S - 0.5, moved.empty)
    during = watched(moved, BEGIN_S + 0.8, current)
    assert during.force is Force.PUSHED
    held = during.estimate()
    assert held.time_s == pytest.approx(moved.at(BEGIN_S + 0.8), abs=0.02)
    assert abs(held.mass_kg - before.mass_kg) < 0.3 * before.half_width_95[0]
    assert held.changes == 0


def test_a_push_leaves_no_trace_in_the_estimate(moved):
    pushed = watched(moved, 14.0, moved.pushed(FORCE_N, BEGIN_S, END_S))
    assert pushed.force is Force.FREE
    found, calm = pushed.estimate(), plain(moved, 14.0, moved.empty)
    assert found.changes == 0
    assert abs(found.mass_kg - calm.mass_kg) < 0.3 * calm.half_width_95[0]


@pytest.mark.parametrize("grasp", [True, False])
def test_another_payload_is_decided_within_three_seconds_and_weighed(moved, grasp):
    current = moved.grasped(BEGIN_S) if grasp else moved.grasped(0.0, BEGIN_S)
    watch = watched(moved, BEGIN_S + 4.0, current)
    events = watch.take_events()
    assert [event.kind for event in events] == [ACTING, PAYLOAD]
    assert events[1].time_s - events[0].time_s < LOOKS_S[-1] + 0.2
    found, mass_kg = watch.estimate(), moved.arm.payload.mass_kg if grasp else 0.0
    assert found.changes == 1
    assert abs(found.changed_s - moved.at(BEGIN_S)) < 0.2
    assert abs(found.mass_kg - mass_kg) < found.half_width_95[0] < 0.3


def test_a_payload_that_is_grasped_slowly_is_never_a_push(moved):
    share = np.clip((moved.time_s - moved.at(BEGIN_S)) / 0.4, 0.0, 1.0)[:, None]
    events = watched(moved, BEGIN_S + 4.0, moved.empty + share * (moved.loaded - moved.empty)).take_events()
    assert [event.kind for event in events] == [ACTING, PAYLOAD]


def test_samples_in_any_parts_give_the_same(moved):
    samples = moved.until(12.0, moved.grasped(BEGIN_S))
    # some were lost, so that blocks of a tenth of a second begin anywhere
    samples = [values[np.random.default_rng(3).random(samples[0].size) < 0.9] for values in samples]
    found = []
    for length in (1, 7, 1000, 10_000):
        watch = WatchedPayload(*moved.watched_arm)
        for start in range(0, samples[0].size, length):
            watch.take(*(values[start : start + length] for values in samples))
        found.append((watch.estimate().theta.tolist(), [(event.kind, event.time_s) for event in watch.take_events()]))
    assert all(each == found[0] for each in found)


def test_a_clock_that_is_set_back_begins_a_new_watch(moved):
    watch = watched(moved, BEGIN_S + 0.5, moved.pushed(FORCE_N, BEGIN_S, END_S))
    assert watch.force is not Force.FREE
    time_s, position, current = moved.until(2.0, moved.empty)
    watch.take(time_s - 1000.0, position, current)
    assert watch.force is Force.FREE
    assert watch.estimate().time_s < moved.time_s[0]


def test_a_second_push_is_noticed_after_the_first(moved):
    current = moved.pushed(FORCE_N, BEGIN_S, END_S) + moved.pushed(-FORCE_N, 12.5, 13.0) - moved.empty
    kinds = [event.kind for event in watched(moved, 15.0, current).take_events()]
    assert kinds == [ACTING, PUSH, OVER] * 2


@pytest.mark.parametrize("more", [-1.0, 1.0])
def test_a_payload_that_is_evident_over_seconds_is_noticed_where_no_window_shows_it(moved, monkeypatch, more):
    monkeypatch.setattr(force_watch, "payload_evidence", lambda *_: SUSPECT + more)
    events = watched(moved, 12.0, moved.empty).take_events()
    assert [event.kind for event in events[:1]] == ([ACTING] if more > 0.0 else [])
    assert all(event.joints.any() for event in events)


def test_a_suspicion_without_evidence_ends_within_three_seconds_and_changes_nothing(moved, monkeypatch):
    answers = [SUSPECT + 1.0, SUSPECT + 1.0]
    monkeypatch.setattr(force_watch, "payload_evidence", lambda *_: answers.pop() if len(answers) > 1 else 0.0)
    watch = watched(moved, 14.0, moved.empty)
    events = watch.take_events()
    assert [event.kind for event in events] == [ACTING, NOTHING]
    assert LOOKS_S[-1] <= events[1].time_s - events[0].time_s < LOOKS_S[-1] + 0.2
    assert events[1].since_s == events[0].time_s
    assert watch.force is Force.FREE
    assert np.array_equal(watch.estimate().theta, plain(moved, 14.0, moved.empty).theta)
    answers.append(SUSPECT + 1.0)
    later = watched(moved, 14.0, moved.pushed(FORCE_N, 11.0, 11.7)).take_events()
    assert [event.kind for event in later] == [ACTING, NOTHING, ACTING, PUSH, OVER]


def test_a_pause_longer_than_what_is_remembered_is_no_event(moved):
    time_s, position, current = moved.until(14.0, moved.empty)
    paused_s = time_s + 11.0 * (time_s >= moved.at(8.2))
    watch = WatchedPayload(*moved.watched_arm)
    for begin, end in ((0.0, 4.0), (4.0, 8.0), (8.0, 8.4), (8.4, 14.0)):
        part = slice(*np.searchsorted(time_s, (moved.at(begin), moved.at(end))))
        watch.take(paused_s[part], position[part], current[part])
    assert not watch.take_events()
    assert watch.force is Force.FREE


def test_a_push_that_was_there_first_does_not_hold_the_payload_for_ever(moved, monkeypatch):
    """Its end looks like a push the other way, which lasts longer than all before it."""
    monkeypatch.setattr(force_watch, "OUTLASTS_S", 4.0)
    watch = watched(moved, 16.0, moved.pushed(2.0 * FORCE_N, 0.0, 2.0))
    assert [event.kind for event in watch.take_events()] == [ACTING, PUSH, PAYLOAD]
    assert watch.force is Force.FREE
    found = watch.estimate()
    assert abs(found.mass_kg) < found.half_width_95[0]
