"""Faults of an EtherCAT line of six drives; run with `python -m tests.ethercat_drives large`.

Every fault ends in the stop that `stop_decisions` names, and without torque, or the error says that torque may remain.
"""

import json
import socket
import struct
import subprocess
import sys
import time
from contextlib import ExitStack, closing, suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from armload_controller.cycle.stop_decisions import Cause, StopCategory, cause_of
from armload_drivers.bring_up.drive_check import Verdict, check, reset
from armload_drivers.cia402.arm_settings import SIMULATION_IDENTITY, EffortFeedback, Fieldbus, Identity
from armload_drivers.cia402.drive_safety import SYNC_MANAGER_WATCHDOG_US
from armload_drivers.cia402.state_machine import POWERED, State, state_in
from armload_drivers.cia402.timeouts import Timeouts
from armload_drivers.driver_errors import BusError, CommandError, DriverError, ForeignMaster, TorqueRemains, WrongDevice
from armload_drivers.ethercat.ethercat_bring_up import EthercatBringUp, open_bring_up
from armload_drivers.ethercat.ethercat_line import LineState, open_line
from armload_drivers.ethercat.ethercat_servos import EthercatServos
from armload_drivers.servos import JointCommand
from tests.ideal_plant import IdealPlant
from tests.lockstep_line import (
    UNDER_IT,
    WHY,
    LockstepLine,
    PlantBehindDrives,
    VirtualFrames,
    drive_states,
    interface,
    order,
)

pytestmark = [pytest.mark.ethercat, pytest.mark.skipif(not UNDER_IT, reason=WHY)]

ROOT = Path(__file__).parents[2]
N = 6
ZERO = np.zeros(N)
CYCLE_S = 0.002
SPEED_RAD_S = 0.5
LOST_PATIENCE_S = 0.05
IMPATIENT = Timeouts(sdo_s=0.2, boot_s=1.0)
"""Waits for drives that do not answer take real time."""


def powered():
    """Which drives carry torque, as they know it."""
    return [state_in(drive["statusword"]) in POWERED for drive in drive_states()]


class Arm:
    """Six drives and a plant.

    Args:
        settings: The arm's settings.
        stack: Closes everything.
        patience_s: Longest wait for a frame.
    """

    def __init__(self, settings, stack, patience_s):
        self.settings = settings
        self.plant = IdealPlant(np.zeros(N), np.full(N, 10.0))
        self.line = stack.enter_context(
            closing(LockstepLine(PlantBehindDrives(self.plant, settings, settings.cycle_s), patience_s))
        )
        self.servos = EthercatServos(settings, self.line, VirtualFrames(), IMPATIENT)
        self.target_rad = ZERO

    def enable(self):
        self.servos.connect()
        self.target_rad = self.servos.enable().position_rad

    def hold(self, cycles=1):
        for _ in range(cycles):
            feedback = self.servos.exchange(JointCommand(self.target_rad, ZERO, ZERO))
        return feedback

    def hold_in_real_time(self, time_s):
        """Requests beside the cycle take real time."""
        end_s = time.monotonic() + time_s
        while time.monotonic() < end_s:
            self.hold()
            time.sleep(self.settings.cycle_s)

    def move(self, cycles, offset_nm=ZERO):
        for _ in range(cycles):
            self.target_rad = self.target_rad + SPEED_RAD_S * self.settings.cycle_s
            feedback = self.servos.exchange(JointCommand(self.target_rad, ZERO, offset_nm))
        return feedback

    def fails(self, cause, cycles=2000):
        """Move until it fails for this cause, and stop as the table says; the error."""
        with pytest.raises(DriverError) as raised:
            self.move(cycles)
        assert cause_of(raised.value) is cause, raised.value
        return raised.value

    def stop(self, cause):
        """Stop and disable; the error of what could not be done, if any."""
        error = None
        steps = {StopCategory.TORQUE_OFF: (self.servos.disable,)}.get(
            cause.category, (self.servos.stop, self.servos.disable)
        )
        for step in steps:
            try:
                step()
            except DriverError as problem:
                error = problem
        return error


