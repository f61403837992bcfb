"""Gears that give way: errors of a fit by links and payloads that lag behind the encoders of their motors.

Behind an elastic gear a joint is at q - c tau: q is its motor's position, tau the torque of links and payload, c its
compliance. All that is beyond turns with it: where 6 kg make shoulder and elbow sag by 10 mrad, the torque of the wrist
changes as by a gain of 3 %, their own by 0.5 %. To first order, beside all other unknowns,

    y = ... + sum_k c_k [tau(q - tau_k e_k) - tau(q)]

with the acceleration of the lag in it. What rows and prior say of c is allowed for and not corrected. Of what they
say, an arm shows all where it carries as much as in these runs and nothing where it carries nothing: a third of the
square on average.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from armload_identification.estimation.arm_rows import ArmRows
from armload_identification.estimation.arm_terms import effort_level
from armload_identification.estimation.carried_torque import carried_torque, first_run_torque
from armload_identification.estimation.estimation_constants import Elasticity
from armload_identification.estimation.posterior import Posterior
from armload_identification.float_array import FloatArray
from armload_identification.model.body_model import BodyModel
from armload_identification.model.chain import Chain

_STEP: Final = 1e-6
"""rad/(N m) of the finite difference."""


def elastic_torque(found: Posterior, chain: Chain, body: BodyModel) -> list[FloatArray]:
    """(n, N, n) axis torque of one standard deviation of n independent errors, on the first run of every group.

    Args:
        found: The solution for rigid joints.
        body: The arm's links.
    """
    torque_nm = first_run_torque(found, body, lambda rows, theta: _lag_torque(rows, chain, body, theta))
    gradient, information = found.beside(*torque_nm)
    level_nm = effort_level([group.runs[0].rows for group in found.problem.groups])
    covariance = np.linalg.inv(information + np.diag((level_nm / Elasticity.lag_rad) ** 2))
    compliance = covariance @ gradient
    root = np.linalg.cholesky(covariance + np.outer(compliance, compliance) / 3.0)
    return [np.tensordot(root.T, torque, axes=1) for torque in torque_nm]


def _lag_torque(rows: ArmRows, chain: Chain, body: BodyModel, theta: FloatArray) -> FloatArray:
    """(n, N, n) change of a run's joint torque per rad/(N m) of each joint's compliance."""

    def rate(values: FloatArray) -> FloatArray:
        return np.gradient(values, rows.time_s, axis=0) if len(values) > 1 else np.zeros_like(values)

    states = rows.position_rad, rows.velocity_rad_s, rows.axis_acceleration_rad_s2 @ body.coupling.T
    carried_nm = carried_torque(chain, body, theta, *states)
    lag = -_STEP * carried_nm
    lags = lag, rate(lag), rate(rate(lag))
    moved = [[state + joint * change for state, change in zip(states, lags, strict=True)] for joint in np.eye(chain.n)]
    return np.stack([(carried_torque(chain, body, theta, *each) - carried_nm) / _STEP for each in moved])
