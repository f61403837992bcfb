"""One drive in the cycle: every single trouble is noticed, by the quick check and by name."""

import struct
from collections import deque

import can
import pytest

from armload_drivers.bus.bus_link import BusLink
from armload_drivers.bus.sync_sources import TimerSync
from armload_drivers.canopen.drive_node import DriveNode
from armload_drivers.cia402.axis_course import axis_courses
from armload_drivers.cia402.object_dictionary import NmtState
from armload_drivers.cia402.process_data.drive_units import ArmUnits
from armload_drivers.cia402.process_data.process_image import drive_image
from armload_drivers.cia402.state_machine import State
from armload_drivers.driver_errors import LoopLost, ServoError, ServoFault, ServoTimeout
from armload_drivers.simulation.virtual_clock import VirtualClock

ENABLED, SWITCHED_ON, QUICK_STOP, FAULT, UNDEFINED = 0x0027, 0x0023, 0x0007, 0x0008, 0x0001
CYCLE_S, HEARTBEAT_S, MOST_MISSING = 0.01, 0.1, 3


class ScriptedBus:
    """A bus on which only what a test adds is received."""

    def __init__(self):
        self.received = deque()

    def send(self, message):
        pass

    def recv(self, timeout):
        return self.received.popleft() if self.received else None


class NodeOnBus:
    """The third joint's drive, node 5, and the frames that it sends."""

    def __init__(self, arm):
        self.clock, self.bus = VirtualClock(), ScriptedBus()
        self.link = BusLink(self.bus)
        drive = arm.drives[2]
        self.node = DriveNode(
            drive,
            drive_image(drive),
            self.link,
            TimerSync(self.clock),
            cycle_s=CYCLE_S,
            heartbeat_s=HEARTBEAT_S,
            max_missing_cycles=MOST_MISSING,
        )
        units = ArmUnits(arm, [0, 0, 0])
        self.node.begin(units.axes[2].counts_per_rad, axis_courses(arm, units)[2])

    def hear(self, cob_id, data):
        self.bus.received.append(can.Message(arbitration_id=cob_id, data=data, is_extended_id=False))
        self.link.drain()

    def feed_back(self, statusword=ENABLED, counts=0):
        self.hear(0x185, struct.pack("<Hih", statusword, counts, 0))

    def beat(self, state=NmtState.OPERATIONAL):
        self.hear(0x705, bytes([state.value]))

    def cycle(self, *words):
        """One cycle with a feedback frame per statusword."""
        self.clock.advance(CYCLE_S)
        self.node.expect()
        for word in words:
            self.feed_back(word)
        self.node.evaluate(self.clock())

    def problem(self, *, must_follow=True):
        return self.node.problem("in the test", self.clock(), must_follow=must_follow)

    def in_order(self):
        return self.node.in_order(self.clock())


@pytest.fixture
def on_bus(arm_settings):
    """A healthy enabled drive."""
    on_bus = NodeOnBus(arm_settings())
    on_bus.cycle(SWITCHED_ON)
    on_bus.node.ask(State.OPERATION_ENABLED, "enabling")
    on_bus.cycle(ENABLED)
    on_bus.cycle(ENABLED)
    on_bus.beat()
    assert on_bus.in_order()
    assert on_bus.problem() is None
    return on_bus


def missing_feedback(on_bus):
    for _ in range(MOST_MISSING + 1):
        on_bus.cycle()


def silence(on_bus):
    for _ in range(round(on_bus.node.heartbeat_limit_s / CYCLE_S) + 1):
        on_bus.cycle(ENABLED)


def twin(on_bus):
    for _ in range(3):
        on_bus.cycle(ENABLED, ENABLED)


