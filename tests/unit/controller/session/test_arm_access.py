"""Opening an arm: the questions before a bus is opened, and the checks before anything is written to drives."""

import errno
import os
import pty
import re
import subprocess
import sys
import time
import uuid
from contextlib import nullcontext
from functools import partial
from importlib import resources

import can
import numpy as np
import pytest

from armload_controller.cli.arm_commands.commission_command import mounting_question
from armload_controller.config.robot import load_robot
from armload_controller.control_errors import ConfigurationError, UnsafeBus
from armload_controller.session import arm_access
from armload_controller.session.arm_access import (
    arm_on_bus,
    clock_from_now,
    open_arm,
    open_bus,
    require_rules,
    simulated_arm,
)
from armload_controller.session.session_load import SessionLoad
from armload_drivers.cia402.arm_settings import Identity
from armload_drivers.driver_errors import BusError, WrongDevice
from armload_drivers.simulation.drives.drive_dictionary import DriveTraits
from armload_drivers.simulation.drives.drives_on_bus import SimulatedDrives
from armload_identification.files.payload_file import write_payload
from armload_identification.model.payload import PayloadResult, Provenance
from tests.bounded import overheard
from tests.ideal_plant import IdealPlant

SDO_WRITES = {0x2F, 0x2B, 0x27, 0x23, 0x22, 0x21, 0x20}
"""First bytes of SDO download requests."""
FOREIGN = Identity(0x02DC, 0x1234_5678)
KEY = "identity = { vendor_id = 0x02DC, product_code = 0x12345678 }"

REAL_ARM = """
import sys, time
import can
from armload_controller.cli.arm_commands.commission_command import mounting_question
from armload_controller.config.robot import load_robot
from armload_drivers.simulation.drives.drive_dictionary import DriveTraits
from armload_drivers.simulation.drives.drives_on_bus import SimulatedDrives
from armload_drivers.simulation.plant_interface import StandingPlant

robot = load_robot(next(word for word in sys.argv if word.endswith(".toml")))
arm = robot.drives.settings
powered = []

class Plant(StandingPlant):
    def set_powered(self, axis, on):
        powered.extend([axis] if on else [])

plant = Plant(robot.simulation.start_rad)
traits = {drive.node_id: DriveTraits(identity=drive.identity) for drive in arm.drives}
from armload_controller.cli.entry import main
with can.Bus(interface="bench", channel="floor") as bus, SimulatedDrives(arm, plant, bus, time.monotonic, traits):
    try:
        main()
    finally:
        print("powered" if powered else "never powered", flush=True)
"""
"""The program with drives of another identity on a bus within this process."""


@pytest.fixture
def untuned(monkeypatch):
    """Skip real-time tuning: locking the memory of this large test process takes seconds; see `test_realtime`."""
    monkeypatch.setattr(arm_access, "tuned_for_cycles", lambda report: nullcontext())


@pytest.fixture
def bench(untuned):
    """prbt's drives on a virtual bus, one of them a foreign drive, and a listener."""
    robot = load_robot("prbt").with_bus(channel=uuid.uuid4().hex)
    arm = robot.drives.settings
    opened = [can.Bus(interface="virtual", channel=robot.bus.channel) for _ in range(2)]
    traits = {6: DriveTraits(identity=FOREIGN)}
    plant = IdealPlant(robot.simulation.plant_spec(None).start_position_rad, robot.limits.torque_max_nm)
    with SimulatedDrives(arm, plant, opened[0], time.monotonic, traits):
        yield robot, opened[1]
    for bus in opened:
        bus.shutdown()


@pytest.fixture
def named(tmp_path):
    """prbt's file with the identity of its drives, with changes by the test."""
    configs = resources.files("armload_configs")
    for role in ("identification", "validation"):
        name = f"prbt_{role}.toml"
        (tmp_path / name).write_text((configs / name).read_text("utf-8"))

    def named(*changes, key=KEY):
        text = re.sub(r"^(node_id = .*)$", rf"\1\n{key}", (configs / "prbt.toml").read_text("utf-8"), flags=re.M)
        for pattern, new in changes:
            text, count = re.subn(pattern, new, text, flags=re.MULTILINE | re.DOTALL)
            assert count
        path = tmp_path / "mine.toml"
        path.write_text(text)
        return path

    return named


def test_simulated_drives_need_not_catch_up_with_the_time_since_the_machine_was_switched_on():
    clock = clock_from_now()
    first_s = clock()
    assert 0.0 <= first_s < 5.0
    assert clock() >= first_s


