"""Drives with false feedback: each falsification is found in the slow round, and stops the arm as the table says."""

from contextlib import contextmanager

import numpy as np
import pytest

from armload_controller.config.robot import load_robot
from armload_controller.control_errors import MotionError
from armload_controller.cycle.stop_decisions import Cause, cause_of
from armload_controller.motion.checked_path import check_path
from armload_controller.session.run_session import no_operator, run_session
from armload_controller.session.session_load import SessionLoad
from armload_drivers.simulation.plant_interface import FROZEN, REVERSED, EncoderFault
from armload_identification.excitation.fourier import Excitation, FourierTrajectory

ROBOT = load_robot("prbt")
CYCLE_S = 1 / ROBOT.bus.cycle_hz
RNG = np.random.default_rng(3)
SWING = FourierTrajectory(
    0.25, np.array([0.0, 0.6, 1.2, 0.0, 0.5, 0.0]), *(RNG.uniform(-0.12, 0.12, (2, 6, 3)) / np.arange(1, 4))
)
PATH = check_path(Excitation(SWING, 1), ROBOT.motion_constraints, CYCLE_S, file=ROBOT.file, key="swing")
LIAR = 2
FROM = 250
"""First exchange with false feedback; the slow round takes 1600."""
MOTOR_TURN_RAD = 2.0 * np.pi / 120.0


def one(values, value):
    """The values of all joints, with the lying drive's replaced."""
    changed = np.array(values)
    changed[LIAR] = value
    return changed


class Lies:
    """Falsifications of the feedback by the drive of one joint."""

    def another_velocity(self, feedback):
        return feedback._replace(velocity_rad_s=one(np.zeros(6), 0.5))

    def no_torque(self, feedback):
        return feedback._replace(torque_nm=one(feedback.torque_nm, 0.0))

    def a_torque_that_never_changes(self, feedback):
        return feedback._replace(torque_nm=one(feedback.torque_nm, 0.7))

    def torque_of_the_wrong_sign(self, feedback):
        return feedback._replace(torque_nm=one(feedback.torque_nm, -feedback.torque_nm[LIAR]))

    def bits(self, feedback, on=0, off=0):
        return feedback._replace(statusword=one(feedback.statusword, (feedback.statusword[LIAR] | on) & (0xFFFF ^ off)))

    def without_voltage(self, feedback):
        return self.bits(feedback, off=0x0010)

    def without_remote(self, feedback):
        return self.bits(feedback, off=0x0200)

    def limiting(self, feedback):
        return self.bits(feedback, on=0x0800)

    def lagging(self, feedback):
        return self.bits(feedback, on=0x2000)


@contextmanager
def session_with(watched_servos, plant, lie, since=FROM):
    """A session whose servos report false feedback, or whose plant breaks, from one exchange on."""
    moved = plant(PATH.start_rad, np.full(6, 3.0))
    servos = watched_servos(ROBOT.drives.settings, moved)
    exchange = servos.exchange

    def lying(command):
        feedback = exchange(command)
        if isinstance(lie, EncoderFault):
            if len(servos.sent) == since:
                moved.fail_encoder(LIAR, lie)
            return feedback
        return lie(feedback) if len(servos.sent) > since else feedback

    servos.exchange = lying

    @contextmanager
    def open_servos(which):
        yield servos

    with run_session(ROBOT, SessionLoad.UNLOADED, open_servos, no_operator()) as session:
        yield session, servos


@pytest.mark.parametrize(
    ("lie", "cause", "since"),
    [
        ("another_velocity", Cause.VELOCITY, 0),
        ("no_torque", Cause.TORQUE_MISSING, FROM),
        ("a_torque_that_never_changes", Cause.TORQUE_MISSING, 0),
        ("torque_of_the_wrong_sign", Cause.TORQUE_REVERSED, 0),
        ("without_voltage", Cause.VOLTAGE, FROM),
        ("without_remote", Cause.REMOTE, FROM),
        ("limiting", Cause.INTERNAL_LIMIT, FROM),
    ],
)
def test_a_lie_is_found_in_the_slow_round(watched_servos, rubbing_plant, lie, cause, since):
    with (
        session_with(watched_servos, rubbing_plant, getattr(Lies(), lie), since) as (session, servos),
        pytest.raises(MotionError, match=ROBOT.joint_names[LIAR]) as caught,
    ):
        session.run(PATH, "run")
    assert cause_of(caught.value.__cause__) is cause
    assert str(caught.value).startswith(f"Motion stopped ({cause.category.title}): {cause.words}")
    assert servos.log[-2:] == ["stop", "disable"]
    assert servos.log.count("enable") == 1, "the run at full speed was not begun"


@pytest.mark.parametrize(
    ("fault", "text"),
    [
        (EncoderFault(jump_rad=MOTOR_TURN_RAD), "the position moved by"),
        (FROZEN, "by a single count"),
        (REVERSED, "against its setpoints"),
    ],
    ids=["jump by a motor turn", "frozen", "reversed"],
)
def test_a_position_that_is_not_as_commanded_is_an_emergency(watched_servos, rubbing_plant, fault, text):
    with (
        session_with(watched_servos, rubbing_plant, fault) as (session, servos),
        pytest.raises(MotionError, match=ROBOT.joint_names[LIAR]) as caught,
    ):
        session.run(PATH, "run")
    assert cause_of(caught.value.__cause__) is Cause.LOOP_LOST
    assert str(caught.value).startswith("Motion stopped (emergency stop): an axis does not move as commanded")
    assert text in str(caught.value)
    assert "press the emergency stop" in str(caught.value)
    assert servos.log[-2:] == ["stop", "disable"]
    assert servos.log.count("enable") == 1, "the run at full speed was not begun"


@pytest.mark.long
def test_a_following_error_that_the_drive_reports_counts_in_the_modes_that_have_the_bit(watched_servos, rubbing_plant):
    """Bit 13 is reserved in interpolated position mode, which prbt's drives run in."""
    with session_with(watched_servos, rubbing_plant, Lies().lagging) as (session, servos):
        session.run(PATH, "run")
    assert servos.log.count("enable") == 2
