"""Bring-up of one drive over SDO, with a simulated drive at the other end: what is read, required and written."""

import re
from contextlib import nullcontext
from dataclasses import replace

import can
import msgspec
import numpy as np
import pytest

from armload_drivers.bring_up import drive_bring_up, drive_objects
from armload_drivers.bring_up.drive_bring_up import configured_units, is_simulation
from armload_drivers.bring_up.drive_objects import DriveObjects
from armload_drivers.bring_up.drive_securing import require_safety
from armload_drivers.bus.bus_link import BusLink
from armload_drivers.canopen.canopen_sdo import CanopenSdo
from armload_drivers.canopen.canopen_setup import CanopenSetup
from armload_drivers.cia402 import object_dictionary as od
from armload_drivers.cia402.arm_settings import SIMULATION_IDENTITY, EffortFeedback, Identity, VendorObject
from armload_drivers.cia402.drive_safety import Safety
from armload_drivers.cia402.object_dictionary import DataType, NmtCommand, PdoDirection
from armload_drivers.cia402.process_data.drive_units import ArmUnits
from armload_drivers.cia402.process_data.process_image import drive_image, effort_entry
from armload_drivers.cia402.state_machine import State
from armload_drivers.cia402.timeouts import Timeouts
from armload_drivers.driver_errors import (
    MissingSafety,
    ServoError,
    ServoFault,
    ServoTimeout,
    SettingChanged,
    WrongDevice,
)
from armload_drivers.simulation.drives.drive_dictionary import DriveTraits
from armload_drivers.simulation.drives.simulated_drive import SimulatedDrive
from armload_drivers.simulation.plant_interface import PlantAxis
from tests.ideal_plant import IdealPlant
from tests.scripted_sdo import ScriptedSdo

CELSIUS = 40.0

SHORT = Timeouts(probe_s=0.01, sdo_s=0.01, mode_s=0.02, fault_reset_s=0.05)
MASTER = 127


class Bench:
    """One simulated drive that answers SDO requests at once, and its bring-up by the master."""

    def __init__(self, arm, drive_arm=None, answers=True, **traits):
        self.queue = []
        self.answers = answers
        actual = (drive_arm or arm).drives[0]
        self.drive = SimulatedDrive(
            actual,
            PlantAxis(IdealPlant(np.array([0.25])), 0),
            cycle_s=0.01,
            traits=DriveTraits(**traits),
            send=self._send,
            rerouted=lambda: None,
        )
        self.drive.switch_on(0.0)
        self.values = self.drive.dictionary.values
        settings, self.arm = arm.drives[0], arm
        self.link = BusLink(self)
        self.sdo = CanopenSdo(settings.node_id, settings.joint, self.link, SHORT.sdo_s)
        self.setup = CanopenSetup(settings, arm, self.sdo, SHORT)

    def _send(self, cob_id, data):
        if cob_id == od.SDO_TX_BASE + self.drive.node_id:
            self.queue.append(can.Message(arbitration_id=cob_id, data=data, is_extended_id=False))

    def send(self, message, timeout=None):
        if self.answers:
            self.drive.request(bytes(message.data), 0.0)

    def recv(self, timeout=None):
        return self.queue.pop(0) if self.queue else None

    def write_cycle(self, **changes):
        """Write the cycle of the arm, or of one that differs; the drive's objects."""
        arm = replace(self.arm, **changes)
        setup = CanopenSetup(arm.drives[0], arm, self.sdo, SHORT)
        setup._write_cycle()
        return setup.objects

    def control(self, *words):
        for word in words:
            self.drive.set_object(od.CONTROLWORD, word)


@pytest.fixture
def bench(arm_settings):
    def bench(changes=None, **options):
        return Bench(arm_settings(**(changes or {})), **options)

    return bench


def test_a_node_is_identified_before_anything_is_sent_that_changes_it(bench):
    made = bench()
    written = []
    made.drive.dictionary.vetoes = dict.fromkeys(made.values, written.append)
    assert made.setup.identify_before_reset() is True
    assert written == []
    assert made.setup.identity == Identity(
        SIMULATION_IDENTITY.vendor_id, SIMULATION_IDENTITY.product_code, made.values[od.REVISION.key]
    )
    assert od.is_drive(made.setup.device_type)


