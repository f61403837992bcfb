"""PDO parameters of a real drive: written in the prescribed order, read back and compared.

Not every drive allows all of them to be written. A correct mapping is left alone. A correct COB-ID that cannot be
written is sufficient; the mapping is then changed with its count at 0, as the older standard prescribes. Anything else
that is fixed is refused, stating the present and the required values.

References:
    CiA 301, 7.5.2.36 (order of writes when a mapping changes).
"""

from __future__ import annotations

from armload_drivers.bring_up.sdo_channel import NO_SUBINDEX, READ_ONLY, SdoChannel
from armload_drivers.cia402 import object_dictionary as od
from armload_drivers.cia402.object_dictionary import Entry, PdoDirection
from armload_drivers.cia402.process_data.process_image import PdoLayout
from armload_drivers.driver_errors import SdoRefused, ServoError

_MOST_PDOS = 512


def map_pdo(sdo: SdoChannel, layout: PdoLayout) -> dict[Entry, int]:
    """Map one of a drive's PDOs as the layout specifies, with synchronous transmission.

    Args:
        sdo: Access to the drive; its `step` names the step in progress.
        layout: The PDO.

    Returns:
        Its parameters, as read back.

    Raises:
        SdoRefused: the drive refuses the mapping.
        ServoError: its COB-ID or mapping is fixed to another value, or a value reads back differently.
    """
    direction, number = layout.direction, layout.number
    cob_id, count = direction.cob_id_entry(number), direction.count_entry(number)
    # Bit 30 (no remote request) is kept: some drives refuse a TPDO without it.
    present = sdo.read(cob_id)
    word = layout.cob_id | present & od.PDO_NO_RTR
    free = _write(sdo, cob_id, word | od.PDO_DISABLED)
    if not free and present != word:
        raise sdo.failure(
            f"{cob_id} is 0x{present:08X}, which is not this node's 0x{word:08X}, and cannot be written",
            "Set the COB-IDs of this node with the manufacturer's tool, or give the drive the node id that they belong "
            "to",
        )
    wanted = [
        (direction.map_entry(number, position), entry.mapping) for position, entry in enumerate(layout.entries, start=1)
    ]
    if _mapped(sdo, direction, number) != [value for _, value in wanted]:
        done = _write(sdo, count, 0) and all(_map(sdo, entry, value, len(wanted)) for entry, value in wanted)
        if not (done and _write(sdo, count, len(wanted))):
            raise _fixed(sdo, layout)
    kind = direction.type_entry(number)
    if sdo.read(kind) != od.PDO_SYNCHRONOUS and not _write(sdo, kind, od.PDO_SYNCHRONOUS):
        raise sdo.failure(
            f"{kind} is {sdo.read(kind)} and cannot be written; {od.PDO_SYNCHRONOUS} is required (with every SYNC)",
            "Set it with the manufacturer's tool",
        )
    if free:
        sdo.write(cob_id, word)
    parameters = dict([*wanted, (count, len(wanted)), (kind, od.PDO_SYNCHRONOUS), (cob_id, word)])
    for entry, value in parameters.items():
        found = sdo.read(entry)
        if found != value:
            raise sdo.failure(
                f"{entry} reads 0x{found:X} after 0x{value:X} was written",
                "The drive does not keep this mapping; see its manual for what can be mapped",
            )
    return parameters


def _write(sdo: SdoChannel, entry: Entry, value: int) -> bool:
    """Write an object; False if it is read-only."""
    try:
        sdo.write(entry, value)
    except SdoRefused as refusal:
        if refusal.abort_code == READ_ONLY:
            return False
        raise
    return True


def _map(sdo: SdoChannel, entry: Entry, value: int, needed: int) -> bool:
    """Write one entry of a mapping; False if it is read-only."""
    try:
        return _write(sdo, entry, value)
    except SdoRefused as refusal:
        if refusal.abort_code != NO_SUBINDEX:
            raise
        most = entry.subindex - 1
        raise sdo.failure(
            f"a PDO of this drive carries at most {most} objects, {needed} are required",
            f"Set pdo_objects_max = {most}: the rest is sent in a second PDO",
        ) from refusal


def _mapped(sdo: SdoChannel, direction: PdoDirection, number: int) -> list[int]:
    """The present mapping parameters of a PDO."""
    count = sdo.read(direction.count_entry(number))
    return [sdo.read(direction.map_entry(number, position)) for position in range(1, count + 1)]


def _fixed(sdo: SdoChannel, layout: PdoLayout) -> ServoError:
    """Error for a mapping that cannot be written."""
    there = ", ".join(f"{word >> 16:04X}:{word >> 8 & 0xFF}" for word in _mapped(sdo, layout.direction, layout.number))
    needed = ", ".join(f"{entry.index:04X}:{entry.subindex}" for entry in layout.entries)
    return sdo.failure(
        f"the mapping is fixed to {there or 'nothing'}; required are {needed}",
        "A drive with a fixed mapping can be used only if it carries these objects in this order",
    )


def switch_others_off(sdo: SdoChannel, direction: PdoDirection, used: int) -> None:
    """Disable all PDOs of a direction after the first `used`: they would load the bus.

    Raises:
        SdoRefused: the drive refuses to disable one.
        ServoError: the parameters of one are read-only, and it would be sent.
    """
    for number in range(used, _MOST_PDOS):
        entry = direction.cob_id_entry(number)
        word = sdo.read_if_there(entry)
        if word is None and number >= od.PDO_COUNT:
            return
        if word is None or word & od.PDO_DISABLED or _write(sdo, entry, word | od.PDO_DISABLED):
            continue
        if not _write(sdo, direction.count_entry(number), 0) and direction is PdoDirection.TRANSMIT:
            raise sdo.failure(
                f"{entry} is 0x{word:08X} and cannot be written, and its mapping is fixed",
                "This PDO would load the bus: switch it off with the manufacturer's tool",
            )
