"""Bring-up of an arm on a line of which a test decides what is there."""

from dataclasses import replace
from types import SimpleNamespace

import pytest

from armload_drivers.cia402 import object_dictionary as od
from armload_drivers.cia402.process_data.drive_units import ArmUnits
from armload_drivers.cia402.process_data.process_image import feedback_entries, setpoint_entries
from armload_drivers.cia402.state_machine import State
from armload_drivers.cia402.timeouts import Timeouts
from armload_drivers.driver_errors import BusError, WrongDevice
from armload_drivers.ethercat import ethercat_bring_up
from armload_drivers.ethercat.ethercat_bring_up import EthercatBringUp
from armload_drivers.ethercat.ethercat_line import LineState
from armload_drivers.ethercat.pdo_assignment import FramePart
from tests.scripted_sdo import ScriptedSdo

STANDSTILL_RAD_S, WATCH_S = 0.005, 0.25

SERVO, CLAMP = 0x0002_0192, 0x0000_0191


class Line:
    """Six devices; an arm's drives have node ids 2, 3 and 5.

    Attributes:
        types: Device type by node id; others have no objects.
        lengths: Bytes of outputs and inputs by place.
    """

    worker, interface, size = None, "eth9", 6

    def __init__(self):
        self.types = {}
        self.lengths = dict.fromkeys(range(6), (8, 8))
        self.requested, self.reached, self.clocked, self.found = [], set(range(6)), [], 0

    def find(self):
        self.found += 1

    def request(self, state, place=None):
        self.requested.append(state)

    def reaches(self, state, place, limit_s):
        assert state is LineState.PREOP
        return place in self.reached

    def map(self):
        return self.lengths

    def follow_clock(self, place, cycle_s):
        self.clocked.append(place)
        return place != 2

    def statuses(self):
        return [LineState.PREOP.value] * 6

    def on_emergency(self, place, take):
        pass


@pytest.fixture
def rig(arm_settings, monkeypatch):
    line = Line()

    def channel(node_id, joint, line_, worker, timeout_s):
        sdo = ScriptedSdo({od.DEVICE_TYPE: line.types[node_id]} if node_id in line.types else {})
        sdo.silent = node_id not in line.types
        return sdo

    monkeypatch.setattr(ethercat_bring_up, "CoeSdo", channel)

    def rig(other_nodes=(), **changes):
        arm = replace(arm_settings(**changes), other_nodes=frozenset(other_nodes))
        return EthercatBringUp(arm, line, SimpleNamespace(now_s=lambda: 0.0), Timeouts(sdo_s=0.1)), line

    return rig


def test_other_devices_are_no_strangers_but_another_drive_is(rig):
    bring_up, line = rig()
    bring_up.find()
    assert line.found == 1
    line.types = {1: CLAMP}
    bring_up.require_no_strangers()
    line.types = {1: CLAMP, 6: SERVO}
    with pytest.raises(WrongDevice, match="it names 3") as raised:
        bring_up.require_no_strangers()
    assert raised.value.node_id == 6
    rig(other_nodes=[6])[0].require_no_strangers()


class Setup:
    """A drive that carries torque, or not."""

    def __init__(self, settings, state=None, counts=(0, 0)):
        self.settings, self.state, self.counts = settings, state, list(counts)
        self.counts_per_rad = 1e5

    def read_powered_state(self):
        return self.state

    def read_position(self):
        return self.counts.pop(0)

    def read_units(self):
        return self


@pytest.mark.parametrize(("share", "abandoned"), [(0.9, True), (-0.9, True), (1.1, False), (-1.1, False)])
def test_a_drive_with_torque_is_watched_for_its_speed(rig, monkeypatch, share, abandoned):
    bring_up, _ = rig()
    slept = []
    monkeypatch.setattr(ethercat_bring_up.time, "sleep", slept.append)
    way = round(share * STANDSTILL_RAD_S * WATCH_S * 1e5)
    drives = bring_up.arm.drives
    idle, holds = Setup(drives[0]), Setup(drives[1], State.QUICK_STOP_ACTIVE, (500, 500 + way))
    (found,) = bring_up.powered_drives([idle, holds])
    assert found.setup is holds
    assert found.abandoned is abandoned
    assert slept == [WATCH_S]
    assert bring_up.powered_drives([idle]) == []
    assert slept == [WATCH_S]


def test_drives_that_are_not_in_preop_are_returned(rig):
    bring_up, line = rig()
    line.reached = {1, 4}
    assert bring_up.restart(bring_up.setups) == [bring_up.setups[1]]


def mapped(bring_up):
    """Lets all drives have their objects in order."""
    for setup in bring_up.line_setups:
        for name, entries in (("outputs", setpoint_entries), ("inputs", feedback_entries)):
            offsets, at = {}, 0
            for entry in entries(setup.settings):
                offsets[entry] = at
                at += entry.type.bits // 8
            setattr(setup, name, FramePart(at, offsets, ()))
    return [(setup.outputs.length, setup.inputs.length) for setup in bring_up.line_setups]


def test_a_cycle_needs_the_lengths_that_the_drives_report(rig):
    bring_up, line = rig()
    line.lengths = {1: (8, 8), 2: (8, 8), 4: (8, 8)}
    assert mapped(bring_up) == [(8, 8)] * 3
    units = ArmUnits(bring_up.arm, [0, 0, 0])
    cycle = bring_up.cycle(units)
    assert list(cycle.nodes) == bring_up.nodes
    assert line.requested == [LineState.PREOP]
    assert not any(node.in_op for node in bring_up.nodes)
    assert line.clocked == []
    line.lengths[2] = (8, 6)
    with pytest.raises(BusError, match=r"joint_3: its frame part has \(8, 6\) bytes"):
        bring_up.cycle(units)


def test_a_drive_on_sync0_needs_a_clock_in_the_line(rig):
    bring_up, line = rig(sync0=True)
    mapped(bring_up)
    with pytest.raises(BusError, match="joint_3: sync0 = true, but no drive of the line has a distributed clock"):
        bring_up.cycle(ArmUnits(bring_up.arm, [0, 0, 0]))
    assert line.clocked == [1, 2]
