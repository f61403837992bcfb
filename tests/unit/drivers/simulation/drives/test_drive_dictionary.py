"""The objects of a simulated drive after a reset: defaults of CiA 301 and CiA 402-2, in units of its settings."""

import pytest

from armload_drivers.cia402 import object_dictionary as od
from armload_drivers.cia402.arm_settings import EffortFeedback, Identity, OperationMode, VendorObject
from armload_drivers.cia402.object_dictionary import DataType
from armload_drivers.simulation.drives.drive_dictionary import DriveTraits, build_dictionary

pytestmark = pytest.mark.pure

VALUES = """
1000:0=131474 1001:0=0 1003:0=0 1003:1=0 1003:2=0 1003:3=0 1003:4=0 1005:0=128 1006:0=0 1010:0=1 1010:1=1 1014:0=130
1016:0=1 1016:1=0 1017:0=0 1018:0=4 1018:1=1095912780 1018:2=1397312769 1018:3=65536 1018:4=2 1019:0=0 1029:0=1 1029:1=0
1200:0=2 1200:1=1538 1200:2=1410 6007:0=1 603F:0=0 6040:0=0 6041:0=0 605A:0=2 605B:0=0 605C:0=1 605D:0=1 605E:0=2
6060:0=0 6061:0=0 6064:0=0 6065:0=500 6066:0=20 606C:0=0 6072:0=3000 6075:0=10000 6076:0=200000 6077:0=0 6078:0=0
607A:0=0 607C:0=0 607D:0=2 607D:1=-2147483648 607D:2=2147483647 607E:0=0 6085:0=6000 608F:0=2 608F:1=6283 608F:2=1
6091:0=2 6091:1=1 6091:2=1 6092:0=2 6092:1=6283 6092:2=1 6098:0=0 60B2:0=0 60C1:0=1 60C1:1=0 60C2:0=2 60C2:1=10
60C2:2=-3 60F4:0=0 60FE:0=2 60FE:1=0 60FE:2=0 6502:0=128
"""
"""Of 1000 counts/rad (6283 a turn), 10 A, 200 N m, 0.5 rad of following error, 6 rad/s2 in a quick stop, in mode 8."""


@pytest.fixture
def built(arm_settings):
    def built(cycle_s=0.01, traits=None, **changes):
        drive = arm_settings(**{"counts_per_rad": 1000.0} | changes).drives[0]
        return build_dictionary(drive, traits or DriveTraits(), cycle_s)

    return built


def test_after_a_reset_every_object_has_its_default(built):
    dictionary = built()
    found = {f"{key >> 8:04X}:{key & 0xFF}={value}" for key, value in dictionary.values.items()}
    assert found == set(VALUES.split())
    assert dictionary.texts[od.SOFTWARE_VERSION.key] == b"1"
    assert not dictionary.complete


@pytest.mark.parametrize(
    ("entry", "allowed"),
    [
        (od.ERROR_COUNT, {0}),
        (od.STORE_ALL, {0x6576_6173}),
        (od.MODE, {0, 8}),
        (od.QUICK_STOP_OPTION, {0, 1, 2, 5, 6}),
        (od.SHUTDOWN_OPTION, {0, 1}),
        (od.DISABLE_OPTION, {0, 1}),
        (od.HALT_OPTION, {1, 2}),
        (od.FAULT_REACTION_OPTION, {0, 1, 2}),
        (od.ABORT_CONNECTION_OPTION, {0, 1, 2, 3}),
        (od.COMMUNICATION_ERROR_BEHAVIOUR, {0, 1, 2}),
        (od.POLARITY, {0, 1 << 5, 1 << 7, 1 << 5 | 1 << 7}),
        (od.SYNC_COB_ID, {0x80}),
        (od.SYNC_COUNTER_OVERFLOW, {0} | set(range(2, 241))),
    ],
)
def test_only_values_of_the_standard_are_taken(built, entry, allowed):
    assert set(built().allowed[entry.key]) == allowed


def test_traits_and_settings_change_the_objects_they_name(built):
    traits = DriveTraits(identity=Identity(None, None), device_type=0x191, polarity=0x80, modes=frozenset({1, 7, 10}))
    values = built(0.254, traits, rated_torque_unit_nm=0.01).values
    assert [values[entry.key] for entry in (od.VENDOR_ID, od.PRODUCT_CODE, od.REVISION)] == [0, 0, 0x0001_0000]
    assert (values[od.DEVICE_TYPE.key], values[od.POLARITY.key]) == (0x191, 0x80)
    assert values[od.SUPPORTED_MODES.key] == 0b10_0100_0001
    assert (values[od.INTERPOLATION_TIME.key], values[od.RATED_TORQUE_MNM.key]) == (254, 20_000)
    assert values[od.ENCODER_INCREMENTS.key] == values[od.FEED.key] == 6283, "whatever the polarity"
    assert built(0.256).values[od.INTERPOLATION_TIME.key] == 255, "no more fit"
    assert built(0.255).values[od.INTERPOLATION_TIME.key] == 255
    assert built(traits=DriveTraits(identity=Identity(5, 6, 7))).values[od.REVISION.key] == 7
    assert built(mode=OperationMode.INTERPOLATED_POSITION).values[od.SUPPORTED_MODES.key] == 1 << 6


def test_what_a_drive_lacks_or_has_of_its_own_follows_from_its_settings(built):
    lacking = built(torque_offset=False, rated_current_a=None, feedback=EffortFeedback.TORQUE).entries
    assert not {od.TORQUE_OFFSET.key, od.RATED_CURRENT_MA.key, od.CURRENT_ACTUAL.key} & lacking.keys()
    assert od.TORQUE_ACTUAL.key in lacking
    own = built(
        vendor_effort=VendorObject(0x2001, 2, DataType.I32, 0.001),
        temperature=VendorObject(0x2002, 3, DataType.I16, 0.1),
    )
    assert own.values[0x2001_02] == 0
    assert own.values[0x2002_03] == 400, "40 degrees in tenths"
    assert {od.TORQUE_OFFSET.key, od.RATED_CURRENT_MA.key} <= own.entries.keys()


def test_a_drive_deviates_in_nothing_unless_told():
    traits = DriveTraits()
    assert traits.boot_message
    assert traits.takes_mode
    assert traits.homed
    assert (traits.polarity, traits.modes, traits.stuck_in, traits.on_request) == (0, None, None, None)
