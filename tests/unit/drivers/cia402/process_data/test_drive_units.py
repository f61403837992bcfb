"""Drive units to and from SI: coupling, signs, rounding, and values out of range."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from armload_drivers.cia402.arm_settings import (
    ArmSettings,
    DriveSettings,
    EffortFeedback,
    Identity,
    OperationMode,
    VendorObject,
)
from armload_drivers.cia402.object_dictionary import DataType
from armload_drivers.cia402.process_data.drive_units import (
    ArmUnits,
    AxisUnits,
    interpolation_times,
    microseconds,
    milliseconds,
    saturate,
)
from armload_drivers.driver_errors import CommandError
from armload_drivers.servos import JointCommand

pytestmark = pytest.mark.pure

COUPLING = np.array([[1.0, 0.0, 0.0], [0.0167, 1.0, 0.0], [-0.02, 0.02, 1.0]])


def drive(node, *, feedback=EffortFeedback.CURRENT, torque_offset=True, limits=(-2.0, 3.0)):
    return DriveSettings(
        joint=f"joint_{node}",
        node_id=node,
        mode=OperationMode.CYCLIC_SYNCHRONOUS_POSITION,
        feedback=feedback,
        counts_per_rad=1e5 * node,
        rated_current_a=10.0 * node if feedback is EffortFeedback.CURRENT else None,
        rated_torque_nm=100.0 * node,
        max_torque_permille=3000,
        following_error_rad=0.1,
        position_min_rad=limits[0],
        position_max_rad=limits[1],
        velocity_max_rad_s=2.0,
        acceleration_max_rad_s2=5.0,
        has_brake=True,
        identity=Identity(None, None),
        torque_offset=torque_offset,
    )


def arm(drives=None, coupling=COUPLING):
    drives = tuple(drive(node) for node in (1, 2, 3)) if drives is None else tuple(drives)
    return ArmSettings(drives, np.asarray(coupling), 0.004, 1_000_000, 0.1, 3)


def torque_arm():
    return arm(drive(node, feedback=EffortFeedback.TORQUE) for node in (1, 2, 3))


def command(position, torque=None):
    position = np.asarray(position, dtype=float)
    zero = np.zeros_like(position)
    return JointCommand(position, zero, zero if torque is None else np.asarray(torque, dtype=float))


angles = st.lists(st.floats(-6.0, 6.0), min_size=3, max_size=3)
torques = st.lists(st.floats(-90.0, 90.0), min_size=3, max_size=3)
polarities = st.lists(st.sampled_from([0x00, 0x20, 0x80, 0xA0]), min_size=3, max_size=3)


@given(angles, polarities)
def test_positions_come_back_within_a_count(position, polarity):
    units = ArmUnits(arm(), polarity)
    raw = units.targets(command(position))
    back = units.joint_position_rad(raw.position_counts)
    worst = np.abs(COUPLING) @ (0.5 / np.array([1e5, 2e5, 3e5]))
    assert np.all(np.abs(back - position) <= worst + 1e-12)


@given(torques, polarities)
def test_torques_come_back_within_a_permille(torque, polarity):
    units = ArmUnits(torque_arm(), polarity)
    raw = units.targets(command(np.zeros(3), torque))
    back = units.joint_torque_nm(raw.effort)
    worst = np.abs(np.linalg.inv(COUPLING).T) @ (0.5e-3 * np.array([100.0, 200.0, 300.0]))
    assert np.all(np.abs(back - torque) <= worst + 1e-12)


@given(angles, torques)
def test_power_is_the_same_on_both_sides_of_the_coupling(velocity, torque):
    """tau_joint . dq_joint = tau_axis . dq_axis determines where transpose and inverse belong."""
    axis_velocity = np.linalg.solve(COUPLING, velocity)
    units = ArmUnits(torque_arm())
    permille = COUPLING.T @ np.array(torque) / (1e-3 * np.array([100.0, 200.0, 300.0]))
    joint_torque = units.joint_torque_nm(permille)
    axis_torque = permille * 1e-3 * np.array([100.0, 200.0, 300.0])
    assert joint_torque @ np.array(velocity) == pytest.approx(axis_torque @ axis_velocity, abs=1e-9)


def test_polarity_changes_signs_where_it_says_so():
    plain, reversed_position, reversed_torque = (AxisUnits.of(drive(1), polarity) for polarity in (0x00, 0x80, 0x20))
    assert reversed_position.counts_per_rad == -plain.counts_per_rad
    assert reversed_position.torque_nm_per_permille == plain.torque_nm_per_permille
    assert reversed_torque.counts_per_rad == plain.counts_per_rad
    assert reversed_torque.torque_nm_per_permille == -plain.torque_nm_per_permille
    assert reversed_torque.effort_per_unit == -plain.effort_per_unit


def test_currents_are_per_motor():
    units = ArmUnits(arm())
    assert units.motor_current_a([100, 100, -100]) == pytest.approx([1.0, 2.0, -3.0])


def test_measured_rounds_and_saturates():
    units = ArmUnits(arm())
    raw = units.measured(np.array([0.1234567, 0.0, 1e9]), np.array([0.149, -1e9, 0.0]))
    assert raw.position_counts == [12346, 0, DataType.I32.bounds[1]]
    assert raw.effort == [1, -DataType.I16.bounds[1], 0]


@pytest.mark.parametrize("value", [math.nan, math.inf, 1e6])
def test_a_target_that_no_drive_can_have_is_refused(value):
    with pytest.raises(CommandError, match=r"joint_1.*target position"):
        ArmUnits(arm(coupling=np.eye(3))).targets(command([value, 0.0, 0.0]))


@pytest.mark.parametrize("value", [math.nan, -math.inf, 1e5, 1e4, -9831.0])
def test_a_torque_offset_that_no_drive_can_have_is_refused(value):
    with pytest.raises(CommandError, match=r"joint_3.*torque offset"):
        ArmUnits(arm(coupling=np.eye(3))).targets(command(np.zeros(3), [0.0, 0.0, value]))


def test_too_few_targets_are_refused():
    with pytest.raises(CommandError, match="3 joints"):
        ArmUnits(arm()).targets(command([0.0, 0.0]))


def test_a_drive_without_60b2_is_not_asked_for_a_torque():
    units = ArmUnits(arm([drive(1), drive(2, torque_offset=False), drive(3)], np.eye(3)))
    assert units.targets(command(np.zeros(3), [5.0, 0.0, 5.0])).effort == [50, 0, 17]
    with pytest.raises(CommandError, match=r"the drives of joint_2 do not accept.*60B2"):
        units.targets(command(np.zeros(3), [0.0, 5.0, 0.0]))


def test_all_drives_have_to_send_the_same():
    with pytest.raises(CommandError, match="same kind"):
        ArmUnits(arm([drive(1), drive(2, feedback=EffortFeedback.TORQUE), drive(3)]))


def test_position_limits_contain_every_coupled_position():
    units = ArmUnits(arm(), [0x80, 0x00, 0x80])
    limits = [units.position_limits_counts(axis) for axis in range(3)]
    corners = np.array(np.meshgrid(*[(-2.0, 3.0)] * 3)).reshape(3, -1).T
    raw = np.array([units.targets(command(corner)).position_counts for corner in corners])
    for axis, (lower, upper) in enumerate(limits):
        assert lower < upper
        assert lower <= raw[:, axis].min() <= lower + 1
        assert upper - 1 <= raw[:, axis].max() <= upper


@pytest.mark.parametrize(
    ("cycle_s", "written"),
    [
        (0.004, [(4, -3), (40, -4)]),
        (0.01, [(1, -2), (10, -3), (100, -4)]),
        (0.0025, [(25, -4), (250, -5)]),
        (1 / 80, [(125, -4)]),
        (1.0, [(1, 0), (10, -1), (100, -2)]),
    ],
)
def test_cycle_times_as_60c2_has_them(cycle_s, written):
    assert interpolation_times(cycle_s) == written
    assert [value * 10.0**exponent for value, exponent in written] == pytest.approx([cycle_s] * len(written))


@pytest.mark.parametrize("cycle_s", [1 / 300, 0.004001, 0.0])
def test_a_cycle_that_60c2_cannot_hold_is_refused(cycle_s):
    with pytest.raises(CommandError, match="60C2"):
        interpolation_times(cycle_s)


def test_times_of_the_communication_profile():
    assert microseconds(0.004) == 4000
    assert milliseconds(0.25) == 250
    assert milliseconds(1e-6) == 1, "0 would switch the timer off"


@pytest.mark.parametrize(
    ("value", "kind", "held"),
    [(1.6, DataType.I16, 2), (1e9, DataType.I16, 32767), (-1e9, DataType.I16, -32768), (-1, DataType.U8, 0)],
)
def test_saturation(value, kind, held):
    assert saturate(value, kind) == held


@pytest.mark.parametrize("key", ["counts_per_rad", "rated_torque_nm", "rated_current_a"])
def test_a_scale_that_only_the_drive_knows_is_not_there_before_connecting(key):
    with pytest.raises(CommandError, match=r"joint_1: .* unknown until it is connected"):
        AxisUnits.of(replace(drive(1), **{key: None}))


def test_a_vendors_effort_has_its_own_scale():
    vendor = VendorObject(0x30D1, 2, DataType.I32, 1e-3)
    units = AxisUnits.of(replace(drive(1), vendor_effort=vendor), 0x20)
    assert units.effort_per_unit == -1e-3
    # 100 N m are 1000 per mille of torque, and of current: 10 A.
    assert units.effort_units_per_nm * 100.0 == pytest.approx(-10.0 / 1e-3)
    unrated = AxisUnits.of(replace(drive(1), vendor_effort=vendor, rated_current_a=None))
    assert unrated.effort_per_unit == 1e-3
    assert np.isnan(unrated.effort_units_per_nm)
