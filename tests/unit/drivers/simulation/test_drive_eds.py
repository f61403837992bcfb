"""The EDS of the simulated drives, as read by other masters."""

from dataclasses import replace

import canopen
import pytest

from armload_drivers.cia402 import object_dictionary as od
from armload_drivers.cia402.arm_settings import SIMULATION_IDENTITY, VendorObject
from armload_drivers.cia402.eds_parser import parse_description
from armload_drivers.cia402.object_dictionary import DataType
from armload_drivers.simulation.drives.drive_dictionary import DriveTraits
from armload_drivers.simulation.drives.drive_eds import drive_eds


@pytest.fixture
def eds(arm_settings):
    return drive_eds(arm_settings().drives[1], 0.01)


def test_the_canopen_package_reads_it(eds, tmp_path):
    path = tmp_path / "joint_3.eds"
    path.write_text(eds)
    dictionary = canopen.import_od(str(path), node_id=9)
    assert dictionary[0x1018][1].default == SIMULATION_IDENTITY.vendor_id
    assert dictionary[0x1400][1].default == 0x209, "COB-IDs are those of any node id"
    assert dictionary[0x60B2].access_type == "rww"
    assert dictionary[0x60B2].pdo_mappable
    assert dictionary[0x6064].data_type == canopen.objectdictionary.INTEGER32
    assert not dictionary[0x6064].writable
    assert (dictionary[0x605A].min, dictionary[0x605A].max) == (0, 6)


def test_it_is_read_without_a_warning_and_describes_every_object(eds, virtual_arm):
    described = parse_description(eds.encode(), "joint_3.eds")
    assert described.warnings == ()
    assert described.value(od.PdoDirection.TRANSMIT.cob_id_entry(1), 5) & 0x7FF == 0x285
    arm = virtual_arm(traits={node: DriveTraits(description=described) for node in (2, 3, 5)})
    arm.servos.connect()
    assert arm.servos.simulated
    assert not any(setup.objects.missing for setup in arm.servos.setups)
    arm.servos.enable()
    arm.servos.stop()


def test_a_vendors_effort_is_in_it(arm_settings):
    drive = replace(arm_settings().drives[0], vendor_effort=VendorObject(0x30D1, 2, DataType.I32, 0.001))
    described = parse_description(drive_eds(drive, 0.01).encode(), "joint_2.eds")
    assert described.objects[0x30D102].bits == 32
    assert described.warnings == ()