def test_a_silent_node_may_be_reset_only_if_it_cannot_be_a_real_drive(bench):
    with pytest.raises(ServoTimeout, match="only simulated drives"):
        bench(answers=False).setup.identify_before_reset()
    real = {"identity": Identity(0x123, 0x456)}
    assert bench(real, answers=False).setup.identify_before_reset() is False


def test_axes_as_sub_indices_of_one_object_are_refused(bench):
    made = bench()
    entries = made.drive.dictionary.entries
    entries[od.POSITION_ACTUAL.key] = msgspec.structs.replace(od.POSITION_ACTUAL, type=od.DataType.U8)
    made.values[od.POSITION_ACTUAL.key] = 2
    entries[od.SECOND_POSITION.key] = od.SECOND_POSITION
    made.values[od.SECOND_POSITION.key] = 0
    with pytest.raises(WrongDevice, match=r"several axes with one node id: it has 6064:2.*use a drive for each axis"):
        made.setup.configure()


def test_a_drive_without_6060_must_be_in_the_mode(bench):
    made = bench()
    made.setup.configure()
    del made.drive.dictionary.entries[od.MODE.key]
    made.setup.configure()
    made.drive.dictionary.entries[od.MODE.key] = od.MODE
    made.drive.set_object(od.MODE, 1)
    del made.drive.dictionary.entries[od.MODE.key]
    with pytest.raises(WrongDevice, match=r"no 6060:0 .*6061 does not report mode 8 .*, but 1"):
        made.setup.configure()


def test_a_node_that_was_reset_must_answer(bench):
    bench().setup.require_alive()
    with pytest.raises(ServoTimeout, match="no boot-up message"):
        bench(answers=False).setup.require_alive()


@pytest.mark.parametrize(
    ("wanted", "said"),
    [
        (Identity(0x123, None), "vendor id"),
        (Identity(SIMULATION_IDENTITY.vendor_id, 0x99), "product code"),
        (replace(SIMULATION_IDENTITY, revision=0x77), "revision .* instead of 0x00000077"),
        (Identity(None, None), None),
    ],
)
def test_the_identity_is_that_of_the_configuration_as_far_as_it_states_one(bench, wanted, said):
    setup = bench({"identity": wanted}).setup
    if said is None:
        assert setup.check_identity().vendor_id == SIMULATION_IDENTITY.vendor_id
        return
    with pytest.raises(WrongDevice, match=said):
        setup.check_identity()


def test_what_is_no_drive_is_refused(bench):
    with pytest.raises(WrongDevice, match="node_id"):
        bench(device_type=0x0002_0191).setup.check_identity()


def test_configured_it_has_mode_cycle_and_pdos(bench):
    made = bench(polarity=0x80)
    assert [name for name, _ in made.setup.reading_steps()] == ["axes", "modes", "scaling", "objects", "reference"]
    assert [name for name, _ in made.setup.writing_steps()] == ["cycle", "setpoints", "feedback", "mode"]
    made.setup.configure()
    assert made.setup.polarity == 0x80
    values = made.values
    assert values[od.MODE_DISPLAY.key] == 8
    assert values[od.CYCLE_PERIOD_US.key] == 10_000
    in_use = {pdo.cob_id for pdo in (*made.drive.rpdos, *made.drive.tpdos) if pdo.cob_id}
    image = drive_image(made.arm.drives[0])
    assert in_use == {layout.cob_id for layout in image.layouts}
    assert made.setup.objects.held[od.POLARITY] == 0x80
    assert made.setup.objects.held[od.MODE_DISPLAY] == 8
    made.setup.require_as_configured()


def test_pdos_that_are_not_used_are_switched_off(bench):
    made = bench()
    for direction in PdoDirection:
        made.drive.set_object(direction.cob_id_entry(3), 0x2A0 + direction.value[2])
    assert made.drive.tpdos[3].cob_id is not None
    made.setup.configure()
    assert made.drive.tpdos[3].cob_id is made.drive.rpdos[3].cob_id is None


