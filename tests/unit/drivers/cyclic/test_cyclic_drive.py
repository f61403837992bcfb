"""A drive in the cycle, on either bus: standstill, the course that its axis is judged by, and problems by name."""

import math

import pytest

from armload_drivers.cia402.arm_settings import OperationMode
from armload_drivers.cia402.state_machine import State
from armload_drivers.cyclic.cyclic_drive import CyclicDrive
from armload_drivers.driver_errors import LoopLost, ServoError, ServoFault, ServoTimeout
from tests.scripted_drives import ENABLED, FAULT, QUICK_STOP, SWITCHED_ON, UNDEFINED

STANDSTILL_RAD_S = 0.005

pytestmark = pytest.mark.pure

COUNTS_PER_RAD, CYCLE_S = 1e5, 0.01
STILL = math.floor(STANDSTILL_RAD_S * CYCLE_S * COUNTS_PER_RAD)


class Course:
    """Notes by what an axis would be judged."""

    def __init__(self):
        self.lost, self.calls = "", []

    def begin(self, counts):
        self.calls.append(("begin", counts))

    def slow_down(self):
        self.calls.append("slow down")

    def follow(self, *values):
        self.calls.append(values)

    def taken(self):
        calls, self.calls = self.calls, []
        return calls


class Drive(CyclicDrive):
    """A drive whose cycles a test writes."""

    restarted, miss = False, None

    def __init__(self, settings, arm):
        self.time_s = 1.0
        super().__init__(settings, lambda: self.time_s, arm)

    def require_configured(self):
        pass

    def leave_cycle(self):
        pass

    def restart(self):
        pass

    def in_order(self, now_s):
        return self.problem("", now_s, must_follow=True) is None

    def _missed(self, step, now_s):
        return self.miss

    def receive(self, word, counts=0, effort=0, target=0, elapsed_s=CYCLE_S):
        self.time_s += elapsed_s
        self._receive(word, counts, effort, target, self.time_s, elapsed_s)


@pytest.fixture
def drive(arm_settings):
    arm = arm_settings(cycle_s=CYCLE_S)
    drive = Drive(arm.drives[1], arm)
    drive.begin(COUNTS_PER_RAD, Course())
    return drive


def enabled(drive):
    drive.receive(SWITCHED_ON)
    drive.ask(State.OPERATION_ENABLED, "enabling")
    drive.receive(ENABLED)
    drive.course.calls.clear()
    return drive


@pytest.mark.parametrize(
    ("mode", "interpolates"),
    [(OperationMode.INTERPOLATED_POSITION, True), (OperationMode.CYCLIC_SYNCHRONOUS_POSITION, False)],
)
def test_interpolation_is_requested_of_an_enabled_drive_that_is_to_remain_enabled(arm_settings, mode, interpolates):
    arm = arm_settings(cycle_s=CYCLE_S, mode=mode)
    drive = Drive(arm.drives[1], arm)
    drive.begin(COUNTS_PER_RAD, Course())

    def requested():
        return bool(drive.controlword(drive.time_s) & 0x0010)

    drive.receive(SWITCHED_ON)
    assert not requested()
    drive.ask(State.OPERATION_ENABLED, "enabling")
    assert not requested()
    drive.receive(ENABLED)
    assert requested() is interpolates
    drive.ask(State.SWITCHED_ON, "disabling")
    assert not requested()


def test_a_drive_begins_with_nothing_of_its_own(arm_settings):
    arm = arm_settings()
    drive = Drive(arm.drives[1], arm)
    values = drive.target_counts, drive.offset_permille, drive.position_counts, drive.effort, drive.statusword
    assert values == (0, 0, 0, 0, 0)
    assert not (drive.lost)
    assert not (drive.is_silent)
    assert not (drive.is_gone)
    assert not (drive.faulty)
    assert not (drive.follows)
    assert drive.still_for(0)
    assert not drive.still_for(1)


def test_standstill_is_counted_and_ends_with_a_motion_that_is_faster(drive):
    for counts in (0, STILL, 0, -STILL):
        drive.receive(SWITCHED_ON, counts)
    assert drive.still_for(4)
    assert not drive.still_for(5)
    drive.receive(SWITCHED_ON, 1)
    assert not drive.still_for(1)
    drive.receive(SWITCHED_ON, 1)
    assert drive.still_for(1)
    drive.forget_rest()
    assert not drive.still_for(1)
    assert drive.position_counts == 1


def test_the_sign_of_the_scale_does_not_matter_for_standstill(drive):
    drive.begin(-COUNTS_PER_RAD, Course())
    drive.receive(SWITCHED_ON, STILL)
    assert drive.still_for(1)


