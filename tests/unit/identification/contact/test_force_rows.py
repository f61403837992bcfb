"""Rows of a calibrated arm: torque is seen with the delay and width with which acceleration is."""

from dataclasses import replace

import numpy as np

from armload_identification.contact.force_rows import RowMaker
from armload_identification.pipeline.estimator_constants import estimator_constants

STEP_S, SPEED_RAD_S = 0.01, 0.5


def test_an_abrupt_stop_leaves_no_residual(moved):
    calibration, chain, transmission = moved.watched_arm
    nothing = np.zeros(chain.n)
    body = replace(
        calibration.body, coulomb_nm=nothing, viscous_nm_s_rad=nothing, root_nm=nothing, load_friction=nothing,
        torque_delay_s=0.0,
    )  # fmt: skip
    calibration = replace(calibration, body=body)
    # a joint stops within two samples
    speed = np.where(np.arange(100) < 50, SPEED_RAD_S, 0.0)
    speed[50] = 0.5 * SPEED_RAD_S
    position = np.tile(moved.position[0], (100, 1))
    position[:, 0] += np.cumsum(speed) * STEP_S
    velocity, acceleration = np.zeros_like(position), np.zeros_like(position)
    velocity[:, 0], acceleration[:-1, 0] = speed, np.diff(speed) / STEP_S
    torque = body.torque(calibration.level(chain), position, velocity, acceleration)
    from_effort = estimator_constants(calibration, chain, transmission).from_effort
    rows = RowMaker(calibration, chain, from_effort).take(
        STEP_S * np.arange(100), position, torque @ np.linalg.inv(from_effort), np.zeros(10)
    )
    inertial = np.ptp(torque[:, 0])
    assert inertial > 1.0
    assert np.abs(rows.residual_nm[:, 0]).max() < 0.03 * inertial
