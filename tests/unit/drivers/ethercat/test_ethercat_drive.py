"""What the state of a drive means: configured, lost, restarted, or hung, with no answers and no change."""

import math
from types import SimpleNamespace

import pytest

from armload_drivers.cia402 import object_dictionary as od
from armload_drivers.cia402.axis_course import AxisCourse
from armload_drivers.cia402.process_data.frame_part import FramePart
from armload_drivers.cia402.process_data.process_image import effort_entry, target_entry
from armload_drivers.cia402.state_machine import State
from armload_drivers.driver_errors import DriveHung, DriveLeftOp, ServoError, ServoTimeout
from armload_drivers.ethercat.ethercat_drive import EthercatDrive
from armload_drivers.ethercat.ethercat_line import LineState

HUNG_REQUESTS, HUNG_S, STATE_ERROR = 2, 0.5, 0x10

CYCLE_S = 0.01


class Line:
    """Keeps the bytes of one drive."""

    inputs = bytes(8)

    def put(self, place, data):
        pass

    def get(self, place):
        return self.inputs

    def on_emergency(self, place, take):
        pass

    def reason(self, place):
        return "no reason"


class Channel:
    unanswered = 0


class Clock:
    def now_s(self):
        return 0.0


@pytest.fixture
def drive(arm_settings):
    arm = arm_settings(cycle_s=CYCLE_S)
    settings = arm.drives[0]
    drive = EthercatDrive(settings, Line(), Channel(), Clock(), arm)
    outputs = FramePart(8, {od.CONTROLWORD: 0, target_entry(settings.mode): 2, od.TORQUE_OFFSET: 6}, ())
    inputs = FramePart(8, {od.STATUSWORD: 0, od.POSITION_ACTUAL: 2, effort_entry(settings): 6}, ())
    drive.map(outputs, inputs, bytes(8))
    course = AxisCourse(1e5, 2.0, 5.0, window_rad=0.1, effort_limit=math.inf, cycle_s=CYCLE_S)
    drive.begin(1e5, course)
    return drive


def test_a_drive_that_answers_no_request_and_changes_nothing_hangs(drive):
    drive._sdo.unanswered = HUNG_REQUESTS
    drive.evaluate(1.0)
    assert drive._missed("in the cycle", 1.0 + 0.9 * HUNG_S) is None
    drive.evaluate(1.0 + HUNG_S)
    assert isinstance(drive._missed("in the cycle", 1.0 + 1.1 * HUNG_S), DriveHung)


def test_a_drive_whose_feedback_changes_does_not_hang_whatever_its_mailbox_does(drive):
    drive._sdo.unanswered = 10 * HUNG_REQUESTS
    for cycle in range(100):
        drive._line.inputs = bytes([0x37, 0x12, cycle, 0, 0, 0, 0, 0])
        drive.evaluate(cycle * CYCLE_S)
        assert drive._missed("in the cycle", cycle * CYCLE_S) is None


def test_its_attributes_are_few_enough_to_be_looked_up_fast(drive):
    """Instances with more than 30 do not share their keys in Python 3.11, and each look-up in a cycle is a search."""
    assert len(vars(drive)) <= 30
    assert len(vars(drive.course)) <= 30


PREOP, SAFEOP, OP = (state.value for state in (LineState.PREOP, LineState.SAFEOP, LineState.OP))


@pytest.mark.parametrize(
    ("status", "in_op", "restarted", "configured"),
    [
        (OP, True, False, False),
        (OP | STATE_ERROR, True, False, False),
        (SAFEOP, False, False, False),
        (PREOP, False, False, True),
        (LineState.INIT.value, False, True, False),
        (LineState.NONE.value, False, True, False),
    ],
)
def test_a_state_that_was_read_tells_whether_it_runs_is_configured_or_has_restarted(
    drive, status, in_op, restarted, configured
):
    drive.status = status
    assert (drive.in_op, drive.restarted) == (in_op, restarted)
    if configured:
        drive.require_configured()
        return
    with pytest.raises(ServoError, match="the drive has restarted since it was configured: it is in"):
        drive.require_configured()


