"""One drive in the cycle: every single trouble is noticed, by the quick check and by name."""

import struct

import pytest

from armload_drivers.cia402.arm_settings import OperationMode
from armload_drivers.cia402.object_dictionary import NmtState
from armload_drivers.cia402.state_machine import State
from armload_drivers.driver_errors import LoopLost, ServoError, ServoFault, ServoTimeout
from tests.scripted_drives import ENABLED, FAULT, QUICK_STOP, SWITCHED_ON, UNDEFINED, ScriptedArm


class NodeOnBus(ScriptedArm):
    """The drive with node id 5."""

    def __init__(self, arm):
        super().__init__(arm)
        self.node = self.nodes[2]

    def cycle_with(self, *words):
        """One cycle with these statuswords of this drive."""
        self.words[5] = words
        self.run()

    def problem(self, *, must_follow=True):
        return self.node.problem("in the test", self.clock(), must_follow=must_follow)

    def in_order(self):
        return self.node.in_order(self.clock())


@pytest.fixture
def on_bus(arm_settings):
    """A healthy enabled drive."""
    on_bus = NodeOnBus(arm_settings())
    on_bus.enable()
    assert on_bus.in_order()
    assert on_bus.problem() is None
    return on_bus


def missing_feedback(on_bus):
    for _ in range(on_bus.arm.max_missing_cycles + 1):
        on_bus.cycle_with()


def silence(on_bus):
    for _ in range(round(on_bus.node.heartbeat_limit_s / on_bus.arm.cycle_s) + 1):
        on_bus.cycle_with(ENABLED)


def twin(on_bus):
    for _ in range(4):  # one more than the frame that was missing when the drives were enabled
        on_bus.cycle_with(ENABLED, ENABLED)


def reboot_and_start(on_bus):
    on_bus.beat(5, NmtState.BOOT_UP)
    on_bus.cycle_with(ENABLED)
    on_bus.beat(5)