def test_the_loaded_run_of_a_simulation_is_its_second(monkeypatch, named):
    """It has noise of its own and, of the harsh twin, 3 % more friction."""
    robot, specs = load_robot(str(named((r"^\[simulation\]$", '[simulation]\nvariant = "harsh"')))), []

    class Asked(Exception):
        pass

    def plant(spec):
        specs.append(spec)
        raise Asked

    monkeypatch.setattr(arm_access, "ArmPlant", plant)
    for load in (SessionLoad.UNLOADED, SessionLoad.LOADED):
        with pytest.raises(Asked), simulated_arm(robot, load):
            pass
    empty, loaded = specs
    assert (empty.payload, empty.friction_scale) == (None, 1.0)
    assert (loaded.payload.mass_kg, loaded.friction_scale) == pytest.approx((3.0, 1.03))
    assert loaded.seed == empty.seed + 1


@pytest.mark.parametrize("interface", ["socketcan", "pcan", "slcan"])
def test_drives_that_nobody_named_are_not_driven(interface):
    robot = load_robot("er50").with_bus(interface=interface, channel="can0")
    with pytest.raises(ConfigurationError, match=r"joints\[1\].drive.identity is missing.*--simulated-drives"):
        require_rules(robot, simulated_drives=False, attended=True)
    require_rules(robot, simulated_drives=True, attended=False)
    require_rules(load_robot("er50"), simulated_drives=False, attended=False)


def test_a_real_arm_needs_somebody_at_a_terminal(named):
    robot = load_robot(str(named())).with_bus(interface="socketcan", channel="can0")
    require_rules(robot, simulated_drives=False, attended=True)
    with pytest.raises(UnsafeBus, match="terminal, even with --yes"):
        require_rules(robot, simulated_drives=False, attended=False)


@pytest.mark.parametrize(
    ("pattern", "key"),
    [
        (r"^\[workspace\].*?(?=^\[\[body)", "workspace"),
        (r"^\[\[body.links\]\].*?(?=^\[excitation)", r"joints\[1\].arm_torque_share"),
    ],
)
def test_a_real_arm_needs_a_file_that_states_its_limits(named, pattern, key):
    robot = load_robot(str(named((pattern, "")))).with_bus(interface="socketcan", channel="can0")
    with pytest.raises(ConfigurationError, match=f"{key} is missing: a real arm"):
        require_rules(robot, simulated_drives=False, attended=True)


@pytest.mark.parametrize("opened", [arm_on_bus, partial(open_arm, load=SessionLoad.UNLOADED)])
def test_no_bus_is_opened_without_what_a_real_arm_needs(named, opened):
    """On the only way to a bus, whatever a command has checked before; this bus does not exist."""
    bus = {"interface": "socketcan", "channel": "none"}
    complete, incomplete = load_robot(str(named())).with_bus(**bus), load_robot("er50").with_bus(**bus)
    for robot, attended, refused in ((complete, False, UnsafeBus), (incomplete, True, ConfigurationError)):
        with pytest.raises(refused), opened(robot, report=print, simulated_drives=False, attended=attended):
            raise AssertionError("the arm was opened")


def test_what_the_configuration_accepts_is_reported(named):
    path = named((r"has_brake = true", "has_brake = false"), (r"(joint_1.*?)accept_missing = .*?\n", r"\1"))
    reported = load_robot(str(path)).drives.weak_points
    joints = ", ".join(f"prbt_joint_{number}" for number in range(2, 7))
    assert reported[0] == "prbt_joint_1 has no brake: it falls when torque is removed"
    assert reported[6] == f"{joints}: the drive's reaction to the loss of its master is unknown (accepted: master_lost)"
    assert not load_robot("er50").drives.weak_points


def test_a_foreign_drive_is_refused_before_anything_is_written(bench):
    robot, listener = bench
    opened = arm_on_bus(robot, print, simulated_drives=True, attended=False)
    with opened as servos, pytest.raises(WrongDevice, match="node 6"):
        servos.connect()
    for message in overheard(listener):
        assert message.arbitration_id != 0, f"NMT command {message}"
        if 0x600 < message.arbitration_id < 0x680:
            assert message.data[0] not in SDO_WRITES, f"SDO write {message}"


def test_the_arm_that_the_file_names_is_connected_and_known_to_be_real(named, untuned):
    robot = load_robot(str(named())).with_bus(channel=uuid.uuid4().hex)
    arm = robot.drives.settings
    traits = {drive.node_id: DriveTraits(identity=FOREIGN) for drive in arm.drives}
    plant = IdealPlant(robot.simulation.start_rad, robot.limits.torque_max_nm)
    with (
        can.Bus(interface="virtual", channel=robot.bus.channel) as bus,
        SimulatedDrives(arm, plant, bus, time.monotonic, traits),
        arm_on_bus(robot, print, simulated_drives=False, attended=True) as servos,
    ):
        servos.connect()
        assert not servos.simulated


