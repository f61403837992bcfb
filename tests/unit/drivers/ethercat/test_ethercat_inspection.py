"""What a scan finds on a line of drives."""

import pytest

from armload_drivers.cia402.arm_settings import Identity
from armload_drivers.ethercat.ethercat_bring_up import find_drives
from armload_drivers.ethercat.ethercat_line import MailboxAbort

pytestmark = pytest.mark.pure
OBJECTS = {(0x1000, 0): 0x20192, (0x1008, 0): b"axis", (0x1018, 1): 7, (0x1018, 2): 8, (0x1018, 3): 9}


class Line:
    """A coupler without objects, then two drives."""

    worker = None

    def find(self):
        return 3

    def identity(self, place):
        return f"EEPROM {place}", 1, 2, 3

    def watchdog_us(self, place):
        return 100_000

    def upload(self, place, index, subindex, limit_s):
        if place == 0 or (index, subindex) not in OBJECTS:
            raise MailboxAbort(0x06020000, "no such object")
        value = OBJECTS[index, subindex]
        return value if isinstance(value, bytes) else value.to_bytes(4, "little")


def test_the_devices_of_a_line_are_numbered_from_1_and_one_without_objects_is_known_by_its_eeprom():
    found = find_drives(Line())
    assert [node.node_id for node in found] == [1, 2, 3]
    assert [node.name for node in found] == ["EEPROM 0", "axis", "axis"]
    assert [node.identity for node in found] == [Identity(1, 2, 3), Identity(7, 8, 9), Identity(7, 8, 9)]
    assert [node.is_drive for node in found] == [False, True, True]
