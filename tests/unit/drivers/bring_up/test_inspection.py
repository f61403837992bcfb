"""Inspection of drives: scan, check as in bring-up, status, and the reset of one fault."""

from contextlib import ExitStack
from dataclasses import replace

import can
import numpy as np
import pytest

from armload_drivers.bring_up.drive_check import Verdict, check, reset
from armload_drivers.canopen.canopen_bring_up import CanopenBringUp, find_nodes
from armload_drivers.cia402.arm_settings import SIMULATION_IDENTITY, Identity, VendorObject
from armload_drivers.cia402.drive_safety import Safety
from armload_drivers.cia402.eds_parser import parse_description
from armload_drivers.cia402.object_dictionary import DataType
from armload_drivers.cia402.state_machine import State
from armload_drivers.cia402.timeouts import Timeouts
from armload_drivers.driver_errors import ServoError, ServoFault, WrongDevice
from armload_drivers.simulation.drives.drive_dictionary import DriveTraits
from armload_drivers.simulation.drives.drives_on_bus import SimulatedDrives
from armload_drivers.simulation.lockstep_bus import LockstepBus, LockstepWire
from armload_drivers.simulation.virtual_clock import VirtualClock
from tests.bounded import overheard
from tests.drive_descriptions import eds, maker_drive
from tests.ideal_plant import IdealPlant

LIMITS = Timeouts(probe_s=0.2, scan_s=0.2, boot_s=0.5, sdo_s=1.0, mode_s=0.05, fault_reset_s=0.1)


class Bench:
    def __init__(self, stack, arm, traits):
        wire = LockstepWire()
        self.arm, self.plant = arm, IdealPlant(np.array([0.1, -0.2, 0.3]))
        self.bus, drives_bus, self.other = (stack.enter_context(LockstepBus(wire)) for _ in range(3))
        self.drives = stack.enter_context(SimulatedDrives(arm, self.plant, drives_bus, VirtualClock(), traits))

    def frames(self):
        return overheard(self.other)


@pytest.fixture
def bench(arm_settings):
    with ExitStack() as stack:
        yield lambda traits=None, arm=None: Bench(stack, arm or arm_settings(), traits)


def never_asked(question):
    """Fails when called: a simulation needs no consent."""
    raise AssertionError(question)


SWITCH_ON = ("2b40600006000000", "2b40600007000000", "2b4060000f000000")
STOP_AND_STAY = ("2b5a600006000000", *SWITCH_ON, "2b40600002000000")
"""605A = 6, and a quick stop at the end."""


def energise(rig, node_id, requests=SWITCH_ON):
    """Another master switches a drive on, by SDO."""
    for data in requests:
        rig.other.send(can.Message(arbitration_id=0x600 + node_id, data=bytes.fromhex(data), is_extended_id=False))


REAL = Identity(0x02DC, 0x1234_5678)


def real_arm(arm, identity):
    """The arm's settings with this identity of its drives."""
    return replace(arm, drives=tuple(replace(drive, identity=identity) for drive in arm.drives))


def only_read(frames):
    requests = [m for m in frames if 0x600 < m.arbitration_id < 0x680]
    assert requests
    return all(m.data[0] >> 5 in {2, 3, 4} for m in requests) and not [m for m in frames if m.arbitration_id == 0]


def test_scan_finds_everybody_and_only_reads(bench):
    rig = bench({3: DriveTraits(absent=frozenset({0x605A, 0x1008}), modes=frozenset({7, 8}))})
    rig.frames()
    nodes = find_nodes(rig.bus, LIMITS)
    assert [node.node_id for node in nodes] == [2, 3, 5]
    assert all(node.is_drive for node in nodes)
    first, second, _ = nodes
    assert first.name == "armload simulated drive, joint_2"
    assert (first.identity.vendor_id, first.modes, first.missing) == (SIMULATION_IDENTITY.vendor_id, (8,), ())
    assert (second.name, second.modes, second.missing) == ("", (7, 8), ("quick_stop",))
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
    rows = check(CanopenBringUp(rig.arm, rig.bus, LIMITS)).steps
    wrong = {(row.node_id, row.step) for row in rows if row.verdict is Verdict.WRONG}
    assert wrong == {(3, "mode"), (5, "identity")}
    assert [row.node_id for row in rows] == sorted(row.node_id for row in rows)
    assert {row.step for row in rows if row.verdict is Verdict.NOT_DONE} == {"safety"}
    assert any("6061" in row.detail for row in rows)
    assert not any(rig.plant.powered)