TROUBLES = {
    "course left": (lambda on_bus: on_bus.node.course.leave("it flew"), LoopLost, "it flew"),
    "fault": (lambda on_bus: on_bus.cycle_with(FAULT), ServoFault, "no emergency message gave a cause; it is in FAULT"),
    "emergency": (lambda on_bus: on_bus.hear(0x085, bytes.fromhex("1023010000000000")), ServoFault, "0x2310"),
    "twin": (twin, ServoError, "two drives have node id 5"),
    "undefined statusword": (lambda on_bus: on_bus.cycle_with(UNDEFINED), ServoError, "0x0001 matches no state.*6041"),
    "rebooted": (lambda on_bus: on_bus.beat(5, NmtState.BOOT_UP), ServoError, "rebooted"),
    "rebooted and started": (reboot_and_start, ServoError, "rebooted"),
    "no feedback": (missing_feedback, ServoTimeout, "no feedback for 4 cycles"),
    "no heartbeat": (silence, ServoTimeout, "no heartbeat for 0.2"),
    "NMT state": (lambda on_bus: on_bus.beat(5, NmtState.PRE_OPERATIONAL), ServoError, "left OPERATIONAL.*PRE-OP"),
    "switched off": (lambda on_bus: on_bus.cycle_with(SWITCHED_ON), ServoError, "left OPERATION ENABLED.*SWITCHED ON"),
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
        on_bus.cycle_with(UNDEFINED)
        assert not on_bus.in_order()
        assert "0x0001 matches no state" in str(on_bus.problem(must_follow=False))
    on_bus.cycle_with(SWITCHED_ON)
    assert on_bus.problem(must_follow=False) is None


def test_a_drive_that_has_never_answered_is_in_an_unknown_state(arm_settings):
    node = NodeOnBus(arm_settings()).node
    assert "the drive has been in an unknown state" in str(node.not_in_time("enabling", 1.0, 0.0))


def test_the_word_of_the_state_before_ends_an_undefined_one(on_bus):
    on_bus.node.ask(State.SWITCHED_ON, "disabling")
    on_bus.cycle_with(UNDEFINED)
    on_bus.cycle_with(ENABLED)
    assert on_bus.problem() is None


def test_a_request_that_the_state_does_not_allow_names_the_drive(on_bus):
    on_bus.cycle_with(QUICK_STOP)
    with pytest.raises(ServoError, match=r"joint_5 \(node 5\), enabling: .*requires the torque to be removed first"):
        on_bus.node.ask(State.OPERATION_ENABLED, "enabling")
    on_bus.cycle_with(FAULT)
    with pytest.raises(ServoError, match="requires a fault reset"):
        on_bus.node.ask(State.SWITCHED_ON, "disabling")


def test_a_heartbeat_from_before_the_start_does_not_show_the_state_after_it(arm_settings):
    on_bus = NodeOnBus(arm_settings())
    on_bus.cycle.begin()
    on_bus.beat(5, NmtState.PRE_OPERATIONAL)
    on_bus.cycle_with(SWITCHED_ON)
    assert on_bus.problem(must_follow=False) is None
    on_bus.beat(5, NmtState.STOPPED)
    assert "left OPERATIONAL, it is in STOPPED" in str(on_bus.problem(must_follow=False))


@pytest.mark.parametrize("data", [b"", b"\x80"])
def test_an_empty_heartbeat_or_a_short_emergency_is_no_message(on_bus, data):
    on_bus.hear(0x705 if not data else 0x085, data)
    assert on_bus.problem() is None


@pytest.mark.parametrize("cob_id", [0x185, 0x285], ids=["position", "effort"])
def test_a_frame_of_a_wrong_length_is_missing_feedback(arm_settings, cob_id):
    """A drive that sends its effort in a frame of its own."""
    on_bus = NodeOnBus(arm_settings(pdo_objects_max=2))
    on_bus.cycle.begin()
    frames = {0x185: struct.pack("<Hi", SWITCHED_ON, 7), 0x285: struct.pack("<h", -2)}
    for data, missing in ((frames[cob_id], False), (frames[cob_id] + b"\0", True), (frames[cob_id][:-1], True)):
        on_bus.node.expect()
        for each, whole in frames.items():
            on_bus.hear(each, data if each == cob_id else whole)
        assert on_bus.node.evaluate(on_bus.clock()) is missing
    assert on_bus.node.wrong_frames == 2
    assert (on_bus.node.position_counts, on_bus.node.effort) == (7, -2)


def test_a_drive_that_catches_up_over_several_cycles_is_no_twin(on_bus):
    for frames in (0, 0, 2, 2, 1):
        on_bus.cycle_with(*[SWITCHED_ON] * frames)
        assert not on_bus.node._surplus_cycles


def test_a_twin_is_noticed_after_missing_feedback_too(on_bus):
    on_bus.cycle_with()
    on_bus.cycle_with(SWITCHED_ON)
    for _ in range(5):
        on_bus.cycle_with(SWITCHED_ON, SWITCHED_ON)
    assert "two drives have node id 5" in str(on_bus.problem(must_follow=False))


# Interpolated position mode --------------------------------------------------------------------------------------

INTERPOLATES, ENABLE_INTERPOLATION = 0x1000, 0x0010
IP, CSP = OperationMode.INTERPOLATED_POSITION, OperationMode.CYCLIC_SYNCHRONOUS_POSITION


@pytest.mark.parametrize("mode", [IP, CSP])
def test_interpolation_is_requested_of_an_enabled_drive_that_shall_stay_enabled(arm_settings, mode):
    on_bus = NodeOnBus(arm_settings(mode=mode))

    def requested():
        return bool(int.from_bytes(on_bus.node.prepare(on_bus.clock()).data[:2], "little") & ENABLE_INTERPOLATION)

    on_bus.cycle.begin()
    on_bus.run()
    on_bus.node.ask(State.OPERATION_ENABLED, "enabling")
    on_bus.cycle_with(SWITCHED_ON)
    assert not requested(), "not enabled yet"
    on_bus.cycle_with(ENABLED)
    assert requested() is (mode is IP)
    on_bus.node.ask(State.QUICK_STOP_ACTIVE, "quick stop")
    assert not requested(), "still enabled, but it shall stop"


@pytest.mark.parametrize("mode", [IP, CSP])
def test_a_drive_follows_setpoints_when_it_is_enabled_and_interpolates(arm_settings, mode):
    on_bus = NodeOnBus(arm_settings(mode=mode))
    on_bus.cycle.begin()
    follows = []
    for word in (SWITCHED_ON, SWITCHED_ON | INTERPOLATES, ENABLED, ENABLED | INTERPOLATES):
        on_bus.cycle_with(word)
        follows.append(on_bus.node.follows)
    assert follows == [False, False, mode is CSP, True]


def test_its_attributes_are_few_enough_to_be_looked_up_fast(on_bus):
    """Instances with more than 30 do not share their keys in Python 3.11, and each look-up in a cycle is a search."""
    assert len(vars(on_bus.node)) <= 30
    assert len(vars(on_bus.node.course)) <= 30