def test_a_setting_that_changed_since_is_refused_by_name(bench):
    made = bench()
    made.setup.configure()
    made.drive.set_object(od.CYCLE_PERIOD_US, 7)
    with pytest.raises(SettingChanged, match="is 7, and was 10000"):
        made.setup.require_as_configured()


def test_a_mode_that_is_not_offered_is_refused_with_those_that_are(bench):
    with pytest.raises(WrongDevice, match=r'mode 8 .* only 1 \(profile position\), 7 .* \(6502\). Set mode = "ip"'):
        bench(modes=frozenset({1, 7})).setup.configure()
    with pytest.raises(WrongDevice, match=r"6060 refuses mode 8 .*another drive"):
        bench(modes=frozenset()).setup.configure()


def test_a_mode_that_is_not_taken_is_a_timeout_with_the_one_reported(bench):
    with pytest.raises(ServoTimeout, match=r"6061 reports mode 0 .* 8 was requested"):
        bench(takes_mode=False).setup.configure()


def test_a_scale_is_read_where_the_configuration_has_none_and_compared_where_it_has(bench, arm_settings):
    drive_arm = arm_settings()
    made = bench({"counts_per_rad": None, "rated_torque_nm": None, "rated_current_a": None}, drive_arm=drive_arm)
    units = made.setup.read_units()
    actual = drive_arm.drives[0]
    assert units.counts_per_rad == pytest.approx(actual.counts_per_rad, rel=1e-6)
    assert made.setup.settings.rated_torque_nm == pytest.approx(actual.rated_torque_nm)
    assert made.setup.settings.rated_current_a == pytest.approx(actual.rated_current_a)
    with pytest.raises(WrongDevice, match="Correct the configuration"):
        bench({"rated_torque_nm": 150.0}, drive_arm=drive_arm).setup.read_units()


def test_a_drive_without_607e_has_no_polarity(bench):
    made = bench(absent=frozenset({0x607E, 0x6085}))
    made.setup.configure()
    assert made.setup.polarity == 0
    assert od.POLARITY in made.setup.objects.missing
    assert od.POLARITY not in made.setup.objects.held


@pytest.mark.parametrize(
    ("changes", "absent", "said"),
    [
        ({}, {0x60B2}, "torque_offset = false"),
        ({"torque_offset_bits": 32}, set(), "has 16 bits instead of 32.*torque_offset_bits = 16"),
        ({}, {0x6078}, 'feedback = "torque"'),
        ({"feedback": EffortFeedback.TORQUE}, {0x6077}, 'feedback = "current"'),
        ({}, {0x6077, 0x6078}, "effort_object"),
        ({"torque_offset": False}, {0x607A}, "no 607A:0 .* requires.*another drive"),
    ],
)
def test_an_object_that_a_pdo_needs_is_named_with_the_way_round(bench, arm_settings, changes, absent, said):
    with pytest.raises(WrongDevice, match=f"(?s){said}"):
        bench(changes, drive_arm=arm_settings(), absent=frozenset(absent)).setup.configure()


def secured(made):
    made.setup.configure()
    made.setup.secure(ArmUnits(made.arm))
    return made


def test_secured_it_has_every_safety_property_and_watches_nobody_yet(bench):
    made = secured(bench())
    assert {finding.of for finding in made.setup.safety} == set(Safety)
    assert not any(finding.refused for finding in made.setup.safety)
    assert made.values[od.HEARTBEAT_CONSUMER.key] == 0
    assert made.values[od.ABORT_CONNECTION_OPTION.key] != 0


def test_the_watch_on_the_master_is_held_while_it_is_on(bench):
    made = secured(bench())
    made.setup.watch_master(on=True)
    watch = made.values[od.HEARTBEAT_CONSUMER.key]
    assert watch >> 16 == MASTER
    assert watch & 0xFFFF > 1e3 * made.arm.heartbeat_s
    assert made.setup.objects.held[od.HEARTBEAT_CONSUMER] == watch
    made.setup.watch_master(on=False)
    assert made.values[od.HEARTBEAT_CONSUMER.key] == 0
    assert od.HEARTBEAT_CONSUMER not in made.setup.objects.held


