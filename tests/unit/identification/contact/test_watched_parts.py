"""Samples in parts, and what follows from events: states and samples that are kept, held, forgotten and given again."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace
from typing import ClassVar

import numpy as np
import pytest

from armload_identification.contact import watched_payload
from armload_identification.contact.contact_levels import BIN_S
from armload_identification.contact.force_watch import Force, ForceEvent, ForceEventKind
from armload_identification.contact.watched_payload import WatchedPayload

pytestmark = pytest.mark.pure

ROOM = "armload_identification.contact"


@dataclass(frozen=True)
class Estimate:
    seen: int
    changes: int
    time_s: float


class Estimator:
    """Remembers the times of the samples that it was given."""

    def __init__(self, *_):
        self.seen, self.changes, self.exchanged_s = [], 0, None

    def update_all(self, time_s, *_):
        self.seen += np.round(time_s, 6).tolist()

    def become(self, other):
        self.seen, self.changes = list(other.seen), other.changes

    def exchange(self, time_s):
        self.exchanged_s = time_s

    def estimate(self):
        return Estimate(len(self.seen), self.changes, self.seen[-1])


class Watch:
    """Says that something has happened after given parts, by their number."""

    events: ClassVar[dict] = {}
    made: ClassVar[list] = []

    def __init__(self, *_):
        self.state, self.parts, self.suspected = Force.FREE, [], 0
        Watch.made.append(self)

    def take(self, row):
        self.parts.append(row.time_s)
        events = self.events.get(len(self.parts), [])
        for event in events:
            acting = event.kind in {ForceEventKind.ACTING, ForceEventKind.PUSH}
            self.state = Force.ACTING if acting else Force.FREE
        return events

    def suspect(self):
        self.suspected += 1
        return []


class Maker:
    """Makes a row of each part."""

    chain = None

    def __init__(self, *_):
        self.waiting, self.count, self.end_s, self.given = [], 0, -np.inf, []

    def take(self, time_s, *_):
        self.given.append(time_s.size)
        rows = []
        for now_s in time_s:
            self.waiting.append(now_s)
            if now_s >= self.end_s:
                rows.append(SimpleNamespace(number=self.count, time_s=np.array(self.waiting)))
                self.waiting, self.end_s = [], now_s + watched_payload.BIN_S
            self.count += 1
        return rows


@pytest.fixture
def watched(monkeypatch):
    """A watch in which something happens after parts of a tenth of a second."""
    monkeypatch.setattr(f"{ROOM}.watched_payload.BIN_S", 0.1)
    monkeypatch.setattr(f"{ROOM}.watched_payload.PayloadEstimator", Estimator)
    monkeypatch.setattr(f"{ROOM}.watched_payload.ForceWatch", Watch)
    monkeypatch.setattr(f"{ROOM}.watched_payload.RowMaker", Maker)
    monkeypatch.setattr(f"{ROOM}.watched_payload.estimator_constants", lambda *_: SimpleNamespace(from_effort=None))

    def watched(**events):
        Watch.events, Watch.made = {int(part[1:]): [event] for part, event in events.items()}, []
        return WatchedPayload(SimpleNamespace(known_arm=SimpleNamespace(noise_nm=1.0)), None, None)

    return watched


def event(kind, time_s, since_s):
    return ForceEvent(kind, time_s, since_s, np.zeros(1, dtype=bool))


TICK_S = 1.0 / 64.0
"""Seven samples are a tenth of a second; part k ends with sample 7 (k - 1), and is judged at once."""


def give(arm, begin, end, at_once=1, back=0):
    """Samples by their number, some at once."""
    time_s = TICK_S * (np.arange(begin, end) - back)
    for part in np.array_split(time_s, max(len(time_s) // at_once, 1)):
        arm.take(part, part[:, None], part[:, None])


def numbers(arm):
    return np.rint(np.array(arm._estimator.seen) / TICK_S).astype(int).tolist()


def states(arm):
    return [round(time_s / TICK_S) for time_s, _ in arm._states]


@pytest.mark.parametrize("at_once", [1, 4, 1000])
def test_forces_are_looked_for_in_the_same_parts_however_the_samples_come(watched, at_once):
    arm = watched()
    give(arm, 0, 211, at_once)
    parts = Watch.made[0].parts
    assert [len(part) for part in parts] == [1] + [7] * 30
    assert sum(arm._maker.given) == 211
    np.testing.assert_allclose([part[-1] for part in parts], 7 * TICK_S * np.arange(31))
    assert numbers(arm) == list(range(211))
    assert arm.estimate() == Estimate(211, 0, 210 * TICK_S)


@pytest.mark.parametrize(("rate_hz", "together"), [(100, 1), (125, 2), (500, 5)])
def test_a_push_waits_for_no_more_samples_than_come_within_ten_milliseconds(monkeypatch, watched, rate_hz, together):
    monkeypatch.setattr(f"{ROOM}.watched_payload.BIN_S", BIN_S)
    arm = watched()
    time_s = np.arange(101) / rate_hz
    arm.take(time_s, time_s[:, None], time_s[:, None])
    assert {len(part) for part in Watch.made[0].parts[1:]} == {together}


def test_a_state_is_kept_each_half_second_and_samples_for_twelve_seconds(watched):
    """Every fifth part, 0.547 s; of 41 states the last 25. The samples of 768 steps before the last."""
    arm = watched()
    give(arm, 0, 1401)
    assert states(arm) == [35 * number for number in range(16, 41)]
    assert [len(state.seen) for _, state in arm._states] == [1 + 35 * number for number in range(16, 41)]
    assert [piece[0][-1] for piece in arm._samples] == [TICK_S * k for k in range(632, 1401)]


def test_while_something_acts_the_payload_of_before_is_held(watched):
    """The last state 0.3 s before the onset at 2 s is that of sample 105."""
    arm = watched(p20=event(ForceEventKind.ACTING, 2.2, 2.0))
    give(arm, 0, 192)
    assert arm.force is Force.ACTING
    assert arm.estimate() == Estimate(106, 0, 191 * TICK_S)
    assert [found.kind for found in arm.take_events()] == [ForceEventKind.ACTING]
    assert not arm.has_news
    assert states(arm) == [0, 35, 70, 105], "none while something acts"
    arm._estimator.changes = 3
    assert arm.changes == 0


def test_nothing_evident_ends_it(watched):
    arm = watched(p20=event(ForceEventKind.ACTING, 2.2, 2.0), p25=event(ForceEventKind.NOTHING, 2.7, 2.0))
    give(arm, 0, 192)
    assert arm.estimate() == Estimate(192, 0, 191 * TICK_S)


def test_another_payload_is_estimated_from_half_a_second_after_its_onset(watched):
    """The onset at 1.9 s is after sample 121, half a second later before sample 154."""
    arm = watched(p20=event(ForceEventKind.ACTING, 2.2, 2.0), p40=event(ForceEventKind.PAYLOAD, 4.3, 1.9))
    give(arm, 0, 285)
    assert arm._estimator.exchanged_s == 1.9
    assert numbers(arm) == [*range(122), *range(154, 285)]
    assert states(arm) == [0, 35, 70, 105, 273]


def test_a_push_is_left_out_from_0_3_s_before_it_to_its_end(watched):
    """From 1.5 s, after sample 96, to the end of part 40."""
    arm = watched(
        p20=event(ForceEventKind.ACTING, 2.2, 2.0),
        p30=event(ForceEventKind.PUSH, 3.2, 1.8),
        p40=event(ForceEventKind.OVER, 273 * TICK_S, 3.7),
    )
    give(arm, 0, 291)
    assert numbers(arm) == [*range(97), *range(274, 291)]
    assert arm.estimate().time_s == 290 * TICK_S


def test_a_change_that_the_estimator_finds_is_looked_at(watched):
    arm = watched()
    give(arm, 0, 72)
    arm._estimator.changes = 1
    give(arm, 72, 78)
    assert Watch.made[0].suspected == 1
    give(arm, 78, 99)
    assert Watch.made[0].suspected == 1


@pytest.mark.parametrize(("back", "anew"), [(64, False), (66, True)])
def test_a_clock_that_goes_back_by_a_second_begins_a_new_watch(watched, back, anew):
    """The 200th sample again, as if it had come 64 or 66 samples earlier."""
    arm = watched()
    give(arm, 0, 200)
    give(arm, 199, 201, back=back)
    assert len(Watch.made) == 1 + anew
    assert states(arm)[0] == (199 - back if anew else 0)
    assert [part.size for part in Watch.made[-1].parts[:2]] == ([1] if anew else [1, 7])


@pytest.mark.parametrize("at_once", [1, 1000])
def test_rows_of_a_clock_that_was_set_back_are_made_anew(watched, at_once):
    arm = watched()
    give(arm, 0, 200, at_once)
    give(arm, 200, 250, at_once, back=150)
    before, after = Watch.made
    assert [part.size for part in before.parts] == [1] + [7] * 28
    assert [part.size for part in after.parts] == [1] + [7] * 7
    assert after.parts[0] == 50 * TICK_S
