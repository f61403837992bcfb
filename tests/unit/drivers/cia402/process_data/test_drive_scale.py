"""The scale reported by a drive, compared with the configuration."""

import math
from dataclasses import replace

import msgspec
import pytest

from armload_drivers.cia402.arm_settings import DriveSettings, EffortFeedback, Identity, OperationMode, VendorObject
from armload_drivers.cia402.object_dictionary import DataType
from armload_drivers.cia402.process_data.drive_scale import ReportedScale, resolve
from armload_drivers.driver_errors import CommandError

pytestmark = pytest.mark.pure

TURN = 2 * math.pi
NOTHING = ReportedScale(None, None, None, None, None)
REPORTED = ReportedScale(4096.0, 100.0, None, 2.0, 5.0)
CONFIGURED = DriveSettings(
    joint="elbow",
    node_id=3,
    mode=OperationMode.CYCLIC_SYNCHRONOUS_POSITION,
    feedback=EffortFeedback.CURRENT,
    counts_per_rad=409_600 / TURN,
    rated_current_a=5.0,
    rated_torque_nm=200.0,
    max_torque_permille=2000,
    following_error_rad=0.1,
    position_min_rad=-1.0,
    position_max_rad=1.0,
    velocity_max_rad_s=2.0,
    acceleration_max_rad_s2=5.0,
    has_brake=True,
    identity=Identity(None, None),
)
OPEN = replace(CONFIGURED, counts_per_rad=None, rated_current_a=None, rated_torque_nm=None)


def test_what_is_not_configured_is_taken_from_the_drive():
    assert resolve(OPEN, REPORTED) == CONFIGURED


def test_what_the_drive_does_not_report_is_taken_from_the_configuration():
    assert resolve(CONFIGURED, NOTHING) == CONFIGURED


def test_agreement_changes_nothing():
    assert resolve(CONFIGURED, REPORTED) == CONFIGURED


@pytest.mark.parametrize("key", ["counts_per_rad", "rated_current_a", "rated_torque_nm"])
def test_contradictions_are_refused(key):
    wrong = replace(CONFIGURED, **{key: 1.1 * getattr(CONFIGURED, key)})
    with pytest.raises(CommandError, match="one of them is wrong"):
        resolve(wrong, REPORTED)


@pytest.mark.parametrize("missing", ["increments_per_motor_turn", "rated_torque_nm", "rated_current_a"])
def test_what_neither_gives_is_refused_with_the_key(missing):
    with pytest.raises(CommandError, match=r"give \w+ in the configuration"):
        resolve(OPEN, msgspec.structs.replace(REPORTED, **{missing: None}))


def test_a_feed_constant_replaces_encoder_and_gear():
    """Pilz: 1/1000 degree at the joint, with any encoder."""
    drive = replace(OPEN, rated_torque_nm=200.0)
    assert resolve(
        drive, msgspec.structs.replace(REPORTED, feed_per_shaft_turn=360_000.0)
    ).counts_per_rad == pytest.approx(360_000 / TURN)


def test_a_feed_of_one_is_not_in_use():
    assert resolve(OPEN, msgspec.structs.replace(REPORTED, feed_per_shaft_turn=1.0)) == CONFIGURED


@pytest.mark.parametrize("gear", [None, 1.0])
def test_a_drive_that_knows_nothing_of_its_gear_may_mean_either_side(gear):
    reported = msgspec.structs.replace(REPORTED, gear_ratio=gear)
    geared = replace(CONFIGURED, gear_ratio=100.0)
    assert resolve(geared, reported).counts_per_rad == pytest.approx(409_600 / TURN)
    beside = replace(geared, counts_per_rad=4096 / TURN, rated_torque_nm=2.0)
    assert resolve(beside, reported) == beside
    with pytest.raises(CommandError, match="the side of the gear"):
        resolve(replace(OPEN, gear_ratio=100.0), reported)
    with pytest.raises(CommandError, match=r"the drive reports position units .* = 651\.899 or 65189\.9"):
        resolve(replace(geared, counts_per_rad=1234.0), reported)


def test_a_vendors_effort_needs_no_rated_current():
    vendor = VendorObject(0x30D1, 2, DataType.I32, 1e-3)
    drive = replace(OPEN, vendor_effort=vendor)
    assert resolve(drive, msgspec.structs.replace(REPORTED, rated_current_a=None)).rated_current_a is None
    with pytest.raises(CommandError, match="rated current"):
        resolve(replace(drive, rated_current_a=12.0), msgspec.structs.replace(REPORTED, rated_current_a=10.0))
    torque = replace(OPEN, feedback=EffortFeedback.TORQUE)
    assert resolve(torque, msgspec.structs.replace(REPORTED, rated_current_a=None)).rated_current_a is None
