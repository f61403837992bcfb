"""`[bus]` of an arm on EtherCAT."""

import pytest

from armload_controller.config.robot import load_robot
from armload_controller.control_errors import ConfigurationError, UnsafeBus
from armload_controller.session.arm_access import bus_of, open_bus
from armload_drivers.cia402.arm_settings import Fieldbus
from tests.ethercat_drives import er50_text


@pytest.fixture
def load(tmp_path):
    def load(change=lambda text: text):
        text = er50_text("eth1").split("[excitation]")
        text = text[0] + text[1].split('validation = "er50_validation.toml"')[1]
        path = tmp_path / "er50_ethercat.toml"
        path.write_text(change(text))
        return load_robot(str(path))

    return load


def test_the_bus_and_its_watchdog_reach_the_drivers(load):
    arm = load().drives.settings
    assert arm.fieldbus is Fieldbus.ETHERCAT
    assert arm.watchdog_s == 2.0
    assert [drive.node_id for drive in arm.drives] == [1, 2, 3, 4, 5, 6]


@pytest.mark.parametrize(
    ("old", "new", "key"),
    [
        ("watchdog_s = 2.0", "", "watchdog_s"),
        ("watchdog_s = 2.0", "watchdog_s = 0.01", "watchdog_s"),
        ("watchdog_s = 2.0", "watchdog_s = 2.0\nbitrate = 1000000", "bitrate"),
        ("watchdog_s = 2.0", "watchdog_s = 2.0\nheartbeat_s = 0.1", "heartbeat_s"),
        ('interface = "ethercat"', 'interface = "socketcan"', "bitrate"),
    ],
)
def test_keys_of_the_other_bus_are_refused_by_name(load, old, new, key):
    with pytest.raises(ConfigurationError, match=rf"bus\.{key}"):
        load(lambda text: text.replace(old, new))


def test_what_works_on_canopen_only_says_so(load):
    with pytest.raises(UnsafeBus, match="CANopen only"), bus_of(load()):
        pass
    with pytest.raises(UnsafeBus, match="CANopen only"), open_bus("ethercat", "eth1", 1_000_000):
        pass
