"""A master independent of this project's: canopen's own objects, and a planner of ten lines.

It moves the simulated drives of an arm from point to point, in lockstep and in virtual time: canopen receives every
frame while it is sent, so that it needs no thread and does not wait.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

import canopen
import numpy as np
from canopen.objectdictionary import ODRecord, ODVariable, datatypes

from armload_drivers.cia402.arm_settings import ArmSettings, EffortFeedback
from armload_drivers.simulation.drives.drives_on_bus import SimulatedDrives
from armload_drivers.simulation.lockstep_bus import LockstepBus, LockstepWire
from armload_drivers.simulation.mujoco_plant import ArmPlant
from armload_drivers.simulation.plant_spec import PlantSpec
from armload_drivers.simulation.virtual_clock import VirtualClock
from armload_identification.float_array import FloatArray

_U8, _U16, _U32 = datatypes.UNSIGNED8, datatypes.UNSIGNED16, datatypes.UNSIGNED32
_OBJECTS = {
    0x6040: _U16, 0x6041: _U16, 0x6060: datatypes.INTEGER8, 0x6061: datatypes.INTEGER8, 0x6064: datatypes.INTEGER32,
    0x6077: datatypes.INTEGER16, 0x6078: datatypes.INTEGER16, 0x607A: datatypes.INTEGER32, 0x60B2: datatypes.INTEGER16,
}  # fmt: skip
_CSP, _IP = 8, 7
_ENABLE = (0x06, 0x07, 0x0F)
_INTERPOLATING = 0x10
_PATIENCE_CYCLES = 2000
_SWITCH_OFF_S = 0.5


class CanopenMaster:
    """Drives an arm with canopen's objects.

    Args:
        arm: Node ids, mode, kind of effort and coupling; scales are read from the drives.
        bus: The master's end of the bus.
        clock: Simulation time, advanced before each SYNC.
    """

    def __init__(self, arm: ArmSettings, bus: LockstepBus, clock: VirtualClock) -> None:
        self._network = canopen.Network(bus)
        self._network.NOTIFIER_CYCLE = 0.0
        bus.listen(lambda message: self._network.notify(message.arbitration_id, bytearray(message.data), clock()))
        self._clock, self._cycle_s = clock, arm.cycle_s
        self._to_axis = np.linalg.inv(arm.coupling)
        self._interpolated = int(arm.drives[0].mode) == _IP
        self._target = 0x60C1 if self._interpolated else 0x607A
        effort = 0x6078 if arm.drives[0].feedback is EffortFeedback.CURRENT else 0x6077
        self._nodes = [self._network.add_node(drive.node_id, _dictionary()) for drive in arm.drives]
        for node in self._nodes:
            node.sdo.RESPONSE_TIMEOUT = 0.1
            self._map(node, effort)
        turns = [self._counts_per_turn(node) for node in self._nodes]
        self._counts_per_rad = np.array(turns) / (2.0 * np.pi)

    def _map(self, node: canopen.RemoteNode, effort: int) -> None:
        """Map statusword, position and effort to the TPDO; controlword, target and torque offset to the RPDO."""
        node.tpdo.read()
        node.rpdo.read()
        back, there = node.tpdo[1], node.rpdo[1]
        for pdo, objects in ((back, [0x6041, 0x6064, effort]), (there, [0x6040, self._target, 0x60B2])):
            pdo.clear()
            for index in objects:
                pdo.add_variable(index, 1 if index == 0x60C1 else 0)
            pdo.trans_type, pdo.enabled = 1, True
            pdo.save()
        node.sdo[0x6060].raw = _IP if self._interpolated else _CSP

    @staticmethod
    def _counts_per_turn(node: canopen.RemoteNode) -> float:
        """Position units per turn of the axis: 608F through 6091."""
        sdo = node.sdo
        return float(sdo[0x608F][1].raw / sdo[0x608F][2].raw * sdo[0x6091][1].raw / sdo[0x6091][2].raw)

    def enable(self) -> FloatArray:
        """Bring all drives to OPERATION ENABLED at their present positions.

        Returns:
            (n,) joint positions in rad.
        """
        axes = np.array([node.sdo[0x6064].raw for node in self._nodes]) / self._counts_per_rad
        here: FloatArray = np.linalg.solve(self._to_axis, axes)
        for node in self._nodes:
            node.nmt.state = "OPERATIONAL"
        for word in _ENABLE:
            for _ in range(_PATIENCE_CYCLES):
                self.cycle(here, word)
                if all(self._reached(node, word) for node in self._nodes):
                    break
        return here

    def switch_off(self, joints_rad: FloatArray) -> None:
        """Remove the torque at the present position."""
        for _ in range(round(_SWITCH_OFF_S / self._cycle_s)):
            self.cycle(joints_rad, _ENABLE[0])

    @staticmethod
    def _reached(node: canopen.RemoteNode, word: int) -> bool:
        """Whether a drive has reached the state requested by a controlword."""
        return bool(node.tpdo[1][0x6041].raw & 0x6F == {0x06: 0x21, 0x07: 0x23, 0x0F: 0x27}[word])

    def cycle(self, joints_rad: FloatArray, word: int = 0x0F) -> None:
        """Send setpoints and a SYNC, one period after the last."""
        counts = np.rint(self._counts_per_rad * (self._to_axis @ joints_rad)).astype(int).tolist()
        word |= _INTERPOLATING if self._interpolated and word == _ENABLE[-1] else 0
        for node, target in zip(self._nodes, counts, strict=True):
            pdo = node.rpdo[1]
            pdo[0].raw, pdo[1].raw, pdo[2].raw = word, target, 0
            pdo.transmit()
        self._clock.advance(self._cycle_s)
        self._network.sync.transmit()

    def stay(self, joints_rad: FloatArray, time_s: float) -> None:
        """Hold a position."""
        for _ in range(round(time_s / self._cycle_s)):
            self.cycle(joints_rad)

    def go(self, begin_rad: FloatArray, end_rad: FloatArray, speed_rad_s: FloatArray) -> None:
        """Move synchronously from rest to rest along a quintic, no joint faster than its speed."""
        time_s = 1.875 * float(np.max(np.abs(end_rad - begin_rad) / speed_rad_s))
        steps = max(1, round(time_s / self._cycle_s))
        for step in range(1, steps + 1):
            u = step / steps
            self.cycle(begin_rad + (end_rad - begin_rad) * u**3 * (10.0 - 15.0 * u + 6.0 * u * u))


def _dictionary() -> canopen.ObjectDictionary:
    """The part of a device description that this master requires."""
    od = canopen.ObjectDictionary()
    for index, kind in _OBJECTS.items():
        od.add_object(_variable(index, 0, kind))
    records = {index: {1: _U32, 2: _U32} for index in (0x608F, 0x6091)} | {0x60C1: {1: datatypes.INTEGER32}}
    records |= {index: {1: _U32, 2: _U8, 3: _U16, 5: _U16} for index in (0x1400, 0x1800)}
    records |= {index: dict.fromkeys(range(1, 9), _U32) for index in (0x1600, 0x1A00)}
    for index, kinds in records.items():
        entry = ODRecord(f"record {index:04X}", index)
        for subindex, kind in ({0: _U8} | kinds).items():
            entry.add_member(_variable(index, subindex, kind))
        od.add_object(entry)
    return od


def _variable(index: int, subindex: int, kind: int) -> ODVariable:
    entry = ODVariable(f"object {index:04X}:{subindex}", index, subindex)
    entry.data_type, entry.access_type, entry.pdo_mappable = kind, "rw", index >= 0x6000
    return entry


@contextmanager
def arm_under_canopen(
    arm: ArmSettings, spec: PlantSpec, hear: Callable[[int, bytes, float], None]
) -> Iterator[CanopenMaster]:
    """A simulated arm with this master, and a listener.

    Args:
        arm: Its drives.
        spec: The arm moved by them.
        hear: Called with COB-ID, data and time of every frame.
    """
    clock, wire = VirtualClock(), LockstepWire()
    with LockstepBus(wire) as ear, LockstepBus(wire) as drives_bus, LockstepBus(wire) as bus:
        ear.listen(lambda message: hear(message.arbitration_id, bytes(message.data), clock()))
        with SimulatedDrives(arm, ArmPlant(spec), drives_bus, clock):
            yield CanopenMaster(arm, bus, clock)
