"""Which objects a drive's frames carry: written in the prescribed order, or taken as they are.

In PREOP only: assignment off, mapping off, entries, mapping on, assignment. A drive that refuses keeps its own mapping,
which is used if it contains every object that is needed.

References:
    CiA 301, 7.5.2.36 (order of writes when a mapping changes); 1C12 and 1C13 by SOEM's source.
"""

from __future__ import annotations

from armload_drivers.bring_up.sdo_channel import SdoChannel
from armload_drivers.cia402.object_dictionary import DataType, Entry, PdoDirection
from armload_drivers.cia402.process_data.frame_part import FramePart, frame_part
from armload_drivers.driver_errors import SdoRefused

_ASSIGNMENTS = {PdoDirection.RECEIVE: 0x1C12, PdoDirection.TRANSMIT: 0x1C13}
"""Objects that assign PDOs to the sync managers of outputs and inputs."""


def assign_pdo(sdo: SdoChannel, direction: PdoDirection, entries: list[Entry]) -> tuple[FramePart, dict[Entry, int]]:
    """Map the objects of one direction.

    Args:
        sdo: Access to the drive, which is in PREOP; its `step` names the step in progress.
        entries: Objects that are needed.

    Returns:
        Where they are, and the parameters as read back.

    Raises:
        ServoError: the drive keeps a mapping that lacks one of them.
    """
    before = _assigned(sdo, direction)
    mapped = _mapped(sdo, before)
    if mapped != [entry.mapping for entry in entries]:
        pdo = before[0] if before else direction.count_entry(0).index
        try:
            _write(sdo, direction, pdo, entries)
        except SdoRefused:
            _assign(sdo, direction, before)
    now = _assigned(sdo, direction)
    mapped = _mapped(sdo, now)
    part = frame_part(mapped, entries)
    lacking = [entry for entry in entries if entry not in part.offsets]
    if lacking:
        there = ", ".join(f"{word >> 16:04X}:{word >> 8 & 0xFF}" for word in mapped)
        raise sdo.failure(
            f"the mapping is fixed to {there or 'nothing'}, and lacks {', '.join(map(str, lacking))}",
            "Choose another mapping with the manufacturer's tool: it must contain all of them, on whole bytes",
        )
    held = {_assignment(direction, number): pdo for number, pdo in enumerate(now, start=1)}
    return part, held


def _assignment(direction: PdoDirection, number: int) -> Entry:
    """Entry of an assignment; 0 is the number of PDOs."""
    kind = DataType.U16 if number else DataType.U8
    return Entry(_ASSIGNMENTS[direction], number, "assigned PDO" if number else "number of assigned PDOs", kind)


def _mapping(pdo: int, number: int) -> Entry:
    """Entry of a mapping; 0 is the number of objects."""
    kind = DataType.U32 if number else DataType.U8
    return Entry(pdo, number, "mapped object" if number else "number of mapped objects", kind)


def _assigned(sdo: SdoChannel, direction: PdoDirection) -> list[int]:
    """Indices of the assigned PDOs."""
    count = sdo.read(_assignment(direction, 0))
    return [sdo.read(_assignment(direction, number)) for number in range(1, count + 1)]


def _mapped(sdo: SdoChannel, pdos: list[int]) -> list[int]:
    """Mapping parameters of PDOs, in order."""
    return [sdo.read(_mapping(pdo, number)) for pdo in pdos for number in range(1, sdo.read(_mapping(pdo, 0)) + 1)]


def _write(sdo: SdoChannel, direction: PdoDirection, pdo: int, entries: list[Entry]) -> None:
    """Map objects to one PDO and assign it alone."""
    sdo.write(_assignment(direction, 0), 0)
    sdo.write(_mapping(pdo, 0), 0)
    for number, entry in enumerate(entries, start=1):
        sdo.write(_mapping(pdo, number), entry.mapping)
    sdo.write(_mapping(pdo, 0), len(entries))
    _assign(sdo, direction, [pdo])


def _assign(sdo: SdoChannel, direction: PdoDirection, pdos: list[int]) -> None:
    """Assign PDOs; a fixed assignment has them already."""
    try:
        sdo.write(_assignment(direction, 0), 0)
        for number, pdo in enumerate(pdos, start=1):
            sdo.write(_assignment(direction, number), pdo)
        sdo.write(_assignment(direction, 0), len(pdos))
    except SdoRefused:
        if _assigned(sdo, direction) != pdos:
            raise
