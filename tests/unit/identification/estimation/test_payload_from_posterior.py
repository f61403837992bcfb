"""A payload read from a posterior: blind directions, gains apart, errors of what is held, and a joint left out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from armload_identification.estimation.arm_terms import GAIN, LOAD_FRICTION
from armload_identification.estimation.estimation_constants import Payloads
from armload_identification.estimation.payload_from_posterior import estimate_of, gear_asymmetry, model_doubts
from armload_identification.estimation.payload_problem import single_problem
from armload_identification.estimation.problem import Noise
from armload_identification.estimation.solve import solve
from armload_identification.model.payload import InertialParameters, derived
from armload_identification.signals.recorded_run import Run
from tests.payload_rows import SAMPLES, payload_of, white

pytestmark = pytest.mark.pure


@pytest.fixture(scope="module")
def torque(regressor, pinocchio_arm):
    noise = np.random.default_rng(2).normal(size=(SAMPLES, 6)) * pinocchio_arm.noise_nm
    return regressor @ pinocchio_arm.payload.theta + noise


def slope_at(theta):
    """(4, 10) derivatives of mass and centre of mass."""
    return derived(InertialParameters(theta))[1][:4]


def test_what_the_motion_does_not_show_is_blind_and_as_good_as_unknown(regressor, pinocchio_arm):
    """Without the columns of c_y and the inertia, c_y has a deviation of a metre, the mass keeps its own."""
    columns = regressor.copy()
    columns[:, :, 2] = 0.0
    columns[:, :, 4:] = 0.0
    measured = columns @ pinocchio_arm.payload.theta + np.random.default_rng(4).normal(size=(SAMPLES, 6))
    found = payload_of(columns, measured, white(pinocchio_arm))
    assert found.rank == 3
    np.testing.assert_allclose(found.blind.T @ found.blind, np.eye(7), atol=1e-9)
    np.testing.assert_allclose(found.blind[[0, 1, 3]], 0.0, atol=1e-6)
    variance, _ = found.spread(np.eye(10))
    assert np.isfinite(variance[[0, 1, 3]]).all()
    assert np.isinf(np.delete(variance, [0, 1, 3])).all()
    assert found.condition_number == np.inf
    slope = slope_at(pinocchio_arm.payload.theta)
    known = found.mass_center(slope, pinocchio_arm.payload.mass_kg, pinocchio_arm.transmission.gain_nm_a)
    deviation = np.sqrt(np.diag(known.measured))
    assert deviation[2] == pytest.approx(1.0, rel=0.01)
    assert deviation[0] < 0.05 * pinocchio_arm.payload.mass_kg
    assert deviation[1] < 0.01


def test_a_column_without_torque_costs_one_direction(regressor, torque, pinocchio_arm):
    found = payload_of(regressor * np.r_[np.ones(9), 0.0], torque, white(pinocchio_arm))
    assert found.rank == 9
    assert payload_of(regressor, torque, white(pinocchio_arm)).rank == 10


@pytest.mark.parametrize("deviation", [0.0, 0.02], ids=["held", "fitted"])
def test_gains_stand_apart_as_slopes(regressor, pinocchio_arm, torque, deviation):
    """A small change of one gain changes the result by its slope, as a fit to the changed torque shows."""
    covariance = deviation**2 * np.eye(6)
    found = payload_of(regressor, torque, white(pinocchio_arm), gain_covariance=covariance)
    known = found.mass_center(slope_at(found.theta), found.theta[0], pinocchio_arm.transmission.gain_nm_a)
    # At the gains that were found, held, so that the others stay as they are.
    gain = np.exp(-found.posterior.value(GAIN))
    held = torque * gain
    before = payload_of(regressor, held, rescaled(pinocchio_arm, gain))
    np.testing.assert_allclose(before.theta, found.theta, rtol=1e-3, atol=1e-3)
    for axis in range(6):
        more = held * np.where(np.arange(6) == axis, np.exp(5e-4), 1.0)
        after = payload_of(regressor, more, rescaled(pinocchio_arm, gain))
        change = (InertialParameters(after.theta).values - InertialParameters(before.theta).values)[:4] / 5e-4
        np.testing.assert_allclose(known.gain_slope[:, axis], change, rtol=0.02, atol=2e-3)
    np.testing.assert_array_equal(known.gain_nm_a, pinocchio_arm.transmission.gain_nm_a)
    # All gains together scale the torque: the mass changes and the centre of mass does not.
    np.testing.assert_allclose(known.gain_slope.sum(axis=1), [found.theta[0], 0, 0, 0], atol=2e-3)
    whole = known.total
    variance, _ = found.spread(slope_at(found.theta))
    # The slopes are those of independent rows, the covariance is that of the residual: up to 19 % wider here.
    np.testing.assert_allclose(np.sqrt(np.diag(whole)), np.sqrt(variance), rtol=0.25)
    if not deviation:
        np.testing.assert_allclose(known.gain_covariance, 0.0, atol=2e-12)


def rescaled(arm, gain):
    """The noise of axes whose torque was multiplied by a factor."""
    return Noise.given(arm.noise_nm * gain, np.ones(6))


@pytest.mark.long
def test_the_freedom_is_that_of_the_matrix_scatter(regressor, pinocchio_arm):
    """Over 120 fits the whitened matrices scatter like Wishart matrices of about that many degrees of freedom."""
    truth, made = pinocchio_arm.payload, []
    for seed in range(120):
        noise = np.random.default_rng(100 + seed).normal(size=(SAMPLES, 6)) * pinocchio_arm.noise_nm
        found = payload_of(regressor, regressor @ truth.theta + noise, white(pinocchio_arm), gain_covariance=NO_ERROR)
        made.append(found.mass_center(slope_at(truth.theta), truth.mass_kg, np.ones(6)))
    mean = np.mean([each.measured for each in made], axis=0)
    root = np.linalg.inv(np.linalg.cholesky(mean))
    scatter = np.mean([np.sum((root @ each.measured @ root.T - np.eye(4)) ** 2) for each in made])
    reported = 1.0 / np.mean([1.0 / each.freedom for each in made])
    assert 0.6 <= reported * scatter / 20.0 <= 1.6, (reported, 20.0 / scatter)


NO_ERROR = np.zeros((6, 6))


@pytest.mark.parametrize("afresh", [True, False])
@pytest.mark.parametrize("axis", [1, 5])
def test_without_an_axis_it_is_the_fit_without_its_rows(regressor, torque, pinocchio_arm, axis, afresh):
    theta, covariance, rank = payload_of(regressor, torque, white(pinocchio_arm)).without(axis, afresh=afresh)
    weight = np.where(np.arange(6) == axis, 0.0, np.ones((SAMPLES, 6)))
    again = payload_of(regressor, torque, white(pinocchio_arm), weight=weight)
    place = again.posterior.problem.place("payload", "payload")
    np.testing.assert_allclose(theta, again.theta, rtol=1e-5, atol=1e-7)
    np.testing.assert_allclose(covariance, again.posterior.bread[place, place], rtol=1e-4, atol=1e-12)
    assert rank == again.rank == 10


def test_a_payload_that_only_one_axis_shows_is_blind_without_it(regressor, torque, pinocchio_arm):
    """All rows but those of joint 3 see nothing of the inertia."""
    only = regressor.copy()
    only[:, np.arange(6) != 2, 4:] = 0.0
    found = payload_of(only, torque, white(pinocchio_arm))
    assert found.without(2, afresh=False)[2] == 4
    assert found.without(4, afresh=False)[2] == found.rank == 10


def test_errors_without_a_term_widen_everything_that_they_move(regressor, torque, pinocchio_arm):
    found = payload_of(regressor, torque, white(pinocchio_arm), gain_covariance=NO_ERROR)
    shift = np.random.default_rng(5).normal(size=(2, 10)) * np.sqrt(np.diag(found.covariance))
    wider = replace(found, shifts=shift)
    np.testing.assert_allclose(wider.covariance - found.covariance, shift.T @ shift, rtol=1e-6, atol=1e-12)
    slope = slope_at(found.theta)
    (before, free), (after, freer) = (each.spread(slope) for each in (found, wider))
    np.testing.assert_allclose(after - before, np.sum((slope @ shift.T) ** 2, axis=1))
    # Variance that does not come from the residual costs no degrees of freedom.
    np.testing.assert_allclose(freer, free * (after / before) ** 2)
    centers = [each.mass_center(slope, found.theta[0], np.ones(6)).measured for each in (found, wider)]
    np.testing.assert_allclose(centers[1] - centers[0], slope @ shift.T @ shift @ slope.T, rtol=1e-6, atol=1e-12)


def test_what_an_axis_sees_of_an_error_is_its_size_in_the_rows(regressor, torque, pinocchio_arm):
    found = payload_of(regressor, torque, white(pinocchio_arm))
    errors = np.random.default_rng(6).normal(size=(10, 2))
    expected = np.sum((regressor @ errors / pinocchio_arm.noise_nm[:, None]) ** 2, axis=0)
    np.testing.assert_allclose(found.seen(errors), expected, rtol=1e-6)


def on_calibrated_arm(arm, calibration, harder=0.0):
    """A run's problem, and its solution, on the calibrated arm; joint 4 rubs harder than calibrated, in N m."""
    known, transmission = calibration.known_arm, calibration.transmission(arm.transmission)
    run = arm.run(arm.trajectory(6, period_s=10.0), True, seed=8, with_phase=False)
    current, speed = run.current_a.copy(), np.gradient(run.position_rad, run.time_s, axis=0)[:, 3]
    current[:, 3] += harder * np.tanh(speed / 0.02) / transmission.gain_nm_a[3]
    signal = Run.of(replace(run, current_a=current), transmission).over_time
    problem = single_problem(signal, calibration.level(arm.chain), transmission.coupling, known)
    given = Noise.given(known.noise_nm, np.ones(6))
    problem = replace(problem, problem=replace(problem.problem, noise=given))
    return problem, solve(problem.problem, rough=True), known


