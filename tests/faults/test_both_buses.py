"""Every fault, scripted in lockstep and on vcan0: the error, its words, the end state, the way back."""

import gc
import os
import signal
import threading
import time
from contextlib import contextmanager
from dataclasses import replace
from itertools import pairwise

import can
import numpy as np
import pytest

from armload_drivers.cia402.arm_settings import Identity, VendorEffort
from armload_drivers.cia402.device_description import DeviceDescription
from armload_drivers.cia402.drive_safety import Safety
from armload_drivers.cia402.object_dictionary import DataType, NmtState
from armload_drivers.cia402.state_machine import State
from armload_drivers.driver_errors import (
    BusError,
    DriverError,
    ForeignMaster,
    MissingSafety,
    SdoRefused,
    ServoError,
    ServoFault,
    ServoTimeout,
    WrongDevice,
)
from armload_drivers.servos import JointCommand
from armload_drivers.simulation.drives.drive_dictionary import SILENCE, DriveTraits
from armload_drivers.simulation.lockstep_bus import LockstepBus
from armload_drivers.simulation.plant_interface import IdealPlant

ZERO = np.zeros(3)


# A drive ----------------------------------------------------------------------------------------------------


def test_a_drive_fault_in_motion_and_the_way_back(fault_arm):
    arm = fault_arm()
    arm.enable()
    arm.move()
    arm.drives.fail(3, 0x2310)
    error = arm.failure(ServoFault)
    assert (error.node_id, error.joint) == (3, "joint_3")
    assert "0x2310 continuous overcurrent" in str(error)
    assert "reset the fault by name" in str(error)
    with pytest.raises(ServoFault):
        arm.move(1)
    arm.comes_to_rest()
    with pytest.raises(ServoFault, match="0x2310"):
        arm.servos.enable()
    arm.servos.reset_faults()
    arm.has_no_torque()
    arm.target_rad = arm.servos.enable().position_rad
    arm.move(5)


def test_a_short_emergency_frame_is_kept(fault_arm):
    """Some vendors send two bytes; the code is what matters."""
    arm = fault_arm()
    arm.enable()
    arm.send(0x083, bytes.fromhex("1023"))
    assert "0x2310" in str(arm.failure(ServoFault))
    arm.comes_to_rest()


def test_following_error(fault_arm):
    arm = fault_arm()
    arm.enable()
    arm.plant.lag_rad = np.array([0.0, 0.0, 0.8])
    error = arm.failure(ServoFault)
    assert error.node_id == 5
    assert "following error" in str(error)
    arm.plant.lag_rad = ZERO
    arm.comes_to_rest()


def test_heartbeat_loss_of_one_drive(fault_arm):
    arm = fault_arm()
    arm.enable()
    arm.send(0x603, bytes.fromhex("2b17100000000000"))
    error = arm.failure(ServoTimeout)
    assert error.node_id == 3
    assert "heartbeat" in str(error)
    assert any("Another SDO client wrote to joint_3 (node 3), object 1017:0" in note for note in error.__notes__)
    arm.comes_to_rest()


def test_a_drive_that_loses_its_supply(fault_arm):
    arm = fault_arm()
    arm.enable()
    arm.move()
    arm.drives.switch_off(5)
    error = arm.failure(ServoTimeout)
    assert (error.node_id, error.joint) == (5, "joint_5")
    assert "supplied" in str(error)
    arm.comes_to_rest()


def test_a_drive_that_reboots(fault_arm):
    arm = fault_arm()
    arm.enable()
    arm.drives.switch_off(2)
    arm.drives.switch_on(2)
    error = arm.failure(ServoError)
    assert error.node_id == 2
    assert "rebooted" in str(error)
    arm.comes_to_rest()
    with pytest.raises(DriverError):
        arm.servos.enable()
    arm.has_no_torque()


