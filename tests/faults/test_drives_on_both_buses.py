"""Drive faults and features of real drives, in lockstep and on vcan0: message, final state, recovery."""

from contextlib import suppress
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from armload_drivers.bring_up.drive_check import reset
from armload_drivers.canopen.canopen_bring_up import CanopenBringUp
from armload_drivers.cia402 import object_dictionary as od
from armload_drivers.cia402.arm_settings import Identity, VendorObject
from armload_drivers.cia402.eds_parser import DeviceDescription
from armload_drivers.cia402.object_dictionary import DataType
from armload_drivers.cia402.state_machine import State
from armload_drivers.driver_errors import (
    DriverError,
    ServoError,
    ServoFault,
    ServoTimeout,
    TorqueRemains,
    WrongDevice,
)
from armload_drivers.simulation.drives.drive_dictionary import DriveTraits
from tests.ideal_plant import IdealPlant

ZERO = np.zeros(3)


# A drive -----------------------------------------------------------------------------------------------------


def test_a_drive_fault_in_motion_and_the_way_back(fault_arm):
    arm = fault_arm()
    arm.enable()
    arm.move()
    arm.drives.fail(3, 0x2310)
    error = arm.failure(ServoFault)
    assert (error.node_id, error.joint) == (3, "joint_3")
    assert "0x2310 continuous overcurrent" in str(error)
    assert "then reset the fault" in str(error)
    with pytest.raises(ServoFault):
        arm.move(1)
    arm.comes_to_rest()
    with pytest.raises(ServoFault, match="0x2310"):
        arm.servos.enable()
    reset(CanopenBringUp(arm.arm, arm.bus, arm.timeouts), "joint_3", lambda question: False)
    arm.has_no_torque()
    arm.target_rad = arm.servos.enable().position_rad
    arm.move(5)


def test_a_short_emergency_frame_is_kept(fault_arm):
    """Some vendors send two bytes only; they contain the error code."""
    arm = fault_arm()
    arm.enable()
    arm.send(0x083, bytes.fromhex("1023"))
    assert "0x2310" in str(arm.failure(ServoFault))
    arm.comes_to_rest()


def test_following_error(fault_arm):
    arm = fault_arm()
    arm.enable()
    for cycle in range(250):
        # Slowly: an axis that falls behind at once has left its course.
        arm.plant.lag_rad = np.array([0.0, 0.0, 0.002 * cycle])
        arm.move(1, 0.0)
    arm.plant.lag_rad = np.array([0.0, 0.0, 0.501])
    with pytest.raises(ServoFault) as raised:
        arm.move(60, 0.0)
    error = raised.value
    assert error.node_id == 5
    assert "following error" in str(error)
    arm.plant.lag_rad = ZERO
    arm.comes_to_rest()


def test_heartbeat_loss_of_one_drive(fault_arm):
    arm = fault_arm()
    arm.enable()
    arm.drives.set_object(3, od.HEARTBEAT_PRODUCER_MS, 0)
    error = arm.failure(ServoTimeout)
    assert error.node_id == 3
    assert "heartbeat" in str(error)
    arm.comes_to_rest()


def test_a_drive_that_loses_its_supply(fault_arm):
    arm = fault_arm()
    arm.enable()
    arm.move()
    arm.drives.switch_off(5)
    error = arm.failure(ServoTimeout)
    assert (error.node_id, error.joint) == (5, "joint_5")
    assert "supply and cable" in str(error)
    with pytest.raises(TorqueRemains, match=r"joint_5 \(node 5\).*could not be read back"):
        arm.comes_to_rest()
    arm.has_no_torque()


def test_a_drive_that_reboots(fault_arm):
    arm = fault_arm()
    arm.enable()
    arm.drives.switch_off(2)
    arm.drives.switch_on(2)
    error = arm.failure(ServoError)
    assert error.node_id == 2
    assert "rebooted" in str(error)
    arm.comes_to_rest()
    with pytest.raises(ServoError, match=r"joint_2 \(node 2\), enabling: the drive has rebooted since"):
        arm.servos.enable()
    arm.has_no_torque()


@pytest.mark.parametrize("cycles", [1, 3])
def test_feedback_missing_for_a_while(fault_arm, cycles):
    arm = fault_arm()
    arm.enable()
    arm.move(3)
    arm.drives.drop_feedback(3, cycles)
    moved = [arm.move(1) for _ in range(20)]
    missing = sum(feedback.missing.sum() for feedback in moved)
    # On vcan0, a cycle without feedback may be one that this program was too late for.
    assert missing <= cycles <= missing + sum(feedback.skipped_cycles for feedback in moved)
    arm.comes_to_rest()


def test_feedback_missing_for_good(fault_arm):
    arm = fault_arm()
    arm.enable()
    arm.drives.drop_feedback(3, 10_000)
    error = arm.failure(ServoTimeout)
    assert error.node_id == 3
    assert "no feedback for 4 cycles" in str(error)
    # The drive obeys although it sends no feedback, as its answers to SDO requests prove.
    arm.servos.stop()
    arm.servos.disable()
    arm.has_no_torque()


