"""`[bus]` and `[joints.drive]` of a robot file, as passed to the drivers."""

import math
from importlib import resources

import pytest

from armload_controller.config.drive_profiles import (
    own_profiles,
    profile_hint,
    profiles_of_vendor,
    shipped_profiles,
    with_profiles,
)
from armload_controller.config.robot import load_robot
from armload_controller.config.tables.drive_tables import BusTable, PartTable
from armload_controller.control_errors import ConfigurationError
from armload_drivers.cia402.arm_settings import OperationMode
from armload_drivers.cia402.object_dictionary import DataType
from armload_identification.storage.strict_toml import BadValue

EDS = """\
[DeviceInfo]
VendorNumber=0x1AB
[6040]
ParameterName=Controlword
DataType=0x6
AccessType=rww
"""


@pytest.fixture
def edited(tmp_path):
    """A copy of er50 without simulation and excitations, with a text replaced once."""
    text = (resources.files("armload_configs") / "er50.toml").read_text("utf-8")

    def make(old="", new="", twin=False):
        assert old in text
        changed = text.replace(old, new, 1)
        changed = "\n".join(
            line
            for line in changed.splitlines()
            if not line.startswith(("identification =", "validation =", "[excitation]"))
        )
        if not twin:
            changed = changed[: changed.index("[simulation]")]
        path = tmp_path / "arm.toml"
        path.write_text(changed)
        (tmp_path / "drive.eds").write_text(EDS)
        (tmp_path / "broken.eds").write_text("nonsense")
        return str(path)

    return make


def drive(path, axis=0):
    return load_robot(path).drives.settings.drives[axis]


def test_a_scale_may_be_left_to_a_real_drive(edited):
    settings = drive(edited("rated_current_a = 10.0", ""))
    assert settings.rated_current_a is None
    assert settings.gear_ratio == 120
    assert settings.counts_per_rad == pytest.approx(120 * 2**17 / (2 * math.pi))
    with pytest.raises(ConfigurationError, match=r"drive\.rated_current_a.*a simulated drive needs its scale"):
        load_robot(edited("rated_current_a = 10.0", "", twin=True))


def test_a_vendors_object_for_the_effort(edited):
    table = 'effort_object = { index = 0x30D1, subindex = 2, type = "i32", a_per_unit = 0.001 }'
    effort = drive(edited("has_brake = true", "has_brake = true\n" + table)).vendor_effort
    assert (effort.index, effort.subindex, effort.type, effort.per_unit) == (0x30D1, 2, DataType.I32, 0.001)


def test_a_vendors_object_for_a_temperature(edited):
    table = 'temperature_object = { index = 0x3201, subindex = 1, type = "i16", celsius_per_unit = 0.1 }'
    read = drive(edited("has_brake = true", "has_brake = true\n" + table)).temperature
    assert (read.index, read.subindex, read.type, read.per_unit) == (0x3201, 1, DataType.I16, 0.1)
    assert drive(edited()).temperature is None


def test_what_a_drive_may_lack_is_named(edited):
    settings = drive(edited("has_brake = true", 'has_brake = true\naccept_missing = ["quick_stop", "master_lost"]'))
    assert settings.accept_missing == {"quick_stop", "master_lost"}


def test_a_device_description_beside_the_file(edited):
    settings = drive(edited("has_brake = true", 'has_brake = true\ndescription = "drive.eds"'))
    assert settings.description.vendor_id == 0x1AB


def test_the_bus(edited):
    arm = load_robot(edited("[bus]", "[bus]\nsync_counter = 10\nother_nodes = [20]")).drives.settings
    assert (arm.sync_counter, arm.other_nodes) == (10, {20})


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (
            "has_brake = true",
            'has_brake = true\naccept_missing = ["brakes"]',
            "expected names of torque_limit, master_lost",
        ),
        ("has_brake = true", 'has_brake = true\naccept_missing = ["605a"]', '605A belongs to "quick_stop"'),
        ("has_brake = true", 'has_brake = true\ndescription = "missing.eds"', "cannot be read"),
        ("has_brake = true", 'has_brake = true\ndescription = "broken.eds"', "no section describes an object"),
        (
            "has_brake = true",
            'has_brake = true\neffort_object = { index = 0x30D1, subindex = 2, type = "i32" }',
            "give one scale",
        ),
        (
            "has_brake = true",
            'has_brake = true\neffort_object = { index = 0x30D1, subindex = 2, type = "i32", nm_per_unit = 0.1 }',
            "needs effort_object.a_per_unit",
        ),
        ("[bus]", "[bus]\nsync_counter = 1", "2 to 240"),
        ("[bus]", "[bus]\nother_nodes = [200]", "127"),
    ],
)
def test_what_is_wrong_is_named(edited, old, new, words):
    with pytest.raises(ConfigurationError) as raised:
        load_robot(edited(old, new))
    assert words in str(raised.value)