@pytest.mark.parametrize("cycles", [1, 3])
def test_feedback_missing_for_a_while(fault_arm, cycles):
    arm = fault_arm()
    arm.enable()
    arm.move(3)
    arm.drives.drop_feedback(3, cycles)
    missing = 0
    for _ in range(20):
        missing += arm.move(1).missing.sum()
    assert missing == cycles
    arm.comes_to_rest()


def test_feedback_missing_for_good(fault_arm):
    arm = fault_arm()
    arm.enable()
    arm.drives.drop_feedback(3, 10_000)
    error = arm.failure(ServoTimeout)
    assert error.node_id == 3
    assert "no feedback for 4 cycles" in str(error)
    # It obeys all the same; its silence is all that is wrong. What it does on SDO requests proves it.
    arm.servos.stop()
    arm.servos.disable()
    arm.has_no_torque()


@pytest.mark.parametrize("state", [State.SWITCH_ON_DISABLED, State.READY_TO_SWITCH_ON, State.SWITCHED_ON])
def test_a_drive_that_ignores_a_state_request(fault_arm, state):
    arm = fault_arm(traits={3: DriveTraits(stuck_in=state)})
    arm.servos.connect()
    with pytest.raises(ServoTimeout) as raised:
        arm.servos.enable()
    assert raised.value.node_id == 3
    assert f"OPERATION ENABLED and standstill not reached within 3.0 s, the drive has been in {state.title}" in str(
        raised.value
    )
    arm.has_no_torque()


def test_a_drive_that_ignores_its_mode(fault_arm):
    arm = fault_arm(traits={3: DriveTraits(takes_mode=False)})
    with pytest.raises(ServoTimeout, match="6061 reports mode 0"):
        arm.servos.connect()
    arm.has_no_torque()


def test_quick_stop_by_the_operator(fault_arm):
    arm = fault_arm()
    arm.enable()
    arm.move()
    arm.servos.stop()
    assert all(arm.plant.powered)
    with pytest.raises(DriverError, match="stopped"):
        arm.move(1)
    arm.comes_to_rest()


# Bring-up ---------------------------------------------------------------------------------------------------


class Requests:
    """Remembers at which step of bring-up a drive's requests come, and fails those of one step.

    Args:
        step: The step whose requests fail; None lets all pass.
        verdict: The abort code, or silence.
    """

    def __init__(self, step=None, verdict=None):
        self.step, self.verdict = step, verdict
        self.setup = None
        self.steps = []

    def __call__(self, request):
        if self.setup is None:
            return None
        # The master waits for the answer meanwhile.
        now = self.setup._sdo.step
        if now not in self.steps:
            self.steps.append(now)
        return self.verdict if now == self.step else None


SAFETY = {f"making sure that the drive {of.value.title}": of for of in Safety}
STEPS = [
    "looking for the node", "identifying", "checking the mode", "reading the scaling", "setting the cycle",
    "looking for the objects of its PDOs", "mapping the receive PDO 1", "mapping the transmit PDO 1",
    "switching unused PDOs off", "selecting the mode", *SAFETY, "setting the heartbeat to watch", "reading the name",
]  # fmt: skip
LATER = ["presetting the target", "checking for faults"]
HARMLESS = {"looking for the node", "reading the name"}
"""A node that answers with an abort is there, and a name is nothing to fail for."""


def test_the_steps_of_bring_up_are_these(fault_arm):
    requests = Requests()
    arm = fault_arm(traits={3: DriveTraits(on_request=requests)})
    requests.setup = arm.servos._setups[1]
    arm.servos.connect()
    assert requests.steps == STEPS
    arm.servos.enable()
    assert requests.steps == STEPS + LATER