def test_errors_of_a_calibration_move_the_payload_as_shifted_values_do(pinocchio_arm, calibration):
    """Each error by which the arm's values are held: the same run solved with the values shifted by it."""
    problem, before, arm = on_calibrated_arm(pinocchio_arm, calibration)
    plain = estimate_of(before, problem, None, arm.errors)
    deviation = np.sqrt(np.diag(plain.covariance))
    assert len(plain.considered) == len(arm.errors)
    for error in np.argsort(-np.linalg.norm(plain.considered / deviation, axis=1))[:5]:
        known = replace(arm.known, target=arm.known.target + arm.known.precision @ arm.errors[error])
        shifted = replace(problem.problem, known=[known])
        change = solve(shifted, rough=True).value("payload", "payload") - plain.theta
        size = plain.considered[error] / deviation
        assert np.abs(change / deviation - size).max() < 0.05 * np.abs(size).max()
    np.testing.assert_array_equal(plain.considered_gains, arm.errors[:, before.problem.place(GAIN)])


def test_friction_that_differs_from_the_calibrations_is_found_with_its_deviation(pinocchio_arm, calibration):
    usual, rubbing = (
        estimate_of(found, problem, None, arm.errors)
        for problem, found, arm in (on_calibrated_arm(pinocchio_arm, calibration, harder) for harder in (0.0, 0.4))
    )
    change = rubbing.friction() - usual.friction()
    covariance = rubbing.friction_covariance(0)
    expected = np.zeros((3, 6))
    expected[0, 3] = 0.4
    deviation = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2)).T
    assert (np.abs(change - expected)[:2] < 4.0 * deviation).all()
    assert deviation[0, 3] < 0.1
    # Of one joint, more Coulomb friction looks like less viscous friction.
    assert (covariance[:, 0, 1] < 0.0).all()
    np.testing.assert_allclose(covariance, np.swapaxes(covariance, 1, 2))
    assert rubbing.body(0).coulomb_nm[3] - usual.body(0).coulomb_nm[3] == pytest.approx(change[0, 3], abs=1e-4)


