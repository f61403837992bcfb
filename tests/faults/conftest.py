"""An arm for scripted faults, in lockstep or on vcan0 in real time."""

import time
from contextlib import ExitStack
from dataclasses import replace

import can
import numpy as np
import pytest

from armload_drivers.bus.kernel_sync import BcmSync, BroadcastManager
from armload_drivers.canopen.canopen_servos import CanopenServos
from armload_drivers.cia402.timeouts import Timeouts
from armload_drivers.driver_errors import DriverError
from armload_drivers.servos import JointCommand
from armload_drivers.simulation.drives.drives_on_bus import SimulatedDrives
from armload_drivers.simulation.lockstep_bus import LockstepBus, LockstepWire
from armload_drivers.simulation.lockstep_sync import LockstepSync
from armload_drivers.simulation.virtual_clock import VirtualClock
from tests.bounded import overheard
from tests.ideal_plant import IdealPlant

ZERO = np.zeros(3)
SPEED_RAD_S = 0.5
VCAN_HEARTBEAT_S = 0.3


class FaultArm:
    """Master, simulated drives, the plant behind them, and a third party on the bus.

    Args:
        vcan: On vcan0; otherwise in lockstep.
        arm: The master's settings.
        traits: Deviations of the drives, by node id.
        drives_arm: The drives' settings if they differ from the master's.
        plant: The plant that they move.
    """

    def __init__(self, vcan, arm, traits=None, drives_arm=None, plant=None):
        if vcan:
            # A virtual machine on a busy host may pause for a tenth of a second; that is no fault of the drives.
            arm = replace(arm, heartbeat_s=VCAN_HEARTBEAT_S)
            drives_arm = drives_arm and replace(drives_arm, heartbeat_s=VCAN_HEARTBEAT_S)
        self.vcan, self.arm = vcan, arm
        self.plant = plant or IdealPlant(np.linspace(0.1, 0.3, len((drives_arm or arm).drives)))
        self._stack = ExitStack()
        wire = LockstepWire()
        self.bus, drives_bus, self.other = (
            self._stack.enter_context(can.Bus(interface="socketcan", channel="vcan0") if vcan else LockstepBus(wire))
            for _ in range(3)
        )
        clock = time.monotonic if vcan else VirtualClock()
        self.drives = self._stack.enter_context(
            SimulatedDrives(drives_arm or arm, self.plant, drives_bus, clock, traits)
        )
        # In lockstep, waiting takes no time.
        self.timeouts = Timeouts(probe_s=0.3, scan_s=0.09, boot_s=1.2, sdo_s=1.0, mode_s=0.3)
        self.sync = BcmSync(BroadcastManager("vcan0")) if vcan else LockstepSync(clock)
        self.servos = CanopenServos(arm, self.bus, self.sync, self.timeouts)

    def send(self, cob_id, data=b"", **kind):
        """The third party sends a frame."""
        self.other.send(can.Message(arbitration_id=cob_id, data=data, is_extended_id=False, **kind))

    def heard(self):
        """Everything on the bus since the last call."""
        return overheard(self.other, 0.02 if self.vcan else 0.0)

    def enable(self):
        self.servos.connect()
        self.start_rad = self.target_rad = self.servos.enable().position_rad
        return self.start_rad

    def move(self, cycles=20, speed_rad_s=SPEED_RAD_S):
        for _ in range(cycles):
            self.target_rad = self.target_rad + self.arm.cycle_s * speed_rad_s
            feedback = self.servos.exchange(JointCommand(self.target_rad, ZERO, ZERO))
        return feedback

    def failure(self, kind, cycles=60):
        """The error with which motion ends."""
        with pytest.raises(kind) as raised:
            self.move(cycles)
        return raised.value

    def comes_to_rest(self):
        """Stop and disable; check that no torque is left and nothing moves."""
        self.servos.stop()
        assert self.plant.velocity_rad_s == pytest.approx(np.zeros(self.plant.n), abs=1e-3)
        self.servos.disable()
        self.has_no_torque()

    def has_no_torque(self):
        assert not any(self.plant.powered)

    def close(self):
        try:
            self.servos.close()
        except DriverError:
            self.has_no_torque()
        finally:
            self._stack.close()


@pytest.fixture(params=["lockstep", pytest.param("vcan", marks=pytest.mark.vcan)])
def fault_arm(request, arm_settings):
    """Makes `FaultArm`s on one of the two buses and closes them."""
    vcan = request.param == "vcan"
    with ExitStack() as stack:

        def make(arm=None, **kwargs):
            made = FaultArm(vcan, arm or arm_settings(cycle_s=0.02 if vcan else 0.01), **kwargs)
            stack.callback(made.close)
            return made

        yield make
