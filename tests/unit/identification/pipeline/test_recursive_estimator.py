"""The recursive estimator: Pinocchio's torque of a calibrated arm, sample by sample, and robustness."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from armload_core import kernels
from armload_identification.calibration.session_gains import SessionGains
from armload_identification.estimation.payload_intervals import NORMAL_HALF_WIDTH
from armload_identification.identification_errors import ModelError
from armload_identification.model.chain import Chain
from armload_identification.pipeline.payload_identification import identify_runs
from armload_identification.pipeline.recursive_estimator import COLOUR, LOAD_LAW, PayloadEstimator
from armload_identification.recording.reading_options import Effort
from armload_identification.recording.recording import Recording
from armload_identification.verdict.decision_levels import ColdArm
from armload_identification.verdict.recording_checks.friction_validity import standard_deviations

pytestmark = pytest.mark.pure


@pytest.fixture(scope="module")
def streams(pinocchio_arm):
    """Time, position and current of one motion, empty and loaded."""
    trajectory = pinocchio_arm.trajectory(6, period_s=10.0)
    runs = [pinocchio_arm.run(trajectory, load, seed=8 + load, with_phase=False) for load in (False, True)]
    rows = min(run.size for run in runs)
    return [(run.time_s[:rows].copy(), run.position_rad[:rows].copy(), run.current_a[:rows].copy()) for run in runs]


@pytest.fixture
def estimator(calibration, pinocchio_arm):
    return PayloadEstimator(calibration, pinocchio_arm.chain, pinocchio_arm.transmission)


def within(found, payload, times=1.5):
    return (np.abs(found.values - payload.values[:4]) < times * found.half_width_95).all()


def test_the_payload_is_found_sample_by_sample(estimator, streams, pinocchio_arm):
    time_s, position, current = streams[1]
    for k in range(len(time_s)):
        estimator.update(time_s[k], position[k], current[k])
    found = estimator.estimate()
    assert found.mass_kg == pytest.approx(pinocchio_arm.payload.mass_kg, rel=0.01)
    assert within(found, pinocchio_arm.payload)
    assert found.determined.all()
    assert found.changes == 0
    assert found.refused == 0
    assert (found.moving_s > 5.0).all()
    printed = str(found)
    assert printed.startswith(
        f"{found.mass_kg:.3f} +- {found.half_width_95[0]:.3f} kg, x {1e3 * found.values[1]:.1f} +- "
    )
    assert "array" not in printed
    assert str(replace(found, determined=np.zeros(4, bool))) == "not determined"
    body = found.possible_body()
    assert body.is_physical
    np.testing.assert_allclose(body.theta[:4], found.theta[:4], atol=0.02)


def test_without_forgetting_it_is_the_batch_solve_of_the_same_run(calibration, streams, pinocchio_arm):
    """The same terms and priors in another form: rows of half the time and two thirds of the window, delay held."""
    chain, time_s, position, current = pinocchio_arm.chain, *streams[1]
    estimator = PayloadEstimator(calibration, chain, pinocchio_arm.transmission, memory_s=1e9)
    for k in range(len(time_s)):
        estimator.update(time_s[k], position[k], current[k])
    found = estimator.estimate()
    run = Recording.from_arrays(time_s, position, current_a=current)
    gains = calibration.transmission(pinocchio_arm.transmission)
    batch = identify_runs(run, None, calibration.level(chain), gains, arm=calibration.known_arm)
    half_width = batch.uncertainty.half_width_95[:4]
    assert (np.abs(batch.plain_parameters.values[:4] - found.values) < 0.15 * half_width).all()
    np.testing.assert_allclose(found.half_width_95, half_width, rtol=0.25)


def test_twenty_samples_per_second_are_enough(estimator, streams, pinocchio_arm):
    """The slowest recording that can be used; fewer samples in a window would give no rows at all."""
    estimator.update_all(*(np.ascontiguousarray(values[::5]) for values in streams[1]))
    found = estimator.estimate()
    assert found.mass_kg == pytest.approx(pinocchio_arm.payload.mass_kg, rel=0.02)
    assert within(found, pinocchio_arm.payload)
    assert found.determined[0]


def test_an_empty_arm_carries_nothing(estimator, streams):
    estimator.update_all(*streams[0])
    found = estimator.estimate()
    assert abs(found.mass_kg) < found.half_width_95[0]
    assert not found.determined.any()
    assert found.possible_body() is None
    assert found.changes == 0


def test_nothing_is_said_before_anything_is_seen(estimator):
    found = estimator.estimate()
    assert found.mass_kg == 0.0
    assert not found.determined.any()
    assert np.isinf(found.half_width_95[1:]).all()


def test_grasped_and_dropped(estimator, streams, pinocchio_arm):
    (time_s, position, empty), (_, _, loaded) = streams
    third = len(time_s) // 3
    current = empty.copy()
    current[third : 2 * third] = loaded[third : 2 * third]
    changed = []
    for start in range(0, len(time_s), 10):
        rows = slice(start, start + 10)
        before = estimator.changes
        estimator.update_all(time_s[rows], position[rows], current[rows])
        if estimator.changes > before:
            found = estimator.estimate()
            changed.append((found.changed_s, np.sign(found.change_kg)))
        if start + 10 >= 2 * third > start:
            carried = estimator.estimate()
    assert carried.mass_kg == pytest.approx(pinocchio_arm.payload.mass_kg, rel=0.05)
    assert within(carried, pinocchio_arm.payload, 2.0)
    (grasped, up), (dropped, down) = changed
    assert (up, down) == (1.0, -1.0)
    assert 0.0 < grasped - time_s[third] < 1.0
    assert 0.0 < dropped - time_s[2 * third] < 1.0
    assert abs(estimator.estimate().mass_kg) < 0.1


def test_jerky_motion_from_place_to_place_is_no_change_of_payload(estimator, jerky, pinocchio_arm):
    """Ruckig's motion of er50 once gave ten changes in 20 s, because torque and acceleration had different filters."""
    estimator.update_all(*jerky)
    found = estimator.estimate()
    assert found.changes == 0
    assert within(found, pinocchio_arm.payload)
    assert found.mass_kg == pytest.approx(pinocchio_arm.payload.mass_kg, rel=0.015)


