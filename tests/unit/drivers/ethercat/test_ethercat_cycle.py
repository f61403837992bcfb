"""The EtherCAT cycle with a line of which a test decides every frame: what is trusted, and what is wrong with it."""

import struct
from concurrent.futures import Future

import numpy as np
import pytest

from armload_drivers.cia402 import object_dictionary as od
from armload_drivers.cia402.process_data.drive_units import ArmUnits
from armload_drivers.cia402.process_data.process_image import effort_entry, target_entry
from armload_drivers.driver_errors import (
    BusError,
    FramesLost,
    LinkDown,
    ServoTimeout,
    WorkingCounterWrong,
)
from armload_drivers.ethercat import ethercat_cycle
from armload_drivers.ethercat.ethercat_cycle import EthercatCycle
from armload_drivers.ethercat.ethercat_drive import EthercatDrive
from armload_drivers.ethercat.ethercat_line import LineState, MailboxAbort, MailboxSilence
from armload_drivers.ethercat.pdo_assignment import FramePart
from tests.scripted_drives import FAULT, SWITCHED_ON

STATE_S = 0.02

CYCLE_S, ALLOWED, DRIVES = 0.01, 3, 5
COMPLETE = 3 * DRIVES
OP, SAFEOP, NONE = LineState.OP.value, LineState.SAFEOP.value, LineState.NONE.value


class Line:
    """Five drives, of which the arm has those with node ids 2, 3 and 5."""

    interface, expected_counter = "eth9", COMPLETE

    def __init__(self):
        self.counter, self.status = COMPLETE, [OP] * DRIVES
        self.words = [SWITCHED_ON] * DRIVES
        self.requested, self.polled, self.codes, self.outputs = [], [], {}, {}
        self.reads = self.frames = 0
        self.limits_s = set()
        self.read = None

    def request(self, state, place=None):
        self.requested.append(state)
        if place is None:
            self.status = [state.value] * DRIVES

    def reaches(self, state, place, limit_s):
        return True

    def statuses(self):
        self.reads += 1
        return self.read.pop(0) if self.read else self.status

    def exchange(self, limit_s):
        self.frames += 1
        self.limits_s.add(limit_s)
        return self.counter

    def put(self, place, data):
        self.outputs[place] = data

    def get(self, place):
        return struct.pack("<Hih", self.words[place], 100 * place, place)

    def reason(self, place):
        return f"reason {place}"

    def on_emergency(self, place, take):
        pass

    def poll_mailbox(self, place):
        self.polled.append(place)

    def upload(self, place, index, subindex, limit_s):
        code = self.codes[place]
        if isinstance(code, Exception):
            raise code
        assert (index, subindex) == (0x603F, 0)
        return struct.pack("<H", code)


class Clock:
    """A frame every cycle, but `skip` cycles late."""

    def __init__(self):
        self.time_s, self.skip = 0.0, 0

    def now_s(self):
        return self.time_s

    def begin(self, cycle_s):
        assert cycle_s == CYCLE_S

    def next(self):
        self.time_s += (1 + self.skip) * CYCLE_S
        return self.time_s, self.skip


class Worker:
    """Does at once what a thread would do beside the cycle."""

    def submit(self, action, *args):
        future = Future()
        try:
            future.set_result(action(*args))
        except Exception as error:  # noqa: BLE001 - as an executor
            future.set_exception(error)
        return future


class Monitor:
    """Another master's frames; none at first."""

    frame, closed, looks = None, 0, 0

    def __init__(self, interface):
        assert interface == "eth9"

    def commands_only(self):
        pass

    def receive(self):
        Monitor.looks += 1
        if isinstance(self.frame, Exception):
            raise self.frame
        return self.frame

    def close(self):
        Monitor.closed += 1


class Channel:
    unanswered = 0


