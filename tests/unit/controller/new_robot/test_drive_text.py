"""`[bus]` and `[joints.drive]` of a first robot file, from nodes that answer, a description, or nothing."""

import re
import tomllib
from dataclasses import replace

import pytest

from armload_controller.config.robot import load_robot
from armload_controller.control_errors import ConfigurationError
from armload_controller.new_robot.drafted_file import DraftedFile
from armload_controller.new_robot.drive_drafts import BusDraft, DriveDraft, drives_found, nodes_described
from armload_controller.new_robot.drive_text import add_bus, add_drive
from armload_drivers.bring_up.inspection import FoundNode
from armload_drivers.cia402.arm_settings import Identity
from armload_drivers.cia402.eds_parser import parse_description
from armload_drivers.simulation.drives.drive_eds import drive_eds
from tests.drive_descriptions import eds, maker_drive


def node(node_id, drive=True):
    kind = 0x0002_0192 if drive else 0x0000_0191
    return FoundNode(node_id, kind, "", Identity(0x2DC, 7), (1, 7, 8), ("master_lost",) if drive else ())


def test_drives_that_answer_are_taken_in_the_order_of_their_nodes(drafted):
    drives = drives_found([node(3), node(9, drive=False), *map(node, (1, 5, 4, 2))], 5, None)
    _, file, path = drafted(bus=BusDraft(drives, "socketcan", "can1", 500_000, None, "as they answered"))
    text = path.read_text()
    assert re.findall(r"^node_id = (\d)$", text, re.MULTILINE) == list("12345")
    assert text.count("identity = { vendor_id = 0x000002DC, product_code = 0x00000007 }") == 5
    assert text.count('mode = "csp"') == 5
    assert '# accept_missing = ["master_lost"]' in text
    assert "joints[2].drive.has_brake" in file.holes
    with pytest.raises(ConfigurationError, match=r"joints\[1\]\.drive\.\w+ is 'FILL IN'"):
        load_robot(str(path))
    with pytest.raises(ConfigurationError, match=r"--scan is '2 CiA 402 drives \(nodes 1, 3\)': one per joint, 5"):
        drives_found([node(3), node(1)], 5, None)


def test_a_description_gives_objects_and_identity_and_with_the_holes_filled_the_file_is_taken(drafted, arm_settings):
    settings = arm_settings()
    described = parse_description(drive_eds(settings.drives[0], settings.cycle_s).encode(), "own.eds")
    drives = nodes_described(described, 5)
    assert [drive.node_id for drive in drives] == [1, 2, 3, 4, 5]
    assert drives[0].identity == Identity(described.vendor_id, described.product_code)
    _, file, path = drafted(bus=BusDraft(drives, "socketcan", "can0", 1_000_000, None, "from own.eds"))
    filled = path.read_text().replace('has_brake = "FILL IN"', "has_brake = true")
    path.write_text(re.sub(r'max_torque_permille = "FILL IN"', "max_torque_permille = 1000", filled))
    robot = load_robot(str(path))
    assert [drive.node_id for drive in robot.drives.settings.drives] == [1, 2, 3, 4, 5]
    assert {place.split(".")[-1] for place in file.holes} <= {"has_brake", "max_torque_permille"}


def test_what_a_description_says_about_sizes_and_a_vendor_alone_is_written(drafted):
    changes = {"60B2": {"DataType": "4"}, "6077": {"DataType": "4"}}
    drives = nodes_described(parse_description(eds(maker_drive(changes=changes), vendor=7).encode(), "own.eds"), 5)
    _, _, path = drafted(bus=BusDraft(drives, "socketcan", "can0", 1_000_000, None, "from own.eds"))
    text = path.read_text()
    for line in ("torque_offset_bits = 32", "effort_bits = 32", "identity = { vendor_id = 0x00000007 }"):
        assert text.count(line) == 5


def test_a_shipped_profile_of_the_vendor_is_a_comment(drafted):
    drives = nodes_described(parse_description(eds(maker_drive(), vendor=0xFB).encode(), "own.eds"), 5)
    _, _, path = drafted(bus=BusDraft(drives, "socketcan", "can0", 1_000_000, None, "from own.eds"))
    assert path.read_text().count('\n# profile = "maxon_epos4" is for maxon EPOS4; other products') == 5


