"""A simulated drive with exactly the objects of a manufacturer's description.

Rules of this file:

- The description determines which objects exist, their types, access, limits and PDO mappability; other objects are not
  accessible by SDO or PDO.
- What contradicts the file itself, or would make it no device, is not taken from it: objects that a PDO contains after
  a reset can be mapped; if no object of the profile could be, the file states nothing about that; a PDO's count and
  1016 can be 0; a mapping has the entries that its count may reach; a PDO on an identifier of SDO or heartbeats is off;
  1000 and the vendor id exist; an object without a type, or a scale too large for its type, has the standard's. Makers
  use numbers of the standard for objects that are no integers: these are bytes.
- Values are those of the description, except those that no description can contain: measured values, and the scale of
  the arm's motors and gears, which was set when the drive was commissioned.
- If an object is absent, the drive behaves as the standard specifies for a drive without it, or does nothing if the
  standard specifies nothing: a drive without 6007 does not react to a lost master, one without 6065 has no following
  error limit.
- The parts of the identity that the description leaves open are those of a simulation. Of a file that lists no modes
  (6502), or none as its value, the drive has those streaming modes for which it has all objects.

References:
    CiA 306-1; CiA 301, 7.5; CiA 402-2, 8.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator

from armload_drivers.cia402 import object_dictionary as od
from armload_drivers.cia402.eds_parser import DescribedObject, DeviceDescription
from armload_drivers.cia402.object_dictionary import DataType, Entry, PdoDirection
from armload_drivers.driver_errors import DescriptionError
from armload_drivers.simulation.drives.sdo_server import Dictionary

_SIMULATED_KEYS = frozenset(
    entry.key
    for entry in (
        od.ERROR_REGISTER,
        od.ERROR_COUNT,
        *od.ERROR_HISTORY,
        od.ERROR_CODE,
        od.CONTROLWORD,
        od.STATUSWORD,
        od.MODE_DISPLAY,
        od.POSITION_ACTUAL,
        od.VELOCITY_ACTUAL,
        od.TORQUE_ACTUAL,
        od.CURRENT_ACTUAL,
        od.FOLLOWING_ERROR_ACTUAL,
        od.RATED_CURRENT_MA,
        od.RATED_TORQUE_MNM,
        od.ENCODER_INCREMENTS,
        od.ENCODER_REVOLUTIONS,
        od.GEAR_MOTOR_REVOLUTIONS,
        od.GEAR_SHAFT_REVOLUTIONS,
        od.FEED,
        od.FEED_SHAFT_REVOLUTIONS,
        od.QUICK_STOP_DECELERATION,
    )
)
"""Objects whose values come from the simulation: measured values, and values in the arm's units."""
_MEASURED = frozenset(entry.key for entry in (od.CONTROLWORD, od.STATUSWORD, od.POSITION_ACTUAL))
"""Those of them that a drive must have with the standard's size."""

_VALUES_IF_ABSENT = {
    od.ABORT_CONNECTION_OPTION: 0,
    od.FOLLOWING_ERROR_WINDOW: 0xFFFF_FFFF,
    od.FOLLOWING_ERROR_TIMEOUT_MS: 0,
}
"""Values for a drive without these objects: no reaction to a lost master, no monitoring of the following error."""

_NAMELESS_CURRENT_MA = 1000
"""6075 of a motor whose rated current is not given."""

_PROFILE = 0x6000
"""First object of device profiles."""
_PDO_PARAMETERS = range(0x1400, 0x1C00)
_NOT_FOR_PDOS = frozenset({*range(0x581, 0x680), *range(0x701, 0x780)})
"""Identifiers of SDO and heartbeats."""
_MOST_PDOS = 512


def pdo_count(described: DeviceDescription, direction: PdoDirection) -> int:
    """Number of PDOs of a direction in a description, up to the first that is missing."""
    missing = (n for n in range(_MOST_PDOS) if direction.cob_id_entry(n).key not in described.objects)
    return next(missing, _MOST_PDOS)


def adopt_description(dictionary: Dictionary, described: DeviceDescription, node_id: int) -> None:
    """Change a drive's dictionary to that of a description.

    Args:
        dictionary: The objects of a simulated drive without its PDO parameters, freshly reset; changed in place.
        node_id: Node id of the drive.

    Raises:
        DescriptionError: an object of the standard is not an integer as required, or has too few bits.
    """
    known = dictionary.entries
    for key, found in described.objects.items():
        _require_number(described, found, known.get(key))
    mapped = _mapped_by_default(described)
    if all(found.mappable is od.Mappable.NO for found in described.objects.values() if found.index >= _PROFILE):
        mapped |= {key for key, entry in known.items() if entry.mappable is not od.Mappable.NO}
    dictionary.entries = {od.DEVICE_TYPE.key: od.DEVICE_TYPE, od.VENDOR_ID.key: od.VENDOR_ID} | {
        key: _entry(found, known.get(key), mapped=key in mapped) for key, found in described.objects.items()
    }
    for entry in _more_mappings(described):
        dictionary.entries.setdefault(entry.key, entry)
        dictionary.values.setdefault(entry.key, 0)
    for key, found in described.objects.items():
        _take_value(dictionary, key, found, node_id, own=key in _SIMULATED_KEYS and key in known)
    for direction in PdoDirection:
        for number in range(pdo_count(described, direction)):
            cob_id = direction.cob_id_entry(number)
            value = described.value(cob_id, node_id)
            if value is None or value in _NOT_FOR_PDOS:
                dictionary.values[cob_id.key] = od.PDO_DISABLED
    _take_identity(dictionary, described)
    for entry, value in _VALUES_IF_ABSENT.items():
        if entry.key not in dictionary.entries:
            dictionary.values[entry.key] = value
    modes = described.modes
    dictionary.values[od.SUPPORTED_MODES.key] = modes
    dictionary.allowed[od.MODE.key] = {0} | {number + 1 for number in range(32) if modes >> number & 1}
    if not described.value(od.DEVICE_TYPE, node_id):
        dictionary.values[od.DEVICE_TYPE.key] = od.DEVICE_TYPE_SERVO
    for key, found in described.objects.items():
        limits = _limits(found, node_id)
        if limits is not None:
            old = dictionary.allowed.get(key)
            dictionary.allowed[key] = limits if old is None else {value for value in old if value in limits}
    counts = [way.count_entry(number) for way in PdoDirection for number in range(pdo_count(described, way))]
    for entry in (*counts, od.HEARTBEAT_CONSUMER):
        limits = dictionary.allowed.get(entry.key)
        if isinstance(limits, range):
            dictionary.allowed[entry.key] = range(min(0, limits.start), limits.stop)
    dictionary.complete = True