@pytest.mark.parametrize("step", [*STEPS, *LATER])
@pytest.mark.parametrize("verdict", [0x0800_0000, SILENCE], ids=["abort", "timeout"])
def test_an_abort_or_a_timeout_at_every_step(fault_arm, arm_settings, step, verdict):
    requests = Requests(step, verdict)
    # A node that is silent at first is reset only where it need not be a simulation.
    anybody = step == "looking for the node" and verdict == SILENCE
    settings = arm_settings(cycle_s=0.02, identity=Identity(None, None)) if anybody else None
    arm = fault_arm(settings, traits={3: DriveTraits(on_request=requests)})
    requests.setup = arm.servos._setups[1]
    kind = ServoTimeout if verdict == SILENCE else SdoRefused
    if step in SAFETY and verdict != SILENCE:
        if SAFETY[step] is Safety.DISABLE_REACTION:
            arm.servos.connect()
            return
        with pytest.raises(MissingSafety, match=SAFETY[step].key):
            arm.servos.connect()
        return
    if step in HARMLESS and not (step == "reading the name" and verdict == SILENCE):
        arm.servos.connect()
        arm.servos.enable()
        return
    if step in STEPS:
        with pytest.raises(kind) as raised:
            arm.servos.connect()
    else:
        arm.servos.connect()
        with pytest.raises(kind) as raised:
            arm.servos.enable()
    error = raised.value
    assert (error.node_id, error.joint, error.step) == (3, "joint_3", step)
    assert "reading" in str(error) or "writing" in str(error)
    arm.has_no_torque()


def test_where_only_simulations_are_allowed_nobody_silent_is_reset(fault_arm):
    requests = Requests("looking for the node", SILENCE)
    arm = fault_arm(traits={3: DriveTraits(on_request=requests)})
    requests.setup = arm.servos._setups[1]
    arm.heard()
    with pytest.raises(ServoTimeout, match="only simulated drives are allowed") as raised:
        arm.servos.connect()
    assert (raised.value.node_id, raised.value.step) == (3, "looking for the node")
    frames = arm.heard()
    assert not [m for m in frames if m.arbitration_id == 0], "no NMT command to anybody"
    assert not [m for m in frames if 0x600 < m.arbitration_id < 0x680 and m.data[0] >> 5 == 1], "nothing is written"


def configured(arm, node_id):
    """Objects of a drive that bring-up writes, as they are then."""
    values = arm.drives._drives[node_id].dictionary.values
    return {f"{key >> 8:04X}:{key & 0xFF}": value for key, value in values.items()}


def test_what_bring_up_leaves_in_a_drive(fault_arm, arm_settings):
    """In numbers, as a manual has them, so that no constant of the driver can be wrong on both sides."""
    settings = replace(arm_settings(cycle_s=0.02), sync_counter=10)
    arm = fault_arm(settings)
    arm.servos.connect()
    heartbeat_ms = round(arm.arm.heartbeat_s * 1e3)
    # q_axis = C^-1 q_joint widens the joints' limits of 3 rad; 500 mrad of following error; 1e6 counts a turn.
    inverse = np.abs(np.linalg.inv(settings.coupling)).sum(axis=1)
    for axis, node_id in enumerate((2, 3, 5)):
        found = configured(arm, node_id)
        limit = 3.0 * inverse[axis] * 1e6 / (2 * np.pi)
        expected = {
            "1005:0": 0x80, "1006:0": 20_000, "1016:1": 0, "1017:0": heartbeat_ms, "1019:0": 10, "1029:1": 0,
            "6007:0": 3, "605A:0": 6, "605B:0": 1, "605C:0": 1, "605D:0": 1, "605E:0": 2, "6060:0": 8,
            "6065:0": 79577, "6066:0": 20, "6072:0": 3000,
            "1400:1": 0x200 + node_id, "1400:2": 1, "1400:5": max(heartbeat_ms, 80),
            "1600:0": 3, "1600:1": 0x6040_0010, "1600:2": 0x607A_0020, "1600:3": 0x60B2_0010,
            "1800:1": 0x4000_0180 + node_id, "1800:2": 1,
            "1A00:0": 3, "1A00:1": 0x6041_0010, "1A00:2": 0x6064_0020, "1A00:3": 0x6078_0010,
        }  # fmt: skip
        assert {name: found[name] for name in expected} == expected
        assert found["60C2:1"] * 10.0 ** found["60C2:2"] == pytest.approx(0.02)
        assert [found["607D:1"], found["607D:2"]] == pytest.approx([-limit, limit], abs=1.0)
        assert all(found[f"{index:04X}:1"] & 0x8000_0000 for index in (0x1401, 0x1402, 0x1403, 0x1801, 0x1802, 0x1803))
    arm.servos.enable()
    watched = {configured(arm, node_id)["1016:1"] for node_id in (2, 3, 5)}
    assert watched == {0x7F_0000 + round(2.5 * heartbeat_ms)}, "while drives may move, they watch the master"


