"""The problem of a payload: its rows by time, what is known of gains and payload, and a calibrated arm."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from armload_identification.estimation.arm_from_posterior import identified_body
from armload_identification.estimation.arm_terms import (
    FRICTION_CHANGE,
    GAIN,
    LINKS,
    PAYLOAD,
    RECORDER,
    SESSION_FRICTION,
)
from armload_identification.estimation.payload_problem import HELD, pair_problem, single_problem
from armload_identification.estimation.prior_knowledge import KnownPayload
from armload_identification.estimation.solve import solve
from armload_identification.estimation.term_kinds import Scope, Shared, Term
from armload_identification.signals.load_signal import load_signal
from armload_identification.signals.recorded_run import Run

pytestmark = pytest.mark.pure


@pytest.fixture(scope="module")
def signal(pair, pinocchio_arm):
    return load_signal(*(Run.of(run, pinocchio_arm.transmission) for run in pair))


@pytest.fixture(scope="module")
def problem(signal, pinocchio_arm):
    return pair_problem(signal, pinocchio_arm.chain, pinocchio_arm.transmission.coupling, None)


@pytest.fixture(scope="module")
def known(calibration, pinocchio_arm):
    chain = pinocchio_arm.chain
    return calibration.level(chain), calibration.transmission(pinocchio_arm.transmission), calibration.known_arm


@pytest.fixture(scope="module")
def alone(pinocchio_arm, known):
    """Of one run of another motion than the calibration's."""
    chain, transmission, arm = known
    run = pinocchio_arm.run(pinocchio_arm.trajectory(6, period_s=10.0), True, seed=8, with_phase=False)
    return single_problem(Run.of(run, transmission).over_time, chain, transmission.coupling, arm)


def payload(found):
    """Values and standard deviations of the payload."""
    place = found.problem.place(PAYLOAD, PAYLOAD)
    return found.value(PAYLOAD, PAYLOAD), np.sqrt(np.diag(found.covariance)[place])


def test_a_pair_is_one_group_whose_arm_is_unknown_and_whose_gains_are_held(problem, pinocchio_arm):
    (group,) = problem.problem.groups
    assert [run.mounting for run in group.runs] == [PAYLOAD, ""]
    found = solve(problem.problem, rough=True)
    value, deviation = payload(found)
    truth = pinocchio_arm.payload.theta
    assert value[0] == pytest.approx(truth[0], rel=2e-3)
    assert (np.abs(value - truth) < 3.5 * deviation).all()
    assert (np.abs(found.value(GAIN)) < 4.0 * HELD).all()
    np.testing.assert_allclose(np.sqrt(np.diag(found.bread)[found.problem.place(GAIN)]), HELD, rtol=0.01)


def test_noise_of_a_pair_is_at_least_that_of_its_samples(signal, pinocchio_arm):
    """Of difference and mean of the periods, and of the difference of slow rounds, in axis coordinates."""
    chain, coupling = pinocchio_arm.chain, pinocchio_arm.transmission.coupling
    slow = replace(signal, loaded=replace(signal.loaded, averaged_noise_nm=3.0 * signal.loaded.averaged_noise_nm))
    for rounds, sampled in ((None, [signal]), (slow, [signal, slow])):
        noise = pair_problem(signal, chain, coupling, None, rounds).problem.noise
        expected = [np.sqrt(one.averaged_noise_nm**2 @ coupling**2) for one in sampled]
        share = noise.least_nm / np.array([expected[0], 0.5 * expected[0], *expected[1:]])
        assert 0.1 < share[0, 0] < 0.5
        np.testing.assert_allclose(share, share[0, 0])
        assert noise.least_correlation[0, 1] == noise.least_correlation[1, 1] > 0.5
        assert (noise.least_correlation[2:, 1] < 0.5).all()  # every second row


