"""When a drive counts as hung: no answers, and no change."""

import math

import pytest

from armload_drivers.cia402 import object_dictionary as od
from armload_drivers.cia402.axis_course import AxisCourse
from armload_drivers.cia402.process_data.frame_part import FramePart
from armload_drivers.cia402.process_data.process_image import effort_entry, target_entry
from armload_drivers.driver_errors import DriveHung
from armload_drivers.ethercat.ethercat_drive import HUNG_REQUESTS, HUNG_S, EthercatDrive

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
