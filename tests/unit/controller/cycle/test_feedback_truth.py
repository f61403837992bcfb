"""Feedback that must not be taken for false, and the statusword bits of each drive."""

from dataclasses import replace

import numpy as np
import pytest

from armload_controller.config.robot import load_robot
from armload_controller.cycle.feedback_truth import (
    LIMITED_S,
    DriveLag,
    InternalLimit,
    PositionJumps,
    PositionReversed,
    TorqueMissing,
    VelocityContradicts,
    VoltageLost,
)
from armload_controller.cycle.plugins import CycleStep
from armload_controller.session.run_session import feedback_truth
from armload_drivers.servos import JointCommand, JointFeedback

ROBOT = load_robot("er50")
N, CYCLE_S = 6, 0.004
SPEED = np.full(N, 0.1)
WORD = 0x1637
COUPLING = ROBOT.drives.coupling


def run(change=lambda cycle, feedback: feedback, cycles=300, first_word=WORD, speed=SPEED):
    """Feed the monitor with an arm at constant speed; `change` modifies the feedback of each cycle."""
    truth = feedback_truth(ROBOT, CYCLE_S)
    ones, none = np.ones(N), np.zeros(N, dtype=bool)
    sent = None
    for cycle in range(cycles):
        position = speed * CYCLE_S * cycle
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
    run(lambda cycle, feedback: replace(feedback, velocity_rad_s=SPEED))


@pytest.mark.parametrize(
    ("bits", "kind"),
    [(WORD & ~0x0010, VoltageLost), (WORD | 0x2000, DriveLag)],
)
def test_a_bit_that_is_wrong_is_a_lie_at_once(bits, kind):
    with pytest.raises(kind, match="joint_4"):
        run(lambda cycle, feedback: replace(feedback, statusword=word(3, bits)) if cycle == 10 else feedback)


def test_a_bit_that_a_drive_never_sets_is_not_missed():
    """Not every drive implements the bits voltage and remote; a bit that was never set cannot be lost."""
    bare = WORD & ~0x0210
    run(lambda cycle, feedback: replace(feedback, statusword=word(3, bare)), first_word=bare)


def test_an_internal_limit_may_be_touched_but_not_lasted_on():
    def limited(lasting_s):
        return lambda cycle, feedback: (
            replace(feedback, statusword=word(1, WORD | 0x0800))
            if 0.2 <= feedback.time_s < 0.2 + lasting_s
            else feedback
        )

    run(limited(0.9 * LIMITED_S))
    with pytest.raises(InternalLimit, match="joint_2"):
        run(limited(1.5 * LIMITED_S))


def test_after_missing_feedback_a_joint_may_have_gone_on():
    """Its last values are repeated; the catch-up is no jump, unless it exceeds what the time allows."""
    fast = np.full(N, 1.0)

    def missing(cycle, feedback):
        if 100 <= cycle < 103:
            held = feedback.position_rad.copy()
            held[2] = fast[2] * CYCLE_S * 99
            return replace(feedback, position_rad=held, missing=np.arange(N) == 2)
        return feedback

    run(missing, speed=fast)
    with pytest.raises(PositionJumps, match="joint_3"):
        run(lambda cycle, feedback: replace(missing(cycle, feedback), missing=np.zeros(N, dtype=bool)), speed=3 * fast)


def test_one_frozen_motor_of_a_coupled_wrist_is_found():
    """Joint 5 still moves a little with the motor of joint 4, but its own motor's position is frozen."""

    def frozen(cycle, feedback):
        axes = np.linalg.solve(COUPLING, feedback.position_rad)
        axes[4] = 0.3
        return replace(feedback, position_rad=COUPLING @ axes)

    with pytest.raises(Exception, match="joint_5: the position has not changed by a single count"):
        run(frozen, 1000)


def swing(amplitude_rad, late_s):
    """Feed the monitor with joints that oscillate with a period of 2 s; joint 6 is late."""

    def places(time_s):
        return amplitude_rad * np.sin(np.pi * (time_s - np.append(np.zeros(N - 1), late_s)).clip(0.0))

    truth, sent = feedback_truth(ROBOT, CYCLE_S), None
    for cycle in range(1500):
        time_s = cycle * CYCLE_S
        words, none = np.full(N, WORD, dtype=np.uint16), np.zeros(N, dtype=bool)
        feedback = JointFeedback(cycle, time_s, places(time_s), None, np.ones(N), None, words, none)
        truth.on_cycle(CycleStep(feedback, sent, None, None, None, None))
        wanted = amplitude_rad * np.sin(np.pi * time_s) * np.ones(N)
        sent = JointCommand(wanted, np.pi * amplitude_rad * np.cos(np.pi * time_s) * np.ones(N), np.zeros(N))


def test_a_small_swing_that_friction_holds_back_is_no_reversal():
    """The simulated PRBT's joint 6 does this at 9 mrad; a large motion against its setpoints is false."""
    swing(0.009, 0.6)
    with pytest.raises(PositionReversed, match="joint_6"):
        swing(0.1, 1.0)


def test_a_velocity_of_another_sign_is_found():
    with pytest.raises(VelocityContradicts, match="joint_1"):
        run(lambda cycle, feedback: replace(feedback, velocity_rad_s=np.where(np.arange(N) == 0, -0.3, SPEED)))


def test_no_current_at_standstill_is_nothing_and_in_motion_a_lie():
    def idle(cycle, feedback):
        return replace(feedback, current_a=np.zeros(N))

    run(idle, speed=np.zeros(N))
    with pytest.raises(TorqueMissing, match="exactly zero"):
        run(idle, 1000)