@pytest.fixture
def settings(arm_settings):
    """Six axes at 500 Hz."""
    small = arm_settings(cycle_s=CYCLE_S, feedback=EffortFeedback.TORQUE, rated_current_a=None)
    drives = tuple(replace(small.drives[0], joint=f"joint_{k}", node_id=k) for k in range(1, N + 1))
    return replace(small, drives=drives, coupling=np.eye(N), fieldbus=Fieldbus.ETHERCAT, watchdog_s=2.0)


@pytest.fixture
def make_arm(settings):
    with ExitStack() as stack:

        def make(patience_s=1.0, **changes):
            arm = Arm(replace(settings, **changes), stack, patience_s)
            stack.callback(lambda: suppress_errors(arm.servos.close))
            return arm

        yield make
        order("lose 0")  # in virtual time, closing would wait in real time for every lost frame
    recover(settings)


def suppress_errors(action):
    with suppress(DriverError):
        action()


def recover(settings):
    """Mend everything that a test has broken."""
    order("lose 0")
    for number in range(N):
        order(f"thaw {number}")
        order(f"heal {number}")
    comes_to_be_without_torque()
    for number, drive in enumerate(drive_states()):
        if state_in(drive["statusword"]) is State.FAULT:
            plant = PlantBehindDrives(IdealPlant(np.zeros(N), np.zeros(N)), settings, settings.cycle_s)
            with closing(LockstepLine(plant)) as line:
                line.find()
                bring_up = EthercatBringUp(settings, line, VirtualFrames())
                reset(bring_up, f"joint_{number + 1}", lambda question: True)


def comes_to_be_without_torque(within_s=5.0):
    """A drive that hung obeys what it was told before; its watchdog acts within 2 s, or as it was set.

    The drives run in a process of their own, which a busy machine may schedule late.
    """
    end_s = time.monotonic() + within_s
    while any(powered()) and time.monotonic() < end_s:
        time.sleep(0.05)
    assert not any(powered())


def test_ten_thousand_cycles_of_csp(make_arm):
    """No working counter is wrong, the torque offset arrives, and every position is reached."""
    arm = make_arm()
    arm.enable()
    start_rad, period = arm.target_rad, 2.0
    for cycle in range(10_000):
        arm.target_rad = start_rad + 0.1 * (1 - np.cos(2 * np.pi * cycle * CYCLE_S / period))
        feedback = arm.servos.exchange(JointCommand(arm.target_rad, ZERO, np.full(N, -7.4)))
        assert not feedback.missing.any()
    cycle = arm.servos._ethercat_cycle
    assert (cycle.wrong, cycle.lost) == (0, 0)
    assert [arm.plant.torque_offset_nm[axis] for axis in range(N)] == pytest.approx([-7.4] * N)
    assert [int.from_bytes(arm.line.upload(k, 0x60B2, 0, 0.5), "little", signed=True) for k in range(N)] == [-37] * N
    assert arm.servos.take_remarks() == ()
    arm.servos.close()
    assert not any(powered())


def test_a_frame_in_which_a_drive_takes_no_part_is_survived_and_reported(make_arm):
    arm = make_arm()
    arm.enable()
    order("wkc 3 2")
    missing = [arm.move(1).missing for _ in range(100)]
    assert sum(row.all() for row in missing) == sum(row.any() for row in missing) == 2, "nothing of them is trusted"
    (remark,) = arm.servos.take_remarks()
    assert "2 of" in remark
    assert "working counter" in remark
    assert arm.servos.take_remarks() == ()


def test_a_drive_that_takes_no_part_for_long_stops_the_arm(make_arm):
    arm = make_arm()
    arm.enable()
    arm.move(50)
    order("wkc 3 4")
    error = arm.fails(Cause.WORKING_COUNTER)
    assert "15 instead of 18" in str(error)
    assert arm.stop(Cause.WORKING_COUNTER) is None
    assert not any(powered())


