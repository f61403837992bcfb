"""The electronic data sheet (EDS) of a simulated drive, for masters that boot drives by their description.

References:
    CiA 306-1 (electronic data sheet).
"""

from __future__ import annotations

from importlib.resources import files
from string import Template

import numpy as np

from armload_drivers.cia402 import object_dictionary as od
from armload_drivers.cia402.arm_settings import DriveSettings
from armload_drivers.cia402.eds_parser import DATA_TYPES
from armload_drivers.cia402.object_dictionary import Access, DataType, Entry, Mappable
from armload_drivers.simulation.drives.drive_dictionary import DriveTraits
from armload_drivers.simulation.drives.sdo_server import Dictionary
from armload_drivers.simulation.drives.simulated_drive import SimulatedDrive
from armload_drivers.simulation.plant_interface import PlantAxis, StandingPlant

_CODES = {kind: code for code, kind in reversed(DATA_TYPES.items())}
_MANDATORY = (0x1000, 0x1001, 0x1018)
_VARIABLE, _ARRAY, _RECORD = 7, 8, 9
_PDO_COMMUNICATION = (range(0x1400, 0x1600), range(0x1800, 0x1A00))
_PDO_MAPPING = (range(0x1600, 0x1800), range(0x1A00, 0x1C00))
_RECORDS = frozenset({0x1018, 0x1200, 0x60C2})
_COB_IDS = frozenset({od.EMERGENCY_COB_ID.key, od.SDO_RX_COB_ID.key, od.SDO_TX_COB_ID.key})
_BIT_RATES = (10, 20, 50, 125, 250, 500, 800, 1000)


def drive_eds(drive: DriveSettings, cycle_s: float) -> str:
    """The EDS of one simulated drive.

    Args:
        drive: The configured drive that it simulates.
        cycle_s: Configured cycle.
    """
    simulated = SimulatedDrive(
        drive,
        PlantAxis(StandingPlant(np.zeros(1)), 0),
        cycle_s=cycle_s,
        traits=DriveTraits(),
        send=lambda cob_id, data: None,
        rerouted=lambda: None,
    )
    dictionary = simulated.dictionary
    indices = sorted({entry.index for entry in dictionary.entries.values()})
    sections = [_head(drive, dictionary)]
    for title, chosen in (
        ("MandatoryObjects", [index for index in indices if index in _MANDATORY]),
        ("OptionalObjects", [i for i in indices if i not in _MANDATORY and not 0x2000 <= i < 0x6000]),
        ("ManufacturerObjects", [i for i in indices if 0x2000 <= i < 0x6000]),
    ):
        rows = [f"{number}=0x{index:04X}" for number, index in enumerate(chosen, start=1)]
        sections.append("\n".join([f"[{title}]", f"SupportedObjects={len(chosen)}", *rows]))
    for index in indices:
        entries = sorted((e for e in dictionary.entries.values() if e.index == index), key=lambda e: e.subindex)
        sections += _object(index, entries, dictionary, drive.node_id)
    return "\n\n".join(sections) + "\n"


def _head(drive: DriveSettings, dictionary: Dictionary) -> str:
    """[FileInfo], [DeviceInfo] and [DummyUsage]."""
    values = dictionary.values
    rates = "\n".join(f"BaudRate_{rate}=1" for rate in _BIT_RATES)
    receive, transmit = (
        len({entry.index for entry in dictionary.entries.values() if first <= entry.index < first + 0x200})
        for first in (0x1400, 0x1800)
    )
    fields = {
        "joint": drive.joint,
        "vendor_id": f"0x{values[od.VENDOR_ID.key]:08X}",
        "product_code": f"0x{values[od.PRODUCT_CODE.key]:08X}",
        "revision": f"0x{values[od.REVISION.key]:08X}",
        "rates": rates,
        "receive": receive,
        "transmit": transmit,
    }
    return Template(files(__package__).joinpath("eds_head.in").read_text("ascii")).substitute(fields).rstrip("\n")


def _object(index: int, entries: list[Entry], dictionary: Dictionary, node_id: int) -> list[str]:
    """The sections of one object: itself, or a record and its sub-indices."""
    if len(entries) == 1 and entries[0].subindex == 0:
        return [_variable(f"{index:04X}", entries[0], dictionary, node_id)]
    is_record = index in _RECORDS or any(index in indices for indices in (*_PDO_COMMUNICATION, *_PDO_MAPPING))
    kind = _RECORD if is_record else _ARRAY
    title = f"[{index:04X}]\nParameterName=object {index:04X}\nObjectType=0x{kind:X}\nSubNumber={len(entries)}"
    return [title, *(_variable(f"{index:04X}sub{e.subindex:X}", e, dictionary, node_id) for e in entries)]


def _variable(title: str, entry: Entry, dictionary: Dictionary, node_id: int) -> str:
    """The section of one value."""
    allowed = dictionary.allowed.get(entry.key)
    limits = f"\nLowLimit={min(allowed)}\nHighLimit={max(allowed)}" if allowed and len(allowed) > 1 else ""
    return f"""\
[{title}]
ParameterName={entry.name}
ObjectType=0x{_VARIABLE:X}
DataType=0x{_CODES[entry.type]:04X}
AccessType={_access(entry)}
DefaultValue={_default(entry, dictionary, node_id)}
PDOMapping={int(entry.mappable is not Mappable.NO)}{limits}"""


def _access(entry: Entry) -> str:
    """AccessType; for objects that are writable by SDO and mappable, with the direction."""
    if entry.access is Access.RW and entry.mappable is Mappable.RPDO:
        return "rww"
    return "rwr" if entry.access is Access.RW and entry.mappable is Mappable.TPDO else entry.access.value


def _default(entry: Entry, dictionary: Dictionary, node_id: int) -> str:
    """Value after a reset; COB-IDs as expressions of the node id."""
    if entry.type is DataType.STRING:
        return dictionary.texts[entry.key].decode("ascii", "replace")
    value = dictionary.values[entry.key]
    of_pdo = entry.subindex == 1 and any(entry.index in indices for indices in _PDO_COMMUNICATION)
    return f"$NODEID+0x{value - node_id:X}" if of_pdo or entry.key in _COB_IDS else str(value)
