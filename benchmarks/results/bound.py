"""The Cramer-Rao bound for the difference of two runs.

    cov(theta) >= [ M sum_t Phi_t^T S^-1 Phi_t ]^-1,     S = diag(noise_loaded^2 + noise_unloaded^2)

over the K samples of one period, M periods, white noise on every raw sample. Phi also contains the estimator's nuisance
columns: the bound is that of the given trajectory and estimator. The unloaded run leaves the arm's own torque free at
every phase; a test checks that this costs no more than the square root of two.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from armload_drivers.simulation.mujoco_plant import NOISE_CYCLE_S
from armload_identification.float_array import FloatArray
from armload_identification.model.payload import InertialParameters, derived
from armload_identification.model.regressor import payload_regressor
from armload_identification.pipeline.identification_result import Identification
from benchmarks.arms.trials import Setup, identified

_PRODUCTS: Final = (7, 8, 9)


def cramer_rao(regressor: FloatArray, noise_nm: FloatArray, periods: int) -> FloatArray:
    """Least covariance of an unbiased estimate.

    Args:
        regressor: (K, n, p) of one period.
        noise_nm: (n,) standard deviation of one raw sample of the difference.
        periods: M of each run.

    Returns:
        (p, p) covariance.
    """
    rows = (regressor / noise_nm[:, None]).reshape(-1, regressor.shape[2])
    scale = np.sqrt(np.sum(rows**2, axis=0))
    inverse = np.linalg.inv(np.linalg.qr(rows / scale, mode="r"))
    return np.asarray(inverse @ inverse.T / np.outer(scale, scale) / periods)


def bound_of(setup: Setup) -> FloatArray:
    """(10, 10) bound of a setup's theta, for its motion, its noise and the estimator's own nuisance columns."""
    result = identified(setup.without_noise(), 0)
    axis_noise = setup.scales.noise_nm * np.sqrt(NOISE_CYCLE_S / setup.loaded.sample_s)
    # Coupled motors correlate the noise of joints; this correlation of 2 % is not used.
    to_joint = np.linalg.inv(setup.scales.coupling).T
    noise = np.sqrt(2.0 * (to_joint**2 @ axis_noise**2))
    return cramer_rao(_columns(setup, result), noise, result.signal.loaded.periods)[:10, :10]


def _columns(setup: Setup, result: Identification) -> FloatArray:
    """(K, n, p) columns of a payload and of the load-dependent friction of each joint that moves."""
    signal, body = result.signal, result.plain.body(0)
    phi = payload_regressor(setup.chain, *signal.loaded.states)
    empty_nm = body.link_torque(setup.chain, *signal.loaded.states)
    per_unit = replace(body, load_friction=np.ones(setup.chain.n))
    of_load = per_unit.added_friction(empty_nm, phi @ result.plain.theta, signal.loaded.states.velocity_rad_s)
    moving = np.flatnonzero(signal.loaded.moves)
    return np.concatenate([phi, of_load[:, :, None] * np.eye(setup.chain.n)[:, moving]], axis=2)


def paper_values(body: InertialParameters) -> FloatArray:
    """(10,) mass, centre of mass, inertia about the frame's ORIGIN with the paper's sign of the products."""
    values = np.concatenate([[body.mass_kg], body.center_of_mass_m, body.theta[4:]])
    values[list(_PRODUCTS)] *= -1.0
    return values


def paper_slope(body: InertialParameters) -> FloatArray:
    """(10, 10) derivative of `paper_values` by theta."""
    _, about_com = derived(body)
    slope = np.eye(10)
    slope[:4] = about_com[:4]
    slope[list(_PRODUCTS)] *= -1.0
    return slope


def paper_deviation(body: InertialParameters, covariance: FloatArray) -> FloatArray:
    """(10,) standard deviations of `paper_values` from a covariance of theta."""
    slope = paper_slope(body)
    return np.asarray(np.sqrt(np.einsum("ki,ij,kj->k", slope, covariance, slope)))
