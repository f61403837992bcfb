"""Bring-up, in lockstep and on vcan0: its steps, each failing once, the settings it leaves, other masters and nodes."""

import threading
import time
from contextlib import contextmanager
from dataclasses import replace

import can
import numpy as np
import pytest

from armload_drivers.bus.kernel_sync import BcmSync, BroadcastManager
from armload_drivers.canopen.canopen_servos import CanopenServos
from armload_drivers.cia402.arm_settings import Identity
from armload_drivers.cia402.drive_safety import Safety
from armload_drivers.cia402.object_dictionary import NmtCommand, NmtState
from armload_drivers.cia402.state_machine import State
from armload_drivers.driver_errors import (
    MissingSafety,
    SdoRefused,
    ServoError,
    ServoTimeout,
    WrongDevice,
)
from armload_drivers.simulation.drives.drive_dictionary import SILENCE, DriveTraits
from armload_drivers.simulation.lockstep_bus import LockstepBus
from armload_drivers.simulation.lockstep_sync import LockstepSync

ZERO = np.zeros(3)


class Requests:
    """Records at which step of bring-up a drive receives requests, and fails those of one step.

    Args:
        step: The step whose requests fail; None for no failure.
        verdict: The abort code, or silence.
    """

    def __init__(self, step=None, verdict=None):
        self.step, self.verdict = step, verdict
        self.setup = None
        self.steps = []

    def __call__(self, request):
        if self.setup is None:
            return None
        # Meanwhile the master waits for the answer.
        now = self.setup._sdo.step
        if now not in self.steps:
            self.steps.append(now)
        return self.verdict if now == self.step else None


SAFETY = {f"making sure that the drive {of.title}": of for of in Safety}
STEPS = [
    "looking for the node", "identifying", "looking for torque", "looking for a second axis",
    "checking the mode", "reading the scaling", "looking for the objects of its PDOs",
    "checking the reference", "setting the cycle",
    "mapping the receive PDO 1", "switching unused PDOs off", "mapping the transmit PDO 1", "selecting the mode",
    *SAFETY, "configuring the heartbeat consumer",
]  # fmt: skip
LATER = ["checking the state", "comparing the settings", "presetting the target"]
HARMLESS = {"looking for the node"}
"""A node that answers with an abort is present."""


def test_the_steps_of_bring_up_are_these(fault_arm):
    requests = Requests()
    arm = fault_arm(traits={3: DriveTraits(on_request=requests)})
    requests.setup = arm.servos.setups[1]
    arm.servos.connect()
    assert requests.steps == STEPS
    arm.servos.enable()
    assert requests.steps == STEPS + LATER


@pytest.mark.parametrize("step", [*STEPS, *LATER])
@pytest.mark.parametrize("verdict", [0x0800_0000, SILENCE], ids=["abort", "timeout"])
def test_an_abort_or_a_timeout_at_every_step(fault_arm, arm_settings, step, verdict):
    requests = Requests(step, verdict)
    # A node that does not answer is reset only if real drives are allowed.
    anybody = step == "looking for the node" and verdict == SILENCE
    settings = arm_settings(cycle_s=0.02, identity=Identity(None, None)) if anybody else None
    arm = fault_arm(settings, traits={3: DriveTraits(on_request=requests)})
    requests.setup = arm.servos.setups[1]
    kind = ServoTimeout if verdict == SILENCE else SdoRefused
    if step in SAFETY and verdict != SILENCE:
        if SAFETY[step] is Safety.DISABLE_REACTION:
            arm.servos.connect()
            return
        with pytest.raises(MissingSafety, match=SAFETY[step].key):
            arm.servos.connect()
        return
    if step in HARMLESS:
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
    requests.setup = arm.servos.setups[1]
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
    """As numbers from the standard, so that a wrong constant of the driver cannot cancel out."""
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
    """Let time pass without the master; in lockstep with SYNC from another source."""
    if arm.vcan:
        time.sleep(seconds)
        return
    for _ in range(round(seconds / arm.arm.cycle_s)):
        arm.sync._clock.advance(arm.arm.cycle_s)
        arm.send(0x080)
    # An SDO answer proves that the drives have processed all frames.
    arm.heard()


def abandoned(fault_arm):
    """An arm whose master ended while it moved; its drives have stopped and hold it."""
    arm = fault_arm()
    arm.enable()
    arm.move()
    alone(arm, 4.0 * arm.arm.heartbeat_s)
    assert power_states(arm) == [State.QUICK_STOP_ACTIVE] * 3
    return arm


def test_drives_without_their_master_stop_hold_and_leave_the_cycle(fault_arm):
    """6007 and 1029 as set by bring-up: the drives stop by quick stop, hold, and ignore further PDOs."""
    arm = abandoned(fault_arm)
    assert nmt_states(arm) == [NmtState.PRE_OPERATIONAL] * 3
    assert all(arm.plant.powered)
    stood = arm.plant.position_rad
    for node_id in (2, 3, 5):
        arm.send(0x200 + node_id, bytes.fromhex("0f00ffff7f000000"))
    alone(arm, 5 * arm.arm.cycle_s)
    assert arm.plant.position_rad == pytest.approx(stood, abs=1e-6)


def test_an_arm_whose_master_was_killed_is_taken_over(fault_arm):
    """The drives hold their position with torque, in QUICK STOP ACTIVE; the next master resets them."""
    arm = abandoned(fault_arm)
    sync = BcmSync(BroadcastManager("vcan0")) if arm.vcan else LockstepSync(arm.sync._clock)
    second = CanopenServos(arm.arm, arm.bus, sync, arm.timeouts)
    second.connect()
    arm.has_no_torque()
    held = "joint_2, joint_3, joint_5: held with torque after the last master ended; the reset removed the torque"
    assert second.take_remarks() == (held,)
    second.enable()
    second.close()
    arm.has_no_torque()


def test_stopped_nodes_that_hold_the_arm_are_not_reset_unseen(fault_arm, arm_settings):
    """A node that NMT has stopped answers no SDO and may hold an axis without a brake with torque."""
    identity = Identity(0x0000_00AB, 0x1234)
    settings = arm_settings(cycle_s=0.02, identity=identity, has_brake=False)
    arm = fault_arm(settings, traits={node: DriveTraits(identity=identity) for node in (2, 3, 5)})
    arm.enable()
    arm.servos.stop()
    arm.send(0x000, [NmtCommand.STOP.value, 0])
    arm.heard()
    assert nmt_states(arm) == [NmtState.STOPPED] * 3
    sync = BcmSync(BroadcastManager("vcan0")) if arm.vcan else LockstepSync(arm.sync._clock)
    with pytest.raises(ServoError, match="no brake and falls without torque"):
        CanopenServos(arm.arm, arm.bus, sync, arm.timeouts).connect()
    assert all(arm.plant.powered)


@contextmanager
def pestered(arm):
    """Another SDO client reads drive 3's position continually; in lockstep right after every request."""
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
    """Answers to the other client are not taken for ours: bring-up ends with an error that names the cause."""
    arm = fault_arm()
    with pestered(arm), pytest.raises(ServoError, match="another SDO client") as raised:
        arm.servos.connect()
    assert raised.value.node_id == 3
    arm.has_no_torque()
    # Without the other client it works again.
    arm.heard()
    arm.servos.connect()
    arm.servos.enable()


def test_a_slave_that_answers_for_another(fault_arm):
    """Two drives with the same node id: the second answers requests meant for the first."""
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
    assert "connected, with this node id" in str(raised.value)


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