class Rig:
    def __init__(self, arm):
        self.line, self.clock = Line(), Clock()
        self.nodes = [EthercatDrive(drive, self.line, Channel(), self.clock, arm) for drive in arm.drives]
        for node in self.nodes:
            objects = {od.CONTROLWORD: 0, target_entry(node.settings.mode): 2, od.TORQUE_OFFSET: 6}
            inputs = {od.STATUSWORD: 0, od.POSITION_ACTUAL: 2, effort_entry(node.settings): 6}
            node.map(FramePart(8, objects, ()), FramePart(8, inputs, ()), bytes(8))
        units = ArmUnits(arm, [0, 0, 0])
        self.cycle = EthercatCycle(arm, self.nodes, units, line=self.line, clock=self.clock, worker=Worker())

    def run(self, cycles=1):
        for _ in range(cycles):
            feedback = self.cycle.run()
        return feedback

    def problems(self, cycles=1):
        self.run(cycles)
        return self.cycle._line_problems()


@pytest.fixture
def rig(arm_settings, monkeypatch):
    monkeypatch.setattr(ethercat_cycle, "FrameMonitor", Monitor)
    monkeypatch.setattr(ethercat_cycle, "is_running", lambda interface: True)
    monkeypatch.setattr(Monitor, "frame", None)
    rig = Rig(arm_settings(cycle_s=CYCLE_S))
    rig.cycle.begin()
    return rig


def test_a_start_goes_through_safeop_to_op_with_frames(rig):
    assert rig.line.requested == [LineState.SAFEOP, LineState.OP]
    assert rig.line.frames == 2
    assert set(rig.line.outputs) == {1, 2, 4}
    rig.cycle.end()
    assert rig.line.requested[-1] is LineState.PREOP
    assert not any(node.in_op for node in rig.nodes)


def test_a_drive_that_does_not_reach_a_state_is_named_after_three_seconds(arm_settings):
    rig = Rig(arm_settings(cycle_s=CYCLE_S))
    rig.line.request = lambda state, place=None: None
    rig.line.status = [SAFEOP, SAFEOP, OP, SAFEOP, SAFEOP]
    with pytest.raises(ServoTimeout, match=r"joint_3.*SAFEOP not reached within 3 s, the drive is in OP: reason 2"):
        rig.cycle.begin()
    assert rig.line.frames == 300


def test_what_else_is_in_the_line_need_not_reach_a_state(rig):
    rig.line.request = lambda state, place=None: setattr(rig.line, "status", [0, *[state.value] * 2, 0, state.value])
    rig.cycle.begin()
    assert all(node.in_op for node in rig.nodes)


def test_a_complete_frame_is_feedback_of_the_frame_before(rig):
    first_s = rig.run().time_s
    feedback = rig.run()
    assert feedback.time_s == pytest.approx(first_s + CYCLE_S)
    assert feedback.time_s == pytest.approx(rig.clock.now_s() - CYCLE_S)
    assert not feedback.missing.any()
    np.testing.assert_array_equal(feedback.statusword, [SWITCHED_ON] * 3)
    assert [node.position_counts for node in rig.nodes] == [100, 200, 400]
    assert (rig.cycle.sent, rig.cycle.lost, rig.cycle.wrong, feedback.cycle) == (2, 0, 0, 2)
    assert rig.line.limits_s == {0.6 * CYCLE_S}
    rig.clock.skip = 2
    assert rig.run().skipped_cycles == 2


def test_frames_that_are_lost_in_a_row_are_a_problem_when_they_are_too_many(rig):
    rig.run()
    rig.line.counter = -1
    assert not rig.problems(ALLOWED)
    assert rig.run(0 + 1).missing.all()
    (problem,) = rig.cycle._line_problems()
    assert isinstance(problem, FramesLost)
    assert f"{ALLOWED + 1} frames in a row did not return within 6.0 ms" in str(problem)
    assert (rig.cycle.lost, rig.cycle.wrong) == (ALLOWED + 1, 0)
    assert all(node.is_gone for node in rig.nodes)
    rig.line.counter = COMPLETE
    assert not rig.problems()
    assert not any(node.is_silent for node in rig.nodes)


def test_a_twentieth_of_the_last_500_frames_may_be_lost(rig):
    lost = 0
    for number in range(500):
        rig.line.counter = -1 if number % 20 == 7 else COMPLETE
        lost += rig.line.counter < 0
        assert not rig.problems()
    assert lost == 25
    rig.line.counter = -1
    while not rig.problems():
        rig.line.counter = COMPLETE
        rig.run()
        rig.line.counter = -1
        lost += 1
    (problem,) = rig.cycle._line_problems()
    assert "26 of the last 500 frames" in str(problem)
    assert "allowed are 25" in str(problem)
    rig.line.counter = COMPLETE
    rig.run(500)
    assert not rig.cycle._line_problems(), "what is longer ago is forgotten"


