"""The holding test of the brakes: what it concludes from torque and position, and a whole one in simulation."""

from contextlib import nullcontext
from importlib import resources
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from armload_controller.config.robot import load_robot
from armload_controller.control_errors import CommissioningError
from armload_controller.motion.motion_control import MotionControl
from armload_controller.session.arm_access import open_arm
from armload_controller.session.brake_test import BrakeFinding, BrakeTest, brakes_tried
from armload_controller.session.run_session import Consent, NoDisplay, Operator, no_operator, run_session
from armload_controller.session.session_load import SessionLoad
from armload_identification.signals.joint_torque import Transmission

MOST_MOVED_RAD = 0.004

CYCLE_S = 0.02
TRIED_NM = np.array([50.0, 0.0, 20.0])
WEIGHT_NM = np.array([-30.0, 5.0, 8.0])


def tried(response, moved_rad):
    """Findings where the motors show a share of the torque, and the joints move."""
    test = BrakeTest(("a", "b", "c"), Transmission(np.ones(3), np.eye(3)), TRIED_NM, CYCLE_S)
    wanted_nm = np.zeros(3)
    for _ in range(2000):
        torque_nm, position_rad = WEIGHT_NM + response * wanted_nm, moved_rad * np.sign(wanted_nm)
        feedback = SimpleNamespace(torque_nm=torque_nm, current_a=None, position_rad=position_rad)
        wanted_nm = test.on_cycle(SimpleNamespace(feedback=feedback))
        if wanted_nm is None:
            break
        assert np.count_nonzero(wanted_nm) <= 1, "one joint at a time"
        assert (np.abs(wanted_nm) <= TRIED_NM).all()
    assert test.done()
    return test.findings()


@pytest.mark.parametrize(
    ("response", "moved_rad", "holds"),
    [
        (1.0, 0.0, True),
        (0.75, 0.5 * MOST_MOVED_RAD, True),
        (0.0, 0.0, False),
        (-0.3, 0.0, False),
        (1.0, 1.5 * MOST_MOVED_RAD, False),
    ],
)
def test_a_brake_that_holds_takes_the_torque_and_the_joint_stands(response, moved_rad, holds):
    first, second, third = tried(response, moved_rad)
    assert (first.holds, third.holds) == (holds, holds)
    assert first.response == pytest.approx(response)
    assert third.moved_rad == pytest.approx(moved_rad)
    assert (second.tried_nm, second.holds) == (0.0, False)


def session_of(robot, operator):
    def open_servos(load):
        return open_arm(robot, load, print, simulated_drives=False, attended=False, brakes_closed=True)

    return run_session(robot, SessionLoad.LOADED, open_servos, operator)


@pytest.mark.long
def test_a_weak_brake_is_found_in_simulation(tmp_path):
    """The brakes of joints 1 and 4 hold a fifth of the torque that is tried."""
    shipped = resources.files("armload_configs")
    for name in ("er50_identification.toml", "er50_validation.toml"):
        (tmp_path / name).write_text(shipped.joinpath(name).read_text("utf-8"))
    head, *joints = shipped.joinpath("er50.toml").read_text("utf-8").split("[[simulation.joints]]\n")
    for joint, torque_nm in ((0, 60.0), (3, 5.0)):
        joints[joint] = f"brake_torque_nm = {torque_nm}\n{joints[joint]}"
    path = tmp_path / "weak.toml"
    path.write_text("[[simulation.joints]]\n".join([head, *joints]))
    with session_of(load_robot(str(path)), no_operator()) as session:
        found = brakes_tried(session)
    assert [finding.holds for finding in found] == [False, True, True, False, True, True]