def test_changes_are_looked_for_once_a_payload_is_known(calibration, pinocchio_arm, streams):
    """Grasped after 3 s of motion: noticed from 5 s on. Dropped 1.2 s after it was noticed: from 2 s after that on."""
    (time_s, position, empty), (_, _, loaded) = streams
    begin_s = time_s[0]
    for grasped_s, noticed_s in ((3.0, 5.0), (8.0, 8.0)):
        estimator = PayloadEstimator(calibration, pinocchio_arm.chain, pinocchio_arm.transmission)
        current, changed = empty.copy(), []
        current[time_s >= begin_s + grasped_s] = loaded[time_s >= begin_s + grasped_s]
        for k in range(np.searchsorted(time_s, begin_s + noticed_s + 6.0)):
            if changed and time_s[k] > changed[0] + 1.2:
                current[k] = empty[k]
            estimator.update(time_s[k], position[k], current[k])
            if estimator.changes > len(changed):
                changed.append(time_s[k])
        assert len(changed) == 2
        assert noticed_s <= changed[0] - begin_s < noticed_s + 1.0
        assert 2.0 <= changed[1] - changed[0] < 3.5


def test_joints_that_ring_are_no_change_of_payload(calibration, estimator, jerky, pinocchio_arm):
    """Forty times the noise on three joints, at 3 Hz: measured by the noise alone, 25 changes in 24 s."""
    time_s, position, current = (values.copy() for values in jerky)
    size = 40.0 * calibration.noise_nm / calibration.gain_nm_a
    current[:, [1, 2, 4]] += (size * np.sin(6.0 * np.pi * time_s[:, None] + np.arange(6)))[:, [1, 2, 4]]
    estimator.update_all(time_s, position, current)
    found = estimator.estimate()
    assert found.changes == 0
    assert within(found, pinocchio_arm.payload)


@pytest.fixture(scope="module")
def without_noise(jerky, pinocchio_arm):
    """Speed, payload's torque and whole arm's torque of the same motion, without friction."""
    kernel = np.exp(-0.5 * (np.arange(-6, 7) / 2.5) ** 2)
    q = np.apply_along_axis(
        lambda x: np.convolve(np.pad(x, 6, mode="edge"), kernel / kernel.sum(), "valid"), 0, jerky[1]
    )
    dq = np.gradient(q, 0.01, axis=0)
    states = q, dq, np.gradient(dq, 0.01, axis=0)
    empty, loaded = (pinocchio_arm.torque(*states, payload) for payload in (None, pinocchio_arm.payload))
    return dq, loaded - empty, loaded - 4.0 * np.tanh(dq / 0.01) - 5.0 * dq