def power_states(arm):
    return [drive.power.machine.state for drive in arm.drives._drives.values()]


def nmt_states(arm):
    return [drive.state for drive in arm.drives._drives.values()]


def alone(arm, seconds):
    """Time passes without the master; in lockstep with SYNC from elsewhere."""
    if arm.vcan:
        time.sleep(seconds)
        return
    for _ in range(round(seconds / arm.arm.cycle_s)):
        arm.sync._clock.advance(arm.arm.cycle_s)
        arm.send(0x080)
    # An SDO answer proves that the drives have seen all of it.
    arm.heard()


def test_drives_without_their_master_stop_hold_and_leave_the_cycle(fault_arm):
    """6007 and 1029, as bring-up set them: a quick stop that holds, and no PDO moves anything any more."""
    arm = fault_arm()
    arm.enable()
    arm.move()
    alone(arm, 4.0 * arm.arm.heartbeat_s)
    assert power_states(arm) == [State.QUICK_STOP_ACTIVE] * 3
    assert nmt_states(arm) == [NmtState.PRE_OPERATIONAL] * 3
    assert all(arm.plant.powered)
    stood = arm.plant.position_rad
    for node_id in (2, 3, 5):
        arm.send(0x200 + node_id, bytes.fromhex("0f00ffff7f000000"))
    alone(arm, 5 * arm.arm.cycle_s)
    assert arm.plant.position_rad == pytest.approx(stood, abs=1e-6)


@contextmanager
def pestered(arm):
    """Another SDO client asks drive 3 for its position all the time; in lockstep right after every request."""
    request = can.Message(arbitration_id=0x603, data=bytes.fromhex("4064600000000000"), is_extended_id=False)
    if not arm.vcan:
        with LockstepBus(arm.bus.wire) as other:
            other.listen(lambda message: message.arbitration_id == 0x603 and other.send(request))
            yield
        return
    stop = threading.Event()

    def pester():
        while not stop.wait(0.0005):
            arm.other.send(request)

    thread = threading.Thread(target=pester)
    thread.start()
    try:
        yield
    finally:
        stop.set()
        thread.join()


def test_two_sdo_users_at_once(fault_arm):
    """The other one's answers are not taken for ours: bring-up ends, and says who is to blame."""
    arm = fault_arm()
    with pestered(arm), pytest.raises(ServoError, match="another SDO client") as raised:
        arm.servos.connect()
    assert raised.value.node_id == 3
    arm.has_no_torque()
    # Alone again, it works.
    arm.heard()
    arm.servos.connect()
    arm.servos.enable()


def test_a_slave_that_answers_for_another(fault_arm):
    """Two drives with one node id: the second answers requests that were not addressed to it."""
    arm_box = []

    def on_request(request):
        if request[1:3] == b"\x02\x65":
            arm_box[0].send(0x583, bytes.fromhex("4318100101000000"))

    arm = fault_arm(traits={3: DriveTraits(on_request=on_request)})
    arm_box.append(arm)
    with pytest.raises(ServoError, match="answered for object 1018:1") as raised:
        arm.servos.connect()
    assert raised.value.node_id == 3
    assert "another master" in str(raised.value).lower()


