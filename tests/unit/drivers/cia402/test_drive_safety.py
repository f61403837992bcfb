"""The table of a drive's safety properties, without a bus."""

import re
from dataclasses import replace

import pytest
from msgspec.structs import replace as replace_struct

from armload_drivers.cia402 import object_dictionary as od
from armload_drivers.cia402.arm_settings import Fieldbus, VendorSetting
from armload_drivers.cia402.drive_safety import (
    Safety,
    SafetyFinding,
    SafetyValues,
    Setting,
    acceptance,
    has_a_way,
    master_watch,
    property_of,
    settings_of,
)
from armload_drivers.cia402.object_dictionary import DataType, Entry
from armload_drivers.cia402.process_data.drive_units import ArmUnits

RATING_TOLERANCE = 0.01


def test_every_property_says_what_is_lost_without_it_and_how_each_way_is_verified():
    for of in Safety:
        assert of.lost, of
        assert of.remedy or of is Safety.DISABLE_REACTION, of
        assert all(way.verified for way in of.ways), of


def test_every_way_writes_what_its_text_says():
    """The operator reads the text, such as `605E = 1`; the drive gets the setting."""
    said = []
    for way in (way for of in Safety for way in of.ways):
        written = {setting.entry.index: setting.value for setting in way.settings}
        for index, value in re.findall(r"\b([0-9A-F]{4}) = (\d+)\b", way.text):
            assert written[int(index, 16)] == int(value), way.text
            said.append(index)
    assert {"6007", "1029", "605A", "605B", "605C", "605D", "605E"} <= set(said)


@pytest.mark.parametrize(
    ("index", "of"),
    [
        (0x6007, Safety.MASTER_LOST), (0x1016, Safety.MASTER_LOST), (0x1029, Safety.MASTER_LOST),
        (0x605A, Safety.QUICK_STOP), (0x605C, Safety.DISABLE_REACTION), (0x6073, Safety.TORQUE_LIMIT), (0x6064, None),
    ],
)  # fmt: skip
def test_objects_belong_to_properties(index, of):
    assert property_of(index) is of


def test_ways_by_what_is_there():
    torque = {0x6073, 0x6075}
    assert has_a_way(Safety.TORQUE_LIMIT, None, lambda entry: entry.index in torque)
    assert not has_a_way(Safety.TORQUE_LIMIT, None, lambda entry: entry.index == 0x6073), "of which current?"
    assert has_a_way(Safety.MASTER_LOST, None, lambda entry: entry.index in {0x1016, 0x1029})
    assert not has_a_way(Safety.MASTER_LOST, None, lambda entry: entry.index == 0x6007), "nobody watches the heartbeat"
    assert has_a_way(Safety.DISABLE_REACTION, None, lambda entry: False)
    optional = [s for of in Safety for way in of.ways for s in way.settings if s.optional]
    assert optional
    assert all(
        has_a_way(of, None, lambda entry: entry not in {setting.entry for setting in optional}) for of in Safety
    ), "what is optional need not be there"


def test_ways_that_the_configuration_opens(arm_settings):
    def limited(**changes):
        return has_a_way(Safety.TORQUE_LIMIT, arm_settings(**changes).drives[0], lambda entry: False)

    def setting(meets):
        return (VendorSetting(Entry(0x3001, 2, "vendor's setting", DataType.U32), 5000, meets),)

    assert not limited()
    assert limited(torque_limit_in_drive=True)
    assert limited(vendor_settings=setting("torque_limit"))
    assert not limited(vendor_settings=setting("quick_stop"))
    assert not has_a_way(Safety.TORQUE_LIMIT, None, lambda entry: False)


def test_advice_keeps_what_was_accepted_before(arm_settings):
    drive = arm_settings(accept_missing=frozenset({"quick_stop"})).drives[0]
    assert acceptance((Safety.MASTER_LOST,), drive) == 'accept_missing = ["master_lost", "quick_stop"]'


@pytest.mark.parametrize(
    ("configured", "reported", "reason"),
    [
        (5.0, None, "6075 reports no rated current"),
        (5.0, 0.0, "6075 reports no rated current"),
        (None, 5.0, ""),
        (5.0, 5.0 * (1.0 + 0.99 * RATING_TOLERANCE), ""),
        (5.0, 5.5, "6075 reports 5.5 A, the configuration 5 A"),
    ],
)
def test_a_torque_limit_in_the_drive_needs_its_rated_current(arm_settings, configured, reported, reason):
    (way,) = [way for way in Safety.TORQUE_LIMIT.ways if 0x6073 in {setting.entry.index for setting in way.settings}]
    drive = replace(arm_settings().drives[0], rated_current_a=configured)
    assert way.condition(drive, reported) == reason


def test_required_values_follow_from_drive_and_arm(arm_settings):
    arm = replace(arm_settings(), cycle_s=0.01, heartbeat_s=0.1, max_missing_cycles=3)
    units = ArmUnits(arm)

    def values(place, settings=arm):
        return SafetyValues(settings.drives[place], settings, units, None)

    assert values(0).setpoint_timeout_ms == 100
    assert values(0, replace(arm, heartbeat_s=0.01)).setpoint_timeout_ms == 40
    assert master_watch(arm) == arm.master_node_id << 16 | 250
    for place, drive in enumerate(arm.drives):
        per_rad = abs(units.axes[place].counts_per_rad)
        assert values(place).following_error_counts == round(drive.following_error_rad * per_rad)
        assert values(place).position_limits_counts == units.position_limits_counts(place)
    limit = Setting(od.MAX_TORQUE, lambda given: given.drive.max_torque_permille)
    assert limit.wanted(values(0)) == arm.drives[0].max_torque_permille
    assert Setting(od.MAX_TORQUE, 7).wanted(values(0)) == 7