@pytest.mark.parametrize("noises", [40.0, 100.0])
def test_an_arm_that_differs_from_its_model_keeps_its_payload(
    calibration, estimator, jerky, without_noise, pinocchio_arm, noises
):
    """The wrist's gears lose a fifth of the payload's torque, unlike the calibrated ones, and three joints ring.

    One change at most: of twelve calibrations from other runs, eleven have one, at the same payload.
    """
    time_s, position, current = jerky
    speed, payload_nm, _ = without_noise
    wrist, ringing = np.isin(np.arange(6), (3, 4, 5)), np.isin(np.arange(6), (1, 2, 4))
    lost = wrist * 0.2 * np.tanh(speed / 0.02) * np.abs(payload_nm)
    lost += np.outer(np.sin(6.0 * np.pi * time_s), ringing * noises * calibration.noise_nm)
    estimator.update_all(
        time_s, position, current + lost @ np.linalg.inv(pinocchio_arm.transmission.joint_torque(np.eye(6)))
    )
    found = estimator.estimate()
    assert found.changes <= 1
    assert abs(found.mass_kg - pinocchio_arm.payload.mass_kg) < found.half_width_95[0]


@pytest.mark.parametrize("share", [0.5, -0.5])
def test_load_dependent_friction_of_the_payload_by_another_law_is_no_change_of_payload(
    calibration, jerky, without_noise, pinocchio_arm, share
):
    """The payload's share of it is half as large again, or half as large, as that of the links."""
    time_s, position, current = jerky
    speed, payload_nm, whole_nm = without_noise
    lossy = replace(calibration, body=replace(calibration.body, load_friction=np.full(6, 0.3)))
    estimator = PayloadEstimator(lossy, pinocchio_arm.chain, pinocchio_arm.transmission)
    lost = 0.3 * np.tanh(speed / 0.02) * (np.abs(whole_nm) + share * np.abs(payload_nm))
    estimator.update_all(
        time_s, position, current + lost @ np.linalg.inv(pinocchio_arm.transmission.joint_torque(np.eye(6)))
    )
    found = estimator.estimate()
    assert found.changes == 0
    assert abs(found.mass_kg - pinocchio_arm.payload.mass_kg) < found.half_width_95[0]


def test_fast_motion_is_a_mean_over_the_window(estimator, pinocchio_arm):
    """Joints at 3 rad/s: 0.5 % of the mass are lost if the acceleration is taken as constant over the window."""
    arm, speed = pinocchio_arm, 3.0 * np.array([1.0, 0.9, 1.1, 0.8, 1.2, 0.7])
    time_s, turned = np.arange(2000) * 0.01, np.array([1.0, 0.6, 0.6, 1.0, 1.0, 1.0])
    angle = speed / turned * time_s[:, None] + np.arange(6)
    states = turned * np.sin(angle), speed * np.cos(angle), -(speed**2) / turned * np.sin(angle)
    torque = arm.torque(*states, arm.payload)
    current = np.ascontiguousarray(torque @ arm.transmission.coupling / arm.transmission.gain_nm_a)
    estimator.update_all(time_s, states[0].copy(), current)
    found = estimator.estimate()
    assert found.mass_kg == pytest.approx(arm.payload.mass_kg, rel=0.003)
    assert found.changes == 0


def test_load_dependent_friction_is_known_to_a_share_of_itself(calibration, estimator, pinocchio_arm, streams):
    """Gears that lose a fifth of their load to friction: no scatter of the rows shows how wrong the law is."""
    lossy = replace(calibration, body=replace(calibration.body, load_friction=np.full(6, 0.2)))
    other = PayloadEstimator(lossy, pinocchio_arm.chain, pinocchio_arm.transmission)
    for one in (estimator, other):
        one.update_all(*streams[1])
    more = other.estimate()
    assert more.half_width_95[0] > 1.96 * LOAD_LAW * 0.2 * more.mass_kg > 2.0 * estimator.estimate().half_width_95[0]


