"""Object dictionary entries used by this driver and its simulated drives, as data.

Each block cites its standard. Names are those of CiA 301 (communication) and CiA 402-2 (drives).
"""

from __future__ import annotations

from enum import Enum

from msgspec import Struct
from msgspec.structs import force_setattr


class DataType(Enum):
    """Data types of CiA 301, 7.4.7.

    Attributes:
        code: Format character of `struct`; empty for strings.
        bits: Size; 0 for strings.
        bounds: Least and greatest value of an integer type.
        is_real: A floating-point number, REAL32 or REAL64.
    """

    U8 = ("B", 8)
    I8 = ("b", 8)
    U16 = ("H", 16)
    I16 = ("h", 16)
    U32 = ("I", 32)
    I32 = ("i", 32)
    U64 = ("Q", 64)
    I64 = ("q", 64)
    F32 = ("f", 32)
    F64 = ("d", 64)
    STRING = ("", 0)

    def __init__(self, code: str, bits: int) -> None:
        self.code = code
        self.bits = bits
        half = 1 << bits >> 1
        self.bounds = (-half, half - 1) if code.islower() else (0, (1 << bits) - 1)
        self.is_real = code in {"f", "d"}


class Access(Enum):
    """SDO access."""

    RO = "ro"
    RW = "rw"
    WO = "wo"


class Mappable(Enum):
    """Direction of PDOs that may carry the entry, if any."""

    NO = "no"
    RPDO = "rpdo"
    TPDO = "tpdo"
    BOTH = "both"


class Entry(Struct, frozen=True):
    """One entry of an object dictionary.

    Attributes:
        index: 0x1000 to 0xFFFF.
        subindex: 0 to 254.
        name: The standard's name.
        type: Data type.
        access: SDO access.
        mappable: Direction of the PDO that may carry it.
        key: Index and subindex in one number; follows from them.
    """

    index: int
    subindex: int
    name: str
    type: DataType
    access: Access = Access.RW
    mappable: Mappable = Mappable.NO
    key: int = 0

    def __post_init__(self) -> None:
        """Compute the key once: the simulated drives look values up by it in every cycle."""
        force_setattr(self, "key", self.index << 8 | self.subindex)

    @property
    def mapping(self) -> int:
        """The entry's value in a mapping parameter (1600, 1A00)."""
        return self.index << 16 | self.subindex << 8 | self.type.bits

    def __str__(self) -> str:
        return f"{self.index:04X}:{self.subindex} {self.name}"


_T, _A, _M = DataType, Access, Mappable

# CiA 301, 7.5.2: communication profile area.
DEVICE_TYPE = Entry(0x1000, 0, "device type", _T.U32, _A.RO)
ERROR_REGISTER = Entry(0x1001, 0, "error register", _T.U8, _A.RO, _M.TPDO)
ERROR_COUNT = Entry(0x1003, 0, "number of errors", _T.U8)
ERROR_HISTORY = tuple(Entry(0x1003, number, f"error {number} ago", _T.U32, _A.RO) for number in range(1, 5))
SYNC_COB_ID = Entry(0x1005, 0, "COB-ID SYNC", _T.U32)
CYCLE_PERIOD_US = Entry(0x1006, 0, "communication cycle period", _T.U32)
DEVICE_NAME = Entry(0x1008, 0, "manufacturer device name", _T.STRING, _A.RO)
SOFTWARE_VERSION = Entry(0x100A, 0, "manufacturer software version", _T.STRING, _A.RO)
STORE_ALL = Entry(0x1010, 1, "store all parameters", _T.U32)
STORE_SIGNATURE = int.from_bytes(b"save", "little")
"""Value of 1010 that stores; no other is taken."""
EMERGENCY_COB_ID = Entry(0x1014, 0, "COB-ID EMCY", _T.U32, _A.RO)
HEARTBEAT_CONSUMER = Entry(0x1016, 1, "consumer heartbeat time", _T.U32)
HEARTBEAT_PRODUCER_MS = Entry(0x1017, 0, "producer heartbeat time", _T.U16)
VENDOR_ID = Entry(0x1018, 1, "vendor id", _T.U32, _A.RO)
PRODUCT_CODE = Entry(0x1018, 2, "product code", _T.U32, _A.RO)
REVISION = Entry(0x1018, 3, "revision number", _T.U32, _A.RO)
SERIAL_NUMBER = Entry(0x1018, 4, "serial number", _T.U32, _A.RO)
SYNC_COUNTER_OVERFLOW = Entry(0x1019, 0, "synchronous counter overflow value", _T.U8)
COMMUNICATION_ERROR_BEHAVIOUR = Entry(0x1029, 1, "communication error behaviour", _T.U8)
SDO_RX_COB_ID = Entry(0x1200, 1, "COB-ID client to server", _T.U32, _A.RO)
SDO_TX_COB_ID = Entry(0x1200, 2, "COB-ID server to client", _T.U32, _A.RO)

