"""What is EtherCAT's own in a drive's bring-up: places in the line, aliases, the mapping, and outputs that stay."""

from types import SimpleNamespace

import pytest

from armload_drivers.cia402 import object_dictionary as od
from armload_drivers.cia402.arm_settings import Identity
from armload_drivers.cia402.object_dictionary import DataType, Entry
from armload_drivers.cia402.timeouts import Timeouts
from armload_drivers.driver_errors import ServoError, ServoTimeout, WrongDevice
from armload_drivers.ethercat.ethercat_setup import EthercatSetup
from armload_drivers.ethercat.pdo_assignment import FramePart
from tests.scripted_sdo import ScriptedSdo

REAL = Identity(0x1AB, 7)
THERE = {od.DEVICE_TYPE: 0x0002_0192, od.VENDOR_ID: 0x1AB, od.PRODUCT_CODE: 7}
ALIASES = (0, 30, 31, 32, 40)


@pytest.fixture
def setup(arm_settings):
    """Bring-up of the drive with node id 3, the third in a line of devices with these aliases."""

    def setup(values=None, aliases=ALIASES, **changes):
        arm = arm_settings(identity=REAL, **changes)
        line = SimpleNamespace(size=len(aliases), alias=lambda place: aliases[place])
        sdo = ScriptedSdo(THERE if values is None else values)
        return EthercatSetup(arm.drives[1], arm, sdo, Timeouts(sdo_s=0.4), line), sdo

    return setup


def test_a_drive_must_be_in_the_line_and_answer(setup):
    there, sdo = setup()
    there.require_alive()
    assert sdo.limits_s == [0.4]
    sdo.silent = True
    with pytest.raises(ServoTimeout, match="no answer; 5 devices were found in the line"):
        there.require_alive()
    beyond, sdo = setup(aliases=ALIASES[:2])
    with pytest.raises(ServoTimeout, match="no answer; 2 devices"):
        beyond.require_alive()
    assert sdo.steps == [], "nobody is asked at a place that there is not"
    setup(aliases=ALIASES[:3])[0].require_alive()


def test_an_alias_tells_exchanged_cables(setup):
    assert setup(alias=31)[0].check_identity() == REAL
    assert setup()[0].check_identity() == REAL
    with pytest.raises(WrongDevice, match=r"alias is 31 instead of 30; the drive with this alias is number 2"):
        setup(alias=30)[0].check_identity()
    with pytest.raises(WrongDevice, match=r"alias is 31 instead of 99; no drive has it"):
        setup(alias=99)[0].check_identity()


def test_another_product_is_refused_whatever_its_alias(setup):
    with pytest.raises(WrongDevice, match="product code"):
        setup(THERE | {od.PRODUCT_CODE: 8}, alias=31)[0].check_identity()


def test_outputs_that_are_not_sent_keep_the_drives_values(setup):
    """A zero in the frame could be a torque limit."""
    limit = Entry(0x6072, 0, "max torque", DataType.U16)
    offset = Entry(0x60B1, 0, "velocity offset", DataType.I32)
    drive, _ = setup({limit: 1500, offset: 0x01020304})
    drive.outputs = FramePart(10, {od.CONTROLWORD: 0}, ((limit, 2), (offset, 5)))
    assert drive.constants() == bytes.fromhex("0000 dc05 00 04030201 00")
    drive, _ = setup({limit: 1500})
    drive.outputs = FramePart(10, {od.CONTROLWORD: 0}, ((offset, 5),))
    with pytest.raises(ServoError, match="reading other outputs"):
        drive.constants()


def test_the_mode_is_held_and_read_back_when_cycles_run(setup):
    drive, sdo = setup(THERE | {od.MODE: 0, od.MODE_DISPLAY: 0})
    drive._select_mode()
    mode = int(drive.settings.mode)
    assert sdo.numbers(od.MODE) == [mode]
    assert drive.objects.held[od.MODE] == mode
    with pytest.raises(ServoTimeout):
        drive.require_started()
    sdo.values[od.MODE_DISPLAY] = mode
    drive.require_started()