# Line by line ----------------------------------------------------------------------------------------------------

KNOWN = DriveDraft(4, Identity(0x1AB, None), "ip", "torque", False, 1500, ())


def drive_lines(drive, joint=1, bus=None):
    file = DraftedFile()
    add_drive(file, joint, drive, bus)
    return file, file.text.splitlines()


def test_a_drive_that_is_known_leaves_only_its_brake_open():
    file, _ = drive_lines(KNOWN)
    assert file.holes == ["joints[2].drive.has_brake"]
    table = tomllib.loads(file.text)["joints"]["drive"]
    assert table == {
        "node_id": 4,
        "mode": "ip",
        "feedback": "torque",
        "max_torque_permille": 1500,
        "following_error_rad": 0.1,
        "has_brake": "FILL IN",
        "torque_offset": False,
        "identity": {"vendor_id": 0x1AB},
    }
    assert not file.unchecked


def test_a_torque_offset_is_mentioned_only_where_there_is_none():
    for has in (True, None):
        assert "torque_offset" not in drive_lines(replace(KNOWN, torque_offset=has))[0].text


def test_a_drive_of_which_nothing_is_known_is_all_holes():
    file, _ = drive_lines(DriveDraft(1, None, None, None, None, None, ()), joint=0)
    assert file.holes == [f"joints[1].drive.{key}" for key in ("mode", "feedback", "max_torque_permille", "has_brake")]
    assert "identity" not in file.text


def test_without_a_drive_the_template_is_a_comment_and_no_hole():
    file, lines = drive_lines(None, joint=2)
    assert file.holes == []
    assert all(line.startswith("# ") for line in lines if line)
    assert not any(line.startswith("# #") for line in lines)
    assert "# node_id = 3" in lines
    assert tomllib.loads(file.text) == {}


def test_currents_need_a_gear_ratio_and_a_torque_constant_of_the_joint():
    file, lines = drive_lines(replace(KNOWN, feedback="current"))
    assert file.holes[1:] == ["joints[2].gear_ratio", "joints[2].torque_constant_nm_a"]
    assert lines.index("[joints.drive]") == 2, "they belong to the joint"


def test_missing_safety_is_said_once_for_all_drives():
    for joint, said in ((0, 1), (1, 0)):
        file, lines = drive_lines(replace(KNOWN, missing=("master_lost", "stop_ramp")), joint=joint)
        assert any(line.startswith('# accept_missing = ["master_lost", "stop_ramp"]') for line in lines)
        assert len(file.unchecked) == said


def test_a_description_is_named_with_its_file():
    bus = BusDraft((), "socketcan", "can0", 1_000_000, "own.eds", "")
    assert 'description = "own.eds"' in drive_lines(KNOWN, bus=bus)[1]
    assert "description =" not in drive_lines(KNOWN, bus=replace(bus, description=None))[0].text


@pytest.mark.parametrize("twin", [False, True])
def test_a_bus_is_a_template_unless_it_is_known_or_simulated(twin):
    file = DraftedFile()
    add_bus(file, "five", None, twin=twin)
    (said,) = file.unchecked
    if twin:
        assert tomllib.loads(file.text)["bus"]["bitrate"] == 1_000_000
        assert "nothing real moves" in said
    else:
        assert tomllib.loads(file.text) == {}
        assert '# channel = "can0"' in file.text
        assert said.startswith("drives: a template in comments")
    file = DraftedFile()
    add_bus(file, "five", BusDraft((), "pcan", "PCAN_USBBUS1", 500_000, None, "as they answered"), twin=False)
    bus = tomllib.loads(file.text)["bus"]
    assert (bus["interface"], bus["channel"], bus["bitrate"], bus["cycle_hz"]) == (
        "pcan",
        "PCAN_USBBUS1",
        500_000,
        100.0,
    )
    assert bus["max_missing_cycles"] == 3
    assert file.unchecked == ["drives: as they answered; the order of the nodes is assumed, lowest at the base"]