def test_check_reports_what_is_missing_and_what_must_not_be(bench):
    rig = bench({2: DriveTraits(absent=frozenset({0x1029})), 3: DriveTraits(absent=frozenset({0x605A}))})
    found = check(CanopenBringUp(rig.arm, rig.bus, LIMITS))
    missing = [(row.node_id, row.detail) for row in found.steps if row.verdict is Verdict.MISSING]
    assert missing == [(2, "1029:1 communication error behaviour"), (3, "605A:0 quick stop option code")]
    refused = [row for row in found.steps if row.verdict is Verdict.WRONG]
    assert [(row.node_id, row.step) for row in refused] == [(3, "safety")]
    assert "accept_missing" in refused[0].detail
    assert [[f.of for f in drive.safety if f.refused] for drive in found.secured] == [[], [Safety.QUICK_STOP], []]
    assert [len(drive.safety) for drive in found.secured] == [len(Safety)] * 3


def test_check_of_an_arm_in_order_and_of_one_that_is_not_there(bench):
    rig = bench()
    assert {row.verdict for row in check(CanopenBringUp(rig.arm, rig.bus, LIMITS)).steps} == {Verdict.OK}
    for node in (2, 3, 5):
        rig.drives.switch_off(node)
    rows = check(CanopenBringUp(rig.arm, rig.bus, LIMITS)).steps
    assert [row.step for row in rows if row.verdict is Verdict.WRONG] == ["answers"] * 3


def test_check_keeps_away_from_a_drive_that_carries_torque(bench):
    rig = bench()
    energise(rig, 3)
    rig.frames()
    rows = check(CanopenBringUp(rig.arm, rig.bus, LIMITS)).steps
    (wrong,) = (row for row in rows if row.verdict is Verdict.WRONG)
    assert (wrong.node_id, wrong.step) == (3, "torque")
    assert wrong.detail.startswith("the drive carries torque in OPERATION ENABLED: another program")
    assert {row.step for row in rows if row.verdict is Verdict.NOT_DONE} == {"reset"}
    assert only_read(rig.frames()), "no drive of the arm is reset or written to"
    assert rig.plant.powered == [False, True, False]


def test_check_and_reset_report_a_drive_whose_master_has_ended(bench):
    rig = bench()
    energise(rig, 3, STOP_AND_STAY)
    rig.drives.fail(5, 0x4310)
    rig.frames()
    (wrong,) = (row for row in check(CanopenBringUp(rig.arm, rig.bus, LIMITS)).steps if row.verdict is Verdict.WRONG)
    held = "the drive holds its position with torque, in QUICK STOP ACTIVE; its master has ended. Press the emergency"
    assert (wrong.node_id, wrong.detail[: len(held)]) == (3, held)
    with pytest.raises(ServoError, match=held):
        reset(CanopenBringUp(rig.arm, rig.bus, LIMITS), "joint_5", never_asked)
    assert only_read(rig.frames()), "not taken over either"
    assert rig.plant.powered == [False, True, False]


def test_check_writes_to_nothing_while_a_drive_does_not_report_its_state(bench):
    rig = bench({3: DriveTraits(on_request=lambda request: 0x0800_0000 if request[:3] == b"\x40\x41\x60" else None)})
    rig.frames()
    rows = check(CanopenBringUp(rig.arm, rig.bus, LIMITS)).steps
    assert [(row.node_id, row.step) for row in rows if row.verdict is Verdict.WRONG] == [(3, "torque")]
    assert only_read(rig.frames())


def lying(rig, cob_id, request, value):
    """From now on the answers to an upload have another value."""
    receive = rig.bus.recv

    def recv(timeout=None):
        message = receive(timeout)
        if message is not None and message.arbitration_id == cob_id and message.data[1:4] == request:
            message.data[4:8] = value.to_bytes(4, "little")
        return message

    rig.bus.recv = recv


def test_a_statusword_that_matches_no_state_is_no_state_without_torque(bench):
    rig = bench()
    lying(rig, 0x583, b"\x41\x60\x00", 0x0001)
    rig.frames()
    (wrong,) = (row for row in check(CanopenBringUp(rig.arm, rig.bus, LIMITS)).steps if row.verdict is Verdict.WRONG)
    assert (wrong.node_id, wrong.step) == (3, "torque")
    assert "statusword 0x0001 matches no state of CiA 402" in wrong.detail
    with pytest.raises(ServoError, match=r"joint_3.*0x0001 matches no state"):
        reset(CanopenBringUp(rig.arm, rig.bus, LIMITS), "joint_5", never_asked)
    assert only_read(rig.frames())


