"""Drives of a small arm of which a test writes every frame: for the master's view of feedback that no drive sends."""

import struct
from collections import deque

import can

from armload_drivers.bus.bus_link import BusLink
from armload_drivers.canopen.canopen_cycle import CanopenCycle
from armload_drivers.canopen.drive_node import DriveNode
from armload_drivers.cia402.object_dictionary import NmtState
from armload_drivers.cia402.process_data.drive_units import ArmUnits
from armload_drivers.cia402.state_machine import State
from armload_drivers.cyclic.rhythm import Rhythm
from armload_drivers.simulation.lockstep_sync import LockstepSync
from armload_drivers.simulation.virtual_clock import VirtualClock

ENABLED, SWITCHED_ON, QUICK_STOP, FAULT, UNDEFINED = 0x0027, 0x0023, 0x0007, 0x0008, 0x0001
MASTER_ID = 127
SYNC_ID = 0x080


class ScriptedBus:
    """A bus on which only what a test adds is received.

    Attributes:
        received: Frames not received yet.
        sent: Frames that the master has sent.
        at_sync: Called when SYNC is sent.
        stamp: Time stamp of an added frame; 0 is none.
    """

    def __init__(self):
        self.received, self.sent, self.at_sync = deque(), [], lambda: None
        self.stamp = lambda: 0.0

    def send(self, message):
        self.sent.append((message.arbitration_id, bytes(message.data)))
        if message.arbitration_id == SYNC_ID:
            self.at_sync()

    def recv(self, timeout):
        return self.received.popleft() if self.received else None

    def add(self, cob_id, data):
        """A frame to be received."""
        self.received.append(
            can.Message(arbitration_id=cob_id, data=data, is_extended_id=False, timestamp=self.stamp())
        )


class ScriptedArm:
    """Cycles of the master, and drives that answer every SYNC with the statusword of their state.

    Args:
        arm: The arm's settings.
        sync: Makes the source of SYNC from a clock.

    Attributes:
        words: The statuswords with which a drive answers the next SYNC, by node id.
        counts: Its position.
    """

    def __init__(self, arm, sync=LockstepSync):
        self.arm, self.clock, self.bus = arm, VirtualClock(), ScriptedBus()
        self.clock.follow(lambda: "")
        self.link, self.sync = BusLink(self.bus), sync(self.clock)
        self.nodes = [DriveNode(drive, self.link, self.sync, arm) for drive in arm.drives]
        self.rhythms = Rhythm("SYNC", arm.cycle_s), Rhythm("feedback", arm.cycle_s)
        units = ArmUnits(arm, [0] * len(arm.drives))
        self.cycle = CanopenCycle(arm, self.nodes, self.link, self.sync, units, self.rhythms)
        self.words = {drive.node_id: [SWITCHED_ON] for drive in arm.drives}
        self.counts = dict.fromkeys(self.words, 0)
        self.bus.at_sync = self._answer

    def _answer(self):
        for node_id, words in self.words.items():
            for word in words:
                self.bus.add(0x180 + node_id, struct.pack("<Hih", word, self.counts[node_id], 0))

    def enable(self):
        """Enable all drives; they send their heartbeats once."""
        self.cycle.begin()
        self.run()
        self.cycle.ask(State.OPERATION_ENABLED, "enabling", lambda node: True)
        self.words = {node_id: [ENABLED] for node_id in self.words}
        self.run(2)
        for node_id in self.words:
            self.beat(node_id)

    def run(self, cycles=1):
        """Cycles without checks; the last feedback."""
        for _ in range(cycles):
            feedback = self.cycle.run()
        return feedback

    def check(self, cycles=1, *, must_follow=True):
        """Cycles with checks; the last feedback."""
        for _ in range(cycles):
            feedback = self.cycle.run_checked("in the test", must_follow=must_follow)
        return feedback

    def hear(self, cob_id, data):
        """A frame is received."""
        self.bus.add(cob_id, data)
        self.link.drain()

    def beat(self, node_id, state=NmtState.OPERATIONAL):
        """A drive's heartbeat."""
        self.hear(0x700 + node_id, bytes([state.value]))