@pytest.mark.parametrize("share", [0.2, -0.2])
def test_an_arm_that_begins_colder_or_warmer_has_no_change_of_payload(
    calibration, estimator, jerky, pinocchio_arm, share
):
    """With only the drift between runs as a prior, there are up to three false alarms."""
    time_s, position, current = jerky
    velocity = np.gradient(position, time_s, axis=0)
    friction = np.sign(velocity) * calibration.body.coulomb_nm + velocity * calibration.body.viscous_nm_s_rad
    added = share * friction @ np.linalg.inv(pinocchio_arm.transmission.joint_torque(np.eye(6)))
    estimator.update_all(time_s, position, current + added)
    found = estimator.estimate()
    assert found.changes == 0
    assert within(found, pinocchio_arm.payload)


def test_a_change_of_friction_is_measured_with_its_covariance(calibration, pinocchio_arm, jerky):
    """Half more Coulomb friction of joint 2, less viscous friction by as much at the speed at which it is reported."""
    time_s, position, current = jerky
    body, speed = calibration.body, calibration.middle_speed_rad_s
    velocity, more = np.gradient(position, time_s, axis=0), np.zeros(6)
    more[1] = 0.5 * body.coulomb_nm[1]
    changed = (np.sign(velocity) - velocity / speed) * more
    added = changed @ np.linalg.inv(pinocchio_arm.transmission.joint_torque(np.eye(6)))
    sizes = []
    for measured in (current, current + added):
        estimator = PayloadEstimator(calibration, pinocchio_arm.chain, pinocchio_arm.transmission)
        estimator.update_all(time_s, position, measured)
        found = estimator.estimate()
        known = found.friction_covariance
        assert (np.linalg.eigvalsh(known) > 0.0).all()
        assert (known[:, [0, 1], [0, 1]] < 2.0 * calibration.friction_spread[:2].T ** 2).all()
        assert (known[:, 0, 1] < 0.0).all(), "their sum is better known than each"
        sizes.append(standard_deviations(found.friction[:2], known, calibration.drift[:2]))
    assert sizes[0].max() < 3.0
    assert sizes[1].argmax() == 1
    assert sizes[1][1] > ColdArm.far_deviations


def test_what_drives_and_buses_do_does_not_break_it(estimator, streams, pinocchio_arm):
    """Irregular stamps, lost samples, a gap, NaN, jumps of an encoder, stamps out of order."""
    rng = np.random.default_rng(3)
    time_s, position, current = (values.copy() for values in streams[1])
    position[500] = np.nan
    current[700, 2] = np.inf
    current[710, 2] = 1e300
    position[900:905, 1] += 1.0
    time_s[1000] = time_s[990]
    kept = rng.random(len(time_s)) > 0.2
    kept[1200:1240] = False
    kept[[500, 700, 710, 1000]] = True
    time_s += rng.uniform(-2e-3, 2e-3, len(time_s))
    estimator.update_all(time_s[kept], position[kept], current[kept])
    found = estimator.estimate()
    assert found.refused == 4
    assert found.changes == 0
    assert found.mass_kg == pytest.approx(pinocchio_arm.payload.mass_kg, rel=0.015)
    assert within(found, pinocchio_arm.payload)


def test_a_clock_that_is_set_begins_a_new_window(estimator, streams, pinocchio_arm):
    time_s, position, current = streams[1]
    half = len(time_s) // 2
    estimator.update_all(time_s[:half], position[:half], current[:half])
    before = estimator.estimate()
    estimator.update(time_s[half] - 1e5, position[half], current[half])
    # The calibration's share of the interval was lost until there were rows again: 0.15 kg instead of 0.52 kg on er50.
    np.testing.assert_allclose(estimator.estimate().half_width_95, before.half_width_95, rtol=1e-6)
    estimator.update_all(time_s[half + 1 :] - 1e5, position[half + 1 :].copy(), current[half + 1 :].copy())
    assert estimator.estimate().mass_kg == pytest.approx(pinocchio_arm.payload.mass_kg, rel=0.01)


