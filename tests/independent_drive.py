"""A CiA 402 drive that shares no code with this project.

SDO server, NMT and heartbeat are those of `canopen.LocalNode`, the rest is written from the standard. It also runs as
a separate process:

    python tests/independent_drive.py INTERFACE CHANNEL MODE NODE_ID...
"""

import json
import sys
import time

import canopen
from canopen.objectdictionary import ODArray, ODRecord, ODVariable, datatypes

U8, U16, U32 = datatypes.UNSIGNED8, datatypes.UNSIGNED16, datatypes.UNSIGNED32
I8, I16, I32 = datatypes.INTEGER8, datatypes.INTEGER16, datatypes.INTEGER32

VENDOR_ID, PRODUCT_CODE = 0x0000_0ACE, 0x1234
INCREMENTS, GEAR = 1 << 17, 80
COUNTS_PER_TURN = INCREMENTS * GEAR
BRAKE_S, MODE_S = 0.05, 0.03
"""Time until the brake is open, and until a change of mode is visible."""

NOT_READY, DISABLED, READY, SWITCHED_ON, ENABLED, QUICK_STOP, FAULT = 0x00, 0x40, 0x21, 0x23, 0x27, 0x07, 0x08
VOLTAGE, REMOTE, INTERPOLATES, VENDORS_BITS = 0x0010, 0x0200, 0x1000, 0xC000


def dictionary(node_id, modes):
    """Objects with their defaults; the drive lacks all others (such as 1019, 1029, 605B to 605D, 6075, 60B2)."""
    single = [
        (0x1000, U32, "ro", 0x0002_0192), (0x1001, U8, "ro", 0), (0x1005, U32, "rw", 0x80), (0x1006, U32, "rw", 0),
        (0x1008, datatypes.VISIBLE_STRING, "const", "independent servo amplifier"), (0x1014, U32, "ro", 0x80 + node_id),
        (0x1017, U16, "rw", 0), (0x6007, I16, "rw", 1), (0x603F, U16, "ro", 0), (0x6040, U16, "rww", 0),
        (0x6041, U16, "ro", 0), (0x605A, I16, "rw", 2), (0x605E, I16, "rw", 2), (0x6060, I8, "rww", 0),
        (0x6061, I8, "ro", 0), (0x6064, I32, "ro", 0), (0x6065, U32, "rw", 1000), (0x6066, U16, "rw", 0),
        (0x6072, U16, "rw", 1000), (0x6076, U32, "ro", 90_000), (0x6077, I16, "ro", 0), (0x607A, I32, "rww", 0),
        (0x607E, U8, "rw", 0), (0x6502, U32, "ro", sum(1 << (mode - 1) for mode in modes)),
    ]  # fmt: skip
    records = {
        0x1016: [(1, U32, "rw", 0)],
        0x1018: [(1, U32, "ro", VENDOR_ID), (2, U32, "ro", PRODUCT_CODE), (3, U32, "ro", 7), (4, U32, "ro", node_id)],
        0x607D: [(1, I32, "rw", -(1 << 31)), (2, I32, "rw", (1 << 31) - 1)],
        0x608F: [(1, U32, "ro", INCREMENTS), (2, U32, "ro", 1)],
        0x6091: [(1, U32, "ro", GEAR), (2, U32, "ro", 1)],
        0x60C1: [(1, I32, "rww", 0)],
        0x60C2: [(1, U8, "rw", 10), (2, I8, "rw", -3)],
    }
    received, sent = ((0x6040, 16),), ((0x6041, 16), (0x6061, 8))
    for number in range(2):
        for communication, mapping, cob_id, content in (
            (0x1400, 0x1600, 0x200 + 0x100 * number + node_id, received),
            (0x1800, 0x1A00, 0x4000_0180 + 0x100 * number + node_id, sent),
        ):
            records[communication + number] = [
                (1, U32, "rw", cob_id | (0x8000_0000 if number else 0)), (2, U8, "rw", 255), (5, U16, "rw", 0),
            ]  # fmt: skip
            values = [index << 16 | bits for index, bits in content] if not number else []
            values += [0] * (8 - len(values))
            records[mapping + number] = [(k + 1, U32, "rw", value) for k, value in enumerate(values)]
            records[mapping + number].insert(0, (0, U8, "rw", 0 if number else len(content)))
    od = canopen.ObjectDictionary()
    for index, kind, access, value in single:
        od.add_object(_variable(index, 0, kind, access, value))
    for index, members in records.items():
        entry = (ODArray if index in {0x1016, 0x608F} else ODRecord)(f"object {index:04X}", index)
        if members[0][0]:
            members.insert(0, (0, U8, "const", members[-1][0]))
        for subindex, kind, access, value in members:
            entry.add_member(_variable(index, subindex, kind, access, value))
        od.add_object(entry)
    return od