# CiA 402-2, clause 8: device control.
ABORT_CONNECTION_OPTION = Entry(0x6007, 0, "abort connection option code", _T.I16)
ERROR_CODE = Entry(0x603F, 0, "error code", _T.U16, _A.RO, _M.TPDO)
CONTROLWORD = Entry(0x6040, 0, "controlword", _T.U16, _A.RW, _M.RPDO)
STATUSWORD = Entry(0x6041, 0, "statusword", _T.U16, _A.RO, _M.TPDO)
QUICK_STOP_OPTION = Entry(0x605A, 0, "quick stop option code", _T.I16)
SHUTDOWN_OPTION = Entry(0x605B, 0, "shutdown option code", _T.I16)
DISABLE_OPTION = Entry(0x605C, 0, "disable operation option code", _T.I16)
HALT_OPTION = Entry(0x605D, 0, "halt option code", _T.I16)
FAULT_REACTION_OPTION = Entry(0x605E, 0, "fault reaction option code", _T.I16)
SECOND_CONTROLWORD = Entry(0x6840, 0, "controlword of a second axis", _T.U16, _A.RW, _M.RPDO)
"""Objects of further axes of one node follow at intervals of 0x800."""
MODE = Entry(0x6060, 0, "modes of operation", _T.I8, _A.RW, _M.RPDO)
MODE_DISPLAY = Entry(0x6061, 0, "modes of operation display", _T.I8, _A.RO, _M.TPDO)
SUPPORTED_MODES = Entry(0x6502, 0, "supported drive modes", _T.U32, _A.RO)

