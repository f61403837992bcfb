"""PDO parameters of a real drive: written in the prescribed order, read back and compared.

References:
    CiA 301, 7.5.2.36 (order of writes when a mapping changes).
"""

from __future__ import annotations

from armload_drivers.bus.sdo_channel import SdoChannel
from armload_drivers.cia402 import object_dictionary as od
from armload_drivers.cia402.object_dictionary import PdoDirection
from armload_drivers.cia402.process_image import PdoLayout


def map_pdo(sdo: SdoChannel, layout: PdoLayout) -> None:
    """Make one of a drive's PDOs carry what the layout says, synchronously.

    Args:
        sdo: Access to the drive; its `step` names what is being done.
        layout: The PDO.

    Raises:
        SdoRefused: the drive does not take the mapping.
        ServoError: it accepts the value and reads back another.
    """
    direction, number = layout.direction, layout.number
    cob_id, count = direction.cob_id_entry(number), direction.count_entry(number)
    entries = [
        (direction.map_entry(number, position), entry.mapping) for position, entry in enumerate(layout.entries, start=1)
    ]
    # Bit 30 (no remote request) is kept: some drives refuse a TPDO without it.
    word = layout.cob_id | sdo.read(cob_id) & od.PDO_NO_RTR
    final = [
        *entries,
        (count, len(entries)),
        (direction.type_entry(number), od.PDO_SYNCHRONOUS),
        (cob_id, word),
    ]
    sdo.write(cob_id, word | od.PDO_DISABLED)
    sdo.write(count, 0)
    for entry, value in final:
        sdo.write(entry, value)
    for entry, value in final:
        found = sdo.read(entry)
        if found != value:
            raise sdo.failure(
                f"{entry} reads 0x{found:X} after 0x{value:X} was written",
                "The drive does not keep this mapping; see its manual for what can be mapped",
            )


def switch_others_off(sdo: SdoChannel, direction: PdoDirection, used: int) -> None:
    """Disable the PDOs of a direction behind the first `used`, where there are any: they would load the bus.

    Raises:
        SdoRefused: the drive does not let them be disabled.
    """
    for number in range(used, od.PDO_COUNT):
        entry = direction.cob_id_entry(number)
        word = sdo.read_if_there(entry)
        if word is not None and not word & od.PDO_DISABLED:
            sdo.write(entry, word | od.PDO_DISABLED)
