"""`CanopenServos` with drives independent of this project (`tests/independent_drive.py`), in real time."""

import time
import uuid
from dataclasses import replace

import can
import canopen
import numpy as np
import pytest

from armload_drivers.bring_up.drive_check import reset
from armload_drivers.bus.sync_sources import TimerSync
from armload_drivers.canopen.canopen_bring_up import CanopenBringUp
from armload_drivers.canopen.canopen_servos import CanopenServos
from armload_drivers.cia402.arm_settings import Identity, OperationMode
from armload_drivers.cia402.object_dictionary import DEVICE_NAME
from armload_drivers.cia402.timeouts import Timeouts
from armload_drivers.driver_errors import ServoFault, WrongDevice
from armload_drivers.servos import JointCommand
from tests.independent_drive import (
    COUNTS_PER_TURN,
    DISABLED,
    ENABLED,
    FAULT,
    QUICK_STOP,
    READY,
    SWITCHED_ON,
    VENDOR_ID,
    join,
)

RAD = COUNTS_PER_TURN / (2.0 * np.pi)
ZERO = np.zeros(3)
PATIENT = Timeouts(scan_s=0.05, sdo_s=5.0, enable_s=10.0, stop_s=10.0, disable_s=10.0)
"""Long timeouts for a busy machine; short scans, since no other node is on the bus."""
STEP_RAD = np.deg2rad(0.02)


def hold(servos, position_rad, cycles):
    for _ in range(cycles):
        servos.exchange(JointCommand(position_rad, ZERO, ZERO))


@pytest.fixture(
    params=[
        OperationMode.CYCLIC_SYNCHRONOUS_POSITION,
        pytest.param(OperationMode.INTERPOLATED_POSITION, marks=pytest.mark.long),
    ],
    ids=lambda mode: mode.name,
)
def mode(request):
    """Either mode; tests that do not depend on it run in one of them only."""
    return request.param


@pytest.fixture
def bench(mode, independent_arm):
    """Servos connected to independently implemented drives."""
    arm = independent_arm(mode, heartbeat_s=0.2)
    channel = uuid.uuid4().hex
    with (
        can.Bus(interface="virtual", channel=channel) as drives_bus,
        can.Bus(interface="virtual", channel=channel) as bus,
    ):
        network = canopen.Network(drives_bus)
        network.NOTIFIER_CYCLE = 0.02
        network.connect()
        drives = join(network, [drive.node_id for drive in arm.drives], [int(mode)])
        servos = CanopenServos(arm, bus, TimerSync(), PATIENT)
        yield servos, drives, arm, bus
        servos.close()
        for drive in drives:
            drive.nmt.stop_heartbeat()
        network.disconnect()


@pytest.mark.parametrize("mode", list(OperationMode), ids=lambda mode: mode.name)
def test_it_is_booted_enabled_moved_and_disabled(bench):
    servos, drives, arm, _ = bench
    servos.connect()
    assert not servos.simulated
    names = [setup.objects.sdo.read_text_if_there(DEVICE_NAME) for setup in servos.setups]
    assert names == ["independent servo amplifier"] * 3
    start = servos.enable().position_rad
    np.testing.assert_allclose(start, arm.coupling @ [drive.position / RAD for drive in drives], atol=1e-6)
    for cycle in range(1, 26):
        servos.exchange(JointCommand(start + STEP_RAD * cycle, ZERO, ZERO))
    end = start + STEP_RAD * 25
    reached = [servos.exchange(JointCommand(end, ZERO, ZERO)) for _ in range(3)][-1]
    np.testing.assert_allclose(reached.position_rad, end, atol=1e-6)
    assert not reached.missing.any()
    servos.stop()
    assert [drive.state for drive in drives] == [QUICK_STOP] * 3
    servos.disable()
    for drive in drives:
        assert drive.states[-5:] == [READY, SWITCHED_ON, ENABLED, QUICK_STOP, DISABLED]
        # A skipped cycle doubles a step; there is no greater one, and no jump on enabling.
        assert max(drive.jumps) < 10 * STEP_RAD * RAD


def test_its_fault_in_motion_is_reported_and_reset_by_name(bench):
    servos, drives, arm, bus = bench
    servos.connect()
    start = servos.enable().position_rad
    drives[1].fail(0x2310)
    with pytest.raises(ServoFault, match=r"joint_3.*2310"):
        hold(servos, start, 50)
    servos.stop()
    servos.disable()
    assert [drive.state for drive in drives] == [DISABLED, FAULT, DISABLED]
    reset(CanopenBringUp(arm, bus, PATIENT), "joint_3", lambda question: True)
    servos.enable()
    assert [drive.state for drive in drives] == [ENABLED] * 3


def test_a_silent_master_is_noticed_by_it(bench):
    """The drive monitors the heartbeat configured in 1016."""
    servos, drives, arm, _ = bench
    servos.connect()
    start = servos.enable().position_rad
    hold(servos, start, round(4 * arm.heartbeat_s / arm.cycle_s))
    assert [drive.state for drive in drives] == [ENABLED] * 3
    time.sleep(4 * arm.heartbeat_s)
    with pytest.raises(ServoFault, match="8130"):
        hold(servos, start, 50)


def test_another_product_is_refused(bench):
    servos, drives, arm, _ = bench
    servos.connect()
    before = [len(drive.states) for drive in drives]
    arm = replace(arm, drives=tuple(replace(d, identity=Identity(VENDOR_ID, 0x9999)) for d in arm.drives))
    channel = drives[0].network.bus.channel_id
    with (
        can.Bus(interface="virtual", channel=channel) as bus,
        pytest.raises(WrongDevice, match=r"product code \(1018\) is 0x00001234 instead of 0x00009999"),
    ):
        CanopenServos(arm, bus, TimerSync(), PATIENT).connect()
    assert [len(drive.states) for drive in drives] == before, "no node was reset"
