"""The electronic data sheet (EDS) of a simulated drive, for masters that boot drives by their description.

References:
    CiA 306-1 (electronic data sheet).
"""

from __future__ import annotations

from io import StringIO
from itertools import groupby

import numpy as np
from canopen.objectdictionary import ObjectDictionary, ODArray, ODRecord, ODVariable
from canopen.objectdictionary.eds import export_eds

from armload_drivers.cia402 import object_dictionary as od
from armload_drivers.cia402.arm_settings import DriveSettings
from armload_drivers.cia402.eds_parser import DATA_TYPES
from armload_drivers.cia402.object_dictionary import Access, DataType, Entry, Mappable
from armload_drivers.simulation.drives.drive_dictionary import DriveTraits
from armload_drivers.simulation.drives.sdo_server import Dictionary
from armload_drivers.simulation.drives.simulated_drive import SimulatedDrive
from armload_drivers.simulation.plant_interface import PlantAxis, StandingPlant

_CODES = {kind: code for code, kind in reversed(DATA_TYPES.items())}
_PDO_COMMUNICATION = (range(0x1400, 0x1600), range(0x1800, 0x1A00))
_RECORDS = (range(0x1018, 0x1019), range(0x1200, 0x1C00), range(0x60C2, 0x60C3))
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
    dictionary, described = simulated.dictionary, ObjectDictionary()
    about, values = described.device_information, dictionary.values
    about.vendor_name, about.product_name, about.order_code = "armload", "armload simulated drive", "SIM"
    about.vendor_number, about.product_number = values[od.VENDOR_ID.key], values[od.PRODUCT_CODE.key]
    about.revision_number, about.granularity, about.simple_boot_up_slave = values[od.REVISION.key], 8, True
    about.nr_of_RXPDO, about.nr_of_TXPDO = len(simulated.rpdos), len(simulated.tpdos)
    about.simple_boot_up_master = about.dynamic_channels_supported = about.group_messaging = False
    about.LSS_supported, about.allowed_baudrates = False, {1000 * rate for rate in _BIT_RATES}
    entries = sorted(dictionary.entries.values(), key=lambda entry: entry.key)
    for index, of_index in groupby(entries, lambda entry: entry.index):
        first, *others = (_variable(entry, dictionary, drive.node_id) for entry in of_index)
        if not others and not first.subindex:
            described.add_object(first)
            continue
        kind = ODRecord if any(index in indices for indices in _RECORDS) else ODArray
        described.add_object(kind(f"object {index:04X}", index))
        for variable in (first, *others):
            described[index].add_member(variable)
    written = StringIO()
    file = {"FileName": f"{drive.joint}.eds", "FileVersion": 1, "FileRevision": 1, "EdsVersion": "4.0"}
    export_eds(described, written, file | {"Description": "armload simulated CiA 402 drive"})
    return written.getvalue()


def _variable(entry: Entry, dictionary: Dictionary, node_id: int) -> ODVariable:
    """One value."""
    variable, allowed = ODVariable(entry.name, entry.index, entry.subindex), dictionary.allowed.get(entry.key)
    variable.data_type, variable.access_type = _CODES[entry.type], _access(entry)
    variable.default_raw = _default(entry, dictionary, node_id)
    variable.pdo_mappable = entry.mappable is not Mappable.NO
    if allowed and len(allowed) > 1:
        variable.min, variable.max = min(allowed), max(allowed)
    return variable


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