@pytest.fixture
def at_a_terminal(tmp_path):
    """Run the program on a real arm, its input a terminal or not, and answer its first question."""
    program = tmp_path / "real_arm.py"
    program.write_text(REAL_ARM)
    plugin = tmp_path / "bench-1.dist-info"
    plugin.mkdir()
    (plugin / "METADATA").write_text("Metadata-Version: 2.1\nName: bench\nVersion: 1\n")
    (plugin / "entry_points.txt").write_text("[can.interface]\nbench = can.interfaces.virtual:VirtualBus\n")

    def at_a_terminal(words, answer):
        keyboard, terminal = pty.openpty()
        command = [sys.executable, str(program), *map(str, words), "--bus", "bench:floor"]
        os.write(keyboard, answer)
        its_input = terminal if answer else subprocess.DEVNULL
        done = subprocess.run(command, check=False, stdin=its_input, capture_output=True, text=True, timeout=60)
        os.close(keyboard)
        os.close(terminal)
        return done.returncode, done.stdout, done.stderr

    return at_a_terminal


def test_without_a_terminal_nothing_moves(named, at_a_terminal, tmp_path):
    status, printed, errors = at_a_terminal(["commission", named(), "-o", tmp_path / "run", "--yes"], b"")
    assert status == 1
    assert "an operator at a terminal" in errors
    assert "never powered" in printed
    assert not (tmp_path / "run").exists()


def test_an_operator_who_says_no_moves_nothing(named, at_a_terminal, tmp_path):
    path = named((r"has_brake = true", "has_brake = false"))
    status, printed, errors = at_a_terminal(["commission", path, "-o", tmp_path / "run"], b"n\n")
    assert status == 1, errors
    assert "not confirmed: nothing was moved" in errors
    assert "warning: prbt_joint_1 has no brake" in printed
    assert "never powered" in printed


@pytest.mark.parametrize(("said", "why"), [(b"", "an operator at a terminal"), (b"n\n", "not confirmed")])
def test_the_brakes_of_a_real_arm_are_tried_only_with_an_operators_consent(named, at_a_terminal, said, why):
    status, printed, errors = at_a_terminal(["drives", "check", named(), "--brakes"], said)
    assert status == 1
    assert why in errors
    assert "never powered" in printed


def test_brakes_are_only_spoken_of_if_every_axis_has_one(named):
    for changes, said in (((), True), (((r"has_brake = true", "has_brake = false"),), False)):
        assert ("the brakes are on" in mounting_question(load_robot(named(*changes)))) is said


def test_consent_beforehand_does_not_cover_a_payload(named, at_a_terminal, tmp_path):
    body = load_robot("prbt").simulation.payload("block")
    known, ones = np.ones(10, dtype=bool), np.ones(6)
    values = np.stack([body.values, body.values], axis=1)
    result = PayloadResult("flange", body, known, values, ones, ones, Provenance("0", "0", {}))
    write_payload(tmp_path / "payload.toml", result)
    words = ["feedforward", "trial", named(), tmp_path / "payload.toml", "--yes"]
    status, printed, errors = at_a_terminal(words, b"n\n")
    assert status == 1, errors
    assert "The arm will hold its position with torque on" in printed
    assert "never powered" in printed


@pytest.mark.parametrize(
    ("number", "remedy"),
    [(errno.EAFNOSUPPORT, "no CAN support loaded: try `modprobe can`"), (errno.ENODEV, "it is up")],
)
def test_why_a_bus_does_not_open_is_said_with_its_remedy(monkeypatch, number, remedy):
    def refuse(**_):
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(can, "Bus", refuse)
    with (
        pytest.raises(BusError, match=f"socketcan:can0 cannot be opened: .*{remedy}"),
        open_bus("socketcan", "can0", 500_000),
    ):
        pass


class Torn:
    """An adapter that cannot even be closed."""

    def shutdown(self):
        raise OSError(errno.EIO, "write failed")


def test_a_bus_that_cannot_be_closed_hides_no_error(monkeypatch):
    monkeypatch.setattr(can, "Bus", lambda **options: Torn())
    with pytest.raises(ZeroDivisionError) as raised, open_bus("virtual", "torn", 1_000_000):
        raise ZeroDivisionError
    assert "The bus could not be closed" in raised.value.__notes__[0]
    with pytest.raises(OSError, match="write failed"), open_bus("virtual", "torn", 1_000_000):
        pass
