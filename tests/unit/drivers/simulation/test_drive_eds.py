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


def test_its_header_names_the_simulation_and_what_it_has(eds):
    """CiA 306-1, 4.6.1.3; COB-IDs are of any node id, and limits are those of the values that are taken."""
    lines = set(eds.replace("\r", "").splitlines())
    assert {
        "VendorName=armload", f"VendorNumber={0x4152_4D4C}", "Granularity=8",
        f"ProductNumber={0x5349_4D01}", "SimpleBootUpSlave=1", "SimpleBootUpMaster=0", "RevisionNumber=65536",
        "NrOfRXPDO=4", "NrOfTXPDO=4", "LSS_Supported=0", "GroupMessaging=0", "FileName=joint_3.eds", "FileVersion=1",
        "FileRevision=1", "EdsVersion=4.0",
    } <= lines, lines  # fmt: skip
    rates = {10, 20, 50, 125, 250, 500, 800, 1000}
    assert {line for line in lines if line.startswith("BaudRate_") and line.endswith("1")} == {
        f"BaudRate_{rate}=1" for rate in rates
    }


@pytest.mark.parametrize(
    ("index", "subindex", "default"),
    [
        (0x1014, 0, 0x80), (0x1200, 1, 0x600), (0x1200, 2, 0x580), (0x1400, 1, 0x200), (0x1403, 1, 0x500),
        (0x1800, 1, 0x180), (0x1803, 1, 0x480),
    ],
)  # fmt: skip
def test_cob_ids_are_the_predefined_ones_of_any_node_id(eds, tmp_path, index, subindex, default):
    path = tmp_path / "joint_3.eds"
    path.write_text(eds)
    for node_id in (1, 127):
        found = canopen.import_od(str(path), node_id=node_id)[index]
        value = (found[subindex] if subindex else found).default
        assert value & 0x7FF == default + node_id


def test_objects_have_the_kind_access_and_limits_of_the_standard(eds, tmp_path):
    path = tmp_path / "joint_3.eds"
    path.write_text(eds)
    dictionary = canopen.import_od(str(path), node_id=9)
    records = {index for index in dictionary if isinstance(dictionary[index], canopen.objectdictionary.ODRecord)}
    assert {0x1018, 0x1200, 0x1400, 0x1403, 0x1600, 0x1800, 0x1A00, 0x1A03, 0x60C2} <= records
    assert not records & {0x1003, 0x1010, 0x1016, 0x607D, 0x608F, 0x60C1, 0x60FE}, "arrays"
    access = {index: dictionary[index].access_type for index in (0x6040, 0x6041, 0x6060, 0x605A, 0x1000)}
    assert access == {0x6040: "rww", 0x6041: "ro", 0x6060: "rww", 0x605A: "rw", 0x1000: "ro"}
    assert (dictionary[0x6007].min, dictionary[0x6007].max) == (0, 3)
    assert (dictionary[0x1005].min, dictionary[0x1005].max) == (None, None), "one value only is no range"
    assert not dictionary[0x605A].pdo_mappable
