"""Looking at drives: who is there, what bring-up would say, how they fare, one fault reset."""

import time
import uuid
from contextlib import ExitStack
from dataclasses import replace

import can
import numpy as np
import pytest

from armload_drivers.arm import SIMULATION_IDENTITY, Identity
from armload_drivers.cia402 import State
from armload_drivers.errors import ServoError, ServoFault
from armload_drivers.inspection import Verdict, check, find_nodes, reset, show
from armload_drivers.simulated_dictionary import DriveTraits
from armload_drivers.simulated_drives import SimulatedDrives
from armload_drivers.simulated_plant import IdealPlant
from armload_drivers.timeouts import Timeouts

LIMITS = Timeouts(probe_s=0.05, scan_s=0.05, boot_s=0.3, sdo_s=0.3, mode_s=0.05, fault_reset_s=0.5)


class Bench:
    def __init__(self, stack, arm, traits):
        channel = uuid.uuid4().hex
        self.arm, self.plant = arm, IdealPlant(np.array([0.1, -0.2, 0.3]))
        self.bus, drives_bus, self.other = (
            stack.enter_context(can.Bus(interface="virtual", channel=channel)) for _ in range(3)
        )
        self.drives = stack.enter_context(SimulatedDrives(arm, self.plant, drives_bus, time.monotonic, traits))

    def frames(self):
        found = []
        while (message := self.other.recv(0.02)) is not None:
            found.append(message)
        return found


@pytest.fixture
def bench(arm_settings):
    with ExitStack() as stack:
        yield lambda traits=None, arm=None: Bench(stack, arm or arm_settings(), traits)


def only_read(frames):
    requests = [m for m in frames if 0x600 < m.arbitration_id < 0x680]
    assert requests
    return all(m.data[0] >> 5 in {2, 3, 4} for m in requests) and not [m for m in frames if m.arbitration_id == 0]


def test_scan_finds_everybody_and_only_reads(bench):
    rig = bench({3: DriveTraits(absent=frozenset({0x6007, 0x1008}), modes=frozenset({7, 8}))})
    rig.frames()
    nodes = find_nodes(rig.bus, LIMITS)
    assert [node.node_id for node in nodes] == [2, 3, 5]
    assert all(node.is_drive for node in nodes)
    first, second, _ = nodes
    assert first.name == "armload simulated drive, joint_2"
    assert (first.identity.vendor_id, first.modes, first.missing) == (SIMULATION_IDENTITY.vendor_id, (8,), ())
    assert (second.name, second.modes, second.missing) == ("", (7, 8), ("6007",))
    assert only_read(rig.frames())


def test_a_device_of_another_kind_is_no_drive(bench):
    rig = bench({3: DriveTraits(device_type=0x0004_0191)})
    assert [node.is_drive for node in find_nodes(rig.bus, LIMITS)] == [True, False, True]


def test_check_goes_on_after_what_is_wrong(bench):
    rig = bench({
        2: DriveTraits(absent=frozenset({0x1029})),
        3: DriveTraits(takes_mode=False),
        5: DriveTraits(identity=Identity(1, 2)),
    })  # fmt: skip
    rows = check(rig.arm, rig.bus, LIMITS)
    wrong = {(row.node_id, row.step) for row in rows if row.verdict is Verdict.WRONG}
    assert wrong == {(3, "mode"), (5, "identity")}
    assert [row.node_id for row in rows] == sorted(row.node_id for row in rows)
    assert {row.step for row in rows if row.verdict is Verdict.NOT_DONE} == {"limits"}
    assert any("6061" in row.detail for row in rows)
    assert not any(rig.plant.powered)


def test_check_tells_what_is_missing_and_what_must_not_be(bench):
    rig = bench({2: DriveTraits(absent=frozenset({0x1029})), 3: DriveTraits(absent=frozenset({0x6007}))})
    rows = check(rig.arm, rig.bus, LIMITS)
    missing = [(row.node_id, row.detail) for row in rows if row.verdict is Verdict.MISSING]
    assert missing == [(2, "1029:1 communication error behaviour")]
    refused = [row for row in rows if row.verdict is Verdict.WRONG]
    assert [(row.node_id, row.step) for row in refused] == [(3, "limits")]
    assert "accept_missing" in refused[0].detail


def test_check_of_an_arm_in_order_and_of_one_that_is_not_there(bench):
    rig = bench()
    assert {row.verdict for row in check(rig.arm, rig.bus, LIMITS)} == {Verdict.OK}
    for node in (2, 3, 5):
        rig.drives.switch_off(node)
    rows = check(rig.arm, rig.bus, LIMITS)
    assert [row.step for row in rows if row.verdict is Verdict.WRONG] == ["answers"] * 3


def test_check_keeps_away_from_a_drive_that_carries_torque(bench):
    rig = bench()
    for data in ("2b40600006000000", "2b40600007000000", "2b4060000f000000"):
        rig.other.send(can.Message(arbitration_id=0x603, data=bytes.fromhex(data), is_extended_id=False))
        time.sleep(0.01)
    rig.frames()
    rows = check(rig.arm, rig.bus, LIMITS)
    assert [row.detail for row in rows if row.verdict is Verdict.WRONG and "carries torque" in row.detail]
    assert not [m for m in rig.frames() if m.arbitration_id == 0 and m.data[1] in {0, 3}], "it is not reset"
    assert rig.plant.powered == [False, True, False]


def test_show_only_reads(bench):
    rig = bench({5: DriveTraits(absent=frozenset({0x603F}))})
    rig.drives.switch_off(3)
    rig.frames()
    status = show(rig.arm, rig.bus, LIMITS, listen_s=0.05)
    first, second, third = status.drives
    assert first.state is State.SWITCH_ON_DISABLED
    assert first.position_rad == pytest.approx(0.1, abs=1e-5)
    assert (first.effort, first.effort_unit, first.error_code) == (0.0, "A", 0)
    assert second.state is None
    assert "no answer" in second.trouble
    assert third.error_code is None
    assert 0.0 <= status.bus_load < 0.02, "the boot-up messages at most"
    assert only_read(rig.frames())


def test_show_tells_a_contradiction(bench, arm_settings):
    rig = bench()
    wrong = replace(rig.arm, drives=tuple(replace(d, counts_per_rad=5.0) for d in rig.arm.drives))
    status = show(wrong, rig.bus, LIMITS, listen_s=0.01)
    assert all("position units" in drive.trouble for drive in status.drives)


def test_one_fault_is_reset_by_name(bench):
    rig = bench()
    rig.drives.fail(3, 0x4310)
    rig.drives.fail(5, 0x4310)
    time.sleep(0.05)
    assert reset(rig.arm, "joint_3", rig.bus, LIMITS) is State.SWITCH_ON_DISABLED
    states = [drive.state for drive in show(rig.arm, rig.bus, LIMITS, listen_s=0.01).drives]
    assert states == [State.SWITCH_ON_DISABLED, State.SWITCH_ON_DISABLED, State.FAULT]
    assert not any(rig.plant.powered)


def test_a_fault_whose_cause_stays_is_told(bench):
    rig = bench()
    rig.drives.fail(3, 0x4310, persistent=True)
    time.sleep(0.05)
    with pytest.raises(ServoFault, match="0x4310"):
        reset(rig.arm, "joint_3", rig.bus, LIMITS)


def test_without_a_fault_there_is_nothing_to_reset(bench):
    rig = bench()
    with pytest.raises(ServoError, match="nothing to reset"):
        reset(rig.arm, "joint_3", rig.bus, LIMITS)