def test_a_position_read_by_sdo_may_differ_by_as_much_more_as_it_is_old(drive):
    enabled(drive)
    drive.receive(ENABLED, 0, effort=9)
    begun_s = drive.time_s
    drive.target_counts = 70
    drive.begin(COUNTS_PER_RAD, drive.course)
    drive.receive(ENABLED, 0, effort=9)
    drive.course.taken()
    drive.take_position(5 * STILL, begun_s + 0.04, begun_s + 0.05)
    assert drive.still_for(2)
    assert not drive.still_for(3)
    assert drive.position_counts == 5 * STILL
    slowed, (target, counts, effort, elapsed_s, longest_s) = drive.course.taken()
    assert slowed == "slow down"
    assert (target, counts, effort) == (70, 5 * STILL, 9)
    assert (elapsed_s, longest_s) == pytest.approx((0.04, 0.05))
    drive.take_position(0, begun_s + 0.08, begun_s + 0.085)
    assert not drive.still_for(1), "five cycles' way in four and a half"
    assert drive.course.taken()[1][3:] == pytest.approx((0.04, 0.045))
    drive.take_position(STILL, begun_s + 0.081, begun_s + 0.082)
    assert drive.still_for(1), "less than a cycle counts as a whole one"
    drive.take_position(STILL, begun_s + 0.085, begun_s + 0.086)
    assert drive.still_for(2)


def test_an_axis_without_torque_is_not_judged(drive):
    drive.receive(SWITCHED_ON, 3)
    drive.take_position(4, drive.time_s, drive.time_s)
    assert drive.course.taken() == []


def test_an_enabled_axis_is_judged_by_its_targets_and_one_that_stops_by_its_ramp(drive):
    drive.receive(SWITCHED_ON, 5)
    drive.ask(State.OPERATION_ENABLED, "enabling")
    drive.receive(ENABLED, 6, 1, 60, 0.01)
    drive.receive(ENABLED, 7, 2, 70, 0.02)
    assert drive.course.taken() == [("begin", 6), (60, 6, 1, 0.01), (70, 7, 2, 0.02)]
    drive.receive(QUICK_STOP, 8, 3, 80, 0.01)
    assert drive.course.taken() == ["slow down", (80, 8, 3, 0.01)]
    drive.receive(SWITCHED_ON, 9)
    drive.receive(ENABLED, 9, 0, 90)
    assert drive.course.taken()[0] == ("begin", 9), "begun again after each loss of torque"


def test_a_drive_leaves_its_state_and_the_step_is_named(drive):
    enabled(drive)
    assert drive.in_order(drive.time_s)
    assert drive.follows
    drive.receive(SWITCHED_ON)
    assert drive.problem("a step", drive.time_s, must_follow=False) is None
    problem = drive.problem("a step", drive.time_s, must_follow=True)
    assert (problem.node_id, problem.joint, problem.step) == (3, "joint_3", "a step")
    assert f"SWITCHED ON (statusword 0x{SWITCHED_ON:04X})" in str(problem)


def test_of_several_problems_the_most_serious_is_named(drive):
    enabled(drive)
    drive.receive(UNDEFINED)
    drive.miss = ServoTimeout(3, "joint_3", "", "missed", "")
    assert "matches no state" in str(drive.problem("", 0.0, must_follow=True))
    drive.receive(FAULT)
    assert isinstance(drive.problem("", 0.0, must_follow=True), ServoFault)
    assert drive.faulty
    drive.course.lost = "it flew"
    assert isinstance(drive.problem("", 0.0, must_follow=True), LoopLost)
    drive.course.lost = ""
    drive.receive(ENABLED)
    assert drive.problem("", 0.0, must_follow=True) is drive.miss


def test_lost_feedback_is_counted_against_what_is_allowed(drive):
    drive._missing = 3
    assert drive.is_silent
    assert not drive.is_gone
    drive._missing = 4
    assert drive.is_gone
    error = drive.gone("a step")
    assert drive.lost
    assert "no feedback for 4 cycles" in str(error)
    drive.receive(SWITCHED_ON)
    assert not (drive.lost)
    assert not (drive.is_silent)


def test_a_state_that_is_not_reached_is_named_with_the_time_in_the_present_one(drive):
    assert "the requested state and standstill not reached within 2.0 s" in str(drive.not_in_time("x", 2.0, 0.0))
    drive.receive(SWITCHED_ON)
    since_s = drive.time_s
    drive.ask(State.OPERATION_ENABLED, "enabling")
    text = str(drive.not_in_time("enabling", 2.0, since_s + 1.5))
    assert "OPERATION ENABLED and standstill not reached within 2.0 s" in text
    assert "SWITCHED ON" in text
    assert "for 1.50 s" in text


def test_a_fresh_start_forgets_what_was_wrong(drive):
    enabled(drive)
    drive.receive(UNDEFINED)
    drive._missing, drive.lost = 9, True
    drive.begin(COUNTS_PER_RAD, Course())
    assert not (drive.lost)
    assert not (drive.is_gone)
    assert not (drive.still_for(1))
    assert drive.statusword == 0
    assert drive.problem("", 0.0, must_follow=False) is None
    with pytest.raises(ServoError):
        raise drive.problem("", 0.0, must_follow=True)
