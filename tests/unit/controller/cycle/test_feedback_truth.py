"""Feedback that must not be taken for false, and the statusword bits of each drive."""

from contextlib import nullcontext

import numpy as np
import pytest

from armload_controller.config.robot import load_robot
from armload_controller.cycle.feedback_truth import (
    DriveLag,
    InternalLimit,
    RemoteLost,
    TorqueMissing,
    VelocityContradicts,
    VoltageLost,
)
from armload_controller.cycle.plugins import CycleStep
from armload_controller.session.run_session import feedback_truth
from armload_drivers.servos import JointCommand, JointFeedback

LIMITED_S = 0.1

ROBOT = load_robot("er50")
N, CYCLE_S = 6, 0.004
SPEED = np.full(N, 0.1)
WORD = 0x1637


def run(change=lambda cycle, feedback: feedback, cycles=300, first_word=WORD, speed=SPEED, start_rad=0.0):
    """Feed the monitor with an arm at constant speed; `change` modifies the feedback of each cycle."""
    truth = feedback_truth(ROBOT, CYCLE_S)
    ones, none = np.ones(N), np.zeros(N, dtype=bool)
    sent = None
    for cycle in range(cycles):
        position = start_rad + speed * CYCLE_S * cycle
        words = np.full(N, first_word if cycle == 0 else WORD, dtype=np.uint16)
        true = JointFeedback(cycle, cycle * CYCLE_S, position, None, ones, None, words, none)
        truth.on_cycle(CycleStep(change(cycle, true), sent, None, None, None, None))
        sent = JointCommand(position, speed, np.zeros(N))
    return truth


def word(joint, value):
    words = np.full(N, WORD, dtype=np.uint16)
    words[joint] = value
    return words


def test_an_honest_arm_passes():
    run()
    run(speed=np.zeros(N))
    run(lambda cycle, feedback: feedback._replace(velocity_rad_s=SPEED))


@pytest.mark.parametrize(
    ("bits", "kind"),
    [(WORD & ~0x0010, VoltageLost), (WORD & ~0x0200, RemoteLost), (WORD | 0x2000, DriveLag)],
)
def test_a_bit_that_is_wrong_is_a_lie_at_once(bits, kind):
    with pytest.raises(kind, match="joint_4"):
        run(lambda cycle, feedback: feedback._replace(statusword=word(3, bits)) if cycle == 10 else feedback)


def test_a_bit_that_a_drive_never_sets_is_not_missed():
    """Not every drive implements the bits voltage and remote; a bit that was never set cannot be lost."""
    bare = WORD & ~0x0210
    run(lambda cycle, feedback: feedback._replace(statusword=word(3, bare)), first_word=bare)


def test_an_internal_limit_may_be_touched_but_not_lasted_on():
    def limited(lasting_s):
        return lambda cycle, feedback: (
            feedback._replace(statusword=word(1, WORD | 0x0800))
            if 0.2 <= feedback.time_s < 0.2 + lasting_s
            else feedback
        )

    run(limited(0.9 * LIMITED_S))
    with pytest.raises(InternalLimit, match="joint_2"):
        run(limited(1.5 * LIMITED_S))


def test_a_velocity_of_another_sign_is_found():
    with pytest.raises(VelocityContradicts, match="joint_1"):
        run(lambda cycle, feedback: feedback._replace(velocity_rad_s=np.where(np.arange(N) == 0, -0.3, SPEED)))


def test_a_velocity_is_compared_with_the_position_over_a_while():
    """A drive's own velocity is noisy from cycle to cycle."""
    run(lambda cycle, feedback: feedback._replace(velocity_rad_s=SPEED + 0.5 * (-1) ** cycle))


@pytest.mark.parametrize(("window", "excess", "found"), [(0, 1.002, True), (1, 1.002, True), (1, 0.998, False)])
def test_every_window_has_the_same_limit(window, excess, found):
    """30 % of the position's speed and 5 % of the greatest one, on average over 100 cycles."""
    wrong = SPEED + excess * (0.3 * SPEED + 0.05 * ROBOT.limits.motion.velocity_max_rad_s)

    def change(cycle, feedback):
        return feedback._replace(velocity_rad_s=SPEED if cycle < 1 + 100 * window else wrong)

    with pytest.raises(VelocityContradicts) if found else nullcontext():
        run(change, cycles=210)


def test_an_arm_that_reports_neither_current_nor_torque_is_not_accused_of_idling():
    run(lambda cycle, feedback: feedback._replace(current_a=None))


def test_an_arm_that_reports_torque_instead_of_current():
    run(lambda cycle, feedback: feedback._replace(current_a=None, torque_nm=np.ones(N)))
    with pytest.raises(TorqueMissing):
        run(lambda cycle, feedback: feedback._replace(current_a=None, torque_nm=np.zeros(N)), 1000)


def test_no_current_at_standstill_is_nothing_and_in_motion_a_lie():
    def idle(cycle, feedback):
        return feedback._replace(current_a=np.zeros(N))

    run(idle, speed=np.zeros(N), start_rad=1.0)
    with pytest.raises(TorqueMissing, match="exactly zero"):
        run(idle, 1000)


@pytest.mark.parametrize(("cycles", "found"), [(250, False), (252, True)])
def test_a_motor_may_turn_by_a_tenth_of_a_radian_without_current(cycles, found):
    """One joint at 0.1 rad/s, that is 0.4 mrad in a cycle: beyond 0.1 rad from the 251st."""
    speed = np.where(np.arange(N) == 0, 0.1, 0.0)

    def idle(cycle, feedback):
        return feedback._replace(current_a=np.where(np.arange(N) == 0, 1e-9, 1.0) if cycle else feedback.current_a)

    told = pytest.raises(TorqueMissing, match=r"joint_1.* exactly zero while it moves by 0\.10 rad")
    with told if found else nullcontext():
        run(idle, cycles=cycles, speed=speed)


def test_a_current_just_above_zero_is_one():
    run(lambda cycle, feedback: feedback._replace(current_a=np.full(N, 1.1e-9)), cycles=1000)