def test_rows_of_slow_noise_have_more_of_it_and_for_longer(signal, pinocchio_arm):
    """Half of the runs have such noise, without an end to it in a window: half of its variance stays in a mean."""
    chain, coupling = pinocchio_arm.chain, pinocchio_arm.transmission.coupling
    lasting = replace(signal.loaded, noise_memory=0.999 ** np.arange(400))
    white = replace(signal, loaded=replace(signal.loaded, noise_memory=np.ones(1)))
    white = replace(white, unloaded=replace(signal.unloaded, noise_memory=np.ones(1)))
    slow = replace(white, loaded=lasting)
    before, after = (pair_problem(one, chain, coupling, None).problem.noise for one in (white, slow))
    sample_nm = np.sqrt(signal.averaged_noise_nm**2 @ coupling**2)
    np.testing.assert_allclose(after.least_nm[0] ** 2, 0.5 * (before.least_nm[0] ** 2 + sample_nm**2), rtol=0.02)
    far = before.least_correlation.shape[1]
    assert after.least_correlation.shape[1] > far
    assert after.least_correlation[0, far] > 0.7


def test_parts_share_the_rows_without_an_overlap(alone):
    (whole,) = alone.problem.groups
    middle_s, end_s = 0.4 * whole.time_s[-1], whole.time_s[-1] + 1.0
    parts = [alone.between(0.0, middle_s), alone.between(middle_s, end_s)]
    times = [part.problem.groups[0].time_s for part in parts]
    np.testing.assert_array_equal(np.concatenate(times), whole.time_s)
    assert times[0][-1] < middle_s <= times[1][0]
    efforts = np.concatenate([part.problem.groups[0].effort_nm for part in parts], axis=1)
    np.testing.assert_array_equal(efforts, whole.effort_nm)
    edge_s = float(times[1][0])
    assert alone.between(edge_s, end_s).problem.groups[0].time_s[0] == edge_s, "the start belongs to a part"
    assert alone.between(0.0, edge_s).problem.groups[0].time_s[-1] < edge_s, "its end does not"


def test_parts_of_a_run_agree_and_know_less(alone, pinocchio_arm):
    (group,) = alone.problem.groups
    middle_s = 0.5 * group.time_s[-1]
    whole, *parts = (
        payload(solve(part.problem, rough=True))
        for part in (alone, alone.between(0.0, middle_s), alone.between(middle_s, 1e3))
    )
    for value, deviation in parts:
        assert deviation[0] > whole[1][0]
        assert abs(value[0] - pinocchio_arm.payload.mass_kg) < 4.0 * deviation[0]


def test_gains_are_known_as_said_last(problem):
    """Their common error too: it moves all gains by the same factor and no row shows it."""
    covariance = 0.02**2 * np.eye(6) + 0.01**2
    twice = problem.with_gains(0.5**2 * np.eye(6)).with_gains(covariance)
    (known,) = twice.problem.known
    np.testing.assert_allclose(np.linalg.inv(known.precision), covariance, rtol=1e-4)
    found = solve(twice.problem, rough=True)
    place = found.problem.place(GAIN)
    after = found.bread[place, place]
    along = np.full(6, 1.0 / 6.0)
    assert np.sqrt(along @ after @ along) > 0.0099, "the common error remains"
    assert (np.diag(after)[1:] < 0.75 * np.diag(covariance)[1:]).all(), "the rows compare the gains"
    (held,) = problem.problem.known
    assert held is not known, "the problem itself is as it was"


def test_gains_of_two_terms_are_one_factor(problem):
    """Of the friction too, of which differences between the runs are shares."""
    one = solve(problem.with_gains(0.05**2 * np.eye(6)).problem, rough=True)
    change = Term("change", Scope.ARM, Shared.GAIN, np.zeros(6), np.full(6, 0.05), "a new drive")
    two = solve(replace(problem.problem, terms=[*problem.problem.terms, change]), rough=True)
    np.testing.assert_allclose(two.value("change"), one.value(GAIN), atol=1e-5)
    np.testing.assert_allclose(payload(two)[0], payload(one)[0], rtol=1e-4, atol=1e-5)