TROUBLES = {
    "course left": (lambda on_bus: on_bus.node.course.leave("it flew"), LoopLost, "it flew"),
    "fault": (lambda on_bus: on_bus.cycle(FAULT), ServoFault, "no emergency message gave a cause; it is in FAULT"),
    "emergency": (lambda on_bus: on_bus.hear(0x085, bytes.fromhex("1023010000000000")), ServoFault, "0x2310"),
    "twin": (twin, ServoError, "two drives have node id 5"),
    "undefined statusword": (lambda on_bus: on_bus.cycle(UNDEFINED), ServoError, "0x0001 matches no state.*6041"),
    "rebooted": (lambda on_bus: on_bus.beat(NmtState.BOOT_UP), ServoError, "rebooted"),
    "no feedback": (missing_feedback, ServoTimeout, "no feedback for 4 cycles"),
    "no heartbeat": (silence, ServoTimeout, "no heartbeat for 0.2"),
    "NMT state": (lambda on_bus: on_bus.beat(NmtState.PRE_OPERATIONAL), ServoError, "left OPERATIONAL.*PRE-OP"),
    "switched off": (lambda on_bus: on_bus.cycle(SWITCHED_ON), ServoError, "left OPERATION ENABLED.*SWITCHED ON"),
}


@pytest.mark.parametrize("name", TROUBLES)
def test_every_single_trouble_is_noticed_and_named(on_bus, name):
    happen, kind, text = TROUBLES[name]
    happen(on_bus)
    assert not on_bus.in_order()
    problem = on_bus.problem()
    assert type(problem) is kind
    assert (problem.node_id, problem.joint, problem.step) == (5, "joint_5", "in the test")
    with pytest.raises(kind, match=text):
        raise problem


def test_an_undefined_statusword_never_counts_as_the_state_before(on_bus):
    """It is a problem until a valid word arrives, also while the drive need not follow."""
    on_bus.node.ask(State.SWITCHED_ON, "disabling")
    for _ in range(3):
        on_bus.cycle(UNDEFINED)
        assert not on_bus.in_order()
        assert "0x0001 matches no state" in str(on_bus.problem(must_follow=False))
    on_bus.cycle(SWITCHED_ON)
    assert on_bus.problem(must_follow=False) is None


def test_a_request_that_the_state_does_not_allow_names_the_drive(on_bus):
    on_bus.cycle(QUICK_STOP)
    with pytest.raises(ServoError, match=r"joint_5 \(node 5\), enabling: .*requires the torque to be removed first"):
        on_bus.node.ask(State.OPERATION_ENABLED, "enabling")
    on_bus.cycle(FAULT)
    with pytest.raises(ServoError, match="requires a fault reset"):
        on_bus.node.ask(State.SWITCHED_ON, "disabling")


def test_a_heartbeat_from_before_the_start_does_not_show_the_state_after_it(arm_settings):
    on_bus = NodeOnBus(arm_settings())
    on_bus.beat(NmtState.PRE_OPERATIONAL)
    on_bus.cycle(SWITCHED_ON)
    assert on_bus.problem(must_follow=False) is None
    on_bus.beat(NmtState.STOPPED)
    assert "left OPERATIONAL, it is in STOPPED" in str(on_bus.problem(must_follow=False))


@pytest.mark.parametrize("data", [b"", b"\x80"])
def test_an_empty_heartbeat_or_a_short_emergency_is_no_message(on_bus, data):
    on_bus.hear(0x705 if not data else 0x085, data)
    assert on_bus.problem() is None


@pytest.mark.parametrize("cob_id", [0x185, 0x285], ids=["position", "effort"])
def test_a_frame_of_a_wrong_length_is_missing_feedback(arm_settings, cob_id):
    """A drive that sends its effort in a frame of its own."""
    on_bus = NodeOnBus(arm_settings(pdo_objects_max=2))
    frames = {0x185: struct.pack("<Hi", SWITCHED_ON, 7), 0x285: struct.pack("<h", -2)}
    for data, missing in ((frames[cob_id], False), (frames[cob_id] + b"\0", True), (frames[cob_id][:-1], True)):
        on_bus.node.expect()
        for each, whole in frames.items():
            on_bus.hear(each, data if each == cob_id else whole)
        assert on_bus.node.evaluate(on_bus.clock()) is missing
    assert on_bus.node.wrong_frames == 2
    assert (on_bus.node.position_counts, on_bus.node.effort) == (7, -2)