@pytest.mark.parametrize("state", [State.SWITCH_ON_DISABLED, State.READY_TO_SWITCH_ON, State.SWITCHED_ON])
def test_a_drive_that_ignores_a_state_request(fault_arm, state):
    arm = fault_arm(traits={3: DriveTraits(stuck_in=state)})
    arm.servos.connect()
    with pytest.raises(ServoTimeout) as raised:
        arm.servos.enable()
    assert raised.value.node_id == 3
    assert f"OPERATION ENABLED and standstill not reached within 3.0 s, the drive has been in {state.title}" in str(
        raised.value
    )
    arm.has_no_torque()


def test_a_drive_that_ignores_its_mode(fault_arm):
    arm = fault_arm(traits={3: DriveTraits(takes_mode=False)})
    with pytest.raises(ServoTimeout, match="6061 reports mode 0"):
        arm.servos.connect()
    arm.has_no_torque()


def test_quick_stop_by_the_operator(fault_arm):
    arm = fault_arm()
    arm.enable()
    arm.move()
    arm.servos.stop()
    assert all(arm.plant.powered)
    with pytest.raises(DriverError, match="stopped"):
        arm.move(1)
    arm.comes_to_rest()


# Other features of real drives ----------------------------------------------------------------------------------


def test_a_vendors_32_bit_current_travels_in_a_pdo_of_its_own(fault_arm, arm_settings):
    vendor = VendorObject(0x30D1, 2, DataType.I32, 1e-3)
    arm = fault_arm(arm_settings(cycle_s=0.02, vendor_effort=vendor))
    arm.plant._torque_nm[:] = [20.0, -40.0, 60.0]
    arm.enable()
    feedback = arm.move(5)
    assert feedback.current_a == pytest.approx([1.0, -2.0, 3.0], abs=1e-3)
    arm.comes_to_rest()


def test_a_vendors_pdo_that_goes_missing_is_missing_feedback(fault_arm, arm_settings):
    vendor = VendorObject(0x30D1, 2, DataType.I32, 1e-3)
    arm = fault_arm(arm_settings(cycle_s=0.02, vendor_effort=vendor))
    arm.enable()
    # A tool on another cable disables TPDO2.
    arm.drives.set_object(3, od.PdoDirection.TRANSMIT.cob_id_entry(1), 0x80000283)
    assert arm.failure(ServoTimeout).node_id == 3


def test_the_sync_counter_counts(fault_arm, arm_settings):
    arm = fault_arm(replace(arm_settings(cycle_s=0.02), sync_counter=10))
    arm.enable()
    arm.heard()
    arm.move(25)
    counts = [m.data[0] for m in arm.heard() if m.arbitration_id == 0x080]
    assert len(counts) >= 25
    assert all(after == before % 10 + 1 for before, after in pairwise(counts))
    arm.comes_to_rest()


def test_a_drive_without_a_sync_counter_is_refused_where_one_is_asked_for(fault_arm, arm_settings):
    arm = fault_arm(replace(arm_settings(), sync_counter=10), traits={3: DriveTraits(absent=frozenset({0x1019}))})
    with pytest.raises(ServoError, match="sync_counter = 0"):
        arm.servos.connect()


def test_scales_that_are_not_configured_come_from_the_drives(fault_arm, arm_settings):
    settings = arm_settings(cycle_s=0.02)
    unknown = {"counts_per_rad": None, "rated_current_a": None, "rated_torque_nm": None}
    bare = replace(settings, drives=tuple(replace(drive, **unknown) for drive in settings.drives))
    arm = fault_arm(bare, drives_arm=settings)
    start = arm.enable()
    assert start == pytest.approx(settings.coupling @ [0.1, 0.2, 0.3], abs=1e-4)
    arm.move(5)
    arm.comes_to_rest()


class _Witness(IdealPlant):
    """Records the speed of each axis at the moment its torque is removed."""

    def __init__(self, position_rad):
        super().__init__(position_rad)
        self.speeds = []

    def set_powered(self, axis, on):
        if self.powered[axis] and not on:
            self.speeds.append(abs(float(self.velocity_rad_s[axis])))
        super().set_powered(axis, on)


def test_torque_goes_at_standstill_only_even_where_another_master_stopped_the_nodes(fault_arm):
    arm = fault_arm(plant=_Witness([0.1, 0.2, 0.3]))
    arm.enable()
    # One drive takes 0.5 s to stop (6085 = 1 rad/s2), longer than the others and the watch after their torque.
    arm.drives.set_object(3, od.QUICK_STOP_DECELERATION, round(arm.arm.drives[1].counts_per_rad))
    arm.move()
    arm.send(0x000, b"\x02\x00")
    arm.failure(DriverError)
    with suppress(ServoTimeout):  # nodes that were stopped send no feedback
        arm.servos.close()
    arm.has_no_torque()
    assert arm.plant.speeds == pytest.approx([0.0] * 3, abs=1e-3)


def test_without_a_configured_identity_the_device_description_is_asked(fault_arm, arm_settings):
    described = DeviceDescription("servo.eds", "", 0x1AB, None, None, None, {}, ())
    settings = arm_settings(cycle_s=0.02, identity=Identity(None, None), description=described)
    arm = fault_arm(settings)
    with pytest.raises(WrongDevice, match=r"vendor id \(1018\) is 0x41524D4C instead of 0x000001AB"):
        arm.servos.connect()
