"""`armload drives` from its user's view: scans, checks, resets and assignments."""

import re
from contextlib import nullcontext
from importlib import resources

import pytest

from armload_controller.session import arm_access
from armload_drivers.bring_up import drive_store
from armload_drivers.bring_up.inspection import FoundNode
from armload_drivers.canopen import node_assignment
from armload_drivers.canopen.lss_master import LssAddress
from armload_drivers.cia402.arm_settings import Identity


def test_a_check_that_finds_something_names_the_shipped_profiles_of_the_vendor(armload, tmp_path):
    text = (resources.files("armload_configs") / "er50.toml").read_text("utf-8")
    text = re.sub(r"^(node_id = .*)$", r"\1\nidentity = { vendor_id = 0xFB }", text, flags=re.MULTILINE)
    path = tmp_path / "arm.toml"
    path.write_text(re.sub(r"(?ms)^\[excitation\].*?(?=^\[)", "", text))
    for named, told in (("", 1), ('profile = "maxon_epos4"\n', 0)):
        path.write_text(path.read_text().replace("[joints.drive]\n", f"[joints.drive]\n{named}"))
        result = armload("drives", "check", str(path))
        assert result.exit_code == 1
        assert result.output.count('profile = "maxon_epos4" is for maxon EPOS4') == told
    assert "profile" not in armload("drives", "check", "er50").output


def test_a_check_fits_100_columns_also_in_a_file(armload):
    """One of prbt's remarks is longer."""
    lines = armload("drives", "check", "prbt", columns=0).output.splitlines()
    assert any("event timer" in line for line in lines)
    assert max(map(len, lines)) <= 100


@pytest.mark.parametrize("text", ["can0", ":can0", "socketcan:"])
@pytest.mark.parametrize("command", ["commission er50 --bus", "drives check er50 --bus", "drives scan"])
def test_an_address_of_a_bus_has_two_parts(armload, command, text):
    result = armload(*command.split(), text)
    assert result.exit_code == 2
    assert "expected INTERFACE:CHANNEL, such as socketcan:can0" in result.output


# What is refused before anything is sent, and what is asked ----------------------------------------------------------


def test_a_virtual_bus_is_not_scanned(armload):
    assert "no nodes outside this process" in str(armload("drives", "scan", "virtual:x").exception)


def test_a_bus_without_nodes_is_said_and_refused(armload, monkeypatch):
    monkeypatch.setattr(arm_access, "nodes_on", lambda interface, channel, bitrate: [])
    result = armload("drives", "scan", "socketcan:can7", "--bitrate", "500000")
    assert result.exit_code == 1
    assert "no node answers on socketcan:can7 at 500000 bit/s" in result.output


def test_nodes_are_listed_and_the_profiles_of_their_vendors_named_once(armload, monkeypatch):
    nodes = [FoundNode(k, 0x0002_0192, "drive", Identity(0xFB, 7), (8,), ()) for k in (1, 2)]
    monkeypatch.setattr(arm_access, "nodes_on", lambda interface, channel, bitrate: nodes)
    result = armload("drives", "scan", "socketcan:can7")
    assert result.exit_code == 0
    assert result.output.count('profile = "maxon_epos4"') == 1


def test_a_sound_arm_has_nothing_left_and_a_status_is_printed_once(armload):
    result = armload("drives", "check", "er50")
    assert result.exit_code == 0, result.output
    assert re.search(r"all \d+ steps are ok", result.output)
    result = armload("drives", "show", "er50", "--once")
    assert result.exit_code == 0
    assert result.output.count("joint_6") == 1


def test_a_joint_that_there_is_not_is_named_with_those_that_are(armload):
    result = armload("drives", "reset", "er50", "joint_9", "--yes")
    assert "one of: joint_1, joint_2" in str(result.exception)
    assert "No reset is required" in str(armload("drives", "reset", "er50", "joint_2", "--yes").exception)


def test_settings_are_stored_on_request(armload, monkeypatch):
    asked = []
    monkeypatch.setattr(drive_store, "store", lambda bring_up, confirm: asked.append(confirm("store?")) or asked[-1])
    result = armload("drives", "store", "er50", "--yes")
    assert result.exit_code == 0
    assert "stored: joint_1, joint_2" in result.output
    assert asked == [True]
    monkeypatch.setattr(drive_store, "store", lambda bring_up, confirm: False)
    assert "not confirmed: nothing was stored" in str(armload("drives", "store", "er50", "--yes").exception)


@pytest.fixture
def assigned(monkeypatch):
    """What nodes are given, on a bus that is not there."""
    given = []

    def assign(bus, node_id, bitrate, address, confirm):
        given.append((node_id, bitrate, address))
        return LssAddress(1, 2, 3, 4) if confirm("?") else None

    monkeypatch.setattr(arm_access, "open_bus", lambda interface, channel, bitrate: nullcontext())
    monkeypatch.setattr(node_assignment, "assign_node", assign)
    return given


def test_a_node_is_given_its_id_and_rate_by_its_identity(armload, assigned):
    words = ("drives", "assign", "socketcan:can0", "--node-id", "5", "--yes")
    result = armload(*words, "--new-bitrate", "500000", "--identity", "0x2DC:1:0x10000:4294967295")
    assert result.exit_code == 0, result.output
    assert result.output.strip().endswith(": node id 5")
    assert armload(*words).exit_code == 0
    assert assigned == [(5, 500_000, LssAddress(0x2DC, 1, 0x10000, 0xFFFF_FFFF)), (5, None, None)]


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--new-bitrate", "123"), "123: expected one of"),
        (("--identity", "1:2:3"), "expected four numbers of 32 bits"),
        (("--identity", "1:2:3:x"), "expected four numbers of 32 bits"),
        (("--identity", "1:2:3:4294967296"), "expected four numbers of 32 bits"),
        (("--identity", "1:2:3:-1"), "expected four numbers of 32 bits"),
    ],
)
def test_a_node_is_not_given_what_makes_no_sense(armload, assigned, options, said):
    result = armload("drives", "assign", "socketcan:can0", "--node-id", "5", "--yes", *options)
    assert result.exit_code == 2
    assert said in " ".join(result.output.split())
    assert not assigned
