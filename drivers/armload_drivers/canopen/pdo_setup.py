"""PDO parameters of a real drive: written in the prescribed order, read back and compared.

Not every drive allows all of them to be written. A correct mapping is left alone. A correct COB-ID that cannot be
written is sufficient; the mapping is then changed with its count at 0, as the older standard prescribes. Anything else
that is fixed is refused, stating the present and the required values, and how the configuration can use it.

References:
    CiA 301, 7.5.2.36 (order of writes when a mapping changes).
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable
from typing import Protocol

from armload_drivers.bring_up.sdo_channel import NO_SUBINDEX, OUT_OF_RANGE, READ_ONLY, SdoChannel
from armload_drivers.cia402 import object_dictionary as od
from armload_drivers.cia402.arm_settings import FixedPdo
from armload_drivers.cia402.object_dictionary import Entry, PdoDirection
from armload_drivers.cia402.process_data.process_image import PdoLayout
from armload_drivers.driver_errors import SdoRefused, ServoError

_MOST_PDOS = 512
_FIXED = frozenset({READ_ONLY})
_NOT_TAKEN = _FIXED | OUT_OF_RANGE | {0x0800_0020, 0x0800_0022}
"""Abort codes of drives that do not take a value, or not in this state."""
_FEWEST_OBJECTS = 2
"""Fewest objects in the first PDO of a direction: controlword and setpoint, statusword and position."""


class MappingAdvice(Protocol):
    """What the configuration can do about a drive that cannot map what it requires."""

    def instead_of(self, entry: Entry, can_be_used: Callable[[Entry], bool]) -> str:
        """About an object that is missing or cannot be mapped; `can_be_used` tells it of another object."""

    def fewer_objects(self, most: int) -> str:
        """About PDOs that carry at most so many objects."""

    def fixed_mapping(self, found: tuple[FixedPdo, ...]) -> str:
        """About PDOs whose mapping cannot be changed."""


def map_pdo(sdo: SdoChannel, layout: PdoLayout, advice: MappingAdvice) -> dict[Entry, int]:
    """Map one of a drive's PDOs as the layout specifies, with synchronous transmission.

    Args:
        sdo: Access to the drive; its `step` names the step in progress.
        advice: What the configuration can do about a drive that cannot map it.

    Returns:
        Its parameters, as read back.

    Raises:
        SdoRefused: the drive refuses the mapping.
        ServoError: its COB-ID or mapping is fixed to another value, or a value reads back differently.
    """
    direction, number = layout.direction, layout.number
    cob_id, count = direction.cob_id_entry(number), direction.count_entry(number)
    # Bit 30 (no remote request) is kept: some drives refuse a TPDO without it.
    present = sdo.read_if_there(cob_id)
    if present is None:
        raise sdo.failure(
            f"the drive has no {cob_id}: it has {number} PDOs in this direction, {number + 1} are required",
            advice.instead_of(layout.entries[0], lambda _: False)
            if number and direction is PdoDirection.RECEIVE
            else "Use firmware that has this PDO, or another drive",
        )
    word = layout.cob_id | present & od.PDO_NO_RTR
    free = _write(sdo, cob_id, word | od.PDO_DISABLED, _NOT_TAKEN)
    if not free and present != word:
        raise sdo.failure(
            f"{cob_id} is 0x{present:08X}, which is not this node's 0x{word:08X}, and cannot be written",
            "Set the COB-IDs of this node with the manufacturer's tool, or give the drive the node id that they belong "
            "to",
        )
    wanted = [(direction.map_entry(number, at), mapped) for at, mapped in enumerate(layout.mapping, start=1)]
    if sdo.read_if_there(count) is None:
        raise sdo.failure(
            f"the drive has no {count}: what this PDO contains cannot be read or set",
            "Use firmware that has it, or another drive",
        )
    if _mapped(sdo, direction, number) != [value for _, value in wanted]:
        if not _write(sdo, count, 0):
            raise _fixed(sdo, layout, advice)
        for position, mapped in enumerate(layout.mapping, start=1):
            _write_entry(sdo, layout, position, mapped, advice)
        if not _write(sdo, count, len(wanted), _NOT_TAKEN):
            raise _too_many(sdo, min(_FEWEST_OBJECTS, len(wanted) - 1), len(wanted), advice)
    kind = direction.type_entry(number)
    transmission = _synchronous(sdo, kind, direction)
    if free:
        sdo.write(cob_id, word)
    parameters = dict([*wanted, (count, len(wanted)), (kind, transmission), (cob_id, word)])
    for entry, value in parameters.items():
        found = sdo.read(entry)
        if found != value:
            raise sdo.failure(
                f"{entry} reads 0x{found:X} after 0x{value:X} was written",
                "The drive does not keep this mapping; see its manual for what can be mapped",
            )
    return parameters


def _write(sdo: SdoChannel, entry: Entry, value: int, refusals: frozenset[int] = _FIXED) -> bool:
    """Write an object; False if it is refused for one of the reasons."""
    try:
        sdo.write(entry, value)
    except SdoRefused as refusal:
        if refusal.abort_code in refusals:
            return False
        raise
    return True


def _synchronous(sdo: SdoChannel, kind: Entry, direction: PdoDirection) -> int:
    """Make a PDO synchronous with every SYNC, and return its transmission type.

    The standard has one meaning for all synchronous types of an RPDO.
    """
    present = sdo.read_if_there(kind)
    if present is None:
        raise sdo.failure(
            f"the drive has no {kind}: nothing says whether this PDO follows SYNC",
            "Use firmware that has it, or another drive",
        )
    if direction is PdoDirection.RECEIVE and present <= od.PDO_SYNCHRONOUS_LAST:
        return present
    for transmission in (od.PDO_SYNCHRONOUS, 0) if direction is PdoDirection.RECEIVE else (od.PDO_SYNCHRONOUS,):
        if present == transmission or _write(sdo, kind, transmission, _NOT_TAKEN):
            return transmission
    raise sdo.failure(
        f"{kind} is {present} and cannot be written; {od.PDO_SYNCHRONOUS} is required (with every SYNC)",
        "Set it with the manufacturer's tool",
    )


def _write_entry(sdo: SdoChannel, layout: PdoLayout, position: int, word: int, advice: MappingAdvice) -> None:
    """Write one entry of a mapping."""
    place = layout.direction.map_entry(layout.number, position)
    try:
        if not _write(sdo, place, word):
            raise _fixed(sdo, layout, advice)
    except SdoRefused as refusal:
        if refusal.abort_code == NO_SUBINDEX:
            raise _too_many(sdo, position - 1, len(layout.mapping), advice) from refusal
        entry = next((entry for entry in layout.entries if entry.mapping == word), None)
        raise sdo.failure(
            f"the drive does not allow {entry or _named([word])} in this PDO (0x{refusal.abort_code:08X} from {place})",
            "Correct fixed_pdos, which must state the PDOs as the drive has them"
            if layout.fixed or entry is None
            else advice.instead_of(entry, lambda other: sdo.has(other) and _accepts(sdo, place, other)),
        ) from refusal


def _accepts(sdo: SdoChannel, place: Entry, other: Entry) -> bool:
    """Whether a PDO accepts another object."""
    try:
        return _write(sdo, place, other.mapping)
    except SdoRefused:
        return False


def _too_many(sdo: SdoChannel, most: int, needed: int, advice: MappingAdvice) -> ServoError:
    """Error for PDOs that carry too few objects."""
    if most < min(needed, _FEWEST_OBJECTS):
        remedy = f"A drive must carry {_FEWEST_OBJECTS} objects in a PDO: use other firmware, or another drive"
    else:
        remedy = advice.fewer_objects(most)
    return sdo.failure(f"a PDO of this drive carries at most {most} objects, {needed} are required", remedy)


def _mapped(sdo: SdoChannel, direction: PdoDirection, number: int) -> list[int]:
    """The present mapping parameters of a PDO."""
    count = sdo.read(direction.count_entry(number))
    return [sdo.read(direction.map_entry(number, position)) for position in range(1, count + 1)]


def _fixed(sdo: SdoChannel, layout: PdoLayout, advice: MappingAdvice) -> ServoError:
    """Error for a mapping that cannot be written."""
    there = _named(_mapped(sdo, layout.direction, layout.number))
    found = tuple(
        FixedPdo(way, number, tuple(_mapped(sdo, way, number)))
        for way in PdoDirection
        if way is layout.direction or not _changes(sdo, way)
        for number in range(od.PDO_COUNT)
        if sdo.read_if_there(way.count_entry(number))
    )
    return sdo.failure(
        f"the mapping is fixed to {there or 'nothing'}; required are {_named(layout.mapping)}",
        advice.fixed_mapping(found),
    )


def _named(mapping: Iterable[int]) -> str:
    """The objects of a mapping."""
    return ", ".join(f"{word >> 16:04X}:{word >> 8 & 0xFF}" for word in mapping if word)


def _changes(sdo: SdoChannel, direction: PdoDirection) -> bool:
    """Whether the first mapping of a direction can be written, by writing what is there."""
    count = direction.count_entry(0)
    present = sdo.read_if_there(count)
    try:
        return present is None or _write(sdo, count, present)
    except SdoRefused:  # for another reason: the PDO is in use
        return True


def switch_others_off(sdo: SdoChannel, direction: PdoDirection, used: Collection[int]) -> None:
    """Disable all PDOs of a direction but those of these numbers: they would load the bus.

    Raises:
        SdoRefused: the drive refuses to disable one.
        ServoError: the parameters of one are read-only, and it would be sent.
    """
    for number in (number for number in range(_MOST_PDOS) if number not in used):
        entry = direction.cob_id_entry(number)
        word = sdo.read_if_there(entry)
        if word is None and number >= od.PDO_COUNT:
            return
        if word is None or word & od.PDO_DISABLED:
            continue
        if _write(sdo, entry, word | od.PDO_DISABLED, _NOT_TAKEN):
            continue
        if not _write(sdo, direction.count_entry(number), 0) and direction is PdoDirection.TRANSMIT:
            raise sdo.failure(
                f"{entry} is 0x{word:08X} and cannot be written, and its mapping is fixed",
                "This PDO would load the bus: switch it off with the manufacturer's tool",
            )