def test_one_drive_fewer_than_configured(fault_arm, arm_settings):
    settings = arm_settings(cycle_s=0.02)
    fewer = replace(settings, drives=settings.drives[:2], coupling=np.eye(2))
    arm = fault_arm(settings, drives_arm=fewer)
    with pytest.raises(ServoTimeout) as raised:
        arm.servos.connect()
    assert (raised.value.node_id, raised.value.joint) == (5, "joint_5")
    assert "supplied and connected" in str(raised.value)


def test_one_drive_more_than_configured(fault_arm, arm_settings):
    settings = arm_settings(cycle_s=0.02)
    fewer = replace(settings, drives=settings.drives[:2], coupling=np.eye(2))
    arm = fault_arm(fewer, drives_arm=settings)
    arm.heard()
    with pytest.raises(WrongDevice) as raised:
        arm.servos.connect()
    assert raised.value.node_id == 5
    assert "other_nodes" in str(raised.value)
    assert not [m for m in arm.heard() if m.arbitration_id == 0], "no node has been reset"


def test_a_drive_that_belongs_to_something_else_is_left_alone(fault_arm, arm_settings):
    settings = arm_settings(cycle_s=0.02)
    fewer = replace(settings, drives=settings.drives[:2], coupling=np.eye(2))
    arm = fault_arm(replace(fewer, other_nodes=frozenset({5})), drives_arm=settings)
    arm.heard()
    arm.servos.connect()
    assert not [m for m in arm.heard() if m.arbitration_id == 0x605], "not even asked"


# The bus ----------------------------------------------------------------------------------------------------


GARBAGE = [(0x183, length) for length in (0, 1, 7)] + [
    (cob_id, length) for cob_id in (0x083, 0x583, 0x703, 0x000, 0x080 + 3) for length in (0, 1, 3)
]


def test_garbage_and_wrong_lengths_on_our_cob_ids(fault_arm):
    arm = fault_arm()
    arm.enable()
    rng = np.random.default_rng(1)
    for cob_id, length in GARBAGE:
        data = rng.integers(0x10, 0x60, length).astype(np.uint8).tobytes()
        if cob_id == 0x083 and length > 1:
            data = bytes(length)
        if cob_id == 0x703 and length:
            data = b"\x05" + data[1:]
        arm.send(cob_id, data)
        assert not arm.move(1).missing.any()
    arm.send(0x183, b"", is_remote_frame=True)
    arm.other.send(can.Message(arbitration_id=0x183, data=bytes(8), is_extended_id=True))
    feedback = arm.move(2)
    assert feedback.position_rad == pytest.approx(arm.target_rad, abs=0.02)
    arm.comes_to_rest()


@pytest.mark.parametrize(
    ("cob_id", "data", "words"),
    [
        (0x000, b"\x02\x00", "stop to all nodes"),
        (0x000, b"\x80\x03", r"pre operational to joint_3 \(node 3\)"),
        (0x203, bytes(8), "sends setpoints to joint_3"),
        (0x77F, b"\x05", "uses this master's node id 127"),
    ],
    ids=["nmt to all", "nmt to one", "setpoints", "heartbeat"],
)
def test_a_second_master(fault_arm, cob_id, data, words):
    arm = fault_arm()
    arm.enable()
    arm.move(5)
    arm.send(cob_id, data)
    # Depending on what it did, the drive's own complaint comes first and the note says who.
    error = arm.failure(DriverError)
    text = str(error) + " ".join(getattr(error, "__notes__", []))
    with pytest.raises(AssertionError, match=words):
        raise AssertionError(text)
    arm.servos.close()
    arm.has_no_torque()


def test_a_second_sync_producer(fault_arm):
    arm = fault_arm()
    arm.enable()
    if arm.vcan:
        pytest.skip("detected by the rhythm of SYNC there: tests/vcan/test_master_lost.py")
    arm.send(0x080)
    assert "produces SYNC as well" in str(arm.failure(ForeignMaster))
    arm.comes_to_rest()


