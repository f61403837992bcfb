"""A stop removes the added torque without a jerk: er50 with its payload, in the simulated plant."""

import math
from contextlib import ExitStack
from dataclasses import replace

import numpy as np
import pytest

from armload_controller.config.robot import load_robot
from armload_drivers.canopen.canopen_servos import CanopenServos
from armload_drivers.servos import JointCommand
from armload_drivers.simulation.drives.drives_on_bus import SimulatedDrives
from armload_drivers.simulation.lockstep_bus import LockstepBus, LockstepWire
from armload_drivers.simulation.lockstep_sync import LockstepSync
from armload_drivers.simulation.mujoco_plant import ArmPlant
from armload_drivers.simulation.virtual_clock import VirtualClock
from tests.fake_servos import FakeServos

JOINT = 1
OFFSET_NM = 150.0
"""About the torque of the payload's weight at the shoulder."""
CYCLE_S = 0.004


class Track(ArmPlant):
    """Records the joints' speeds every 1 ms."""

    def __init__(self, spec):
        super().__init__(spec)
        self.speeds = []

    def advance(self, time_s):
        for _ in range(math.ceil((time_s - self.time_s) / 1e-3 - 1e-6)):
            super().advance(min(time_s, self.time_s + 1e-3))
            self.speeds.append(self._velocity[:: self._hinges].copy())


@pytest.fixture(params=["fake", "canopen"])
def arm(request):
    robot = load_robot("er50")
    settings = replace(robot.drives.settings, cycle_s=CYCLE_S)
    spec = robot.simulation.plant_spec(robot.simulation.payload_name)
    # At standstill, friction would hide the effect of the torque.
    plant = Track(replace(spec, friction_scale=0.0))
    with ExitStack() as stack:
        if request.param == "fake":
            servos = FakeServos(settings, plant)
        else:
            clock, wire = VirtualClock(), LockstepWire()
            bus, drives_bus = (stack.enter_context(LockstepBus(wire)) for _ in range(2))
            stack.enter_context(SimulatedDrives(settings, plant, drives_bus, clock))
            servos = CanopenServos(settings, bus, LockstepSync(clock))
        stack.callback(servos.close)
        servos.connect()
        hold = servos.enable().position_rad
        yield servos, plant, hold


def with_offset(servos, hold, seconds=0.6):
    """Hold the position with added torque, faded in smoothly."""
    cycles = round(seconds / CYCLE_S)
    offset = np.zeros(6)
    for cycle in range(cycles + 50):
        offset[JOINT] = OFFSET_NM * min(1.0, cycle / cycles)
        servos.exchange(JointCommand(hold, np.zeros(6), offset))


def test_the_arm_does_not_jerk_when_a_stop_takes_its_added_torque(arm):
    servos, plant, hold = arm
    with_offset(servos, hold)
    stands = plant.sample(CYCLE_S).joint_position_rad
    plant.speeds.clear()
    servos.stop()
    plant.advance(plant.time_s + 0.1)
    faded = np.array(plant.speeds)[:, JOINT]
    assert plant.sample(CYCLE_S).joint_position_rad == pytest.approx(stands, abs=1e-3)

    # The same arm, with the torque removed at once.
    servos.disable()
    servos.enable()
    with_offset(servos, hold)
    plant.speeds.clear()
    for axis in range(6):
        plant.set_torque_offset(axis, 0.0)
    plant.advance(plant.time_s + 0.3)
    step = np.array(plant.speeds)[:, JOINT]
    assert np.abs(faded).max() < 0.2 * np.abs(step).max()
    assert np.abs(np.diff(faded)).max() < 0.1 * np.abs(np.diff(step)).max()


def test_a_stop_in_motion_is_no_rougher_with_added_torque_than_without(arm):
    servos, plant, hold = arm
    peaks = []
    for offset_nm in (0.0, OFFSET_NM):
        offset = np.zeros(6)
        position = hold.copy()
        for cycle in range(1, 251):
            offset[JOINT] = offset_nm * min(1.0, cycle / 150)
            position = hold + 0.3 * CYCLE_S * cycle * min(1.0, cycle / 100) * (np.arange(6) == JOINT)
            servos.exchange(JointCommand(position, np.zeros(6), offset))
        plant.speeds.clear()
        servos.stop()
        peaks.append(np.abs(np.diff(np.array(plant.speeds)[:, JOINT])).max())
        servos.disable()
        hold = servos.enable().position_rad
    assert peaks[1] < 1.5 * peaks[0]