# CiA 402-2: position, torque and current.
POSITION_ACTUAL = Entry(0x6064, 0, "position actual value", _T.I32, _A.RO, _M.TPDO)
SECOND_POSITION = Entry(0x6064, 2, "position actual value of a second axis", _T.I32, _A.RO, _M.TPDO)
FOLLOWING_ERROR_WINDOW = Entry(0x6065, 0, "following error window", _T.U32)
FOLLOWING_ERROR_TIMEOUT_MS = Entry(0x6066, 0, "following error time out", _T.U16)
VELOCITY_ACTUAL = Entry(0x606C, 0, "velocity actual value", _T.I32, _A.RO, _M.TPDO)
MAX_TORQUE = Entry(0x6072, 0, "max torque", _T.U16)
MAX_CURRENT = Entry(0x6073, 0, "max current", _T.U16)
RATED_CURRENT_MA = Entry(0x6075, 0, "motor rated current", _T.U32, _A.RO)
RATED_TORQUE_MNM = Entry(0x6076, 0, "motor rated torque", _T.U32, _A.RO)
TORQUE_ACTUAL = Entry(0x6077, 0, "torque actual value", _T.I16, _A.RO, _M.TPDO)
CURRENT_ACTUAL = Entry(0x6078, 0, "current actual value", _T.I16, _A.RO, _M.TPDO)
TORQUE_ACTUAL_32 = Entry(0x6077, 0, "torque actual value", _T.I32, _A.RO, _M.TPDO)
CURRENT_ACTUAL_32 = Entry(0x6078, 0, "current actual value", _T.I32, _A.RO, _M.TPDO)
"""The variants of some manufacturers."""
TARGET_POSITION = Entry(0x607A, 0, "target position", _T.I32, _A.RW, _M.RPDO)
HOME_OFFSET = Entry(0x607C, 0, "home offset", _T.I32)
HOMING_METHOD = Entry(0x6098, 0, "homing method", _T.I8)
POSITION_LIMIT_MIN = Entry(0x607D, 1, "software position limit, min", _T.I32)
POSITION_LIMIT_MAX = Entry(0x607D, 2, "software position limit, max", _T.I32)
POLARITY = Entry(0x607E, 0, "polarity", _T.U8)
QUICK_STOP_DECELERATION = Entry(0x6085, 0, "quick stop deceleration", _T.U32)
ENCODER_INCREMENTS = Entry(0x608F, 1, "position encoder resolution, increments", _T.U32, _A.RO)
ENCODER_REVOLUTIONS = Entry(0x608F, 2, "position encoder resolution, motor revolutions", _T.U32, _A.RO)
GEAR_MOTOR_REVOLUTIONS = Entry(0x6091, 1, "gear ratio, motor revolutions", _T.U32, _A.RO)
GEAR_SHAFT_REVOLUTIONS = Entry(0x6091, 2, "gear ratio, shaft revolutions", _T.U32, _A.RO)
FEED = Entry(0x6092, 1, "feed constant, feed", _T.U32, _A.RO)
FEED_SHAFT_REVOLUTIONS = Entry(0x6092, 2, "feed constant, shaft revolutions", _T.U32, _A.RO)
POSITION_OFFSET = Entry(0x60B0, 0, "position offset", _T.I32, _A.RW, _M.RPDO)
VELOCITY_OFFSET = Entry(0x60B1, 0, "velocity offset", _T.I32, _A.RW, _M.RPDO)
TORQUE_OFFSET = Entry(0x60B2, 0, "torque offset", _T.I16, _A.RW, _M.RPDO)
TORQUE_OFFSET_32 = Entry(0x60B2, 0, "torque offset", _T.I32, _A.RW, _M.RPDO)
"""The variant of some manufacturers."""
INTERPOLATION_SETPOINT = Entry(0x60C1, 1, "interpolation data record, 1st set-point", _T.I32, _A.RW, _M.RPDO)
INTERPOLATION_TIME = Entry(0x60C2, 1, "interpolation time period value", _T.U8)
INTERPOLATION_EXPONENT = Entry(0x60C2, 2, "interpolation time index", _T.I8)
PHYSICAL_OUTPUTS = Entry(0x60FE, 1, "digital outputs, physical outputs", _T.U32)
OUTPUT_MASK = Entry(0x60FE, 2, "digital outputs, bit mask", _T.U32)
SET_BRAKE = 1
"""Bit 0 of both: the brake is closed by the master, whatever the drive would do with it."""
FOLLOWING_ERROR_ACTUAL = Entry(0x60F4, 0, "following error actual value", _T.I32, _A.RO, _M.TPDO)

DEVICE_TYPE_SERVO = 0x0002_0192
"""Device profile 402 (0x192), servo drive."""


MODE_NAMES = {
    1: "profile position", 2: "velocity", 3: "profile velocity", 4: "profile torque", 6: "homing",
    7: "interpolated position", 8: "cyclic synchronous position", 9: "cyclic synchronous velocity",
    10: "cyclic synchronous torque",
}  # fmt: skip
"""Modes of operation of the standard, by number (CiA 402-2, 6060)."""


def named_modes(modes: int) -> str:
    """The modes in a value of 6502, by number and name."""
    offered = [number + 1 for number in range(32) if modes >> number & 1]
    return ", ".join(f"{number} ({MODE_NAMES.get(number, 'manufacturer-specific')})" for number in offered)


def is_drive(device_type: int) -> bool:
    """Whether 1000 is that of a CiA 402 drive: its low 16 bits decide; the rest states the kind of drive.

    Some manufacturers fill the upper half arbitrarily (0xFFFF0192), some leave it zero (0x00000192).
    """
    return device_type & 0xFFFF == DEVICE_TYPE_SERVO & 0xFFFF


_OTHER_PROFILES = {
    0: "no standardised profile",
    401: "inputs and outputs",
    404: "measuring devices and closed-loop controllers",
    405: "programmable controllers",
    406: "encoders",
    408: "hydraulic drives",
    410: "inclinometers",
    418: "batteries",
    419: "battery chargers",
}
"""Other devices on the buses of arms (CiA 301, 7.5.2.1)."""