def test_check_reports_a_drive_that_does_not_come_back(bench):
    rig = bench({3: DriveTraits(boot_message=False)})
    with LockstepBus(rig.bus.wire) as supply:
        supply.listen(lambda message: message.arbitration_id == 0 and rig.drives.switch_off(3))
        rows = check(CanopenBringUp(rig.arm, rig.bus, LIMITS)).steps
    wrong = [row for row in rows if row.verdict is Verdict.WRONG]
    assert {row.node_id for row in wrong} == {3}
    assert wrong[0].step == "boot"


def test_check_reports_a_drive_that_the_configuration_does_not_name(bench):
    rig = bench()
    fewer = replace(rig.arm, drives=rig.arm.drives[:2], coupling=np.eye(2))
    wrong = [row for row in check(CanopenBringUp(fewer, rig.bus, LIMITS)).steps if row.verdict is not Verdict.OK]
    assert [(row.node_id, row.step) for row in wrong] == [(5, "other drives")]
    assert "other_nodes" in wrong[0].detail
    assert not [
        row
        for row in check(CanopenBringUp(replace(fewer, other_nodes=frozenset({5})), rig.bus, LIMITS)).steps
        if row.verdict is Verdict.WRONG
    ]


def test_check_writes_to_no_real_drive_that_nobody_named(bench, arm_settings):
    rig = bench({3: DriveTraits(identity=REAL)}, arm_settings(identity=Identity(None, None)))
    rig.frames()
    rows = check(CanopenBringUp(rig.arm, rig.bus, LIMITS)).steps
    anonymous = [row for row in rows if row.step == "identity" and row.verdict is Verdict.NOT_DONE]
    assert [row.node_id for row in anonymous] == [3]
    assert "identity = { vendor_id = 0x000002DC, product_code = 0x12345678 }" in anonymous[0].detail
    frames = rig.frames()
    assert only_read([m for m in frames if m.arbitration_id == 0x603])
    assert {m.data[1] for m in frames if m.arbitration_id == 0} == {2, 5}, "the simulated ones are"


@pytest.mark.parametrize(
    ("vendor", "product", "verdict"),
    [(0x02DC, 0x1234_5678, Verdict.OK), (0x02DC, 0, Verdict.WRONG), (0, 0, Verdict.NOT_DONE)],
)
def test_a_description_names_a_drive_by_vendor_and_product(bench, arm_settings, vendor, product, verdict):
    described = parse_description(eds(maker_drive(), vendor, product).encode(), "drive.eds")
    arm = arm_settings(identity=Identity(None, None), description=described)
    assert {drive.is_named for drive in arm.drives} == {vendor != 0}
    rig = bench(dict.fromkeys((2, 3, 5), DriveTraits(identity=REAL)), arm)
    rows = [row for row in check(CanopenBringUp(rig.arm, rig.bus, LIMITS)).steps if row.step == "identity"]
    assert {row.verdict for row in rows} == {verdict}
    if verdict is not Verdict.OK:
        assert all("identity = { vendor_id = 0x000002DC, product_code = 0x12345678 }" in row.detail for row in rows)


def test_the_vendor_is_sufficient_where_a_drive_reports_no_product_code(bench, arm_settings):
    named = arm_settings(identity=Identity(0x02DC, None))
    nameless = DriveTraits(identity=REAL, on_request=lambda data: 0x0609_0011 if data[1:4] == b"\x18\x10\2" else None)
    rig = bench(dict.fromkeys((2, 3, 5), nameless), named)
    assert {row.verdict for row in check(CanopenBringUp(rig.arm, rig.bus, LIMITS)).steps} == {Verdict.OK}