@pytest.mark.parametrize("memory_s", [0.5, 60.0, 1e9])
def test_the_information_stays_positive_definite(calibration, pinocchio_arm, streams, memory_s):
    """A repeated motion, then standstill; for a million updates: `python -m benchmarks.accuracy.measured_motion`."""
    estimator = PayloadEstimator(calibration, pinocchio_arm.chain, pinocchio_arm.transmission, memory_s=memory_s)
    time_s, position, current = streams[1]
    rng, length = np.random.default_rng(1), time_s[-1] - time_s[0] + 0.01
    for number in range(12):
        estimator.update_all(time_s + number * length, position, current + rng.normal(0.0, 0.1, current.shape))
    still = time_s[-1] + 12.0 * length + np.arange(1, 3000) * 0.01
    estimator.update_all(still, np.tile(position[-1], (len(still), 1)), np.tile(current[-1], (len(still), 1)))
    _, covariance, *_ = estimator._read()
    scaled = covariance / np.sqrt(np.outer(np.diag(covariance), np.diag(covariance)))
    assert np.linalg.eigvalsh(scaled).min() > 0.0


def test_a_million_updates_leave_it_as_good_as_a_thousand(calibration, pinocchio_arm, streams):
    """17 minutes at 1 kHz, nothing forgotten, in the C loop."""
    estimator = PayloadEstimator(calibration, pinocchio_arm.chain, pinocchio_arm.transmission, memory_s=1e12)
    slow_s, *signals = streams[1]
    time_s = slow_s[0] + np.arange(10_000) * 1e-3
    fine = [np.column_stack([np.interp(time_s, slow_s, column) for column in part.T]) for part in signals]
    estimator.update_all(time_s, *fine)
    once = estimator.estimate()
    for number in range(1, 100):
        estimator.update_all(time_s + 10.0 * number, *fine)
    found = estimator.estimate()
    scaled = found.covariance / np.sqrt(np.outer(np.diag(found.covariance), np.diag(found.covariance)))
    assert np.linalg.eigvalsh(scaled).min() > 0.0
    assert found.covariance[0, 0] < 0.1 * once.covariance[0, 0]
    assert found.mass_kg == pytest.approx(once.mass_kg, abs=once.half_width_95[0])
    assert found.changes == 0


@pytest.mark.parametrize(("joints", "wider"), [([2], 1.1), ([0, 1, 2, 3, 4, 5], 3.0)])
def test_joints_that_no_payload_explains_count_less_and_widen_the_intervals(
    calibration, pinocchio_arm, streams, joints, wider
):
    """Torques that change every three seconds, ten times a joint's noise."""
    time_s, position, current = streams[1]
    wrong = current.copy()
    size = 10.0 * calibration.noise_nm / calibration.gain_nm_a
    wrong[:, joints] += (size * np.sin(2.1 * time_s[:, None] + np.arange(6)))[:, joints]
    found = []
    for measured in (current, wrong):
        estimator = PayloadEstimator(calibration, pinocchio_arm.chain, pinocchio_arm.transmission)
        estimator.update_all(time_s, position, measured)
        found.append(estimator.estimate())
        assert within(found[-1], pinocchio_arm.payload)
    usual, off = found
    assert off.covariance[0, 0] > wider * usual.covariance[0, 0]
    if len(joints) == 1:
        assert off.mass_kg == pytest.approx(usual.mass_kg, rel=0.01)


def test_a_push_at_rest_is_contact(calibration, pinocchio_arm, estimator, streams):
    _, position, _ = streams[0]
    still = np.tile(position[0], (200, 1))
    body = calibration.body
    nothing = np.zeros_like(still[:1])
    carried = body.link_torque(calibration.level(pinocchio_arm.chain), still[:1], nothing, nothing)[0]
    transmission = calibration.transmission(pinocchio_arm.transmission)
    per_ampere = transmission.joint_torque(np.eye(6))
    for push, expected in ((1.4, False), (6.0, True)):
        torque = carried.copy()
        torque[1] += push * (body.coulomb_nm[1] + body.load_friction[1] * abs(carried[1]))
        current = np.tile(np.linalg.solve(per_ampere.T, torque), (200, 1))
        time_s = np.arange(200) * 0.01 + 10.0 * push
        estimator.update_all(time_s, still, current)
        assert estimator.estimate().contact is expected
        assert estimator.changes == 0


