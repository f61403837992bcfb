"""Torque of a rigid body on an arm, and the regressors of links and rotors: the array interface of the kernels.

    tau_payload = J(q)^T w = Phi_L(q, dq, ddq) theta_L                     Chen 2016, eqs. (2), (5)

theta = [m, m cx, m cy, m cz, Ixx, Iyy, Izz, Ixy, Ixz, Iyz], inertia as TENSOR elements (Ixy = -int xy dm)
about the ORIGIN of the body's frame: the flange for a payload, the joint frame for a link.

Arrays are converted and checked here before they are passed to the kernels.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from armload_core import kernels
from armload_identification.float_array import FloatArray
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
    return _of_states(kernels.payload_torque_into, feedforward_model(chain, theta), (chain.n,), q, dq, ddq)


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
    return _of_states(kernels.payload_regressor_into, chain.packed, (chain.n, PARAMETERS), q, dq, ddq)


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
    return _of_states(kernels.body_regressor_into, chain.packed, (chain.n, PARAMETERS * chain.n), q, dq, ddq)


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


def _of_states(
    kernel: Callable[..., None], packed: FloatArray, of_one: tuple[int, ...], *states: ArrayLike
) -> FloatArray:
    """(N, *of_one) that a kernel makes of q, dq, ddq, where `of_one` begins with n; of a single sample without N."""
    arrays, n = [np.ascontiguousarray(state, dtype=np.float64) for state in states], of_one[0]
    shape = arrays[0].shape
    for name, array in zip(("q", "dq", "ddq"), arrays, strict=True):
        if array.ndim not in (1, 2) or array.shape[-1] != n or array.shape != shape:
            raise ModelError(f"{name} has shape {array.shape}, q has {shape}; expected one shape (N, {n}) or ({n},)")
    rows = [array.reshape(-1, n) for array in arrays]
    out = np.zeros((len(rows[0]), *of_one))
    kernel(packed, *rows, out)
    return out[0] if len(shape) == 1 else out