def test_knowledge_of_the_payload_is_added_to_what_the_rows_say(problem, pinocchio_arm):
    assert problem.knowing(None) is problem.problem
    truth = pinocchio_arm.payload
    mass_kg = truth.mass_kg + 0.001
    prior = KnownPayload(mass_kg=mass_kg).prior()
    given = problem.knowing(prior)
    assert given.known[:-1] == problem.problem.known
    value, deviation = payload(solve(given, rough=True))
    free_value, free_deviation = payload(solve(problem.problem, rough=True))
    assert value[0] == pytest.approx(mass_kg, rel=1e-4)
    assert deviation[0] < 2e-5 * mass_kg
    # 3 % because the noise is estimated again.
    assert (deviation < 1.05 * free_deviation).all()
    moved = value[1:4] / value[0] - free_value[1:4] / free_value[0]
    assert (np.abs(moved) < 0.01).all()


def test_a_calibrated_arm_is_held_in_a_run_of_its_own(alone, known):
    """Its body, friction and gains stay; payload, friction of the run and nothing else are free."""
    _, _, arm = known
    found = solve(alone.problem, rough=True)
    of_arm = slice(0, arm.errors.shape[1])
    calibrated = np.linalg.solve(arm.known.precision, arm.known.target)
    spread = np.sqrt(np.sum(arm.errors**2, axis=0))
    moved = np.abs(found.x[of_arm] - calibrated)
    assert (moved <= 0.01 * spread + 1e-9).all(), (moved / np.maximum(spread, 1e-12)).max()
    names = {term.name for term in alone.problem.terms}
    assert {PAYLOAD, FRICTION_CHANGE, LINKS} <= names
    assert SESSION_FRICTION not in names
    np.testing.assert_array_equal(alone.layout.base, arm.body.base.ravel())


def test_a_recorder_whose_torque_is_later_than_in_the_calibration_does_not_change_the_payload(pinocchio_arm, known):
    chain, transmission, arm = known
    run = pinocchio_arm.run(pinocchio_arm.trajectory(6, period_s=10.0), True, seed=8, with_phase=False)
    late = replace(run, current_a=np.roll(run.current_a, 2, axis=0))  # by 20 ms
    problem = single_problem(Run.of(late, transmission).over_time, chain, transmission.coupling, arm)
    found = solve(problem.problem, rough=True)
    value, deviation = payload(found)
    body = identified_body(found, problem.layout.base, problem.layout.peak_rad_s, np.zeros((3, chain.n)))
    assert body.torque_delay_s == pytest.approx(arm.body.torque_delay_s + 0.02, abs=0.002)
    assert found.value(RECORDER)[0] == pytest.approx(0.02, abs=0.002)
    assert (np.abs(value - pinocchio_arm.payload.theta)[:4] < 4.0 * deviation[:4]).all()


def test_a_pair_on_a_calibrated_arm_has_friction_of_the_day_and_of_each_run(pair, pinocchio_arm, known):
    chain, transmission, arm = known
    signal = load_signal(*(Run.of(run, transmission) for run in pair))
    problem = pair_problem(signal, chain, transmission.coupling, arm)
    names = [term.name for term in problem.problem.terms]
    assert SESSION_FRICTION in names
    assert FRICTION_CHANGE in names
    value, _ = payload(solve(problem.problem, rough=True))
    assert value[0] == pytest.approx(pinocchio_arm.payload.mass_kg, rel=0.005)


@pytest.mark.parametrize("last_digits", range(8))
def test_both_runs_of_a_pair_have_the_same_rows_whatever_the_last_digits_of_their_clocks(
    signal, pinocchio_arm, last_digits
):
    time_s = 0.004 * np.arange(250.0)  # 2.5 samples to each of a hundred rows, which rounds up or down
    loaded, unloaded = (
        replace(run.part(0.0, run.time_s[250]), periodic=True, time_s=time_s * (1.0 + 1e-15 * digits))
        for run, digits in ((signal.loaded, 0), (signal.unloaded, last_digits))
    )
    clocks = replace(signal, loaded=loaded, unloaded=unloaded)
    chain, coupling = pinocchio_arm.chain, pinocchio_arm.transmission.coupling
    (group,) = pair_problem(clocks, chain, coupling, None).problem.groups
    assert group.effort_nm.shape[1] > 90
