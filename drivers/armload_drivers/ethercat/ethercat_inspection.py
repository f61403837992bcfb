"""Inspection of an EtherCAT line without a cycle: `armload drives scan` and `show`. Objects are only read."""

from __future__ import annotations

import time

from armload_drivers.bring_up.inspection import ArmStatus, FoundNode, describe, drive_status
from armload_drivers.cia402 import object_dictionary as od
from armload_drivers.cia402.arm_settings import Fieldbus, Identity
from armload_drivers.cia402.timeouts import Timeouts
from armload_drivers.driver_errors import ServoError
from armload_drivers.ethercat.coe_sdo import CoeSdo
from armload_drivers.ethercat.ethercat_bring_up import EthercatBringUp
from armload_drivers.ethercat.ethercat_line import EthercatLine


def find_drives(line: EthercatLine, timeouts: Timeouts | None = None) -> list[FoundNode]:
    """All devices of a line, in their order; they are put in PREOP.

    A device without objects is described by its EEPROM.
    """
    limits = timeouts or Timeouts()
    found = []
    for place in range(line.find()):
        sdo = CoeSdo(place + 1, "unknown joint", line, line.worker, limits.sdo_s)
        try:
            device_type = sdo.read(od.DEVICE_TYPE)
        except ServoError:
            name, *identity = line.identity(place)
            found.append(FoundNode(place + 1, None, name, Identity(*identity), (), ()))
        else:
            found.append(describe(sdo, place + 1, [device_type], Fieldbus.ETHERCAT))
    return found


def show(bring_up: EthercatBringUp, wait_s: float) -> ArmStatus:
    """Status of the drives of an arm, in PREOP.

    Args:
        bring_up: The arm.
        wait_s: Time to wait before.
    """
    time.sleep(wait_s)
    drives = tuple(drive_status(setup, bring_up.timeouts) for setup in bring_up.setups)
    return ArmStatus(drives, None, 0, False)