def test_a_finding_tells_its_way_or_each_obstacle_once(arm_settings):
    way = Safety.QUICK_STOP.ways[0]
    assert SafetyFinding(Safety.QUICK_STOP, way, False, ()).found == way.text
    obstacles = (("605A = 6", "is not there"), ("605A = 2", "is not there"), ("other", "reads back 3"))
    missing = SafetyFinding(Safety.QUICK_STOP, None, False, obstacles)
    assert missing.found == "is not there; reads back 3"
    assert missing.refused
    assert not replace_struct(missing, accepted=True).refused
    assert not SafetyFinding(Safety.QUICK_STOP, way, False, ()).refused


def test_the_settings_of_a_vendors_way_are_those_of_its_property(arm_settings):
    entries = [Entry(0x3001, number, "vendor's setting", DataType.U32) for number in (1, 2)]
    given = tuple(
        VendorSetting(entry, 5, of) for entry, of in zip(entries, ("torque_limit", "quick_stop"), strict=True)
    )
    drive = arm_settings(vendor_settings=given).drives[0]
    (vendor,) = [way for way in Safety.TORQUE_LIMIT.ways if way.by_vendor]
    assert settings_of(vendor, Safety.TORQUE_LIMIT, drive) == (Setting(entries[0], 5),)
    own = Safety.QUICK_STOP.ways[0]
    assert settings_of(own, Safety.QUICK_STOP, drive) == own.settings


def test_objects_of_every_way_get_the_numbers_of_the_arm(arm_settings):
    """Cycles of 4 ms, a heartbeat of 100 ms, a watchdog of 70 ms; 1000 counts/rad, 0.25 rad of following error."""
    arm = replace(
        arm_settings(counts_per_rad=1000.0, following_error_rad=0.25, max_torque_permille=1200),
        cycle_s=0.004, heartbeat_s=0.1, watchdog_s=0.07,
    )  # fmt: skip
    values = SafetyValues(arm.drives[0], arm, ArmUnits(arm), None)
    written = {
        f"{setting.entry.index:04X}:{setting.entry.subindex}={setting.wanted(values)}" + "?" * setting.optional
        for way in (way for of in Safety for way in of.ways)
        for setting in way.settings
    }
    assert {each for each in written if not each.startswith("607D")} == {
        "6072:0=1200", "6073:0=1200", "1016:1=8323322", "6007:0=3", "1029:1=0?", "1029:1=0", "0420:0=70000", "605E:0=2",
        "605E:0=1", "1400:5=100", "1006:0=4000", "605A:0=6", "605A:0=2", "605B:0=1", "605C:0=1", "605D:0=1?",
        "6065:0=250", "6066:0=20?", "1017:0=100",
    }  # fmt: skip
    assert 8323322 == 127 << 16 | 250, "the master's node id, and two and a half heartbeats"


@pytest.mark.parametrize(
    ("fieldbus", "of", "ways"),
    [
        (Fieldbus.CANOPEN, Safety.MASTER_LOST, [{0x1016, 0x6007, 0x1029}, {0x1016, 0x1029}, set()]),
        (Fieldbus.ETHERCAT, Safety.MASTER_LOST, [{0x0420, 0x6007}, {0x0420, 0x605E}, set()]),
        (Fieldbus.CANOPEN, Safety.SETPOINTS_LOST, [{0x1400}, {0x1006}, set()]),
        (Fieldbus.ETHERCAT, Safety.SETPOINTS_LOST, [{0x0420}, set()]),
        (Fieldbus.CANOPEN, Safety.DRIVE_LOST, [{0x1017}]),
        (Fieldbus.ETHERCAT, Safety.DRIVE_LOST, [set()]),
    ],
)
def test_each_bus_has_its_own_ways(fieldbus, of, ways):
    assert [{setting.entry.index for setting in way.settings} for way in of.ways_on(fieldbus)] == ways
    assert has_a_way(of, None, lambda entry: entry.index in ways[0], fieldbus)
    assert has_a_way(of, None, lambda entry: False, fieldbus) is (ways[0] == set())


def test_a_quick_stop_that_leaves_the_axis_to_its_brake_needs_one(arm_settings):
    (way,) = [way for way in Safety.QUICK_STOP.ways if "by the brake" in way.text]
    assert way.condition(arm_settings(has_brake=True).drives[0], None) == ""
    assert way.condition(arm_settings(has_brake=False).drives[0], None) == "the axis has no brake"


@pytest.mark.parametrize(("reported", "close"), [(5.0499, True), (5.0599, False), (4.9499, False), (4.9501, True)])
def test_a_rated_current_may_differ_by_a_hundredth(arm_settings, reported, close):
    (way,) = [way for way in Safety.TORQUE_LIMIT.ways if 0x6073 in {setting.entry.index for setting in way.settings}]
    assert (way.condition(arm_settings(rated_current_a=5.0).drives[0], reported) == "") is close


def test_a_drive_that_keeps_to_the_joints_limits_is_given_both(arm_settings):
    arm = arm_settings()
    values = SafetyValues(arm.drives[1], arm, ArmUnits(arm), None)
    (way,) = [way for way in Safety.POSITION_LIMITS.ways if not way.by_vendor]
    written = {setting.entry: setting.wanted(values) for setting in way.settings}
    low, high = ArmUnits(arm).position_limits_counts(1)
    assert written == {od.POSITION_LIMIT_MIN: low, od.POSITION_LIMIT_MAX: high}
    assert low < high