def _variable(index, subindex, kind, access, value):
    entry = ODVariable(f"object {index:04X}:{subindex}", index, subindex)
    entry.data_type, entry.access_type, entry.default = kind, access, value
    return entry


class IndependentDrive(canopen.LocalNode):
    """One drive on a network. It runs in the network's receiving thread.

    Attributes:
        state: Power state, as coded in 6041.
        position: Of the axis, in counts.
        states: Every power state so far.
        jumps: Distance from position to setpoint, in counts, in every cycle with torque.
    """

    def __init__(self, node_id, modes, position):
        super().__init__(node_id, dictionary(node_id, modes))
        self.position = self._setpoint = position
        self.states, self.jumps = [], []
        self._enter(DISABLED)
        self._forget()
        self.add_read_callback(self._read)
        self.add_write_callback(self._written)

    def associate_network(self, network):
        super().associate_network(network)
        network.subscribe(0, self._nmt)
        network.subscribe(0x80, self._sync)

    def boot(self):
        """Boot-up message, then PRE-OPERATIONAL."""
        self.nmt.send_command(0)
        self.nmt.send_command(128)

    def value(self, index, subindex=0):
        return self._find_object(index, subindex).decode_raw(self.get_data(index, subindex))

    def keep(self, index, value, subindex=0):
        data = self._find_object(index, subindex).encode_raw(value)
        self.data_store.setdefault(index, {})[subindex] = data

    # Communication ---------------------------------------------------------------------------------------------

    def _forget(self):
        self.data_store.clear()
        self._received, self._waiting = [], {}
        self._last_word = self._asked_mode = 0
        self._open_at_s = self._mode_at_s = self._heard_s = None
        self._travel = 0.0

    def _nmt(self, _can_id, data, _timestamp):
        command, addressed = data
        if addressed not in {0, self.id}:
            return
        if command in {129, 130}:
            for cob_id in self._received:
                self.network.unsubscribe(cob_id)
            if self.state != FAULT:
                self._enter(DISABLED)
            self._forget()
            self.boot()
        elif command == 1:
            for number in range(2):
                word = self.value(0x1400 + number, 1)
                if not word & 0x8000_0000:
                    self._received.append(word & 0x7FF)
                    self.network.subscribe(word & 0x7FF, lambda *frame, number=number: self._rpdo(number, *frame))
            master = self.value(0x1016, 1) >> 16 & 0x7F
            if master:
                self.network.subscribe(0x700 + master, self._hear)
        elif command in {2, 128} and self.state in {ENABLED, QUICK_STOP}:
            self._enter(DISABLED)

    def _hear(self, *_frame):
        now_s, limit_s = time.monotonic(), (self.value(0x1016, 1) & 0xFFFF) / 1e3
        if limit_s and self._heard_s is not None and now_s - self._heard_s > limit_s:
            self.fail(0x8130)
        self._heard_s = now_s

    def _rpdo(self, number, _cob_id, data, _timestamp):
        if self.nmt.state != "OPERATIONAL":
            return
        if self.value(0x1400 + number, 2) <= 240:
            self._waiting[number] = bytes(data)
        else:
            self._take(number, bytes(data))

    def _take(self, number, data):
        """Write an RPDO's values to the mapped objects."""
        for index, subindex, size in self._mapping(0x1600 + number):
            self.data_store.setdefault(index, {})[subindex], data = data[:size], data[size:]
        self._obey(self.value(0x6040))

    def _mapping(self, index):
        words = [self.value(index, position) for position in range(1, self.value(index, 0) + 1)]
        return [(word >> 16, word >> 8 & 0xFF, (word & 0xFF) // 8) for word in words]

    def _sync(self, *_frame):
        if self.nmt.state != "OPERATIONAL":
            return
        for number in sorted(self._waiting):
            self._take(number, self._waiting.pop(number))
        for number in range(2):
            word = self.value(0x1800 + number, 1)
            if not word & 0x8000_0000 and self.value(0x1800 + number, 2) <= 240:
                parts = [self.get_data(index, sub) for index, sub, _ in self._mapping(0x1A00 + number)]
                self.network.send_message(word & 0x7FF, b"".join(parts))
        self._move()

    # Power -----------------------------------------------------------------------------------------------------

    def fail(self, code):
        """Go to FAULT and send an emergency message with the code."""
        if self.state != FAULT:
            self._enter(FAULT)
            self.keep(0x603F, code)
            self.emcy.send(code, 0x81)

    def _enter(self, state):
        self.state = state
        self.states.append(state)
        self._open_at_s = None

    def _obey(self, word):
        """Transitions of CiA 402, figure 2."""
        if self.state == FAULT:
            if word & 0x80 and not self._last_word & 0x80:
                self._enter(DISABLED)
        elif not word & 0x02:
            if self.state != DISABLED:
                self._enter(DISABLED)
        elif word & 0x06 == 0x02:
            if self.state == ENABLED:
                self._enter(QUICK_STOP)
            elif self.state in {READY, SWITCHED_ON}:
                self._enter(DISABLED)
        elif word & 0x07 == 0x06:
            if self.state in {DISABLED, SWITCHED_ON, ENABLED}:
                self._enter(READY)
        elif word & 0x0F == 0x07:
            if self.state in {READY, ENABLED}:
                self._enter(SWITCHED_ON)
        elif self.state == SWITCHED_ON:
            self._open_at_s = self._open_at_s or time.monotonic() + BRAKE_S
            if time.monotonic() >= self._open_at_s:
                self._setpoint, self._travel = self.position, 0.0
                self._enter(ENABLED)
        self._last_word = word

    def _move(self):
        """Move to the setpoint latched at this SYNC; it is reached at the next one."""
        mode = self.value(0x6061)
        if self.state == ENABLED:
            follows = mode == 8 or (mode == 7 and self._last_word & 0x10)
            target = (self.value(0x607A) if mode == 8 else self.value(0x60C1, 1)) if follows else self._setpoint
            self.jumps.append(abs(target - self.position))
            self._travel = target - self.position
            self.position = self._setpoint = target
        elif self.state == QUICK_STOP:
            self._travel *= 0.5
            self.position += round(self._travel)
            if abs(self._travel) < 1.0 and self.value(0x605A) < 5:
                self._enter(DISABLED)
        else:
            self._travel = 0.0

    def _read(self, index, subindex, od):
        if index == 0x6041:
            interpolates = self.state == ENABLED and self._last_word & 0x10 and self.value(0x6061) == 7
            follows = self.state == ENABLED and self.value(0x6061) == 8
            active = INTERPOLATES if interpolates or follows else 0
            return self.state | VOLTAGE | REMOTE | VENDORS_BITS | active
        if index == 0x6064:
            return self.position
        if index == 0x6061:
            shown = self._mode_at_s is not None and time.monotonic() >= self._mode_at_s
            return self._asked_mode if shown else 0
        return None

    def _written(self, index, subindex, od, data):
        value = od.decode_raw(bytes(data))
        if index == 0x6060:
            if value and not self.value(0x6502) >> (value - 1) & 1:
                raise canopen.SdoAbortedError(0x0609_0030)
            self._asked_mode, self._mode_at_s = value, time.monotonic() + MODE_S
        elif index == 0x6040:
            self._obey(value)
        elif 0x1600 <= index < 0x1602 or 0x1A00 <= index < 0x1A02:
            base = index - 0x200
            if not self.value(base, 1) & 0x8000_0000:
                raise canopen.SdoAbortedError(0x0601_0000)
            if subindex and self.value(index, 0):
                raise canopen.SdoAbortedError(0x0800_0022)


def join(network, node_ids, modes, position=5000):
    """Put drives on a network."""
    drives = [IndependentDrive(node_id, modes, position * (axis + 1)) for axis, node_id in enumerate(node_ids)]
    for drive in drives:
        network.add_node(drive)
        drive.boot()
    return drives


def main():
    """Run drives until standard input ends, then print their history."""
    interface, channel, mode, *nodes = sys.argv[1:]
    network = canopen.Network()
    network.NOTIFIER_CYCLE = 0.05
    network.connect(interface=interface, channel=channel)
    drives = join(network, [int(node) for node in nodes], [int(mode)])
    sys.stdout.write("ready\n")
    sys.stdout.flush()
    sys.stdin.read()
    network.disconnect()
    json.dump(
        [{"position": d.position, "states": d.states, "jump": max(d.jumps, default=0)} for d in drives], sys.stdout
    )


if __name__ == "__main__":
    main()