def test_a_property_that_the_drive_lacks_is_refused_unless_accepted(bench):
    lacking = frozenset({0x6065, 0x6066})
    with pytest.raises(MissingSafety, match="following_error"):
        secured(bench(absent=lacking))
    made = secured(bench({"accept_missing": frozenset({"following_error"})}, absent=lacking))
    (finding,) = (finding for finding in made.setup.safety if finding.way is None)
    assert finding.of is Safety.FOLLOWING_ERROR
    assert finding.accepted
    assert not finding.refused
    assert finding.obstacles


def test_require_safety_names_no_more_than_what_is_refused(bench):
    made = secured(bench())
    findings = made.setup.safety
    assert require_safety(made.setup.objects, None, findings) is None


def test_objects_are_held_with_their_value_or_the_reason_why_not(bench):
    made = bench(absent=frozenset({0x6085}), forgets=frozenset({0x6065}))
    objects = DriveObjects(made.sdo)
    assert objects.hold(od.QUICK_STOP_OPTION, 6) == ""
    assert objects.held == {od.QUICK_STOP_OPTION: 6}
    assert objects.hold(od.QUICK_STOP_DECELERATION, 5) == "no 6085"
    assert "after 5 was written" in objects.hold(od.FOLLOWING_ERROR_WINDOW, 5)
    assert "was refused (0x0609003" in objects.hold(od.QUICK_STOP_OPTION, 7)
    assert "cannot be written, and must be 3" in objects.hold(od.DEVICE_TYPE, 3)
    assert objects.hold(od.DEVICE_TYPE, made.values[od.DEVICE_TYPE.key]) == "", "it has the value already"
    assert objects.read(od.QUICK_STOP_DECELERATION) is objects.read(od.QUICK_STOP_DECELERATION) is None
    assert objects.missing == [od.QUICK_STOP_DECELERATION]


def test_a_drive_that_makes_sync_itself_is_told_not_to(bench):
    made = bench()
    made.values[od.SYNC_COB_ID.key] = 0x4000_0080
    made.write_cycle()
    assert made.values[od.SYNC_COB_ID.key] == od.SYNC_DEFAULT_COB_ID
    bench(absent=frozenset({0x1005})).write_cycle()


def test_a_sync_counter_is_set_while_the_period_is_0(bench):
    made = bench()
    made.write_cycle(sync_counter=10)
    assert made.values[od.SYNC_COUNTER_OVERFLOW.key] == 10
    assert made.values[od.CYCLE_PERIOD_US.key] == 10_000
    without = bench(absent=frozenset({0x1019}))
    without.write_cycle()
    with pytest.raises(ServoError, match="sync_counter = 0"):
        without.write_cycle(sync_counter=10)


def test_an_interpolation_that_is_not_the_cycle_is_refused_with_the_rate_that_would_do(bench):
    made = bench(forgets=frozenset({0x60C2}))
    with pytest.raises(ServoError, match=r"over 0.01 s \(60C2\).*cycle of 0.004 s") as caught:
        made.write_cycle(cycle_s=0.004)
    assert "cycle_hz = 100" in str(caught.value)
    without = bench(absent=frozenset({0x60C2, 0x1006}))
    objects = without.write_cycle()
    assert set(objects.missing) == {od.CYCLE_PERIOD_US, od.INTERPOLATION_TIME, od.INTERPOLATION_EXPONENT}


@pytest.mark.parametrize(
    ("cycle_s", "accepts_hz", "advice"),
    [
        (0.004, {100, 500}, "Set cycle_hz = 100"),
        (0.004, {200, 500}, "Set cycle_hz = 200"),
        (0.0025, {200, 500}, "Set cycle_hz = 500"),
        (0.004, set(), "ask the manufacturer"),
    ],
)
def test_of_the_rates_that_a_drive_accepts_the_nearest_is_proposed(bench, monkeypatch, cycle_s, accepts_hz, advice):
    tried = []

    def interpolates_over(drive, period_s):
        tried.append(period_s)
        return round(1 / period_s) in accepts_hz

    made = bench()
    monkeypatch.setattr(drive_objects, "_interpolates_over", interpolates_over)
    with pytest.raises(ServoError, match=advice):
        drive_objects.set_interpolation(made.setup.objects, cycle_s, (100, 200, 500, 1000), "ask the manufacturer")
    assert tried[0] == cycle_s


