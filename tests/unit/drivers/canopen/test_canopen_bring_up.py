"""The status of an arm's bus, and which nodes are found on one."""

from types import SimpleNamespace

import pytest

from armload_drivers.canopen import canopen_bring_up
from armload_drivers.canopen.canopen_bring_up import CanopenBringUp, find_nodes
from armload_drivers.cia402.arm_settings import NODE_IDS
from armload_drivers.cia402.timeouts import Timeouts


class Link:
    """A link on which bits are heard while time passes."""

    def __init__(self, bus):
        self.bus, self.busiest_bits, self.error_frames, self.error_passive = bus, 0, 3, True

    def pump(self, left_s):
        self.bus.now_s += min(left_s, 0.3)
        self.busiest_bits += 60_000


@pytest.fixture
def bus(monkeypatch):
    """A bus whose time passes only while it is listened to."""
    bus = SimpleNamespace(now_s=100.0)
    monkeypatch.setattr(canopen_bring_up, "BusLink", Link)
    monkeypatch.setattr(canopen_bring_up.time, "monotonic", lambda: bus.now_s)
    monkeypatch.setattr(canopen_bring_up, "canopen_setups", lambda arm, link, timeouts: [(link, timeouts)])
    return bus


def test_the_load_of_the_bus_is_that_of_the_time_that_was_listened(bus, arm_settings, monkeypatch):
    """1 Mbit/s: four times 60,000 bits in a second are 24 %."""
    seen = []
    monkeypatch.setattr(canopen_bring_up, "drive_status", lambda setup, timeouts: seen.append(setup) or "status")
    bring_up = CanopenBringUp(arm_settings(), bus)
    status = bring_up.status(1.0)
    assert bus.now_s == pytest.approx(101.0)
    assert status.bus_load == pytest.approx(0.24)
    assert (status.drives, status.error_frames, status.error_passive) == (("status",), 3, True)
    ((link, timeouts),) = seen
    assert link is not bring_up._link, "its counters begin at zero"
    assert timeouts == Timeouts()


def test_drives_that_do_not_boot_are_returned_and_strangers_refused_by_the_arms_limits(bus, arm_settings, monkeypatch):
    given = []
    for name in ("reset_drives", "powered_on_bus", "require_no_strangers"):
        monkeypatch.setattr(canopen_bring_up, name, lambda *values, name=name: given.append((name, values)) or [name])
    limits = Timeouts(scan_s=0.7, boot_s=9.0)
    bring_up = CanopenBringUp(arm_settings(), bus, limits)
    setups, arm, link = bring_up.setups, bring_up.arm, bring_up._link
    assert bring_up.restart(setups) == ["reset_drives"]
    assert bring_up.powered_drives(setups) == ["powered_on_bus"]
    bring_up.require_no_strangers()
    assert given == [
        ("reset_drives", (setups, (), link, 9.0)),
        ("powered_on_bus", (setups, arm, link)),
        ("require_no_strangers", (link, arm, 0.7)),
    ]


@pytest.mark.parametrize(
    ("limits", "scan_s", "sdo_s"), [((), 0.2, 0.5), ((Timeouts(scan_s=0.4, sdo_s=2.0),), 0.4, 2.0)]
)
def test_all_nodes_that_answer_are_described(bus, monkeypatch, limits, scan_s, sdo_s):
    asked = []

    def scan(link, nodes, time_s):
        asked.append((nodes, time_s))
        return {5: ["a"], 9: ["b", "c"]}

    monkeypatch.setattr(canopen_bring_up, "scan", scan)
    monkeypatch.setattr(canopen_bring_up, "CanopenSdo", lambda node_id, joint, link, limit_s: (node_id, joint, limit_s))
    monkeypatch.setattr(canopen_bring_up, "inspect_node", lambda sdo, node_id, types: (sdo, node_id, types))
    assert find_nodes(bus, *limits) == [
        ((5, "unknown joint", sdo_s), 5, ["a"]),
        ((9, "unknown joint", sdo_s), 9, ["b", "c"]),
    ]
    assert asked == [(sorted(NODE_IDS), scan_s)]