def test_one_frame_in_a_hundred_may_be_lost_and_one_in_five_stops_the_arm(make_arm):
    arm = make_arm(patience_s=LOST_PATIENCE_S, watchdog_s=6.0, max_missing_cycles=50)
    arm.enable()
    order("lose 0.01")
    arm.move(1000)
    (remark,) = arm.servos.take_remarks()
    assert "did not return" in remark
    order("lose 0.2")
    with pytest.raises(DriverError) as raised:
        arm.move(2000)
    assert cause_of(raised.value) is Cause.FRAMES
    assert "of the last 500 frames" in str(raised.value)
    order("lose 0")  # in virtual time a stop would wait in real time for every lost frame
    arm.stop(Cause.FRAMES)
    arm.servos.close()
    assert not any(powered())


def test_frames_that_are_lost_in_a_row_stop_the_arm(make_arm):
    arm = make_arm(patience_s=LOST_PATIENCE_S, watchdog_s=6.0)
    arm.enable()
    arm.move(50)
    order("lose 1")
    error = arm.fails(Cause.FRAMES, 10)
    assert "4 frames in a row" in str(error)
    order("lose 0")
    arm.stop(Cause.FRAMES)
    assert not any(powered())


def test_outputs_of_another_length_never_reach_a_frame(make_arm):
    """A longer one would overwrite the next drive's."""
    arm = make_arm()
    arm.servos.connect()
    with pytest.raises(CommandError, match="3 bytes of outputs instead of"):
        arm.line.put(2, bytes(3))
    other = make_arm()
    found = other.line.map
    other.line.map = lambda: [(outputs + 1, inputs) for outputs, inputs in found()]
    with pytest.raises(BusError, match="its mapping is not what it reports"):
        other.servos.connect()


def test_a_line_without_distributed_clocks_refuses_a_drive_that_needs_them(make_arm, settings):
    arm = make_arm(drives=tuple(replace(drive, sync0=True) for drive in settings.drives))
    arm.line.follow_clock = lambda place, cycle_s: False
    with pytest.raises(BusError, match="no drive of the line has a distributed clock"):
        arm.servos.connect()


def test_a_drive_that_leaves_op_stops_the_arm(make_arm):
    arm = make_arm()
    arm.enable()
    arm.move(50)
    order("safeop 2")
    error = arm.fails(Cause.LEFT_OP, 50)
    assert error.joint == "joint_3"
    assert "SAFEOP" in str(error)
    assert "0x001B" in str(error)
    arm.stop(Cause.LEFT_OP)
    assert not any(powered())


def test_a_fault_is_named_by_its_emergency(make_arm):
    arm = make_arm()
    arm.enable()
    arm.move(50)
    order("fault 4 2310")
    error = arm.fails(Cause.DRIVE_FAULT, 50)
    assert error.joint == "joint_5"
    assert "0x2310" in str(error)
    arm.stop(Cause.DRIVE_FAULT)
    assert not any(powered())


def test_a_broken_cable_stops_the_arm_and_names_who_is_lost(make_arm):
    """The drives behind it stop by their own watchdogs, and the others at once."""
    arm = make_arm(watchdog_s=0.2)
    arm.enable()
    arm.move(50)
    order("drop 3")
    error = arm.fails(Cause.MISSING_FEEDBACK, 50)
    assert error.joint == "joint_4"
    assert "cable" in str(error)
    assert any("joint_6" in note for note in error.__notes__)
    problem = arm.stop(Cause.MISSING_FEEDBACK)
    assert "joint_4" in str(problem), "of the drives behind the cut nothing can be read back"
    assert "emergency stop" in str(problem)
    comes_to_be_without_torque(within_s=1.0)


