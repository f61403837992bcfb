"""A master that shares no code with this project: canopen's CiA 402 profile, PDO objects and SYNC.

`network_with_drives` connects it to simulated drives. The profile sends RPDOs only if they are asynchronous, or as a
periodic task. As its users do, this master presets the target, starts the task, and writes to the map.
"""

import time
import uuid
from contextlib import contextmanager

import can
import canopen
from canopen.objectdictionary import ODRecord, ODVariable, datatypes, export_od, import_od
from canopen.profiles.p402 import BaseNode402

from armload_drivers.simulation.drives.drives_on_bus import SimulatedDrives

U8, U16, U32 = datatypes.UNSIGNED8, datatypes.UNSIGNED16, datatypes.UNSIGNED32
I8, I16, I32 = datatypes.INTEGER8, datatypes.INTEGER16, datatypes.INTEGER32
TEXT = datatypes.VISIBLE_STRING

PATIENCE_S = 5.0
PERIOD_S = 0.02
ENABLE_IP = 0x1F
"""Controlword for OPERATION ENABLED with interpolation enabled (bit 4)."""


def description(path):
    """Write an EDS file for this master; returns canopen's object dictionary."""
    od = canopen.ObjectDictionary()
    for index, kind in (
        (0x1000, U32), (0x1001, U8), (0x1008, TEXT), (0x1017, U16), (0x603F, U16), (0x6040, U16), (0x6041, U16),
        (0x6060, I8), (0x6061, I8), (0x6064, I32), (0x6077, I16), (0x607A, I32), (0x60B2, I16), (0x6502, U32),
    ):  # fmt: skip
        od.add_object(_variable(index, 0, kind))
    records = {0x1018: {1: U32, 2: U32}, 0x608F: {1: U32, 2: U32}, 0x6091: {1: U32, 2: U32}, 0x60C1: {1: I32}}
    for number in range(2):
        for base in (0x1400, 0x1800):
            records[base + number] = {1: U32, 2: U8, 3: U16, 5: U16}
        for base in (0x1600, 0x1A00):
            records[base + number] = dict.fromkeys(range(1, 9), U32)
    for index, kinds in records.items():
        entry = ODRecord(f"record {index:04X}", index)
        for subindex, kind in ({0: U8} | kinds).items():
            entry.add_member(_variable(index, subindex, kind))
        od.add_object(entry)
    export_od(od, str(path), "eds")
    return import_od(str(path))


def _variable(index, subindex, kind):
    entry = ODVariable(f"object {index:04X}:{subindex}", index, subindex)
    entry.data_type, entry.access_type, entry.pdo_mappable = kind, "rw", index >= 0x6000
    return entry


@contextmanager
def network_with_drives(arm, plant):
    """A connected network on a virtual bus with an arm's simulated drives, in real time."""
    channel = uuid.uuid4().hex
    with (
        can.Bus(interface="virtual", channel=channel) as drives_bus,
        can.Bus(interface="virtual", channel=channel) as bus,
        SimulatedDrives(arm, plant, drives_bus, time.monotonic),
    ):
        network = canopen.Network(bus)
        network.NOTIFIER_CYCLE = PERIOD_S
        network.connect()
        try:
            yield network
        finally:
            network.disconnect()


class Master:
    """One drive under canopen's profile.

    Args:
        network: A connected network.
        node_id: The drive.
        od: Its description.
    """

    def __init__(self, network, node_id, od):
        self.network = network
        self.node = network.add_node(BaseNode402(node_id, od))
        # canopen's 0.2 to 0.8 s are too short when other tests run in parallel.
        self.node.TIMEOUT_CHECK_TPDO = self.node.TIMEOUT_SWITCH_OP_MODE = PATIENCE_S
        self.node.TIMEOUT_SWITCH_STATE_SINGLE = self.node.TIMEOUT_SWITCH_STATE_FINAL = PATIENCE_S

    def boot(self):
        """Reset, and wait for the boot-up message; canopen's own wait misses a message that arrives earlier."""
        seen = []
        self.node.nmt.add_heartbeat_callback(seen.append)
        self.node.nmt.state = "RESET"
        deadline_s = time.monotonic() + 5.0
        while 0 not in seen and time.monotonic() < deadline_s:
            time.sleep(0.01)
        assert 0 in seen
        assert self.node.sdo[0x1000].raw & 0xFFFF == 402

    def counts_per_turn(self):
        """Encoder counts per turn of the axis, from 608F and 6091."""
        sdo = self.node.sdo
        return sdo[0x608F][1].raw / sdo[0x608F][2].raw * sdo[0x6091][1].raw / sdo[0x6091][2].raw

    def configure(self, mode, split):
        """Map PDOs: controlword and target in one PDO, or in two of which the first is asynchronous."""
        node = self.node
        self.target = 0x607A if mode == "CYCLIC SYNCHRONOUS POSITION" else 0x60C1
        node.tpdo.read()
        node.rpdo.read()
        if split:
            maps = [(node.rpdo[1], [0x6040], 255), (node.rpdo[2], [self.target], 1)]
            maps += [(node.tpdo[1], [0x6041], 1), (node.tpdo[2], [0x6064, 0x6077], 2)]
        else:
            maps = [(node.rpdo[1], [0x6040, self.target], 1), (node.tpdo[1], [0x6041, 0x6064], 1)]
        for pdo, objects, kind in maps:
            pdo.clear()
            for index in objects:
                pdo.add_variable(index, 1 if index == 0x60C1 else 0)
            pdo.trans_type, pdo.enabled = kind, True
            pdo.save()
        node.setup_402_state_machine()
        node.op_mode = mode
        assert node.op_mode == mode

    def enable(self):
        """Preset the target, start all periodic messages, and go to OPERATION ENABLED."""
        node = self.node
        actual = node.sdo[0x6064].raw
        node.rpdo_pointers[self.target].raw = actual
        carrier = node.rpdo_pointers[self.target].pdo_parent
        carrier.start(PERIOD_S)
        self.network.sync.start(PERIOD_S)
        node.nmt.state = "OPERATIONAL"
        for state in ("READY TO SWITCH ON", "SWITCHED ON", "OPERATION ENABLED"):
            node.state = state
            carrier.update()
        if self.target == 0x60C1:
            node.controlword = ENABLE_IP
            carrier.update()
        return actual

    def move(self, counts, steps=20):
        """Ramp the target up, a step per received TPDO; returns the drive's final actual position."""
        node = self.node
        target = node.rpdo_pointers[self.target]
        begin, feedback = target.raw, node.tpdo_pointers[0x6064].pdo_parent
        for step in range(1, steps + 1):
            feedback.wait_for_reception(1.0)
            target.raw = begin + round(counts * step / steps)
            target.pdo_parent.update()
        deadline_s = time.monotonic() + 2.0
        while node.tpdo_values[0x6064] != begin + counts and time.monotonic() < deadline_s:
            feedback.wait_for_reception(1.0)
        return node.tpdo_values[0x6064]

    def disable(self):
        """Remove torque, at standstill."""
        self.node.state = "SWITCH ON DISABLED"

    def leave(self):
        """Stop all periodic messages."""
        self.network.sync.stop()
        for pdo in self.node.rpdo.values():
            pdo.stop()
        self.node.nmt.state = "PRE-OPERATIONAL"