def test_a_drive_that_is_not_named_is_read_and_not_written_to(bench, arm_settings):
    """What else must be set is said at once."""
    traits = DriveTraits(identity=REAL, absent=frozenset({0x6078, 0x60B2}))
    rig = bench(dict.fromkeys((2, 3, 5), traits), arm_settings(identity=Identity(None, None)))
    rows = check(CanopenBringUp(rig.arm, rig.bus, LIMITS)).steps
    said = "\n".join(row.detail for row in rows if row.node_id == 3)
    for advice in ("identity = {", 'feedback = "torque"', "torque_offset = false"):
        assert advice in said
    assert not [frame for frame in rig.frames() if frame.arbitration_id >> 7 == 0xC and frame.data[0] >> 5 == 1]


def test_check_of_a_real_arm_that_the_file_names(bench, arm_settings):
    traits = dict.fromkeys((2, 3, 5), DriveTraits(identity=REAL))
    rig = bench(traits, arm_settings(identity=REAL))
    assert {row.verdict for row in check(CanopenBringUp(rig.arm, rig.bus, LIMITS)).steps} == {Verdict.OK}


def test_show_only_reads(bench):
    rig = bench({5: DriveTraits(absent=frozenset({0x603F}))})
    rig.drives.switch_off(3)
    rig.frames()
    status = CanopenBringUp(rig.arm, rig.bus, LIMITS).status(0.05)
    first, second, third = status.drives
    assert first.state is State.SWITCH_ON_DISABLED
    assert first.position_rad == pytest.approx(0.1, abs=1e-5)
    assert (first.effort, first.effort_unit, first.error_code) == (0.0, "A", 0)
    assert second.state is None
    assert second.trouble == f"no answer within {LIMITS.probe_s} s"
    assert third.error_code is None
    assert 0.0 <= status.bus_load < 0.02, "the boot-up messages at most"
    assert only_read(rig.frames())


@pytest.mark.parametrize(("kind", "per_unit"), [(DataType.I16, 0.1), (DataType.U8, 1.0), (DataType.F32, 1.0)])
def test_show_reports_a_vendors_temperature(bench, arm_settings, kind, per_unit):
    arm = arm_settings(temperature=VendorObject(0x3201, 1, kind, per_unit))
    rig = bench({5: DriveTraits(absent=frozenset({0x3201}))}, arm)
    shown = [drive.temperature_celsius for drive in CanopenBringUp(rig.arm, rig.bus, LIMITS).status(0.01).drives]
    assert shown[:2] == pytest.approx([40.0, 40.0])
    assert shown[2] is None


def test_show_reports_no_temperature_where_none_is_configured(bench):
    rig = bench()
    status = CanopenBringUp(rig.arm, rig.bus, LIMITS).status(0.01)
    assert {drive.temperature_celsius for drive in status.drives} == {None}


def test_show_reports_a_contradiction(bench, arm_settings):
    rig = bench()
    wrong = replace(rig.arm, drives=tuple(replace(d, counts_per_rad=5.0) for d in rig.arm.drives))
    status = CanopenBringUp(wrong, rig.bus, LIMITS).status(0.01)
    assert all("position units" in drive.trouble for drive in status.drives)


def test_one_fault_is_reset_by_name(bench):
    rig = bench()
    rig.drives.fail(3, 0x4310)
    rig.drives.fail(5, 0x4310)
    assert reset(CanopenBringUp(rig.arm, rig.bus, LIMITS), "joint_3", never_asked) is State.SWITCH_ON_DISABLED
    states = [drive.state for drive in CanopenBringUp(rig.arm, rig.bus, LIMITS).status(0.01).drives]
    assert states == [State.SWITCH_ON_DISABLED, State.SWITCH_ON_DISABLED, State.FAULT]
    assert not any(rig.plant.powered)


def test_a_fault_is_reset_while_another_drive_is_switched_off(bench):
    rig = bench()
    rig.drives.fail(3, 0x4310)
    rig.drives.switch_off(5)
    assert reset(CanopenBringUp(rig.arm, rig.bus, LIMITS), "joint_3", never_asked) is State.SWITCH_ON_DISABLED


def test_a_fault_whose_cause_stays_is_reported(bench):
    rig = bench()
    rig.drives.fail(3, 0x4310, persistent=True)
    with pytest.raises(ServoFault, match="0x4310"):
        reset(CanopenBringUp(rig.arm, rig.bus, LIMITS), "joint_3", never_asked)


def test_without_a_fault_there_is_nothing_to_reset(bench):
    rig = bench()
    with pytest.raises(ServoError, match="No reset is required"):
        reset(CanopenBringUp(rig.arm, rig.bus, LIMITS), "joint_3", never_asked)