def test_a_hung_firmware_in_motion_has_left_its_course(make_arm):
    """The working counter and 6041 stay good: only the position betrays it."""
    arm = make_arm()
    arm.enable()
    arm.move(50)
    order("freeze 1")
    error = arm.fails(Cause.LOOP_LOST, 200)
    assert error.joint == "joint_2"
    assert any("firmware" in note for note in error.__notes__)
    problem = arm.stop(Cause.LOOP_LOST)
    assert "joint_2" in str(problem)
    assert "emergency stop" in str(problem)
    assert powered() == [number == 1 for number in range(N)], "nobody can remove the torque of a hung drive"


def test_a_hung_firmware_at_rest_answers_no_request(make_arm):
    arm = make_arm()
    arm.enable()
    order("freeze 1")
    with pytest.raises(DriverError) as raised:
        arm.hold_in_real_time(5.0)
    assert cause_of(raised.value) is Cause.HUNG
    assert raised.value.joint == "joint_2"
    arm.stop(Cause.HUNG)
    assert powered() == [number == 1 for number in range(N)]


def set_far_end(state):
    """The drives' end of the cable."""
    subprocess.run(["ip", "link", "set", f"{interface()}-far", state], check=True)


def test_an_unplugged_cable_is_named_and_the_drives_stop_by_themselves(make_arm):
    arm = make_arm(patience_s=LOST_PATIENCE_S, watchdog_s=0.2)
    arm.enable()
    arm.move(50)
    try:
        set_far_end("down")
        error = arm.fails(Cause.LINK, 50)
        assert "no link" in str(error)
        arm.line.hurry()
        assert "no link" in str(arm.stop(Cause.LINK))
        with pytest.raises(TorqueRemains, match="emergency stop"):
            arm.servos.close()  # nothing can be read back without a cable
        comes_to_be_without_torque(within_s=1.0)
    finally:
        set_far_end("up")


READ_TYPE = struct.Struct("<6s6s2sHBBHHHH2sH30x").pack(
    b"\xff" * 6, b"\x02\0\0\0\0\x01", b"\x88\xa4", 0x1000 | 14, 1, 0, 0, 0, 2, 0, b"\0\0", 0
)
"""A frame with which masters look for drives: read register 0 of the first in the line (APRD)."""


def test_another_make_of_master_that_looks_for_drives_in_motion_stops_the_arm(make_arm):
    arm = make_arm()
    arm.enable()
    arm.move(50)
    assert arm.servos.take_remarks() == ()
    with socket.socket(socket.AF_PACKET, socket.SOCK_RAW) as foreign:
        foreign.bind((interface(), 0))
        foreign.send(READ_TYPE)
    error = arm.fails(Cause.OTHER_MASTER, 50)
    assert "command 1" in str(error)
    assert arm.stop(Cause.OTHER_MASTER) is None
    assert not any(powered())


FOREIGN = """
import sys, pysoem
master = pysoem.Master()
master.open(sys.argv[1])
assert master.config_init() == 6
"""


def test_another_make_of_master_that_restarts_the_drives_in_motion_stops_the_arm(make_arm):
    """It puts them in INIT, which removes their torque; whichever is seen first is the cause."""
    arm = make_arm()
    arm.enable()
    arm.move(50)
    foreign = subprocess.Popen([sys.executable, "-c", FOREIGN, interface()])
    with pytest.raises(DriverError) as raised:
        arm.hold_in_real_time(20.0)
    assert foreign.wait(20.0) == 0
    assert cause_of(raised.value) in {Cause.OTHER_MASTER, Cause.LEFT_OP, Cause.MISSING_FEEDBACK, Cause.FRAMES}
    arm.stop(Cause.OTHER_MASTER)
    assert not any(powered())


def test_drives_may_follow_their_distributed_clocks(make_arm, settings):
    """These drives have the registers of a clock and no SYNC0: that the set-up passes is all that can be seen."""
    arm = make_arm(drives=tuple(replace(drive, sync0=True) for drive in settings.drives))
    arm.enable()
    arm.move(100)
    assert arm.servos.take_remarks() == ()


