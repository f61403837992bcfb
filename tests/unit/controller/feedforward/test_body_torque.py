"""The arm's part of the feed-forward torque: compared with the body model, on a perfect and on the simulated arm."""

import numpy as np
import pytest

from armload_controller.config.robot import load_robot
from armload_controller.feedforward.body_torque import ArmTorque, LoadFriction, held_torque
from armload_controller.motion.checked_path import check_path
from armload_controller.session.arm_access import simulated_arm
from armload_controller.session.feedforward_comparison import ComparisonRuns, Measure, beyond_lag, rms
from armload_controller.session.run_session import no_operator, run_session
from armload_controller.session.session_load import SessionLoad
from armload_identification.excitation.fourier import Excitation, FourierTrajectory
from armload_identification.model.body_model import BodyModel
from armload_identification.model.payload import InertialParameters, PayloadResult, Provenance

ROBOT = load_robot("prbt").with_simulated_payload("block")
CHAIN = ROBOT.chain
SWEEP = FourierTrajectory(
    0.25,
    np.array([0.0, 0.5, 1.2, 0.0, 0.6, 0.0]),
    np.array([[0.2], [0.9], [0.0], [0.0], [0.3], [0.2]]),
    np.array([[0.0], [0.0], [0.9], [0.2], [-0.7], [0.0]]),
)


def true_body():
    """The simulated arm as a calibration, with the true links instead of base parameters."""
    spec = ROBOT.simulation.plant_spec(None)
    bodies = [joint.link for joint in spec.joints]
    links = [InertialParameters.from_center_of_mass(b.mass_kg, b.center_of_mass_m, b.inertia_kg_m2) for b in bodies]

    def each(name):
        return np.array([getattr(joint, name) for joint in spec.joints])

    return BodyModel(
        links=np.array([link.theta for link in links]),
        base=np.ones((6, 10), dtype=bool),
        rotor_inertia_kg_m2=each("reflected_rotor_inertia_kg_m2"),
        coulomb_nm=each("coulomb_nm"),
        viscous_nm_s_rad=each("viscous_nm_s_rad"),
        root_nm=np.linspace(0.0, 5.0, 6),
        offset_nm=np.full(6, 7.0),
        load_friction=each("load_friction"),
        torque_delay_s=0.0,
        reversal_speed_rad_s=np.full(6, 0.01),
        coupling=np.eye(6),
    )


BODY = true_body()


def test_half_of_the_coulomb_friction_holds_a_joint():
    np.testing.assert_allclose(held_torque(BODY), 0.5 * BODY.coulomb_nm)


@pytest.mark.parametrize("seed", range(5))
def test_payload_and_arm_together_are_the_bodys_torque_without_its_offset(seed):
    q, dq, ddq, payload_nm = np.random.default_rng(seed).normal(size=(4, 6))
    whole = BODY.torque(CHAIN, q[None], dq[None], ddq[None], 20.0 * payload_nm[None])[0] - BODY.offset_nm
    added = ArmTorque(CHAIN, BODY).torque_nm(q, dq, ddq, 20.0 * payload_nm)
    np.testing.assert_allclose(20.0 * payload_nm + added, whole, atol=1e-9)


@pytest.mark.parametrize("seed", range(5))
def test_the_friction_of_the_load_is_what_the_loaded_arm_rubs_more_than_the_empty_one(seed):
    q, dq, ddq, payload_nm = np.random.default_rng(seed).normal(size=(4, 6))
    arm, friction = ArmTorque(CHAIN, BODY), LoadFriction(CHAIN, BODY)
    loaded, empty = (arm.torque_nm(q, dq, ddq, nm) for nm in (payload_nm, np.zeros(6)))
    np.testing.assert_allclose(friction.torque_nm(q, dq, ddq, payload_nm), loaded - empty, atol=1e-9)


def test_at_standstill_there_is_weight_and_no_friction():
    q, still = SWEEP.evaluate(0.3).position_rad, np.zeros(6)
    weight = BODY.link_torque(CHAIN, q[None], still[None], still[None])[0]
    np.testing.assert_allclose(ArmTorque(CHAIN, BODY).torque_nm(q, still, still, np.ones(6)), weight, atol=1e-12)
    assert not LoadFriction(CHAIN, BODY).torque_nm(q, still, still, np.ones(6)).any()


def test_what_is_tried_is_held_by_friction():
    assert (held_torque(BODY) < BODY.coulomb_nm).all()


def test_the_lag_is_taken_off_and_what_is_no_lag_is_left():
    phase = np.arange(400) * 0.01
    bump = np.zeros((400, 6))
    bump[100:104] = 1e-3
    late = SWEEP.evaluate(phase).position_rad - SWEEP.evaluate(phase - 0.05).position_rad
    np.testing.assert_allclose(beyond_lag(late, SWEEP, phase), 0.0, atol=1e-7)
    np.testing.assert_allclose(beyond_lag(late + bump, SWEEP, phase), bump, atol=1e-4)


@pytest.fixture(scope="module")
def compared():
    """The loaded simulated arm without feed-forward, with the payload's, with its friction, and with all of the arm's
    torque."""
    payload = ROBOT.simulation.payload("block")
    values = np.stack([payload.values, payload.values], axis=1)
    ones = np.ones(6)
    known = PayloadResult("flange", payload, np.ones(10, bool), values, ones, ones, Provenance("0", "0", {}))
    sweep, cycle_s = Excitation(SWEEP, 1), 1 / ROBOT.bus.cycle_hz
    path = check_path(sweep, ROBOT.motion_constraints, cycle_s, file=ROBOT.file, key="sweep")
    runs = ComparisonRuns(ROBOT, path, held_torque(BODY))

    def open_servos(load):
        return simulated_arm(ROBOT, load)

    with run_session(ROBOT, SessionLoad.UNLOADED, open_servos, no_operator()) as session:
        empty = runs.plain(session, "empty")
    with run_session(ROBOT, SessionLoad.LOADED, open_servos, no_operator()) as session:
        without = runs.plain(session, "loaded")
        fed, verdict = runs.with_feedforward(session, known, "payload", None)
        terms = {"friction": LoadFriction(CHAIN, BODY), "arm": ArmTorque(CHAIN, BODY)}
        all_runs = {"payload": fed}
        for name, term in terms.items():
            all_runs[name], _ = runs.with_feedforward(session, known, name, verdict, term)
    added = runs.compare(without, all_runs, empty, known)
    beyond = runs.compare(without, all_runs, None, known)
    return verdict, added, beyond


@pytest.mark.long
def test_with_the_arms_friction_known_every_joint_is_tried(compared):
    verdict, _, _ = compared
    assert verdict.usable.all()
    assert (verdict.tried_nm >= held_torque(BODY)).all()


@pytest.mark.long
def test_the_friction_under_the_payload_belongs_to_its_torque(compared):
    _, added, _ = compared
    assert added.measure is Measure.ADDED
    for joint in (1, 2):
        assert added.reduction("friction")[joint] > added.reduction("payload")[joint] + 0.05


@pytest.mark.long
def test_the_arms_own_torque_takes_what_the_payloads_leaves(compared):
    _, _, beyond = compared
    assert beyond.measure is Measure.TORQUES
    assert (beyond.reduction("arm")[:5] > 0.3).all()
    assert (beyond.reduction("payload")[:5] < 0.6).all()
    assert (rms(beyond.with_rad["arm"])[:5] < rms(beyond.with_rad["friction"])[:5]).all()