def test_nobody_is_asked_about_a_real_drive_that_has_no_fault(bench, arm_settings):
    rig = bench(dict.fromkeys((2, 3, 5), DriveTraits(identity=REAL)), arm_settings(identity=REAL))
    rig.frames()
    with pytest.raises(ServoError, match=r"the drive is in SWITCH ON DISABLED\. No reset is required"):
        reset(CanopenBringUp(rig.arm, rig.bus, LIMITS), "joint_3", never_asked)
    assert only_read(rig.frames())


@pytest.fixture
def real_fault(bench, arm_settings):
    """A real arm with a fault, whose file names its drives."""
    rig = bench(dict.fromkeys((2, 3, 5), DriveTraits(identity=REAL)), arm_settings(identity=REAL))
    rig.drives.fail(3, 0x4310)
    rig.frames()
    return rig


def test_a_real_drive_is_reset_with_consent(real_fault):
    questions = []
    state = reset(
        CanopenBringUp(real_fault.arm, real_fault.bus, LIMITS),
        "joint_3",
        lambda text: bool(questions.append(text)) or True,
    )
    assert state is State.SWITCH_ON_DISABLED
    assert len(questions) == 1
    assert "joint_3 (node 3) is in FAULT: 0x4310" in questions[0]
    written = {
        m.arbitration_id for m in real_fault.frames() if 0x600 < m.arbitration_id < 0x680 and m.data[0] >> 5 == 1
    }
    assert written == {0x603}, "by name only"


def test_without_consent_a_real_drive_is_not_written_to(real_fault):
    assert reset(CanopenBringUp(real_fault.arm, real_fault.bus, LIMITS), "joint_3", lambda text: False) is None
    assert only_read(real_fault.frames())


def test_a_real_drive_that_nobody_named_is_not_reset(real_fault):
    anybody = real_arm(real_fault.arm, Identity(None, None))
    with pytest.raises(WrongDevice, match="does not name"):
        reset(CanopenBringUp(anybody, real_fault.bus, LIMITS), "joint_3", never_asked)
    assert only_read(real_fault.frames())


def test_nothing_is_reset_while_another_drive_of_the_arm_carries_torque(bench):
    rig = bench()
    rig.drives.fail(3, 0x4310)
    energise(rig, 5)
    rig.frames()
    with pytest.raises(ServoError, match=r"joint_5.*carries torque"):
        reset(CanopenBringUp(rig.arm, rig.bus, LIMITS), "joint_3", never_asked)
    assert only_read(rig.frames())


def test_a_fault_that_somebody_else_resets_meanwhile_is_not_reset_again(real_fault):
    def consent(question):
        energise(real_fault, 3, ["2b40600080000000", "2b40600000000000"])
        overheard(real_fault.bus)
        real_fault.frames()
        return True

    with pytest.raises(ServoError, match="only FAULT can be reset, the drive is in SWITCH ON DISABLED"):
        reset(CanopenBringUp(real_fault.arm, real_fault.bus, LIMITS), "joint_3", consent)
    assert only_read(real_fault.frames())


def test_a_node_that_refuses_its_device_type_is_no_drive(bench):
    refuses = DriveTraits(on_request=lambda request: 0x0800_0000 if request[:3] == b"\x40\x00\x10" else None)
    nodes = find_nodes(bench({3: refuses}).bus, LIMITS)
    assert [(node.device_type is None, node.is_drive) for node in nodes] == [
        (False, True),
        (True, False),
        (False, True),
    ]


def test_what_a_drive_says_about_its_reference_is_shown(bench):
    rig = bench({5: DriveTraits(absent=frozenset({0x607C, 0x6098}))})
    rows = check(CanopenBringUp(rig.arm, rig.bus, LIMITS)).steps
    said = {row.node_id: row.detail for row in rows if row.step == "reference"}
    assert said[2] == "home offset (607C) is 0, homing method (6098) is 0"
    assert said[5] == "no 607C, no 6098"


def test_an_axis_that_is_not_homed_is_refused(bench, arm_settings):
    rig = bench({3: DriveTraits(homed=False)}, arm_settings(homed_bit=15))
    rows = check(CanopenBringUp(rig.arm, rig.bus, LIMITS)).steps
    (wrong,) = [row for row in rows if row.verdict is Verdict.WRONG]
    assert (wrong.node_id, wrong.step) == (3, "reference")
    assert "not homed: bit 15" in wrong.detail