def _more_mappings(described: DeviceDescription) -> Iterator[Entry]:
    """Mapping entries that a writable count may reach, whether the file has them or not."""
    for direction in PdoDirection:
        for number in range(pdo_count(described, direction)):
            count = described.find(direction.count_entry(number))
            if count is not None and count.access is od.Access.RW and count.greatest is not None:
                most = min(count.greatest.constant, od.PDO_MAX_ENTRIES)
                yield from (direction.map_entry(number, at) for at in range(1, most + 1))


def _require_number(described: DeviceDescription, found: DescribedObject, known: Entry | None) -> None:
    """Refuse a PDO parameter that is not an integer, and an object that cannot hold a drive's measured values."""
    if found.index not in _PDO_PARAMETERS and (found.type is None or known is None or known.key not in _MEASURED):
        return
    least_bits = known.type.bits if known is not None and known.key in _MEASURED else 1
    if found.bits is None or found.bits < least_bits:
        title = f"{found.index:04X}" + (f"sub{found.subindex}" if found.subindex else "")
        what = f"an integer of at least {least_bits} bits" if least_bits > 1 else "an integer"
        raise DescriptionError(described.source, title, "DataType", f"expected {what}: {found.name or 'no name'}")


def _mapped_by_default(described: DeviceDescription) -> frozenset[int]:
    """Keys of the objects that PDOs contain after a reset."""
    words = (
        found.value.constant
        for direction in PdoDirection
        for number in range(pdo_count(described, direction))
        for position in range(1, od.PDO_MAX_ENTRIES + 1)
        if (found := described.find(direction.map_entry(number, position))) is not None and found.value is not None
    )
    return frozenset(word >> 8 for word in words)


def _entry(found: DescribedObject, known: Entry | None, *, mapped: bool) -> Entry:
    """An entry; values that are not numbers are handled as bytes.

    Args:
        found: Its description.
        known: The same object of the simulation.
        mapped: Whether a PDO contains it after a reset.
    """
    kind, mappable = found.type or DataType.STRING, found.mappable
    too_small = (
        known is not None and known.key in _SIMULATED_KEYS and (found.bits is None or found.bits < known.type.bits)
    )
    if known is not None and (found.type is None or too_small):
        kind = known.type
    # Makers confuse "rwr" and "rww".
    confused = known is not None and mappable is not known.mappable and found.access is od.Access.RW
    if mapped or (confused and known is not None and od.Mappable.NO not in {mappable, known.mappable}):
        mappable = od.Mappable.BOTH
    return Entry(found.index, found.subindex, found.name, kind, found.access, mappable)


def _take_value(dictionary: Dictionary, key: int, found: DescribedObject, node_id: int, *, own: bool) -> None:
    """Set the initial value of an object."""
    if not dictionary.entries[key].type.code:
        dictionary.texts[key] = found.text.encode() or dictionary.texts.get(key, b"")
        return
    value = None if found.value is None else found.value.of(node_id)
    if key == od.RATED_CURRENT_MA.key and not dictionary.values.get(key):
        dictionary.values[key] = value or _NAMELESS_CURRENT_MA
    elif value is not None and found.type is not None and not own:
        least, greatest = found.type.bounds
        dictionary.values[key] = value if found.type.is_real else min(max(value, least), greatest)
    else:
        dictionary.values.setdefault(key, 0)


def _take_identity(dictionary: Dictionary, described: DeviceDescription) -> None:
    """Set 1018 from the file's header if the objects do not give it."""
    for entry, number in (
        (od.VENDOR_ID, described.vendor_id),
        (od.PRODUCT_CODE, described.product_code),
        (od.REVISION, described.revision),
    ):
        found = described.find(entry)
        if number is not None and (found is None or found.value is None):
            dictionary.values[entry.key] = number


def _limits(found: DescribedObject, node_id: int) -> Collection[int] | None:
    """Permitted values of an integer; None if the description sets no limit."""
    if found.bits is None or found.type is None or (found.least is None and found.greatest is None):
        return None
    least, greatest = found.type.bounds
    if found.least is not None:
        least = found.least.of(node_id)
    if found.greatest is not None:
        greatest = found.greatest.of(node_id)
    return range(least, greatest + 1) if least < greatest else None