def test_a_real_arm_is_enabled_with_consent_only(ideal_servos):
    robot = load_robot("prbt").with_bus(cycle_hz=1.0 / CYCLE_S)
    asked = []
    operator = Operator(
        NoDisplay(), MotionControl(), Consent(lambda question: bool(asked.append(question)), given=True)
    )
    servos = ideal_servos(6, CYCLE_S)
    servos.simulated = False

    def open_servos(load):
        return nullcontext(servos)

    with run_session(robot, SessionLoad.LOADED, open_servos, operator) as session, pytest.raises(CommissioningError):
        brakes_tried(session)
    assert "brakes stay closed" in asked[0]
    assert servos.log == ["connect"]


def test_only_axes_with_a_brake_that_take_added_torque_are_tried(edited, monkeypatch):
    """Joint 1 has no brake, and joint 2 takes no torque offset."""
    monkeypatch.setattr(BrakeTest, "findings", lambda test: ())
    path = Path(edited("has_brake = true", "has_brake = false"))
    text = path.read_text()
    second = text.index("[joints.drive]", text.index('name = "joint_2"'))
    without = text[second:].replace("has_brake = true", "has_brake = true\ntorque_offset = false", 1)
    path.write_text(text[:second] + without)
    robot, held = load_robot(path), []
    brakes_tried(SimpleNamespace(robot=robot, hold=lambda plugins, action, warning: held.extend(plugins)))
    (test,) = held
    np.testing.assert_array_equal(test._tried_nm > 0.0, [False, False, True, True, True, True])
    assert (test._tried_nm < robot.limits.added_torque_max_nm).all()


@pytest.mark.parametrize(
    ("finding", "holds"),
    [
        ((50.0, 0.7, 0.004), True), ((50.0, 0.69, 0.004), False), ((50.0, 0.7, 0.0041), False),
        ((0.0, 1.0, 0.0), False),
    ],
)  # fmt: skip
def test_a_brake_holds_from_seven_tenths_of_the_torque_and_up_to_four_milliradians(finding, holds):
    assert BrakeFinding("a", *finding).holds is holds


def test_every_push_and_rest_has_its_time_and_its_end_is_averaged():
    """At 50 Hz: rests of 1 s, pushes of 1.6 s, the last 0.3 s of each; a joint is pushed both ways."""
    test = BrakeTest(("a",), Transmission(np.ones(1), np.eye(1)), np.array([40.0]), CYCLE_S)
    wanted = []
    while not test.done():
        number = len(wanted)
        torque_nm = np.array([1000.0 if number in {34, 114, 164, 244} else 0.0])
        feedback = SimpleNamespace(torque_nm=torque_nm, current_a=None, position_rad=np.zeros(1))
        wanted.append(test.on_cycle(SimpleNamespace(feedback=feedback))[0])
    assert wanted == [0.0] * 50 + [40.0] * 80 + [0.0] * 50 + [-40.0] * 80
    assert test._means == [(0.0, 0.0)] * 4, "15 cycles at the end only: from 35, 115, 165 and 245 on"


def test_the_torque_that_is_tried_is_a_tenth_of_what_may_be_added_where_there_is_a_brake():
    drives = [SimpleNamespace(has_brake=True, torque_offset=offset) for offset in (True, False)]
    drives.append(SimpleNamespace(has_brake=False, torque_offset=True))
    robot = SimpleNamespace(
        joint_names=("a", "b", "c"),
        drives=SimpleNamespace(
            settings=SimpleNamespace(drives=drives), transmission=Transmission(np.ones(3), np.eye(3))
        ),
        limits=SimpleNamespace(added_torque_max_nm=np.array([100.0, 50.0, 20.0])),
        bus=SimpleNamespace(cycle_hz=50.0),
    )
    held = []

    def hold(plugins, action, warning):
        held.extend(plugins)
        action(held.append)
        held[0]._means = [(0.0, 0.0)] * 4

    findings = brakes_tried(SimpleNamespace(robot=robot, hold=hold))
    test, done = held
    assert done == test.done
    assert test._tried_nm == pytest.approx([10.0, 0.0, 0.0])
    assert (test._rest, test._push, test._measured) == (50, 80, 15)
    assert [finding.tried_nm for finding in findings] == pytest.approx([10.0, 0.0, 0.0])