SCAN = "from tests.ethercat.test_faults_on_ethercat import scan_line; scan_line()"


def scan_line():
    """Open the line; prints the refusal."""
    try:
        with open_line(interface()):
            pass
    except DriverError as error:
        sys.stdout.write(str(error))


@pytest.mark.parametrize("right", ["net_raw", "net_admin"])
def test_a_missing_right_is_named(right):
    command = ["setpriv", f"--bounding-set=-{right}", f"--inh-caps=-{right}", sys.executable, "-c", SCAN]
    refusal = subprocess.run(command, check=True, capture_output=True, text=True, cwd=ROOT).stdout
    assert f"CAP_{right.upper()}" in refusal
    assert "setpriv" in refusal


@pytest.mark.parametrize(("kind", "what"), [("address", "10.9.8.7/24"), ("route", "10.9.8.0/24")])
def test_an_interface_of_a_network_is_refused(kind, what):
    subprocess.run(["ip", kind, "add", what, "dev", interface()], check=True)
    try:
        with pytest.raises(BusError, match=f"carries .*{kind}") as raised, open_line(interface()):
            pass
        assert f"ip {kind} flush dev" in str(raised.value)
    finally:
        subprocess.run(["ip", kind, "flush", "dev", interface()], check=True)


def test_an_interface_that_is_down_or_unplugged_is_refused():
    set_far_end("down")
    try:
        with pytest.raises(BusError, match="down or has no link"), open_line(interface()):
            pass
    finally:
        set_far_end("up")


def test_a_drive_that_has_restarted_since_it_was_configured_is_not_enabled(make_arm):
    arm = make_arm()
    arm.servos.connect()
    arm.line.request(LineState.INIT, 3)
    assert arm.line.reaches(LineState.INIT, 3, 2.0)
    with pytest.raises(DriverError, match=r"joint_4.* has restarted"):
        arm.servos.enable()
    assert not any(powered())


def test_another_identity_or_place_or_alias_is_refused_before_anything_is_written(settings):
    others = {
        "vendor id": replace(settings.drives[2], identity=Identity(0x123, 0x456)),
        "serial number": replace(settings.drives[2], identity=replace(SIMULATION_IDENTITY, serial=4)),
        "alias": replace(settings.drives[2], alias=1003),
    }
    for what, drive in others.items():
        drives = (*settings.drives[:2], drive, *settings.drives[3:])
        with open_bring_up(replace(settings, drives=drives), interface()) as bring_up:
            with pytest.raises(WrongDevice, match=what) as raised:
                bring_up.setups[2].check_identity()
            assert raised.value.joint == "joint_3"


def test_a_drive_more_or_less_than_configured_is_refused(settings):
    fewer = replace(settings, drives=settings.drives[:5], coupling=np.eye(5))
    with open_line(interface()) as line:
        servos = EthercatServos(fewer, line, VirtualFrames())
        with closing(servos), pytest.raises(WrongDevice, match="does not name"):
            servos.connect()
    seventh = replace(settings.drives[0], joint="joint_7", node_id=7)
    more = replace(settings, drives=(*settings.drives, seventh), coupling=np.eye(7))
    with open_bring_up(more, interface()) as bring_up:
        rows = check(bring_up).steps
    assert {row.joint for row in rows if row.verdict is Verdict.WRONG} == {"joint_7"}


def test_the_watchdog_is_set_and_read_back(settings):
    with open_bring_up(replace(settings, watchdog_s=0.05), interface()) as bring_up:
        found = check(bring_up)
        assert not [row for row in found.steps if row.verdict is Verdict.WRONG]
        assert {finding.way.text for drive in found.secured for finding in drive.safety if "0420" in finding.way.text}
        held = [setup.objects.held[SYNC_MANAGER_WATCHDOG_US] for setup in bring_up.setups]
        assert held == [50_000] * N