def test_wrong_use_is_named(calibration, pinocchio_arm, estimator):
    with pytest.raises(ValueError, match="float64 arrays of 6 numbers"):
        estimator.update(0.0, np.zeros(5), np.zeros(6))
    with pytest.raises(ValueError, match="float64 arrays of 6 numbers"):
        estimator.update(0.0, np.zeros(6), np.zeros(6, dtype=np.float32))
    with pytest.raises(TypeError):
        estimator.update(0.0, np.zeros(6))
    with pytest.raises(TypeError, match="__init__"):
        kernels.PayloadEstimator.__new__(kernels.PayloadEstimator).update(0.0, np.zeros(6), np.zeros(6))
    chain = pinocchio_arm.chain
    turned = Chain(chain.placement, chain.axis, chain.flange, -chain.gravity_m_s2)
    with pytest.raises(ModelError, match="different kinematics"):
        PayloadEstimator(calibration, turned, pinocchio_arm.transmission)


def test_the_interval_counts_rows_twice_and_adds_the_arms_errors_and_the_law_of_its_friction(
    calibration, estimator, streams, pinocchio_arm
):
    def found_with(changed):
        other = PayloadEstimator(changed, pinocchio_arm.chain, pinocchio_arm.transmission)
        other.update_all(*streams[1])
        return other.estimate()

    estimator.update_all(*streams[1])
    found = estimator.estimate()
    rows = np.empty((10, 10))
    estimator._kernel.read_into(np.empty(10), rows, np.empty((3, 6)), np.empty(6), np.empty(kernels.ESTIMATOR_STATUS))
    np.testing.assert_allclose(found.covariance, COLOUR * rows)
    unsure = found_with(replace(calibration, covariance=9.0 * calibration.covariance))
    np.testing.assert_allclose(unsure.covariance, found.covariance, rtol=0.1)
    assert (unsure.half_width_95 > 1.2 * found.half_width_95).all()
    body = calibration.body
    # Only for the interval: as a constant of the estimator it would no longer fit the data.
    estimator.calibration = replace(calibration, body=replace(body, load_friction=body.load_friction + 0.2))
    rubbing = estimator.estimate()
    beside = (rubbing.half_width_95[0] / NORMAL_HALF_WIDTH) ** 2 - np.sum(
        estimator._shifts(rubbing.theta)[0][:, 0] ** 2
    )
    assert beside > (0.2 * LOAD_LAW * rubbing.mass_kg) ** 2


def test_reported_torque_is_used_with_its_gains_as_current_is(calibration, estimator, streams, pinocchio_arm):
    time_s, position, current = streams[1]
    nominal = pinocchio_arm.transmission
    factor = calibration.gain_nm_a / nominal.gain_nm_a
    reporting = replace(calibration, effort=Effort.TORQUE, gain_nm_a=factor)
    of_torque = PayloadEstimator(reporting, pinocchio_arm.chain, nominal)
    of_torque.update_all(time_s, position, np.ascontiguousarray(nominal.joint_torque(current)))
    estimator.update_all(time_s, position, current)
    np.testing.assert_allclose(of_torque.estimate().values, estimator.estimate().values, rtol=0.02)


def test_a_drift_of_all_gains_is_part_of_the_interval_if_it_is_allowed_for(calibration, pinocchio_arm, streams):
    factor = 1.02
    arm, (time_s, position, current) = pinocchio_arm, streams[1]

    def estimate(session, drift):
        estimator = PayloadEstimator(calibration, arm.chain, arm.transmission, session)
        estimator.update_all(time_s, position, drift * current)
        return estimator.estimate()

    allowed = SessionGains.assumed(calibration, 0.02)
    strict, found, right = estimate(None, factor), estimate(allowed, factor), estimate(allowed, 1.0)
    assert found.mass_kg == strict.mass_kg
    assert strict.half_width_95[0] < abs(found.mass_kg - arm.payload.mass_kg) < found.half_width_95[0]
    per_one = found.drifted_kg / found.gains.deviation
    assert found.mass_kg - right.mass_kg == pytest.approx(np.log(factor) * per_one, rel=0.1)
    # a motion whose gains are right leaves less of the drift possible than one that shows it
    assert right.gains.deviation < 0.5 * allowed.deviation < found.gains.deviation
    measured = replace(allowed, log_factor=1e-3)
    assert estimate(measured, factor).gains is measured
