"""The torque window from the model: its bounds, and an arm that is pushed unexpectedly."""

from dataclasses import replace

import msgspec
import numpy as np
import pytest

from armload_controller.config.robot import load_robot
from armload_controller.control_errors import MotionError
from armload_controller.cycle.control_cycle import Cycle
from armload_controller.cycle.following_monitor import FollowingMonitor
from armload_controller.cycle.stop_decisions import Cause, cause_of
from armload_controller.cycle.torque_gate import TorqueGate
from armload_controller.motion.checked_path import check_path
from armload_controller.motion.motion_control import MotionControl
from armload_controller.session.run_session import run_leg, torque_window
from armload_controller.session.session_load import SessionLoad
from armload_drivers.simulation.mujoco_plant import ArmPlant
from armload_identification.excitation.fourier import Excitation, FourierTrajectory
from armload_identification.model.payload import InertialParameters
from armload_identification.model.regressor import payload_torque
from tests.fake_servos import FakeServos

ROBOT = load_robot("prbt").with_simulated_payload("block")
SWING = FourierTrajectory(
    0.5, np.array([0.0, 0.5, 1.2, 0.0, 0.6, 0.0]), np.full((6, 1), 0.2), np.array([[0.2], [0.1], [-0.2]] * 2)
)
LIMITS, CYCLE_S = ROBOT.limits.motion, 1 / ROBOT.bus.cycle_hz
PATH = check_path(Excitation(SWING, 2), ROBOT.motion_constraints, CYCLE_S, file=ROBOT.file, key="swing")


class PushedPlant(ArmPlant):
    """An arm with an external force on its forearm from a time on, in base coordinates."""

    def __init__(self, spec, force_n, from_s):
        super().__init__(spec)
        self.force_n, self.from_s = force_n, from_s

    def advance(self, time_s):
        if time_s >= self.from_s:
            self._data.xfrc_applied[5, :3] = self.force_n
        super().advance(time_s)


def run(force_n, from_s=3.0, payload="block", load=SessionLoad.LOADED, robot=ROBOT):
    """Run a leg on the pushed arm; returns the cycles sent and the error that stopped it."""
    start = np.linalg.solve(robot.drives.coupling, PATH.start_rad)
    plant = PushedPlant(replace(robot.simulation.plant_spec(payload), start_position_rad=start), force_n, from_s)
    servos = FakeServos(robot.drives.settings, plant)
    monitor = FollowingMonitor(LIMITS, 3)
    gate = TorqueGate(robot.limits.torque_max_nm, CYCLE_S)
    cycle = Cycle(servos, LIMITS, gate, MotionControl(), [monitor, torque_window(robot, load, CYCLE_S)])
    servos.connect()
    try:
        run_leg(cycle, PATH, PATH.measured, lambda done: None)
    except MotionError as error:
        return monitor.summary.duration_s, error
    finally:
        servos.close()
    return monitor.summary.duration_s, None


@pytest.mark.parametrize("force_n", [(0.0, 0.0, -250.0), (0.0, 450.0, 0.0), (200.0, -100.0, 200.0)])
def test_an_arm_that_meets_something_is_stopped_before_it_is_behind(force_n):
    seconds, error = run(force_n)
    # The hardest blow throws a joint back faster than its servo can be wrong.
    assert cause_of(error.__cause__) in {Cause.TORQUE, Cause.LOOP_LOST}
    assert 3.0 <= seconds < 3.2
    assert "ook for a collision" in str(error)


@pytest.mark.parametrize("variant", ["harsh", pytest.param("normative", marks=pytest.mark.long)])
@pytest.mark.parametrize(
    ("payload", "load"), [("block", SessionLoad.LOADED), (None, SessionLoad.UNLOADED), (None, SessionLoad.LOADED)]
)
def test_an_arm_that_meets_nothing_is_not_stopped(payload, load, variant):
    simulation = msgspec.structs.replace(ROBOT.tables.simulation, variant=variant)
    robot = ROBOT.with_tables(simulation=simulation)
    assert run((0.0, 0.0, 0.0), payload=payload, load=load, robot=robot)[1] is None


def test_a_payload_on_a_flange_that_should_be_empty_is_noticed_where_it_is_more_than_the_room():
    model = ROBOT.strength.expected_torque(loaded=False)
    heaviest = 3.0 * ROBOT.payloads.heaviest.theta
    q = np.array([0.0, 1.5, 0.0, 0.0, 0.0, 0.0])
    still = np.zeros(6)
    least, greatest = model.bounds_nm(q, still, still)
    weight = payload_torque(ROBOT.chain, heaviest, q, still, still)
    arm = 0.5 * (least + greatest)
    assert ((arm + weight < least) | (arm + weight > greatest)).any()


@pytest.mark.parametrize("seed", range(5))
def test_the_bounds_hold_the_arm_and_every_share_of_its_payload(seed):
    rng = np.random.default_rng(seed)
    q, dq, ddq = rng.uniform(-1.0, 1.0, (3, 6))
    model = ROBOT.strength.expected_torque(loaded=True)
    least, greatest = model.bounds_nm(q, dq, ddq)
    empty_least, empty_greatest = ROBOT.strength.expected_torque(loaded=False).bounds_nm(q, dq, ddq)
    assert (least <= empty_least).all()
    assert (greatest >= empty_greatest).all()
    payload = InertialParameters(ROBOT.payloads.heaviest.theta * rng.uniform(0.0, 1.0))
    middle = 0.5 * (empty_least + empty_greatest)
    torque = middle + payload_torque(ROBOT.chain, payload.theta, q, dq, ddq)
    assert ((torque > least) & (torque < greatest)).all()


def test_an_arm_known_by_its_shares_alone_gets_a_wider_window_than_one_with_a_body():
    er50 = load_robot("er50")
    q = np.zeros(6)
    least, greatest = er50.strength.expected_torque(loaded=False).bounds_nm(q, q, q)
    np.testing.assert_allclose(greatest, -least)
    assert (greatest < 0.6 * er50.limits.torque_max_nm).all()


def test_without_a_payload_in_the_file_the_limits_are_the_window():
    untold = ROBOT.with_tables(heaviest_payload=None, expected_payload=None)
    assert untold.strength.expected_torque(loaded=True) is None
    assert untold.strength.expected_torque(loaded=False) is not None