def test_torque_and_faults_are_told_apart_before_work_begins(bench):
    made = bench()
    setup = made.setup
    setup.require_disabled()
    assert setup.read_powered_state() is None
    with pytest.raises(ServoError, match="No reset is required"):
        setup.read_fault()
    made.drive.command(NmtCommand.START, 0.0)
    made.control(0x06, 0x07, 0x0F)
    assert setup.read_powered_state() is State.OPERATION_ENABLED
    with pytest.raises(ServoError, match="carries torque"):
        setup.require_disabled()
    setup.remove_torque(0.01)
    assert setup.read_state() is State.SWITCH_ON_DISABLED
    made.drive.fail(0x7300, 0.0)
    assert "sensor" in setup.read_fault()
    with pytest.raises(ServoFault, match="sensor"):
        setup.require_disabled()
    assert setup.reset_fault() is State.SWITCH_ON_DISABLED
    assert made.values[od.CONTROLWORD.key] == 0


def test_a_fault_whose_cause_persists_is_not_reset(bench):
    made = bench()
    made.drive.fail(0x7300, 0.0, persistent=True)
    with pytest.raises(ServoFault, match="sensor"):
        made.setup.reset_fault()
    with pytest.raises(ServoError, match="No reset is required"):
        bench().setup.reset_fault()


def test_a_drive_that_keeps_its_torque_is_named(bench):
    made = bench(stuck_in=State.OPERATION_ENABLED)
    made.drive.command(NmtCommand.START, 0.0)
    made.control(0x06, 0x07, 0x0F)
    with pytest.raises(ServoError, match="keeps its torque"):
        made.setup.remove_torque(0.01)


def test_the_target_is_preset_to_the_present_position_without_an_offset(bench):
    made = bench()
    made.values |= {od.TARGET_POSITION.key: 5, od.TORQUE_OFFSET.key: 9}
    counts = made.setup.hold_present_position()
    assert counts == made.values[od.TARGET_POSITION.key] == round(0.25 * 1e6 / (2 * np.pi))
    assert made.values[od.TORQUE_OFFSET.key] == 0
    assert made.setup.read_position() == counts
    made.setup.ask_position()
    made.link.pump(0.0)
    assert made.setup.answered_position() == counts


def test_a_temperature_is_read_where_one_is_configured_in_its_unit(bench):
    assert bench().setup.read_temperature_celsius() is None
    place = VendorObject(0x2027, 0, DataType.I16, 0.1)
    assert bench({"temperature": place}).setup.read_temperature_celsius() == pytest.approx(CELSIUS)


def test_the_masters_node_is_the_highest_that_nobody_has(arm_settings):
    arm = arm_settings()
    assert arm.master_node_id == 127
    assert replace(arm, other_nodes=frozenset({127, 126})).master_node_id == 125


def test_the_arm_gets_the_scales_that_its_drives_reported(bench, arm_settings):
    made = bench({"rated_torque_nm": None}, drive_arm=arm_settings())
    made.setup.read_units()
    units = configured_units(made.arm, [made.setup])
    assert [axis.torque_nm_per_permille for axis in units.axes] == [pytest.approx(0.2)]


def test_the_simulation_is_known_by_vendor_and_product():
    assert is_simulation(replace(SIMULATION_IDENTITY, revision=9))
    assert not is_simulation(replace(SIMULATION_IDENTITY, product_code=9))
    assert not is_simulation(replace(SIMULATION_IDENTITY, vendor_id=9))


# What a drive may lack or contradict, object by object ---------------------------------------------------------------


@pytest.fixture
def scripted(arm_settings):
    """The bring-up of a drive that has just these objects."""

    def scripted(values, refusals=None, **changes):
        arm = arm_settings(**changes)
        sdo = ScriptedSdo(values, refusals)
        return CanopenSetup(arm.drives[0], arm, sdo, SHORT), sdo

    return scripted


