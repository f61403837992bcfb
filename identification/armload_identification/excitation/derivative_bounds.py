"""Bounds of the time derivatives of an arm's motion, for any motion of the joints within given rates.

A quantity is bounded by a row of numbers: its magnitude, and the magnitude of each of its time derivatives,

    |f| <= F_0,  |f'| <= F_1,  |f''| <= F_2, ...

Bounds of a sum add up; each product (of numbers, dot, cross) obeys |a b| <= |a| |b| and Leibniz's rule,

    |(f g)^(m)| <= sum_j  binomial(m, j) F_j G_{m-j},

and a vector that is fixed in a link turning with w has v' = w x v, so that

    V_{m+1} <= sum_j  binomial(m, j) W_j V_{m-j}.

Applied to the Newton-Euler equations in base coordinates, these three rules give the bounds below. They hold for every
configuration, and are therefore guaranteed, but far above the actual values.
"""

from __future__ import annotations

from math import comb

import numpy as np

from armload_identification.excitation.fourier import FourierTrajectory
from armload_identification.float_array import FloatArray
from armload_identification.model.chain import Chain
from armload_identification.model.dynamics import ArmDynamics
from armload_identification.model.payload import symmetric_tensor

_ORDERS = 5


def rate_bounds(trajectory: FourierTrajectory) -> FloatArray:
    """Bounds of the joints' first to fourth derivatives along a trajectory.

    The fourth is the third times the highest angular frequency: the derivative of a trigonometric polynomial of
    degree H is at most H w_f times the polynomial's maximum (Bernstein's inequality).

    Returns:
        (4, n) in rad/s, rad/s2, rad/s3, rad/s4.
    """
    reach = trajectory.bounds()
    highest = 2.0 * np.pi * trajectory.base_frequency_hz * trajectory.harmonics
    jerk = reach.jerk_max_rad_s3
    return np.array([reach.velocity_max_rad_s, reach.acceleration_max_rad_s2, jerk, highest * jerk])


def point_rates(chain: Chain, rates: FloatArray, link: int, lever_m: float) -> FloatArray:
    """Greatest speed of a point that is fixed in a link, and of its first three derivatives.

    Args:
        rates: (4, n) from `rate_bounds`.
        link: Number of the joint that moves the link, from 1; 0 is the base.
        lever_m: Distance of the point from the joint frame's origin.

    Returns:
        (4,) in m/s, m/s2, m/s3, m/s4.
    """
    angular = _angular_velocities(chain, rates)
    total = _fixed_vector(lever_m, angular[link])
    for j in range(link):
        total = total + _fixed_vector(_joint_distance(chain, j), angular[j])
    return np.asarray(total[1:])


def torque_curvature(dynamics: ArmDynamics, rates: FloatArray) -> FloatArray:
    """Bound of the second time derivative of the joints' torques.

    Args:
        dynamics: The arm with its payload.
        rates: (4, n) from `rate_bounds`.

    Returns:
        (n,) in N m/s2.
    """
    chain, body = dynamics.chain, dynamics.body
    n = chain.n
    angular = _angular_velocities(chain, rates)
    offset = [_fixed_vector(_joint_distance(chain, k), angular[k]) for k in range(n)]
    acceleration = np.zeros(3)
    acceleration[0] = np.sqrt(np.sum(chain.gravity_m_s2**2))
    moment = np.zeros((n, 3))
    for k in range(n):
        theta = body.links[k]
        turning = angular[k + 1]
        acceleration = acceleration + offset[k][2:]
        first = _fixed_vector(float(np.sqrt(np.sum(theta[1:4] ** 2))), turning)
        force = abs(theta[0]) * acceleration + first[2:]
        # angular momentum I w = sum_i lambda_i u_i (u_i . w) over the principal axes u_i, fixed in the link
        axis = _fixed_vector(1.0, turning)[:4]
        moments = np.linalg.eigvalsh(symmetric_tensor(theta[4:]))  # principal ones, about the frame's origin
        momentum = np.abs(moments).sum() * _leibniz_product(_leibniz_product(axis, axis), turning)
        about_origin = _leibniz_product(first[:3], acceleration) + momentum[1:]
        arm = np.zeros(3)
        for i in range(k, -1, -1):
            moment[i] += about_origin + _leibniz_product(arm, force)
            arm = arm + offset[i][:3]
    torque = np.array([_leibniz_product(_fixed_vector(1.0, angular[i])[:3], moment[i])[2] for i in range(n)])
    return np.asarray(torque + np.abs(body.rotor_mass_kg_m2) @ rates[3])


def _angular_velocities(chain: Chain, rates: FloatArray) -> list[FloatArray]:
    """Angular velocity of the base and of every link, with three derivatives: w_k = w_{k-1} + z_k dq_k."""
    angular = [np.zeros(4)]
    for i in range(chain.n):
        axis = _fixed_vector(1.0, angular[-1])[:4]  # z_k is fixed in link k - 1 too
        angular.append(angular[-1] + _leibniz_product(axis, rates[:, i]))
    return angular


def _fixed_vector(length: float, angular: FloatArray) -> FloatArray:
    """A vector fixed in a link, with four derivatives."""
    row = np.zeros(_ORDERS)
    row[0] = length
    for m in range(_ORDERS - 1):
        row[m + 1] = sum(comb(m, j) * angular[j] * row[m - j] for j in range(m + 1))
    return row


def _leibniz_product(a: FloatArray, b: FloatArray) -> FloatArray:
    """Leibniz's rule."""
    return np.array([sum(comb(m, j) * a[j] * b[m - j] for j in range(m + 1)) for m in range(len(a))])


def _joint_distance(chain: Chain, joint: int) -> float:
    """Distance of a joint's origin from the previous one's."""
    return float(np.sqrt(np.sum(chain.placement[joint, :3, 3] ** 2)))