def no_drive(device_type: int) -> str:
    """Explanation of a 1000 for which `is_drive` is False."""
    profile = device_type & 0xFFFF
    known = f", {_OTHER_PROFILES[profile]}" if profile in _OTHER_PROFILES else ""
    return (
        f"device type (1000) is 0x{device_type:08X}: its low 16 bits, 0x{profile:04X}, mean device profile {profile}"
        f"{known}; a CiA 402 drive has 0x0192 there, 402"
    )


PDO_DISABLED = 0x8000_0000
"""Bit 31 of a PDO's COB-ID: the PDO does not exist."""
PDO_NO_RTR = 0x4000_0000
"""Bit 30 of a TPDO's COB-ID: no remote request."""
PDO_SYNCHRONOUS = 1
"""Transmission type: with every SYNC."""
PDO_SYNCHRONOUS_LAST = 240
"""Highest synchronous transmission type."""
PDO_EVENT_DRIVEN = 254
"""Transmission types from this one on are event-driven."""
PDO_MAX_ENTRIES = 8
PDO_COUNT = 4
"""PDOs with pre-defined COB-IDs, in each direction."""

POLARITY_POSITION = 0x80
"""Bit 7 of 607E: positions change sign between the objects and the motor."""
POLARITY_TORQUE = 0x20
"""Bit 5 of 607E, with vendors that use it: torques and currents change sign."""

NMT_COB_ID = 0x000
SYNC_DEFAULT_COB_ID = 0x080
SYNC_MEANING = 0x4000_07FF
"""Bits of 1005 that matter: whether the node produces SYNC, and its COB-ID."""
EMERGENCY_BASE = 0x080
SDO_TX_BASE = 0x580
SDO_RX_BASE = 0x600
HEARTBEAT_BASE = 0x700
"""Pre-defined connection set, CiA 301, 7.3.3; the node id is added."""


class PdoDirection(Enum):
    """Receive or transmit, as seen from the drive: indices of PDO 1 and the COB-IDs of PDO 1."""

    RECEIVE = (0x1400, 0x1600, 0x200)
    TRANSMIT = (0x1800, 0x1A00, 0x180)

    def carries(self, mappable: Mappable) -> bool:
        """Whether a PDO of this direction may carry an entry with this mappability."""
        own = Mappable.RPDO if self is PdoDirection.RECEIVE else Mappable.TPDO
        return mappable in {own, Mappable.BOTH}

    def cob_id_entry(self, number: int) -> Entry:
        """COB-ID of PDO `number`, numbered from 0."""
        return Entry(self.value[0] + number, 1, "COB-ID of the PDO", _T.U32)

    def type_entry(self, number: int) -> Entry:
        """Transmission type."""
        return Entry(self.value[0] + number, 2, "transmission type", _T.U8)

    def timer_entry(self, number: int) -> Entry:
        """Event timer: sends a TPDO after this time, watches for an RPDO within it."""
        return Entry(self.value[0] + number, 5, "event timer", _T.U16)

    def count_entry(self, number: int) -> Entry:
        """Number of mapped objects."""
        return Entry(self.value[1] + number, 0, "number of mapped objects", _T.U8)

    def map_entry(self, number: int, position: int) -> Entry:
        """Mapped object at `position`, numbered from 1."""
        return Entry(self.value[1] + number, position, f"mapped object {position}", _T.U32)

    def default_cob_id(self, number: int, node_id: int) -> int:
        """COB-ID of the pre-defined connection set."""
        return int(self.value[2]) + 0x100 * number + node_id


class NmtCommand(Enum):
    """Command specifiers of NMT (CiA 301, 7.2.8.2.1)."""

    START = 1
    STOP = 2
    PRE_OPERATIONAL = 128
    RESET_NODE = 129
    RESET_COMMUNICATION = 130


class NmtState(Enum):
    """NMT states as a heartbeat encodes them."""

    BOOT_UP = 0
    STOPPED = 4
    OPERATIONAL = 5
    PRE_OPERATIONAL = 127