@pytest.mark.parametrize(
    ("there", "changes", "text"),
    [
        ({od.POSITION_ACTUAL: bytes(4)}, {}, None),
        ({od.SECOND_CONTROLWORD: 0}, {"second_axis_unused": True}, None),
        (
            {od.SECOND_CONTROLWORD: 0},
            {},
            "it has 6840:0 controlword of a second axis, and only the first axis is watched",
        ),
        ({od.POSITION_ACTUAL: bytes(1), od.SECOND_POSITION: 0}, {}, "several axes with one node id: it has"),
        ({od.POSITION_ACTUAL: bytes(4), od.SECOND_POSITION: 0}, {}, None),
        ({od.POSITION_ACTUAL: bytes(1)}, {}, None),
    ],
)
def test_a_drive_has_one_axis(scripted, there, changes, text):
    setup, _ = scripted(there, **changes)
    with pytest.raises(WrongDevice, match=text) if text else nullcontext():
        setup._check_axes()


@pytest.mark.parametrize(
    ("there", "bit", "said"),
    [
        ({}, None, "no 607C, no 6098"),
        ({od.HOME_OFFSET: 0}, None, "home offset (607C) is 0"),
        ({od.HOME_OFFSET: -5, od.HOMING_METHOD: 35}, None, "home offset (607C) is -5, homing method (6098) is 35"),
        ({od.STATUSWORD: 1 << 8}, 8, "no 607C, no 6098"),
        ({od.STATUSWORD: 0xFEFF}, 8, None),
    ],
)
def test_a_position_needs_its_reference_where_the_drive_reports_it(scripted, there, bit, said):
    setup, _ = scripted(there, homed_bit=bit)
    if said is not None:
        assert setup._check_reference() == said
        return
    with pytest.raises(ServoError, match=r"the axis is not homed: bit 8 of the statusword \(6041\) is 0"):
        setup._check_reference()


CSP, IP = 1 << 7, 1 << 6
"""Bits of 6502."""


@pytest.mark.parametrize(
    ("modes", "there", "text"),
    [
        (CSP, [od.TARGET_POSITION], None),
        (0, [od.TARGET_POSITION], None),
        (None, [od.TARGET_POSITION], None),
        (IP, [od.TARGET_POSITION, od.INTERPOLATION_SETPOINT], 'is not offered, only .*Set mode = "ip"'),
        (IP, [od.TARGET_POSITION], "is not offered, only .*the drive lacks 60C1:1"),
        (CSP, [], "the drive has no 607A:0 target position, which mode 8 .CYCLIC_SYNCHRONOUS_POSITION. requires"),
        (CSP | IP, [od.INTERPOLATION_SETPOINT], 'the drive has no 607A:0.*Set mode = "ip"'),
        (CSP, [od.INTERPOLATION_SETPOINT], "the drive has no 607A:0"),
    ],
)
def test_the_mode_is_one_that_the_drive_offers_with_its_setpoint(scripted, modes, there, text):
    setup, _ = scripted({od.SUPPORTED_MODES: modes} if modes is not None else {})
    setup._sdo.values.update(dict.fromkeys(there, 0))
    with pytest.raises(WrongDevice, match=text) if text else nullcontext() as caught:
        setup._check_mode()
    if text and "Set mode" not in text:
        assert "Set mode" not in str(caught.value)


@pytest.mark.parametrize(
    ("values", "refusals", "text"),
    [
        ({od.MODE: 0, od.MODE_DISPLAY: 8}, None, None),
        ({od.MODE: 0}, None, None),
        ({od.MODE_DISPLAY: 8}, None, None),
        ({od.MODE_DISPLAY: 7}, None, r"the drive has no 6060:0 .*, and 6061 does not report mode 8 .*, but 7"),
        ({}, None, "and 6061 does not report mode 8 .*, but None"),
        ({od.MODE: 0, od.MODE_DISPLAY: 7}, None, "6061 reports mode 7 after 0.02 s, 8 was requested"),
        ({od.MODE: 0, od.MODE_DISPLAY: 8}, {("write", od.MODE): 0x0609_0030}, "6060 refuses mode 8 .* with 0x06090030"),
        ({od.MODE: 0, od.MODE_DISPLAY: 8}, {("write", od.MODE): 0x0800_0000}, "said the drive"),
    ],
)
def test_the_mode_is_written_and_must_be_reported(scripted, values, refusals, text):
    setup, sdo = scripted(values, refusals)
    with pytest.raises(ServoError, match=text) if text else nullcontext():
        setup._select_mode()
    if text is None:
        assert sdo.numbers(od.MODE) == ([8] if od.MODE in values else [])
        shown = od.MODE_DISPLAY if od.MODE_DISPLAY in values else od.MODE
        assert setup.objects.held[shown] == 8