def test_a_cable_that_is_unplugged_ends_it_at_once(rig, monkeypatch):
    rig.line.counter = -1
    rig.run()
    monkeypatch.setattr(ethercat_cycle, "is_running", lambda interface: False)
    with pytest.raises(LinkDown, match="eth9"):
        rig.run()


def test_a_wrong_counter_although_all_are_in_op_is_no_feedback(rig):
    rig.line.counter = COMPLETE - 1
    assert rig.run().missing.all()
    assert not rig.problems(ALLOWED - 1)
    (problem,) = rig.problems()
    assert isinstance(problem, WorkingCounterWrong)
    assert f"is {COMPLETE - 1} instead of {COMPLETE}, {ALLOWED + 1} frames in a row" in str(problem)
    assert rig.cycle.wrong == ALLOWED + 1
    rig.line.counter = COMPLETE
    assert not rig.problems()


def test_of_a_drive_that_has_left_op_nothing_is_taken_and_of_the_others_what_they_prove(rig):
    rig.line.status = [OP, OP, SAFEOP | 0x10, OP, OP]
    rig.line.counter = 6
    np.testing.assert_array_equal(rig.run().missing, [False, True, False])
    rig.line.counter = 5
    assert rig.run().missing.all(), "less than two drives in OP provide"
    assert (rig.cycle.wrong, rig.cycle._line_problems()) == (0, [])
    rig.line.status = [SAFEOP] * DRIVES
    rig.line.counter = 0
    assert rig.run().missing.all()


def test_states_are_read_now_and_then_and_at_once_after_a_wrong_counter(rig):
    rig.run()
    before = rig.line.reads
    rig.run(80)
    assert rig.line.reads - before == pytest.approx(80 * CYCLE_S / STATE_S, rel=0.4)
    before = rig.line.reads
    rig.line.counter = COMPLETE - 3
    rig.run(3)
    assert rig.line.reads - before == 3


def test_a_reading_that_finds_nobody_is_repeated_unless_a_frame_has_proved_otherwise(rig):
    rig.line.read = [[NONE] * DRIVES] * 3 + [[OP] * DRIVES]
    rig.cycle.read_states()
    assert not rig.line.read
    assert all(node.in_op for node in rig.nodes)
    rig.line.read = [[NONE] * DRIVES] * 5
    rig.cycle.read_states(all_answered=True)
    assert len(rig.line.read) == 4
    assert all(node.in_op for node in rig.nodes)
    rig.cycle.read_states()
    assert not rig.line.read
    assert not any(node.in_op for node in rig.nodes)


def test_another_masters_frame_is_kept_until_the_next_start(rig):
    assert rig.cycle.rivals == ("", "")
    Monitor.frame = BusError("down")
    rig.run()
    assert rig.cycle.rivals == ("", "")
    rig.run(2)
    Monitor.frame = bytes(16) + b"\x05"
    rig.run(2)
    assert "another master sends EtherCAT frames on eth9 (command 5)" in rig.cycle.rivals[0]
    looks = Monitor.looks
    rig.run(5)
    assert Monitor.looks == looks, "one is enough"
    Monitor.frame = None
    rig.cycle.begin()
    assert rig.cycle.rivals == ("", "")
    closed = Monitor.closed
    rig.cycle.close()
    rig.cycle.close()
    assert Monitor.closed == closed + 1


def test_mailboxes_are_looked_into_in_turn_but_not_of_a_drive_outside_op(rig):
    rig.line.polled.clear()
    rig.run(40)
    assert rig.line.polled[:6] in ([1, 2, 4, 1, 2, 4], [2, 4, 1, 2, 4, 1], [4, 1, 2, 4, 1, 2])
    assert len(rig.line.polled) == pytest.approx(8, abs=1)
    rig.line.status = [OP, OP, SAFEOP, OP, OP]
    rig.line.counter = COMPLETE - 3
    rig.line.polled.clear()
    rig.run(40)
    assert set(rig.line.polled) == {1, 4}


