"""SYNC in virtual time: the order of drain, time, command and message."""

import pytest

from armload_drivers.bus.sync_sources import SyncTick, sync_messages
from armload_drivers.simulation.lockstep_sync import LockstepSync

pytestmark = pytest.mark.pure


class Noted:
    """A bus and a clock that note what happens, in order."""

    def __init__(self):
        self.events, self.time_s = [], 5.0

    def __call__(self):
        return self.time_s

    def advance(self, by_s):
        self.time_s += by_s
        self.events.append(("advance", by_s))

    def require_follower(self):
        self.events.append("follower")

    def drain(self):
        self.events.append("drain")

    def send(self, message):
        self.events.append(bytes(message.data))


@pytest.mark.parametrize(("counter", "sent"), [(0, [b"", b"", b""]), (2, [b"\x01", b"\x02", b"\x01"])])
def test_time_passes_by_a_period_before_every_sync(counter, sent):
    noted = Noted()
    sync = LockstepSync(noted)
    sync.begin(noted, 0.25, counter)
    assert sync.now_s() == 5.0
    for number, data in enumerate(sent, start=1):
        tick = sync.next(noted, lambda: noted.events.append("command"))
        assert tick == SyncTick(5.0 + 0.25 * number, 0)
        assert noted.events == ["drain", ("advance", 0.25), "command", data]
        noted.events.clear()
    assert next(sync_messages(counter)).data == sent[0]


@pytest.mark.parametrize(("complete", "events"), [(True, ["drain"]), (False, ["drain", "follower"])])
def test_feedback_that_is_not_there_yet_will_not_come(complete, events):
    noted = Noted()
    LockstepSync(noted).await_feedback(noted, lambda: complete)
    assert noted.events == events