def test_a_watchdog_that_cannot_be_so_long_is_refused(settings):
    with open_bring_up(replace(settings, watchdog_s=60.0), interface()) as bring_up:
        wrong = [row for row in check(bring_up).steps if row.verdict is Verdict.WRONG]
    assert len(wrong) == N
    assert all("0420" in row.detail and "master_lost" in row.detail for row in wrong)


MASTER = """
import os, sys, time
import numpy as np
from tests.ethercat.test_faults_on_ethercat import run_master
run_master(float(sys.argv[1]))
"""


def run_master(watchdog_s):
    """A master in real time that moves until it is stopped; prints a line when it moves, and its end."""
    from armload_drivers.deadline_clock import DeadlineClock
    from tests.conftest import small_arm

    small = small_arm(cycle_s=0.01, feedback=EffortFeedback.TORQUE, rated_current_a=None)
    drives = tuple(replace(small.drives[0], joint=f"joint_{k}", node_id=k) for k in range(1, N + 1))
    arm = replace(small, drives=drives, coupling=np.eye(N), max_missing_cycles=10)
    arm = replace(arm, fieldbus=Fieldbus.ETHERCAT, watchdog_s=watchdog_s)
    with open_line(interface()) as line, closing(EthercatServos(arm, line, DeadlineClock())) as servos:
        servos.connect()
        target = servos.enable().position_rad
        sys.stdout.write("moving\n")
        sys.stdout.flush()
        try:
            for _ in range(3000):
                target = target + 0.001
                servos.exchange(JointCommand(target, ZERO, ZERO))
        except DriverError as error:
            sys.stdout.write(json.dumps([cause_of(error).name, str(error)]) + "\n")
            sys.stdout.flush()
            raise SystemExit(1) from error


def started_master(watchdog_s):
    """A master in a process of its own, in the folder of the checkout."""
    return subprocess.Popen(
        [sys.executable, "-c", MASTER, str(watchdog_s)],
        stdout=subprocess.PIPE,
        text=True,
        cwd=ROOT,
    )


@pytest.mark.parametrize(("away_s", "watchdog_s"), [(0.1, 0.06), (0.5, 0.2), (2.0, 0.2)])
def test_a_master_that_is_not_scheduled_finds_stopped_drives(settings, away_s, watchdog_s):
    """SIGSTOP: the drives' watchdogs act; continued, the master moves nothing any more."""
    import signal

    master = started_master(watchdog_s)
    try:
        assert master.stdout.readline() == "moving\n"
        assert all(powered())
        master.send_signal(signal.SIGSTOP)
        time.sleep(away_s)
        comes_to_be_without_torque(within_s=1.0)
        stood = [drive["position"] for drive in drive_states()]
        master.send_signal(signal.SIGCONT)
        cause, text = json.loads(master.stdout.readline())
        assert cause in {"LEFT_OP", "DRIVE_FAULT"}, text
        assert [drive["position"] for drive in drive_states()] == stood
        assert master.wait(20) == 1
        assert not any(powered())
    finally:
        master.kill()
        master.wait()
        master.stdout.close()
        recover(settings)


def test_a_second_master_is_refused_and_the_first_goes_on(settings):
    master = started_master(2.0)
    try:
        assert master.stdout.readline() == "moving\n"
        with pytest.raises(ForeignMaster, match="another armload"), open_line(interface()):
            pass
        from armload_drivers.ethercat.network_interface import require_quiet

        with pytest.raises(ForeignMaster, match="another master sends"):
            require_quiet(interface())
        assert all(powered())
        master.kill()
        master.wait()
        with pytest.raises(BusError, match="in OP although no master sends"):
            require_quiet(interface())
    finally:
        master.kill()
        master.wait()
        master.stdout.close()
        time.sleep(2.5)
        recover(settings)
