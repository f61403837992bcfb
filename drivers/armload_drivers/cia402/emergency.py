"""Emergency messages, and error codes (603F) as text.

References:
    CiA 301, 7.2.7 (EMCY, error register 1001); CiA 402-2, table "error codes".
"""

from __future__ import annotations

import struct
from dataclasses import dataclass

_HEADER = struct.Struct("<HB")

_CODES = {
    0x1000: "generic error",
    0x2100: "current on the device's input side",
    0x2110: "short circuit or earth leakage at the input",
    0x2200: "internal current",
    0x2211: "internal overcurrent 1",
    0x2212: "internal overcurrent 2",
    0x2213: "overcurrent in ramp function",
    0x2214: "overcurrent in sequence",
    0x2220: "continuous overcurrent in the device",
    0x2230: "short circuit or earth leakage in the device",
    0x2300: "current on the device's output side",
    0x2310: "continuous overcurrent at the output",
    0x2320: "short circuit or earth leakage at the output",
    0x2330: "earth leakage at the output",
    0x2340: "short circuit at the output",
    0x2350: "load level fault (I2t, thermal state)",
    0x3100: "mains voltage",
    0x3110: "mains overvoltage",
    0x3120: "mains undervoltage",
    0x3130: "phase failure",
    0x3200: "DC link voltage",
    0x3210: "DC link overvoltage",
    0x3220: "DC link undervoltage",
    0x3300: "output voltage",
    0x4200: "device temperature",
    0x4210: "device too hot",
    0x4220: "device too cold",
    0x4300: "drive temperature",
    0x4310: "drive too hot",
    0x4320: "drive too cold",
    0x5100: "supply",
    0x5200: "control hardware",
    0x5300: "operating unit",
    0x5400: "power section",
    0x5430: "input stages",
    0x5441: "contactor",
    0x5500: "data storage",
    0x6010: "software watchdog",
    0x6100: "internal software",
    0x6200: "user software",
    0x6300: "data record",
    0x6310: "loss of parameters",
    0x6320: "parameter error",
    0x7100: "power module",
    0x7110: "brake chopper",
    0x7120: "motor",
    0x7121: "motor blocked",
    0x7122: "motor commutation",
    0x7123: "motor tilted",
    0x7200: "measurement circuit",
    0x7300: "sensor",
    0x7305: "incremental sensor 1",
    0x7310: "speed sensor",
    0x7320: "position sensor",
    0x7380: "position sensor",
    0x7500: "communication module",
    0x8100: "communication",
    0x8110: "CAN overrun, frames lost",
    0x8120: "CAN in error passive mode",
    0x8130: "life guard or heartbeat error: the drive no longer receives its master's heartbeat",
    0x8140: "recovered from bus-off",
    0x8141: "recovered from bus-off",
    0x8150: "CAN identifier collision",
    0x8210: "PDO not processed, wrong length",
    0x8220: "PDO longer than mapped",
    0x8240: "unexpected SYNC data length",
    0x8250: "RPDO timeout: no setpoints from the master",
    0x8300: "torque control",
    0x8311: "excess torque",
    0x8313: "standstill torque",
    0x8400: "velocity controller",
    0x8480: "speed out of range",
    0x8500: "position controller",
    0x8600: "positioning controller",
    0x8611: "following error: the axis is further from its target than 6065 allows",
    0x8612: "reference limit",
    0x8700: "sync controller: SYNC missing or irregular",
    0x8800: "winding controller",
    0x8900: "process data monitoring",
    0x8A00: "control monitoring",
    0x9000: "external error",
    0xF001: "deceleration",
    0xF002: "sub-synchronous run",
    0xF003: "stroke operation",
    0xF004: "control",
}


def describe(code: int) -> str:
    """Error code (603F, EMCY bytes 0 and 1) with its meaning.

    Codes that the standard does not list get the meaning of their class; vendor codes have none.
    """
    if code == 0:
        return "0x0000 no error"
    if code >= 0xFF00:
        return f"0x{code:04X} vendor-specific, see the drive's manual"
    for mask in (0xFFFF, 0xFFF0, 0xFF00, 0xF000):
        text = _CODES.get(code & mask)
        if text is not None:
            return f"0x{code:04X} {text}"
    return f"0x{code:04X} not listed by CiA 402"


@dataclass(frozen=True, slots=True)
class Emergency:
    """One emergency message.

    Attributes:
        code: Error code; 0 if the error is no longer present.
        register: Error register; None if the frame was too short.
        manufacturer: The vendor's bytes that were received.
    """

    code: int
    register: int | None
    manufacturer: bytes

    @property
    def text(self) -> str:
        """Code, meaning, and the vendor's bytes if any of them is not zero."""
        words = describe(self.code)
        if any(self.manufacturer):
            words += f" (vendor bytes {self.manufacturer.hex(' ')})"
        return words


def parse(data: bytes) -> Emergency | None:
    """Parse an EMCY frame of any length; None if it does not contain a code.

    Short frames are accepted, because some drives send them.
    """
    if len(data) < 2:
        return None
    if len(data) < _HEADER.size:
        return Emergency(int.from_bytes(data[:2], "little"), None, b"")
    code, register = _HEADER.unpack_from(data)
    return Emergency(code, register, bytes(data[3:8]))


def pack(code: int, register: int) -> bytes:
    """EMCY frame of a drive without vendor bytes (8 bytes)."""
    return _HEADER.pack(code, register).ljust(8, b"\0")