@pytest.mark.parametrize(
    ("found", "text"),
    [
        ({}, None),
        ({"vendor_id": 3}, r"vendor id \(1018\) is 0x00000003 instead of 0x00000002"),
        ({"product_code": None}, r"product code \(1018\) is nothing instead of 0x00000007"),
        ({"revision": 2}, r"revision \(1018\) is 0x00000002 instead of 0x00000001"),
        ({"serial": 10}, r"serial number \(1018\) is 0x0000000A instead of 0x00000009"),
    ],
)
def test_every_number_of_the_identity_that_is_configured_counts(scripted, found, text):
    numbers = {"vendor_id": 2, "product_code": 7, "revision": 1, "serial": 9}
    entries = dict(zip(numbers, (od.VENDOR_ID, od.PRODUCT_CODE, od.REVISION, od.SERIAL_NUMBER), strict=True))
    reported = {entries[name]: value for name, value in (numbers | found).items() if value is not None}
    setup, _ = scripted({od.DEVICE_TYPE: 0x0002_0192} | reported, identity=Identity(**numbers))
    with pytest.raises(WrongDevice, match=text) if text else nullcontext():
        assert setup.check_identity() == Identity(**numbers)


@pytest.mark.parametrize(
    ("entry", "usable", "advice"),
    [
        (od.TORQUE_OFFSET, [], "Set torque_offset = false; feed-forward is then refused on this drive"),
        (od.STATUSWORD, [], "A joint requires 6041: use other firmware, or another drive"),
        (od.CURRENT_ACTUAL, [od.TORQUE_ACTUAL], 'It has 6077:0 torque actual value: set feedback = "torque"'),
        (od.TORQUE_ACTUAL, [od.CURRENT_ACTUAL], 'It has 6078:0 current actual value: set feedback = "current"'),
    ],
)
def test_what_is_missing_can_be_avoided_by_the_configuration(scripted, entry, usable, advice):
    setup, _ = scripted({})
    assert setup.instead_of(entry, lambda other: other in usable) == advice
    if usable:
        assert "set feedback" not in setup.instead_of(entry, lambda other: False)


NO_EFFORT = r"A drive must report current \(6078\) or torque \(6077\) in a PDO"


@pytest.mark.parametrize(
    ("entry", "bits", "there", "advice"),
    [
        (od.STATUSWORD, 32, {}, "A drive of CiA 402 has 16: ask its manufacturer for firmware that conforms"),
        (od.TORQUE_OFFSET, 8, {}, "^Set torque_offset = false"),
        (od.TORQUE_OFFSET, 32, {}, "^It has no second receive PDO, which 32 bits require. Set torque_offset = false"),
        (od.TORQUE_OFFSET_32, 16, {}, "^Set torque_offset_bits = 16"),
        (od.CURRENT_ACTUAL, 24, {od.TORQUE_ACTUAL: bytes(2)}, '^It has 6077:0 .*: set feedback = "torque"$'),
        (od.CURRENT_ACTUAL, 24, {od.TORQUE_ACTUAL: bytes(4)}, f"^{NO_EFFORT}"),
        (od.CURRENT_ACTUAL_32, 16, {}, "^Set effort_bits = 16"),
        (od.TORQUE_ACTUAL_32, 16, {}, "^Set effort_bits = 16"),
    ],
)
def test_an_object_of_another_size_has_its_key_or_no_use(scripted, entry, bits, there, advice):
    setup, _ = scripted(there)
    assert re.search(advice, setup._resized(entry, bits))


