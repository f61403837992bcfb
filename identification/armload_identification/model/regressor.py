"""Torque of a rigid body on an arm, and the regressors of links and rotors: the array interface of the kernels.

    tau_payload = J(q)^T w = Phi_L(q, dq, ddq) theta_L                     Chen 2016, eqs. (2), (5)

theta = [m, m cx, m cy, m cz, Ixx, Iyy, Izz, Ixy, Ixz, Iyz], inertia as TENSOR elements (Ixy = -int xy dm)
about the ORIGIN of the body's frame: the flange for a payload, the joint frame for a link.

Arrays are converted and checked here before they are passed to the kernels.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from armload_core import kernels
from armload_core.arrays import FloatArray
from armload_identification.identification_errors import ModelError
from armload_identification.model.chain import Chain
from armload_identification.model.finite_array import finite_array

PARAMETERS = kernels.BODY_PARAMETERS
"""Length of theta."""


def feedforward_model(chain: Chain, theta: ArrayLike) -> FloatArray:
    """Chain and payload as one array for the feed-forward's kernel.

    Args:
        theta: (10,) payload parameters in the flange frame.

    Returns:
        Packed array; its last ten numbers are theta.

    Raises:
        ModelError: theta is not ten finite numbers.
    """
    return np.concatenate([chain.packed, finite_array("theta", theta, (PARAMETERS,))])


def payload_torque(chain: Chain, theta: ArrayLike, q: ArrayLike, dq: ArrayLike, ddq: ArrayLike) -> FloatArray:
    """Joint torque that a payload requires.

        tau = J(q)^T w(q, dq, ddq, theta)

    Args:
        theta: (10,) payload parameters in the flange frame.
        q: (N, n) or (n,) joint positions in rad.
        dq: Velocities in rad/s, same shape.
        ddq: Accelerations in rad/s2, same shape.

    Returns:
        Torques in N m, same shape.

    Raises:
        ModelError: a shape that does not fit.

    References:
        Chen 2016, eqs. (2), (5).
    """
    model = feedforward_model(chain, theta)
    states, single = _states(chain, q, dq, ddq)
    out = np.empty_like(states[0])
    kernels.payload_torque_into(model, *states, out)
    return out[0] if single else out


def payload_regressor(chain: Chain, q: ArrayLike, dq: ArrayLike, ddq: ArrayLike) -> FloatArray:
    """Phi_L with tau_payload = Phi_L theta_L, for a body in the flange frame.

    Args:
        q: (N, n) or (n,) joint positions in rad.
        dq: Velocities in rad/s, same shape.
        ddq: Accelerations in rad/s2, same shape.

    Returns:
        (N, n, 10), or (n, 10) for a single sample, in N m per unit of theta.

    Raises:
        ModelError: a shape that does not fit.

    References:
        Chen 2016, eqs. (4), (5).
    """
    states, single = _states(chain, q, dq, ddq)
    out = np.empty((states[0].shape[0], chain.n, PARAMETERS))
    kernels.payload_regressor_into(chain.packed, *states, out)
    return out[0] if single else out


def body_regressor(chain: Chain, q: ArrayLike, dq: ArrayLike, ddq: ArrayLike) -> FloatArray:
    """Regressor of all links' parameters: tau_links = body_regressor [theta_1; ...; theta_n].

    Args:
        q: (N, n) or (n,) joint positions in rad.
        dq: Velocities in rad/s, same shape.
        ddq: Accelerations in rad/s2, same shape.

    Returns:
        (N, n, 10 n), or (n, 10 n) for a single sample; columns 10 (i - 1) to 10 i belong to link i,
        in joint frame i.

    Raises:
        ModelError: a shape that does not fit.

    References:
        Chen 2016, eq. (1), the part without friction.
    """
    states, single = _states(chain, q, dq, ddq)
    out = np.zeros((states[0].shape[0], chain.n, PARAMETERS * chain.n))
    kernels.body_regressor_into(chain.packed, *states, out)
    return out[0] if single else out


def rotor_columns(ddq: FloatArray, coupling: FloatArray) -> FloatArray:
    """Joint torque per unit inertia of each axis's rotor: C^-T e_i (C^-1 ddq)_i.

    Args:
        ddq: (N, n) joint accelerations in rad/s2.
        coupling: (n, n) C.

    Returns:
        (N, n, n) [sample, axis, joint] in N m per kg m2.
    """
    to_axis = np.linalg.inv(coupling)
    return np.asarray((ddq @ to_axis.T)[:, :, None] * to_axis[None, :, :])


def _states(
    chain: Chain, q: ArrayLike, dq: ArrayLike, ddq: ArrayLike
) -> tuple[tuple[FloatArray, FloatArray, FloatArray], bool]:
    """q, dq, ddq as C-contiguous (N, n), and whether they were a single sample."""
    position, velocity, acceleration = (np.ascontiguousarray(a, dtype=np.float64) for a in (q, dq, ddq))
    shape = position.shape
    for name, state in (("q", position), ("dq", velocity), ("ddq", acceleration)):
        if state.ndim not in (1, 2) or state.shape[-1] != chain.n or state.shape != shape:
            raise ModelError(
                f"{name} has shape {state.shape}, q has {shape}; expected one shape (N, {chain.n}) or ({chain.n},)"
            )
    rows = (-1, chain.n)
    return (position.reshape(rows), velocity.reshape(rows), acceleration.reshape(rows)), len(shape) == 1