# Profiles ---------------------------------------------------------------------------------------------------


PROFILE = """\
[product]
name = "Some Drive"
source = "its manual"
peculiarities = ["it hums"]

[drive]
mode = "ip"
torque_offset_bits = 32
effort_object = { index = 0x2100, subindex = 1, type = "i16", a_per_unit = 0.01 }
"""


@pytest.mark.parametrize("name", shipped_profiles())
def test_every_shipped_profile_can_be_used_and_accepts_nothing(edited, name):
    path = edited('mode = "csp"  # assumed\nfeedback = "current"  # assumed\n', f'profile = "{name}"\n')
    robot = load_robot(path)
    assert robot.drives.profiles["joint_1"].product.name
    assert robot.drives.peculiarities
    assert not robot.drives.settings.drives[0].accept_missing
    assert not robot.drives.settings.drives[0].torque_limit_in_drive


def test_the_four_products_are_shipped():
    assert set(shipped_profiles()) == {"elmo_gold", "maxon_epos4", "pilz_prbt", "roboteq"}


def test_a_vendors_shipped_profiles_are_a_hint():
    assert profiles_of_vendor(0xFB) == {"maxon_epos4": "maxon EPOS4"}
    assert profile_hint(0xFB) == (
        'profile = "maxon_epos4" is for maxon EPOS4; other products of this vendor (0x000000FB) need their own'
    )
    assert not profiles_of_vendor(7)
    assert profile_hint(None) == profile_hint(7) == "", "the profile without a vendor id is nobody's"


def test_fixed_pdos(edited):
    key = "fixed_pdos = {{ rpdo1 = [{}], tpdo2 = [0x60640020, 0x60410010, 0x60780010] }}\n"
    made = drive(edited('mode = "csp"', key.format("0x607A0020, 0x60B20010, 0x60400010") + 'mode = "csp"'))
    assert [(pdo.key, len(pdo.mapping)) for pdo in made.fixed_pdos] == [("rpdo1", 3), ("tpdo2", 3)]
    for words, what in (
        ("0x607A0020", "fixed_pdos.*none of rpdo1 carries 6040:0 and 607A:0"),
        ("-1", "fixed_pdos"),
    ):
        with pytest.raises(ConfigurationError, match=what):
            load_robot(edited('mode = "csp"', key.format(words) + 'mode = "csp"'))
    with pytest.raises(ConfigurationError, match="rpdo5"):
        load_robot(edited('mode = "csp"', 'fixed_pdos = { rpdo5 = [] }\nmode = "csp"'))


def test_the_robots_own_keys_go_before_the_profiles(edited, tmp_path):
    (tmp_path / "mine.toml").write_text(PROFILE)
    settings = drive(edited('mode = "csp"', 'profile = "mine.toml"\nmode = "csp"'))
    assert settings.mode is OperationMode.CYCLIC_SYNCHRONOUS_POSITION
    assert settings.torque_offset_bits == 32
    assert settings.vendor_effort.index == 0x2100
    assert drive(str(tmp_path / "arm.toml"), 1).torque_offset_bits == 16, "the other joints name no profile"


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("mine.toml", PROFILE + 'accept_missing = ["master_lost"]\n', "mine.toml"),
        ("mine.toml", PROFILE.replace("32", "24"), "torque_offset_bits"),
        (
            "other.toml",
            PROFILE,
            "expected a shipped profile, elmo_gold, maxon_epos4, pilz_prbt, roboteq, or a TOML file",
        ),
    ],
)
def test_what_is_wrong_with_a_profile_is_named(edited, tmp_path, name, text, words):
    (tmp_path / "mine.toml").write_text(text)
    with pytest.raises(ConfigurationError, match=words):
        load_robot(edited('mode = "csp"', f'profile = "{name}"\nmode = "csp"'))