@pytest.mark.parametrize("times", [0.5, 1.0, 2.0])
def test_what_a_run_leaves_beyond_the_calibrations_noise_may_be_a_lasting_error(pinocchio_arm, calibration, times):
    """A quarter of it, of one joint at a time, in the form of the measured torque."""
    _, found, arm = on_calibrated_arm(pinocchio_arm, calibration)
    doubts = model_doubts(found, replace(arm, noise_nm=found.noise_nm[0] / times))
    beyond = found.noise_nm[0] * np.sqrt(max(1.0 - times**-2.0, 0.0))
    size = np.sqrt(np.mean(doubts**2, axis=1))
    np.testing.assert_allclose(size, Payloads.lasting * np.diag(beyond), atol=1e-12)
    torque = found.problem.groups[0].runs[0].rows.effort_nm
    np.testing.assert_allclose(doubts[2, :, 2] * torque[0, 2], doubts[2, 0, 2] * torque[:, 2], atol=1e-9)


def test_gears_that_lose_more_in_one_direction_are_errors_of_their_gains(pinocchio_arm, calibration):
    """One by one, and all of a kind together."""
    problem, found, arm = on_calibrated_arm(pinocchio_arm, calibration)
    plain, wider = (estimate_of(found, problem, None, arm.errors, gears=gears) for gears in (False, True))
    own = gear_asymmetry(found.value(LOAD_FRICTION))
    assert gear_asymmetry(np.array([0.1, 0.2])) == pytest.approx([0.006, 0.024])
    moved = np.vstack([(plain.gain_slope * own).T, plain.gain_slope @ own])
    np.testing.assert_allclose(wider.covariance - plain.covariance, moved.T @ moved, rtol=1e-6, atol=1e-12)


def test_an_error_of_the_torque_moves_the_payload_by_what_it_looks_like(regressor, torque, pinocchio_arm):
    found = payload_of(regressor, torque, white(pinocchio_arm))
    like = np.random.default_rng(7).normal(size=10)
    np.testing.assert_allclose(found.doubting((regressor @ like)[None]).shifts[-1], like, rtol=1e-6)
    np.testing.assert_allclose(found.drifting, found.theta, rtol=1e-6)