def test_bus_off(fault_arm):
    arm = fault_arm()
    arm.enable()
    arm.move(5)
    arm.send(0x40, bytes(8), is_error_frame=True)
    error = arm.failure(BusError)
    assert "bus-off" in str(error)
    assert "termination" in str(error)
    arm.servos.close()
    arm.has_no_torque()


def test_error_passive_is_known_and_survived(fault_arm):
    arm = fault_arm()
    arm.enable()
    arm.send(0x04, bytes([0, 0x20, 0, 0, 0, 0, 0, 0]), is_error_frame=True)
    arm.move(2)
    assert arm.servos.bus_errors.error_passive
    assert arm.servos.bus_errors.error_frames == 1
    arm.send(0x04, bytes([0, 0x40, 0, 0, 0, 0, 0, 0]), is_error_frame=True)
    arm.move(2)
    assert not arm.servos.bus_errors.error_passive
    arm.comes_to_rest()


def test_the_load_of_the_bus_is_measured(fault_arm):
    arm = fault_arm()
    arm.enable()
    arm.move(240)
    rate = 1 / arm.arm.cycle_s
    frames = 55 + 6 * 135
    assert arm.servos.bus_load == pytest.approx(frames * rate / 1e6, rel=0.25)


# Ctrl-C and SIGTERM -----------------------------------------------------------------------------------------


INTERRUPTS = (signal.SIGINT, signal.SIGTERM)


@pytest.fixture
def interrupted():
    """Both signals as an exception in the main thread, as a program would have it.

    A background job of a shell without job control inherits SIGINT ignored; Python then sets no handler of its own.
    Garbage of earlier tests is not collected meanwhile: an exception in the middle of a `__del__` is lost.
    """

    def handler(number, frame):
        raise KeyboardInterrupt(signal.Signals(number).name)

    before = {number: signal.signal(number, handler) for number in INTERRUPTS}
    gc.disable()
    yield
    gc.enable()
    for number, earlier in before.items():
        signal.signal(number, earlier)


@pytest.mark.parametrize("number", INTERRUPTS)
@pytest.mark.parametrize("phase", ["connect", "enable", "exchange", "stop", "disable", "reset_faults"])
def test_an_interrupt_in_every_phase(fault_arm, interrupted, phase, number):
    """Sent from the drives' side in the middle of the phase; after `close` no torque is left."""
    seen = []
    steps = {"connect": b"\x2b\x17\x10", "enable": b"\x40\x41\x60", "reset_faults": b"\x23\x16\x10"}

    def on_request(request):
        if seen and request[:3] == steps.get(seen[0]):
            seen.clear()
            os.kill(os.getpid(), number)

    arm = fault_arm(traits={5: DriveTraits(on_request=on_request)})
    if phase == "connect":
        seen.append(phase)
        with pytest.raises(KeyboardInterrupt):
            arm.servos.connect()
    else:
        arm.servos.connect()
        if phase in {"enable", "reset_faults"}:
            seen.append(phase)
            with pytest.raises(KeyboardInterrupt):
                getattr(arm.servos, phase)()
        else:
            arm.target_rad = arm.servos.enable().position_rad
            arm.move(10)
            timer = threading.Timer(0.01, os.kill, (os.getpid(), number))
            with pytest.raises(KeyboardInterrupt):
                run_until_interrupted(arm, phase, timer)
            timer.join()
    arm.servos.close()
    arm.has_no_torque()


def run_until_interrupted(arm, phase, timer):
    timer.start()
    if phase != "exchange":
        getattr(arm.servos, phase)()
    end_s = time.monotonic() + 10.0
    while time.monotonic() < end_s:
        if phase == "exchange":
            arm.servos.exchange(JointCommand(arm.target_rad, ZERO, ZERO))
        else:
            time.sleep(0.001)
    pytest.fail("no interrupt came")