def test_the_cause_of_a_fault_is_asked_for_and_silence_is_no_cause(rig):
    rig.line.words = [FAULT] * DRIVES
    rig.run()
    rig.line.codes = {1: 0x2310, 2: MailboxAbort(1, "no"), 4: MailboxSilence()}
    rig.cycle._explain(rig.nodes)
    texts = [str(node.problem("", 0.0, must_follow=False)) for node in rig.nodes]
    assert "0x2310" in texts[0]
    assert all("no emergency message gave a cause" in text for text in texts[1:])
    rig.line.codes = {2: 0x3210, 4: 0x3210}
    rig.cycle._explain(rig.nodes)
    texts = [str(node.problem("", 0.0, must_follow=False)) for node in rig.nodes]
    assert ["0x3210" in text for text in texts] == [False, True, True], "a cause that is known is not asked for again"


def test_frames_go_on_while_something_waits_for_a_drive(rig):
    class Slow:
        """Ends its action after five looks."""

        looks = 0

        def submit(self, action):
            future = Future()

            def done():
                Slow.looks += 1
                if Slow.looks == 5:
                    future.set_result(action())
                return Slow.looks >= 5

            future.done = done
            return future

    rig.cycle._worker, did = Slow(), []
    frames = rig.line.frames
    rig.cycle._poll_due_s = 1e9
    rig.cycle.meanwhile(lambda: did.append(1))
    assert did == [1]
    assert rig.line.frames - frames == 4


def test_the_cycles_time_is_its_clocks(rig):
    rig.run(7)
    assert rig.cycle.now_s() == rig.clock.time_s > 0.0


def test_at_the_end_every_drive_has_a_second_to_reach_preop(rig):
    waited = []
    rig.line.reaches = lambda *values: waited.append(values) or True
    rig.cycle.end()
    assert waited == [(LineState.PREOP, place, 1.0) for place in (1, 2, 4)]


def test_other_masters_are_looked_for_in_every_cycle_of_ten_milliseconds(rig):
    looks = Monitor.looks
    rig.run(40)
    assert Monitor.looks - looks == pytest.approx(40, abs=8), "rounding may postpone a look by a cycle"


def test_the_cause_of_a_fault_is_waited_for_5_ms_per_drive(rig, monkeypatch):
    rig.line.words = [FAULT] * DRIVES
    rig.run()
    asked, waited = [], []
    monkeypatch.setattr(rig.line, "upload", lambda *values: asked.append(values[-1]) or b"\0\0")
    whole = ethercat_cycle.wait
    monkeypatch.setattr(ethercat_cycle, "wait", lambda futures, limit_s: waited.append(limit_s) or whole(futures, 0))
    rig.cycle._explain(rig.nodes[:2])
    assert (asked, waited) == ([0.005, 0.005], [pytest.approx(0.01)])


@pytest.mark.parametrize(
    ("in_op", "counter", "trusted"), [(2, 6, True), (2, 5, False), (2, 7, True), (0, 1, False), (1, 3, True)]
)
def test_drives_in_op_are_trusted_if_the_counter_has_three_for_each(rig, in_op, counter, trusted):
    """One for inputs and two for outputs (LRW)."""
    rig.line.status = [OP, *[OP if number < in_op else SAFEOP for number in range(2)], OP, SAFEOP]
    rig.line.counter = counter
    missing = rig.run().missing
    assert (not missing[:in_op].any() and in_op > 0) is trusted
    assert missing[in_op:].all()


def test_while_something_waits_for_a_drive_a_failing_bus_is_tried_again_after_a_cycle(rig, monkeypatch):
    slept, runs = [], []

    def run():
        runs.append(1)
        if len(runs) < 3:
            raise BusError("down")
        future.set_result(None)

    future = Future()
    monkeypatch.setattr(ethercat_cycle.time, "sleep", slept.append)
    monkeypatch.setattr(rig.cycle, "run", run)
    rig.cycle._worker = Worker()
    rig.cycle._worker.submit = lambda action: future
    rig.cycle.meanwhile(lambda: None)
    assert slept == [CYCLE_S, CYCLE_S]
