"""Columns of the wrong sign, found from Pinocchio's links and friction."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from armload_identification.estimation.contradicted_gains import GainFit
from armload_identification.estimation.payload_from_posterior import estimate_of
from armload_identification.estimation.payload_problem import pair_problem
from armload_identification.estimation.solve import solve
from armload_identification.identification_errors import EstimationError, RecordingError
from armload_identification.model.joint_states import JointStates
from armload_identification.pipeline.payload_identification import identify_runs
from armload_identification.signals.load_signal import load_signal
from armload_identification.signals.recorded_run import Run
from armload_identification.verdict.recording_checks.column_mistakes import (
    RunColumns,
    exchanged_columns,
    flipped_signs,
)
from armload_identification.verdict.recording_checks.joint_scales import JointScales
from armload_identification.verdict.recording_checks.pair_contradictions import CONTRADICTIONS, FittedPair, check_scales
from armload_identification.verdict.recording_checks.usable_runs import usable_runs

pytestmark = pytest.mark.pure


@pytest.fixture(scope="module")
def signal(pair, pinocchio_arm):
    return load_signal(*(Run.of(run, pinocchio_arm.transmission) for run in pair))


def flipped(run, joints):
    return scaled(run, joints, -1.0)


def solved(signal, arm):
    """The payload of a pair with held gains, without any check."""
    problem = pair_problem(signal, arm.chain, arm.transmission.coupling, None)
    return estimate_of(solve(problem.problem, rough=True), problem, None, np.zeros((0, 6)))


def require_consistent(plain, gains, signal, friction_nm):
    """The checks of a payload against its runs, with another friction of the arm."""
    fit = FittedPair(plain, gains, signal, signal, np.zeros_like(signal.torque_nm), None)
    fit.__dict__["friction_nm"] = friction_nm
    for check in CONTRADICTIONS[1:-1]:
        check(fit)


def as_assumed(n):
    """Gains that were fitted and found as assumed."""
    zero = np.zeros(n)
    return GainFit(zero, zero + 0.01, zero > 0.0, zero > 0.0, disagree=False, assumed_deviation=zero, noticeable=zero)


def scaled(run, joints, factor):
    return replace(run, current_a=run.current_a * np.where(np.isin(np.arange(6), joints), factor, 1.0))


@pytest.mark.parametrize("joints", [(), (0,), (1,), (5,), (1, 2), (3, 5), (0, 1, 4)], ids=str)
def test_flipped_signs_are_found_in_either_run(signal, pinocchio_arm, joints):
    coupling = pinocchio_arm.transmission.coupling
    sign = np.where(np.isin(np.arange(6), joints), -1.0, 1.0)
    flips = coupling @ np.diag(sign) @ np.linalg.inv(coupling)  # tau = C^-T tau_axis
    for run in (signal.loaded, signal.unloaded):
        spoiled = replace(run, torque_nm=run.torque_nm @ flips)
        assert flipped_signs(spoiled, pinocchio_arm.chain, coupling) == joints


def noisy_parts(pinocchio_arm, length_s):
    """Parts of a run with 5 % of noise on each torque."""
    run = pinocchio_arm.run(pinocchio_arm.trajectory(), False, seed=21, periods=2, noise=0.0, with_phase=False)
    effort = np.sqrt(np.mean(run.current_a**2, axis=0))
    noisy = run.current_a + 0.05 * effort * np.random.default_rng(22).normal(size=run.current_a.shape)
    rows = round(length_s / 0.01)
    for first in range(0, 500, 50):
        part = replace(run, current_a=noisy).rows(slice(first, first + rows))
        yield Run.of(part, pinocchio_arm.transmission).motion


def test_no_sign_is_blamed_for_friction_that_a_second_of_motion_does_not_determine(pinocchio_arm):
    """Without its error, negative friction of sound joints was evidence of flipped signs."""
    chain, coupling = pinocchio_arm.chain, pinocchio_arm.transmission.coupling
    assert [flipped_signs(run, chain, coupling) for run in noisy_parts(pinocchio_arm, 1.0)] == [()] * 10


def test_a_flipped_sign_is_found_in_three_seconds_in_spite_of_noise(pinocchio_arm):
    chain, coupling = pinocchio_arm.chain, pinocchio_arm.transmission.coupling
    flips = coupling @ np.diag([1.0, 1.0, 1.0, -1.0, 1.0, 1.0]) @ np.linalg.inv(coupling)
    runs = [run.with_torque_times(flips) for run in noisy_parts(pinocchio_arm, 3.0)]
    assert [flipped_signs(run, chain, coupling) for run in runs] == [(3,)] * 10


@pytest.mark.parametrize("joints", [(0, 1), (2, 5), (4, 5)], ids=str)
def test_exchanged_joints_are_found_from_the_loaded_run(signal, pinocchio_arm, joints):
    order = np.arange(6)
    order[list(joints)] = joints[::-1]
    run, coupling = signal.loaded, pinocchio_arm.transmission.coupling
    torque = (run.torque_nm @ coupling)[:, order] @ np.linalg.inv(coupling)  # of the motors' columns
    states = JointStates(*(state[:, order] for state in run.states))
    found = exchanged_columns(replace(run, states=states, torque_nm=torque), pinocchio_arm.chain, coupling)
    assert (found.joints, found.what) == (joints, "all columns")


@pytest.mark.parametrize("joint", [1, 3, 4])
@pytest.mark.parametrize("what", ["all columns", "the positions"])
def test_a_reversed_joint_is_found_from_the_loaded_run(signal, pinocchio_arm, joint, what):
    turn = np.diag(np.where(np.arange(6) == joint, -1.0, 1.0))
    run, coupling = signal.loaded, pinocchio_arm.transmission.coupling
    by_axis = coupling @ turn @ np.linalg.inv(coupling)
    torque = run.torque_nm @ (by_axis if what == "all columns" else np.eye(6))
    states = JointStates(*(state @ turn for state in run.states))
    found = exchanged_columns(replace(run, states=states, torque_nm=torque), pinocchio_arm.chain, coupling)
    assert (found.joints, found.what) == ((joint,), what)
    assert f"{what} of joint {joint + 1} are reversed" in found.said
    assert "only in the other direction" in found.said


@pytest.mark.parametrize("gravity_m_s2", [[9.81, 0.0, 0.0], [0.0, 0.0, 9.81]], ids=["wall", "ceiling"])
def test_an_arm_that_is_not_mounted_as_configured_is_no_exchange_of_joints(signal, pinocchio_arm, gravity_m_s2):
    chain = pinocchio_arm.chain.under(np.array(gravity_m_s2))
    found = exchanged_columns(signal.unloaded, chain, pinocchio_arm.transmission.coupling)
    assert "the arm was mounted on the floor, gravity_m_s2 = [0.0, 0.0, -9.81]" in found.said


@pytest.mark.parametrize("order", [(0, 1, 2, 4, 5, 3), (0, 3, 1, 2, 4, 5)], ids=str)
def test_currents_exchanged_in_a_cycle_of_three_are_found(signal, pinocchio_arm, order):
    run, coupling = signal.unloaded, pinocchio_arm.transmission.coupling
    torque = (run.torque_nm @ coupling)[:, order] @ np.linalg.inv(coupling)
    found = exchanged_columns(replace(run, torque_nm=torque), pinocchio_arm.chain, coupling)
    assert found.joints == tuple(np.flatnonzero(np.array(order) != np.arange(6)))
    assert found.what == "the currents or torques"


def test_no_exchange_is_found_in_good_runs(signal, pinocchio_arm):
    for run in (signal.loaded, signal.unloaded):
        assert exchanged_columns(run, pinocchio_arm.chain, pinocchio_arm.transmission.coupling) is None


def test_good_runs_are_not_searched(signal, pair, pinocchio_arm):
    runs = tuple(Run.of(run, pinocchio_arm.transmission) for run in pair)
    assert RunColumns(signal, runs, pinocchio_arm.chain, pinocchio_arm.transmission.coupling, None).look_right


@pytest.mark.parametrize(
    ("spoilt", "said"),
    [
        ((True, True), r"^loaded\.mcap and unloaded\.mcap: joint 3 .*sign of its current or torque is flipped"),
        ((True, False), r"^loaded\.mcap: joint 3 "),
        ((False, True), r"^unloaded\.mcap: joint 3 "),
    ],
    ids=["both", "loaded", "unloaded"],
)
def test_the_file_of_a_flipped_sign_is_named(pair, pinocchio_arm, spoilt, said):
    runs = [flipped(run, [2]) if spoil else run for run, spoil in zip(pair, spoilt, strict=True)]
    with pytest.raises(RecordingError, match=said):
        identify_runs(*runs, pinocchio_arm.chain, pinocchio_arm.transmission)


def test_a_sign_that_only_the_payload_reveals_is_found(signal, pinocchio_arm):
    """As on a last joint without friction, whose unloaded torque does not determine its sign."""
    sign = np.where(np.arange(6) == 5, -1.0, 1.0)
    spoiled = signal.of_both(lambda run: run.with_torque_times(np.diag(sign)))
    with pytest.raises(RecordingError, match=r"joint 6 .*payload torque that the other joints imply.* flipped"):
        require_consistent(solved(spoiled, pinocchio_arm), as_assumed(6), spoiled, np.ones(6))


@pytest.mark.parametrize(
    ("joint", "factor"),
    [
        (2, 1.0 / 6.0),
        (1, 1e-3),
        (5, 1e-3),
        *(pytest.param(*case, marks=pytest.mark.long) for case in ((5, 6.0),)),
    ],
)
def test_a_gain_beyond_all_plausible_ones_is_an_error_and_no_percentage(pair, pinocchio_arm, joint, factor):
    runs = [scaled(run, [joint], factor) for run in pair]
    with pytest.raises(EstimationError, match=rf"joint {joint + 1} contradicts .*factor of 3: the sign .* gear ratio"):
        identify_runs(*runs, pinocchio_arm.chain, pinocchio_arm.transmission)


@pytest.mark.long
def test_a_gain_wrong_by_orders_of_magnitude_is_refused_or_named_beside_the_right_payload(pair, pinocchio_arm):
    """A joint almost free of noise decides the payload, so that others seem wrong; one full of noise counts little."""
    small = [scaled(run, [4], 1e-3) for run in pair]
    said = "joint 5 contradicts|or another joint reports a small part of its torque"
    with pytest.raises(EstimationError, match=said):
        identify_runs(*small, pinocchio_arm.chain, pinocchio_arm.transmission)
    great = [scaled(run, [1], 1e3) for run in pair]
    found = identify_runs(*great, pinocchio_arm.chain, pinocchio_arm.transmission)
    low, high = found.uncertainty.interval_95[:4].T
    true = np.array([pinocchio_arm.payload.mass_kg, *pinocchio_arm.payload.center_of_mass_m])
    assert (low < true).all()
    assert (true < high).all()
    assert any("does not explain the torque difference of joint 2" in note for note in found.notes)


@pytest.mark.parametrize(("joint", "factor"), [(4, 1.0), (4, 0.85), (4, 0.6)])
def test_a_share_of_a_reported_torque_is_fitted_as_a_gain_and_named(pair, pinocchio_arm, joint, factor):
    """Drives compute the torque that they report from their current, with a rated torque that may be wrong."""
    share = np.where(np.arange(6) == joint, factor, 1.0)
    torque = [pinocchio_arm.transmission.joint_torque(run.current_a) for run in pair]
    runs = [replace(run, current_a=None, torque_nm=share * nm) for run, nm in zip(pair, torque, strict=True)]
    found = identify_runs(*runs, pinocchio_arm.chain, pinocchio_arm.transmission)
    assert found.uncertainty.determined[0]
    assert np.flatnonzero(found.gains.contradicted).tolist() == ([] if factor == 1.0 else [joint])


def test_a_joint_is_judged_by_others_only_if_they_imply_its_torque(pair, pinocchio_arm):
    """Not against friction that hides it, nor by torques that are mostly noise."""
    runs = [scaled(run, [5], 1e-3) for run in pair]
    small = load_signal(*(Run.of(run, pinocchio_arm.transmission) for run in runs))
    noise = 200.0 * np.random.default_rng(7).normal(size=small.torque_nm.shape) * (np.arange(6) < 5)
    run = small.loaded
    noisy = replace(small, loaded=replace(run, torque_nm=run.torque_nm + noise, raw_nm=run.raw_nm + noise))
    for signal, friction_nm in ((small, 1e3), (noisy, 1e-3), (small, 1e-3)):
        plain = solved(signal, pinocchio_arm)
        if signal is small and friction_nm < 1.0:
            with pytest.raises(EstimationError, match="joint 6 contradicts"):
                require_consistent(plain, as_assumed(6), signal, np.full(6, friction_nm))
        else:
            require_consistent(plain, as_assumed(6), signal, np.full(6, friction_nm))


def test_a_scale_is_refused_only_far_beyond_its_interval_and_only_in_motion():
    def check(scale, half_width, rest=(), friction_nm=1.0):
        moves = ~np.isin(np.arange(4), rest)
        payload_nm = np.array([1.0, 0.1, 1.0, 1.0])
        check_scales(JointScales(np.array(scale), np.array(half_width)), payload_nm, np.full(4, friction_nm), moves)

    check([1.0, 2.8, 0.4, np.nan], [0.01, 0.1, 0.01, np.inf])
    check([1.0, 9.0, -2.0, 1.0], [0.01, 3.1, 1.2, 0.1])
    check([1.0, 9.0, -2.0, 1.0], [0.01, 0.1, 0.1, 0.1], rest=(1, 2))
    check([1.0, -0.9, 1.0, 1.0], [0.01, 0.1, 0.1, 0.1], friction_nm=1.1)
    with pytest.raises(EstimationError, match="torque of joint 2 contradicts"):
        check([1.0, -0.9, 1.0, 1.0], [0.01, 0.1, 0.1, 0.1], friction_nm=0.9)
    with pytest.raises(EstimationError, match=r"torque of joint 2 contradicts .* its torque constant"):
        check([1.0, 9.0, 1.0, 1.0], [0.01, 2.9, 0.1, 0.1])
    with pytest.raises(EstimationError, match=r"torque of joints 2 and 3 contradicts .* their columns are"):
        check([1.0, 9.0, -2.0, 1.0], [0.01, 0.1, 0.1, 0.1])
    with pytest.raises(EstimationError, match="torque of joint 1 contradicts"):
        check([1.0, 900.0, 1100.0, 950.0], [0.01, 20.0, 20.0, 90.0])


def trembling(run, joint, rng):
    """The joint at rest, with a servo that opposes its vibration."""
    position, torque = (values.copy() for values in (run.states.position_rad, run.torque_nm))
    velocity, acceleration = (np.array(values) for values in run.states[1:])
    speed = 4e-4 * rng.normal(size=len(position))
    position[:, joint], velocity[:, joint], acceleration[:, joint] = 0.3, speed, 0.0
    torque[:, joint] = 60.0 - 3e4 * speed
    return replace(run, states=JointStates(position, velocity, acceleration), torque_nm=torque)


def test_a_joint_at_rest_has_no_friction_that_could_drive_the_arm(signal, pinocchio_arm):
    run = trembling(signal.loaded, 1, np.random.default_rng(1))
    assert list(run.moves) == [True, False, True, True, True, True]
    assert flipped_signs(run, pinocchio_arm.chain, pinocchio_arm.transmission.coupling) == ()


def test_a_velocity_that_is_not_the_derivative_of_the_position_is_refused(pair, pinocchio_arm):
    run = pair[0]
    velocity = pinocchio_arm.trajectory().evaluate(run.phase_s).velocity_rad_s
    measured = velocity + 0.3 * np.random.default_rng(5).normal(size=velocity.shape)
    gap = np.r_[0:400, 600 : run.size]
    noisy = replace(run, velocity_rad_s=measured)
    parts = {
        name: getattr(noisy, name)[gap] for name in ("time_s", "position_rad", "velocity_rad_s", "current_a", "phase_s")
    }
    for good in (noisy, replace(noisy, **parts), replace(run, velocity_rad_s=np.zeros_like(velocity))):
        usable_runs([good], 6, pinocchio_arm.transmission)
    with pytest.raises(RecordingError, match=r"velocity of joints 1 to 6 is not the derivative"):
        usable_runs(
            [replace(run, position_rad=velocity, velocity_rad_s=run.position_rad)], 6, pinocchio_arm.transmission
        )
    with pytest.raises(RecordingError, match=r"velocity of joints 1 and 2 is not the derivative"):
        usable_runs([replace(run, velocity_rad_s=velocity[:, [1, 0, 2, 3, 4, 5]])], 6, pinocchio_arm.transmission)
    with pytest.raises(RecordingError, match="these columns are velocities"):
        usable_runs([replace(run, current_a=measured)], 6, pinocchio_arm.transmission)


@pytest.mark.parametrize(("what", "times"), [("positions", "57.3"), ("velocities", "0.0175")])
def test_a_single_joint_in_degrees_is_named(pair, pinocchio_arm, what, times):
    run = pair[0]
    velocity = pinocchio_arm.trajectory().evaluate(run.phase_s).velocity_rad_s
    degrees = np.where(np.arange(6) == 4, 180.0 / np.pi, 1.0)
    run = replace(run, velocity_rad_s=velocity * (degrees if what == "velocities" else 1.0))
    run = replace(run, position_rad=run.position_rad * (degrees if what == "positions" else 1.0))
    with pytest.raises(RecordingError, match=rf"joint 5 moves {times} times as fast .* Its {what} look like degrees"):
        usable_runs([run], 6, pinocchio_arm.transmission)


def test_an_exchange_that_does_not_explain_the_run_is_not_named(signal, pinocchio_arm):
    """Joints 2 and 3 exchanged, and noise instead of joint 5's torque, for which no exchange can account."""
    run, coupling = signal.loaded, pinocchio_arm.transmission.coupling
    axis = (run.torque_nm @ coupling)[:, [0, 2, 1, 3, 4, 5]]
    for noise, named in ((0.0, (1, 2)), (1.0, None)):
        torque = axis.copy()
        torque[:, 4] = (1.0 - noise) * axis[:, 4] + noise * np.random.default_rng(1).normal(size=len(axis))
        spoiled = replace(run, torque_nm=torque @ np.linalg.inv(coupling))
        found = exchanged_columns(spoiled, pinocchio_arm.chain, coupling)
        assert (None if found is None else found.joints) == named