# What else real drives have ---------------------------------------------------------------------------------


def test_a_vendors_32_bit_current_travels_in_a_pdo_of_its_own(fault_arm, arm_settings):
    vendor = VendorEffort(0x30D1, 2, DataType.I32, 1e-3)
    arm = fault_arm(arm_settings(cycle_s=0.02, vendor_effort=vendor))
    arm.plant._torque_nm[:] = [20.0, -40.0, 60.0]
    arm.enable()
    feedback = arm.move(5)
    assert feedback.current_a == pytest.approx([1.0, -2.0, 3.0], abs=1e-3)
    arm.comes_to_rest()


def test_a_vendors_pdo_that_goes_missing_is_missing_feedback(fault_arm, arm_settings):
    vendor = VendorEffort(0x30D1, 2, DataType.I32, 1e-3)
    arm = fault_arm(arm_settings(cycle_s=0.02, vendor_effort=vendor))
    arm.enable()
    # Another client switches TPDO2 off.
    arm.send(0x603, bytes.fromhex("2301180183020080"))
    assert arm.failure(ServoTimeout).node_id == 3


def test_the_sync_counter_counts(fault_arm, arm_settings):
    arm = fault_arm(replace(arm_settings(cycle_s=0.02), sync_counter=10))
    arm.enable()
    arm.heard()
    arm.move(25)
    counts = [m.data[0] for m in arm.heard() if m.arbitration_id == 0x080]
    assert len(counts) >= 25
    assert all(after == before % 10 + 1 for before, after in pairwise(counts))
    arm.comes_to_rest()


def test_a_drive_without_a_sync_counter_is_refused_where_one_is_asked_for(fault_arm, arm_settings):
    arm = fault_arm(replace(arm_settings(), sync_counter=10), traits={3: DriveTraits(absent=frozenset({0x1019}))})
    with pytest.raises(ServoError, match="sync_counter = 0"):
        arm.servos.connect()


def test_scales_that_are_not_configured_come_from_the_drives(fault_arm, arm_settings):
    settings = arm_settings(cycle_s=0.02)
    unknown = {"counts_per_rad": None, "rated_current_a": None, "rated_torque_nm": None}
    bare = replace(settings, drives=tuple(replace(drive, **unknown) for drive in settings.drives))
    arm = fault_arm(bare, drives_arm=settings)
    start = arm.enable()
    assert start == pytest.approx(settings.coupling @ [0.1, 0.2, 0.3], abs=1e-4)
    arm.move(5)
    arm.comes_to_rest()


class _Witness(IdealPlant):
    """Remembers how fast an axis was when its torque went."""

    def __init__(self, position_rad):
        super().__init__(position_rad)
        self.speeds = []

    def set_powered(self, axis, on):
        if self.powered[axis] and not on:
            self.speeds.append(abs(float(self.velocity_rad_s[axis])))
        super().set_powered(axis, on)


def test_torque_goes_at_standstill_only_even_where_another_master_stopped_the_nodes(fault_arm):
    arm = fault_arm(plant=_Witness([0.1, 0.2, 0.3]))
    arm.enable()
    arm.move()
    arm.send(0x000, b"\x02\x00")
    arm.failure(DriverError)
    arm.servos.close()
    arm.has_no_torque()
    assert arm.plant.speeds == pytest.approx([0.0] * 3, abs=1e-3)


def test_without_a_configured_identity_the_device_description_is_asked(fault_arm, arm_settings):
    described = DeviceDescription("servo.eds", "", "", 0x1AB, None, None, None, {}, ())
    settings = arm_settings(cycle_s=0.02, identity=Identity(None, None), description=described)
    arm = fault_arm(settings)
    with pytest.raises(WrongDevice, match=r"vendor id \(1018\) is 0x41524D4C instead of 0x000001AB"):
        arm.servos.connect()
