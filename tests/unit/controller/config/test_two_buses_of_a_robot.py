"""`[bus.a]` and `[bus.b]`: which joints are where, and what is refused."""

from importlib import resources

import pytest

from armload_controller.config.robot import load_robot
from armload_controller.control_errors import ConfigurationError
from armload_controller.session.arm_access import bus_of, simulated_arm
from armload_controller.session.session_load import SessionLoad
from armload_drivers.bus.joined_bus import JoinedBus

SINGLE = 'interface = "virtual"\nchannel = "armload-er50"\n'
PARTS = '\n[bus.a]\ninterface = "virtual"\nchannel = "left"\n\n[bus.b]\ninterface = "virtual"\nchannel = "right"\n'


@pytest.fixture
def two_buses(tmp_path):
    """Makes er50 with joints 4 to 6 on a second bus, with a change of the text."""
    shipped = resources.files("armload_configs")
    for name in ("er50_identification.toml", "er50_validation.toml"):
        (tmp_path / name).write_text(shipped.joinpath(name).read_text("utf-8"))

    def make(old="", new=""):
        text = shipped.joinpath("er50.toml").read_text("utf-8")
        assert SINGLE in text
        text = text.replace(SINGLE, "").replace(
            "max_missing_cycles = 3  # assumed\n", f"max_missing_cycles = 3\n{PARTS}"
        )
        for node in (4, 5, 6):
            text = text.replace(f"node_id = {node}  # assumed\n", f'node_id = {node}\nbus = "b"\n')
        assert old in text
        path = tmp_path / "two.toml"
        path.write_text(text.replace(old, new) if old else text)
        return load_robot(str(path))

    return make


def test_joints_are_on_the_bus_that_they_name(two_buses):
    robot = two_buses()
    assert [drive.bus for drive in robot.drives.settings.drives] == [0, 0, 0, 1, 1, 1]
    assert robot.bus.address == "virtual:left and virtual:right"
    assert robot.bus.in_virtual_time


def test_the_command_line_gives_a_channel_for_each(two_buses):
    robot = two_buses().with_bus("socketcan", "can0,can1")
    assert robot.bus.address == "socketcan:can0 and socketcan:can1"
    assert not robot.bus.in_virtual_time
    with pytest.raises(ConfigurationError, match="two buses: expected two channels, such as can0,can1"):
        two_buses().with_bus("socketcan", "can0")


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('[bus.b]\ninterface = "virtual"\nchannel = "right"\n', "", r"bus\.b.*an arm on two buses has"),
        ('[bus.b]\ninterface = "virtual"\n', '[bus.b]\ninterface = "socketcan"\n', "two channels of one interface"),
        ('channel = "right"', 'channel = "left"', "two channels of one interface"),
        (PARTS, "", r"bus\.interface.*required, or \[bus\.a\] and \[bus\.b\]"),
        (PARTS, SINGLE, r"drive\.bus.*the file has one bus"),
        ('bus = "b"\n', "", "put joints on both"),
        ("[bus]\n", '[bus]\nchannel = "x"\n', r"bus\.channel.*states it in"),
    ],
)
def test_what_is_wrong_is_named(two_buses, old, new, said):
    with pytest.raises(ConfigurationError, match=said):
        two_buses(old, new)


def test_the_simulated_arm_moves_on_two_wires(two_buses):
    with simulated_arm(two_buses(), SessionLoad.UNLOADED) as servos:
        servos.connect()
        here = servos.enable().position_rad
        servos.stop()
        servos.disable()
        assert servos.standing_rad() == pytest.approx(here, abs=1e-3)


def test_both_are_opened_and_closed(two_buses):
    robot = two_buses()
    with bus_of(robot) as bus:
        assert isinstance(bus, JoinedBus)
        assert len(bus.parts) == 2