def test_a_vendors_setting(edited):
    line = 'vendor_settings = [{ index = 0x3001, subindex = 2, type = "u32", value = 5000, meets = "torque_limit" }]'
    (setting,) = drive(edited("has_brake = true", f"has_brake = true\n{line}")).vendor_settings
    assert (setting.entry.index, setting.entry.subindex, setting.value, setting.meets) == (
        0x3001,
        2,
        5000,
        "torque_limit",
    )
    for old, new, words in (
        ("torque_limit", "torque", "expected one of torque_limit"),
        ("5000", "-1", "0 to 4294967295"),
    ):
        with pytest.raises(ConfigurationError, match=words):
            load_robot(edited("has_brake = true", f"has_brake = true\n{line.replace(old, new)}"))


TIMES = {"bitrate": 500_000, "cycle_hz": 100.0, "heartbeat_s": 0.1, "max_missing_cycles": 1}


def test_an_arm_is_moved_to_another_bus_or_to_two():
    one = BusTable(interface="virtual", channel="x", **TIMES)
    assert (one.address, one.in_virtual_time) == ("virtual:x", True)
    assert one.elsewhere("socketcan", "can0,can1") == {"interface": "socketcan", "channel": "can0,can1"}
    parts = {name: PartTable(interface="socketcan", channel=f"can{number}") for number, name in enumerate("ab")}
    two = BusTable(**parts, **TIMES)
    assert (two.address, two.in_virtual_time) == ("socketcan:can0 and socketcan:can1", False)
    assert two.elsewhere("virtual", "x,y") == {
        "a": {"interface": "virtual", "channel": "x"},
        "b": {"interface": "virtual", "channel": "y"},
    }
    for channels in ("x", "x,y,z"):
        with pytest.raises(BadValue, match="two channels, such as can0,can1"):
            two.elsewhere("virtual", channels)


@pytest.mark.parametrize(
    ("buses", "said"),
    [
        ({"interface": "socketcan"}, "channel"),
        ({"channel": "can0"}, "interface"),
        ({"a": PartTable(interface="socketcan", channel="can0")}, "two buses has"),
        ({"b": PartTable(interface="socketcan", channel="can0")}, "two buses has"),
        (
            {
                "a": PartTable(interface="socketcan", channel="can0"),
                "b": PartTable(interface="socketcan", channel="can0"),
            },
            "two channels of one interface",
        ),
        (
            {
                "a": PartTable(interface="socketcan", channel="can0"),
                "b": PartTable(interface="virtual", channel="can1"),
            },
            "two channels of one interface",
        ),
        (
            {
                "a": PartTable(interface="virtual", channel="x"),
                "b": PartTable(interface="virtual", channel="y"),
                "channel": "z",
            },
            "channel.* states it in",
        ),
    ],
)
def test_an_arm_is_on_one_bus_or_on_two_channels(buses, said):
    with pytest.raises(BadValue, match=said):
        BusTable(**buses, cycle_hz=100.0, max_missing_cycles=1)


def test_a_files_own_profiles_are_those_named_with_their_suffix_each_once():
    shipped = shipped_profiles()[0]
    drives = ["own.toml", "own.toml", shipped, "packaged", 3, "other.toml"]
    joints = [*({"drive": {"profile": profile}} for profile in drives), {"drive": 4}, {}, 5]
    assert own_profiles({"joints": joints}) == ("own.toml", "other.toml")
    assert own_profiles({"joints": 7}) == own_profiles({}) == ()


def test_what_is_not_a_table_of_a_joint_is_left_to_the_check_of_the_file(tmp_path):
    values = {"joints": [5, {"drive": 4}, {"drive": {"profile": 3}}, {}], "robot": {"a": 1}}
    assert with_profiles(values, tmp_path, "arm.toml") == values
    assert with_profiles({"joints": 7}, tmp_path, "arm.toml") == {"joints": 7}