@pytest.mark.parametrize(
    ("status", "error", "text"),
    [
        (OP, None, ""),
        (LineState.NONE.value, ServoTimeout, "the drive has left the line: it does not answer under its address"),
        (SAFEOP, DriveLeftOp, "the drive has left OP, it is in SAFEOP: no reason"),
    ],
)
def test_a_drive_that_left_is_lost(drive, status, error, text):
    drive.status = status
    found = drive._missed("in the cycle", 0.0)
    assert type(found) is (error or type(None))
    assert drive.lost is bool(error)
    assert text in str(found)
    gone = drive.gone("in the cycle")
    assert isinstance(gone, ServoTimeout)
    assert ("has left the line" in str(gone)) is (error is ServoTimeout)


def test_the_cause_of_a_fault_is_the_emergency_else_the_error_code(drive):
    drive._take_emergency(0x2310, 2, b"\1\2\3\4\5")
    drive.explain(0x7500)
    assert (drive._emergency.code, drive._emergency.register) == (0x2310, 2)
    drive._take_emergency(0, 0, b"")
    assert drive._emergency is None
    drive.explain(0x7500)
    assert (drive._emergency.code, drive._emergency.register) == (0x7500, None)


class NotedLine(Line):
    """Notes requests, and reaches only some states."""

    def __init__(self, *reached):
        self.requested, self.reached = [], reached

    def request(self, state, place):
        self.requested.append(state)

    def reaches(self, state, place, limit_s):
        return state in self.reached


@pytest.mark.parametrize(
    ("reached", "requested"), [((), [LineState.INIT]), ((LineState.INIT,), [LineState.INIT, LineState.PREOP])]
)
def test_a_restart_goes_through_init(drive, reached, requested):
    drive._line = line = NotedLine(*reached)
    drive.restart()
    assert line.requested == requested


@pytest.mark.parametrize(("status", "requested"), [(OP, [LineState.SAFEOP]), (SAFEOP, []), (PREOP, [])])
def test_only_a_drive_in_op_leaves_the_cycle(drive, status, requested):
    drive._line = line = NotedLine()
    drive.status = status
    drive.leave_cycle()
    assert line.requested == requested


def test_feedback_is_judged_by_the_target_of_the_frame_before_and_the_time_since(drive):
    judged = []
    drive._receive = lambda *values: judged.append(values)
    drive._line.inputs = bytes([0x37, 0x12, 5, 0, 0, 0, 7, 0])
    for cycle in range(3):
        drive.target_counts = 100 * cycle
        drive.evaluate(1.0 + 0.25 * cycle)
    assert [values[:4] for values in judged] == [(0x1237, 5, 7, target) for target in (0, 0, 100)]
    assert [values[4] for values in judged] == [1.0, 1.25, 1.5]
    assert [values[5] for values in judged][1:] == pytest.approx([0.25, 0.25])


@pytest.mark.parametrize(("same", "noted"), [(1, False), (2, True), (3, True)])
def test_feedback_without_a_changed_bit_for_two_cycles_of_a_moving_target_points_to_the_firmware(drive, same, noted):
    for cycle in range(same + 1):
        drive.target_counts = cycle
        drive.evaluate(CYCLE_S * cycle)
    assert drive._same_cycles == same
    notes = getattr(drive.astray("in the cycle"), "__notes__", [])
    assert any("not a bit of its feedback has changed" in note for note in notes) is noted
    drive.evaluate(1.0)
    drive.evaluate(1.1)
    assert drive._same_cycles == 0, "at rest nothing needs to change"


def test_every_state_of_a_restart_has_two_seconds(drive):
    waited = []
    drive._line = SimpleNamespace(
        request=lambda state, place: None, reaches=lambda *values: waited.append(values) or True
    )
    drive.restart()
    assert waited == [(LineState.INIT, drive.place, 2.0), (LineState.PREOP, drive.place, 2.0)]


def test_a_drive_is_in_order_only_with_everything_as_it_should_be(drive):
    drive.machine.state = State.OPERATION_ENABLED
    assert drive.in_order(0.0)
    for name, wrong in (("_undefined", 0x1234), ("_missing", 1), ("status", OP | STATE_ERROR), ("_emergency", "one")):
        before = getattr(drive, name)
        setattr(drive, name, wrong)
        assert not drive.in_order(0.0), name
        setattr(drive, name, before)
    drive._sdo.unanswered = 1
    assert not drive.in_order(0.0)
    drive._sdo.unanswered = 0
    drive.course.lost = "left"
    assert not drive.in_order(0.0)
