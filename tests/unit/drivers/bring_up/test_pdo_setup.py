"""PDO parameters as written by the master, with the drive's side."""

import can
import pytest

from armload_drivers.bring_up.pdo_setup import map_pdo, switch_others_off
from armload_drivers.bus.bus_link import BusLink
from armload_drivers.bus.sdo_channel import SdoChannel
from armload_drivers.cia402 import object_dictionary as od
from armload_drivers.cia402.object_dictionary import PdoDirection
from armload_drivers.cia402.process_data.process_image import PdoLayout
from armload_drivers.driver_errors import SdoRefused, ServoError
from armload_drivers.simulation.drives.drive_pdos import Pdo
from armload_drivers.simulation.drives.sdo_server import Dictionary, SdoServer

TRANSMIT = PdoDirection.TRANSMIT
LAYOUT = PdoLayout(TRANSMIT, 0, 0x185, (od.STATUSWORD, od.POSITION_ACTUAL, od.TORQUE_ACTUAL))


class Drive:
    """A bus with one drive's SDO server."""

    def __init__(self, pdos=4):
        self.dictionary = Dictionary()
        for entry in LAYOUT.entries:
            self.dictionary.add(entry, 0)
        self.pdos = [Pdo(TRANSMIT, n, 5, self.dictionary, (od.STATUSWORD,)) for n in range(pdos)]
        self.server = SdoServer(self.dictionary)
        self.queue = []

    def send(self, message, timeout=None):
        answer = self.server.receive(bytes(message.data))
        if answer is not None:
            self.queue.append(can.Message(arbitration_id=0x585, data=answer, is_extended_id=False))

    def recv(self, timeout=None):
        return self.queue.pop(0) if self.queue else None

    @property
    def sdo(self):
        channel = SdoChannel(5, "joint_2", BusLink(self), timeout_s=0.01)
        channel.step = "mapping the transmit PDO"
        return channel


def test_a_mapping_is_written_in_an_order_that_the_standard_allows():
    drive = Drive()
    map_pdo(drive.sdo, LAYOUT)
    pdo = drive.pdos[0]
    assert (pdo.cob_id, pdo.type, pdo.length) == (0x185, od.PDO_SYNCHRONOUS, LAYOUT.length)
    assert all(pdo.carries(entry) for entry in LAYOUT.entries)
    assert drive.dictionary.values[TRANSMIT.cob_id_entry(0).key] & od.PDO_NO_RTR


def test_a_mapping_can_be_written_again():
    drive = Drive()
    map_pdo(drive.sdo, LAYOUT)
    map_pdo(drive.sdo, LAYOUT)
    assert drive.pdos[0].length == LAYOUT.length


def test_a_drive_that_keeps_something_else_is_found_out():
    drive = Drive()
    kind = TRANSMIT.type_entry(0)

    def stubborn():
        drive.dictionary.values[kind.key] = 255

    drive.dictionary.reactions[kind.key] = stubborn
    with pytest.raises(ServoError, match="transmission type reads 0xFF after 0x1") as raised:
        map_pdo(drive.sdo, LAYOUT)
    assert raised.value.step == "mapping the transmit PDO"


def test_a_drive_that_cannot_map_an_object_says_so():
    drive = Drive()
    drive.dictionary.remove([od.TORQUE_ACTUAL.index])
    with pytest.raises(SdoRefused, match="1A00:3"):
        map_pdo(drive.sdo, LAYOUT)


def test_other_pdos_are_switched_off_where_there_are_any():
    drive = Drive(pdos=3)
    switch_others_off(drive.sdo, TRANSMIT, 1)
    assert [pdo.cob_id for pdo in drive.pdos] == [0x185, None, None]
