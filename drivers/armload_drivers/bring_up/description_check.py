"""A drive's description compared with its configuration, before the drive is queried. Nothing is read from a bus.

A description is the vendor's claim and not always true, so bring-up still reads back everything it writes. But a
missing torque offset, for example, is reported here before anyone goes to the cell.
"""

from __future__ import annotations

from armload_drivers.cia402.arm_settings import DriveSettings
from armload_drivers.cia402.drive_safety import Safety, has_a_way
from armload_drivers.cia402.eds_parser import DeviceDescription
from armload_drivers.cia402.object_dictionary import Entry, PdoDirection
from armload_drivers.cia402.process_data.process_image import drive_image


def description_gaps(drive: DriveSettings) -> tuple[str, ...]:
    """What the configuration requires and the description lacks, as text; empty without a description."""
    described = drive.description
    if described is None:
        return ()
    gaps = [
        gap
        for layout in drive_image(drive).layouts
        for entry in layout.entries
        if (gap := _unmappable(described, layout.direction, entry))
    ]
    gaps += [
        f"{described.source} has no object for {of.key}: {of.lost}; see accept_missing"
        for of in Safety
        if of.key not in drive.accept_missing
        and not has_a_way(of, drive, lambda entry: described.find(entry) is not None)
    ]
    return tuple(gaps)


def _unmappable(described: DeviceDescription, direction: PdoDirection, entry: Entry) -> str:
    """Why a PDO cannot carry an object; empty if it can."""
    found = described.find(entry)
    if found is None:
        return f"{described.source} has no {entry}, which a PDO must carry"
    if not direction.carries(found.mappable):
        return f"{described.source} does not allow {entry} to be mapped to a PDO"
    if found.bits is not None and found.bits != entry.type.bits:
        return f"{described.source} gives {entry} {found.bits} bits instead of {entry.type.bits}"
    return ""