def test_a_makers_effort_is_corrected_or_left_out(scripted):
    setup, _ = scripted({}, vendor_effort=VendorObject(0x2001, 2, DataType.I32, 0.001))
    entry = effort_entry(setup.settings)
    assert setup._resized(entry, 16) == 'Correct the type in effort_object: "i16" has 16 bits'
    assert setup.instead_of(entry, lambda other: other is od.CURRENT_ACTUAL) == (
        'Correct effort_object. Or leave it out. It has 6078:0 current actual value: set feedback = "current"'
    )
    assert re.match(f"Correct effort_object. {NO_EFFORT}", setup.instead_of(entry, lambda other: False))
    assert setup._resized(od.TORQUE_OFFSET, 8).startswith("Set torque_offset = false"), "it is another object"


@pytest.mark.parametrize(
    ("numbers", "ratio"),
    [((1000, 4), 250.0), ((0, 4), None), ((1000, 0), None), ((None, 4), None), ((1000, None), None)],
)
def test_a_scale_that_is_incomplete_or_zero_is_none(numbers, ratio):
    assert drive_bring_up._ratio(*numbers) == ratio


def test_an_identity_is_stated_as_the_file_has_it():
    assert drive_bring_up.stated(Identity(0x1AB, None)) == "identity = { vendor_id = 0x000001AB }"
    assert drive_bring_up.stated(Identity(1, 2)) == "identity = { vendor_id = 0x00000001, product_code = 0x00000002 }"


def test_a_drive_without_the_exponent_of_60c2_interpolates_in_milliseconds(scripted):
    setup, sdo = scripted({od.INTERPOLATION_TIME: 5})
    drive_objects.set_interpolation(setup.objects, 0.01)
    assert sdo.numbers(od.INTERPOLATION_TIME) == [10]
    assert setup.objects.held == {od.INTERPOLATION_TIME: 10}
    fixed, _ = scripted({od.INTERPOLATION_TIME: 5}, {("write", od.INTERPOLATION_TIME): 0x0609_0030})
    with pytest.raises(ServoError, match=r"over 0\.005 s \(60C2\) and does not accept the cycle of 0\.01 s"):
        drive_objects.set_interpolation(fixed.objects, 0.01)
    tenths = {od.INTERPOLATION_TIME: 50, od.INTERPOLATION_EXPONENT: -4}
    refused = {("write", entry): 0x0601_0002 for entry in tenths}
    other, _ = scripted(tenths, refused)
    with pytest.raises(ServoError, match=r"over 0\.005 s") as caught:
        drive_objects.set_interpolation(other.objects, 0.01)
    assert "Set cycle_hz = 200" in str(caught.value)


def test_a_drive_with_an_interpolation_of_nothing_has_none(scripted):
    setup, _ = scripted({od.INTERPOLATION_TIME: 0}, {("write", od.INTERPOLATION_TIME): 0x0601_0002})
    drive_objects.set_interpolation(setup.objects, 0.01)
    assert setup.objects.missing == [od.INTERPOLATION_EXPONENT, od.INTERPOLATION_TIME]


@pytest.mark.parametrize(
    ("there", "refusals", "reason"),
    [
        ({od.MODE: 0}, {}, ""),
        ({od.MODE: 8}, {("write", od.MODE): 0x0601_0002}, ""),
        ({}, {}, "no 6060"),
        ({od.MODE: 7}, {("write", od.MODE): 0x0601_0002}, "6060 is 7, cannot be written, and must be 8"),
        ({od.MODE: 7}, {("write", od.MODE): 0x0609_0030}, "6060 is 7, and 8 was refused (0x06090030)"),
        ({od.MODE: lambda: 7}, {}, "6060 reads 7 after 8 was written"),
        ({od.MODE: 7}, {("read", od.MODE): 0x0800_0000}, "6060 cannot be read back (0x08000000)"),
    ],
)
def test_a_value_is_held_or_the_reason_is_told(scripted, there, refusals, reason):
    setup, _ = scripted(there, refusals)
    assert setup.objects.hold(od.MODE, 8) == reason
    assert setup.objects.held == ({} if reason else {od.MODE: 8})
    named, _ = scripted({})
    assert named.objects.hold(od.INTERPOLATION_TIME, 1) == "no 60C2:1"
