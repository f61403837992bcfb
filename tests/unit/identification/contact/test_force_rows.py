"""Rows of a calibrated arm: torque is seen as acceleration is, and a joint is uncertain while a row sees it stop."""

from dataclasses import replace

import numpy as np
import pytest

from armload_identification.contact.contact_levels import BINS, STAMP_SIGMAS, STOPPING
from armload_identification.contact.force_rows import ForceRows, RecentRows, RowMaker
from armload_identification.pipeline.estimator_constants import estimator_constants

SPEED_RAD_S, SAMPLES = 0.5, 100


def joined(rows):
    """They about no payload."""
    return ForceRows.joined([row.about(np.zeros(10)) for row in rows])


def stopped(moved, step_s, **friction):
    """Rows of a joint that stops within two samples, the time of the stop, and the joint's torque."""
    calibration, chain, transmission = moved.watched_arm
    nothing = dict.fromkeys(("coulomb_nm", "viscous_nm_s_rad", "root_nm", "load_friction"), np.zeros(chain.n))
    body = replace(calibration.body, torque_delay_s=0.0, **(nothing | friction))
    calibration = replace(calibration, body=body)
    middle = SAMPLES // 2
    speed = np.where(np.arange(SAMPLES) < middle, SPEED_RAD_S, 0.0)
    speed[middle] = 0.5 * SPEED_RAD_S
    position = np.tile(moved.position[0], (SAMPLES, 1))
    position[:, 0] += np.cumsum(speed) * step_s
    velocity, acceleration = np.zeros_like(position), np.zeros_like(position)
    velocity[:, 0], acceleration[:-1, 0] = speed, np.diff(speed) / step_s
    torque = body.torque(calibration.level(chain), position, velocity, acceleration)
    from_effort = estimator_constants(calibration, chain, transmission).from_effort
    rows = RowMaker(calibration, chain, from_effort).take(
        step_s * np.arange(SAMPLES), position, torque @ np.linalg.inv(from_effort)
    )
    return joined(rows), step_s * middle, torque[:, 0]


def test_an_abrupt_stop_leaves_no_residual(moved):
    rows, _, torque = stopped(moved, 0.01)
    inertial = np.ptp(torque)
    assert inertial > 1.0
    assert np.abs(rows.residual_nm[:, 0]).max() < 0.03 * inertial


@pytest.mark.parametrize("step_s", [0.01, 0.02])
def test_a_joint_is_uncertain_from_when_a_row_sees_it_stop(moved, step_s):
    rows, stop_s, _ = stopped(moved, step_s, coulomb_nm=np.ones(moved.arm.chain.n))
    doubt, half_s = rows.doubt_nm[:, 0] / STOPPING, 0.5 * BINS * step_s
    assert doubt[rows.time_s < stop_s - half_s].max() < 1e-6
    assert doubt[rows.time_s > stop_s - 0.25 * half_s].min() > 0.9


def moving_steadily(moved, late_s):
    """Rows of a joint at constant speed, whose samples are stamped late."""
    calibration, chain, transmission = moved.watched_arm
    nothing = dict.fromkeys(("coulomb_nm", "viscous_nm_s_rad", "root_nm", "load_friction"), np.zeros(chain.n))
    calibration = replace(calibration, body=replace(calibration.body, torque_delay_s=0.0, **nothing))
    time_s = 0.01 * np.arange(len(late_s))
    velocity = np.zeros((len(late_s), chain.n))
    velocity[:, 0] = SPEED_RAD_S
    position = moved.position[0] + velocity * time_s[:, None]
    torque = calibration.body.torque(calibration.level(chain), position, velocity, np.zeros_like(position))
    from_effort = estimator_constants(calibration, chain, transmission).from_effort
    effort = torque @ np.linalg.inv(from_effort)
    return joined(RowMaker(calibration, chain, from_effort).take(time_s + late_s, position, effort))


def test_a_joint_is_uncertain_by_what_scattered_stamps_do_to_its_acceleration(moved):
    late_s = np.random.default_rng(1).normal(0.0, 1e-3, 2000)
    rows = moving_steadily(moved, late_s)
    off, doubt = np.abs(rows.residual_nm[:, 0]), rows.doubt_nm[:, 0]
    assert np.sqrt(np.mean(off**2)) > 0.5
    assert (off < doubt).mean() > 0.95
    assert np.sqrt(np.mean(doubt**2)) == pytest.approx(STAMP_SIGMAS * np.sqrt(np.mean(off**2)), rel=0.15)
    assert moving_steadily(moved, np.zeros(400)).doubt_nm[:, 0].max() < 1e-6


def test_rows_are_the_same_however_samples_come_and_known_with_the_same_sample(moved):
    calibration, chain, transmission = moved.watched_arm
    from_effort = estimator_constants(calibration, chain, transmission).from_effort
    motion = moved.until(2.0, moved.loaded)
    whole = RowMaker(calibration, chain, from_effort).take(*motion)
    made, single = RowMaker(calibration, chain, from_effort), []
    for k in range(motion[0].size):
        rows = made.take(*(values[k : k + 1] for values in motion))
        assert all(row.number == k for row in rows)
        single += rows
    assert [row.number for row in single] == [row.number for row in whole]
    payload = np.random.default_rng(1).normal(size=10)
    for one, other in zip(single, whole, strict=True):
        for value, expected in zip(one.about(payload), other.about(payload), strict=True):
            np.testing.assert_allclose(value, expected, rtol=1e-9, atol=1e-9)


def test_recent_rows_are_those_that_were_added_and_not_left_out():
    recent, kept = RecentRows(2), []
    for k in range(100):
        row = ForceRows(
            np.array([float(k)]), *[np.full((1, 2), float(k))] * 2, np.full((1, 2, 16), k), *[np.full((1, 2), k)] * 4
        )
        recent.rows = recent.rows.since(k - 7.0)
        recent.add(row)
        kept = [*kept, k][-8:]
        assert recent.rows.time_s.tolist() == kept
        assert recent.rows.columns[:, 1, 3].tolist() == kept
