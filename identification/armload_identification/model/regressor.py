"""Torque of a rigid body on an arm, and its regressor: numba kernels and their array front.

    tau_payload = J(q)^T w = Phi_L(q, dq, ddq) theta_L                     Chen 2016, eqs. (2), (5)

theta = [m, m cx, m cy, m cz, Ixx, Iyy, Izz, Ixy, Ixz, Iyz], inertia as TENSOR elements (Ixy = -int xy dm)
about the ORIGIN of the body's frame: the flange for a payload, the joint frame for a link.

The kernels keep the rules of `kernels`; the arrays that go into them are checked here.
"""

from __future__ import annotations

import math

import numba
import numpy as np
from numpy.typing import ArrayLike

from armload_core.arrays import FloatArray
from armload_identification.identification_errors import ModelError
from armload_identification.model.chain import Chain
from armload_identification.model.kernels import FRAME_NUMBERS, forward_into, rows_into

PARAMETERS = 10
"""Length of theta."""

FEEDFORWARD_ROWS = 3
"""Rows of the work array of `payload_torque_into`: the torque, and two of its own."""


@numba.njit(
    "void(float64[::1], int64, int64, float64[:, ::1], float64[:, ::1], float64[:, ::1], float64[:, :, ::1])",
    cache=True,
    fastmath={"contract"},
    nogil=True,
)
def _regressor_batch(packed, n, joints, q, dq, ddq, out):  # type: ignore[no-untyped-def]
    """Regressor of the flange (joints == 0) or of link `joints`, per sample into zeroed out (N, n, 10)."""
    frames = np.empty((n, FRAME_NUMBERS))
    for t in range(q.shape[0]):
        if joints == 0:
            forward_into(packed, n, q[t], dq[t], ddq[t], frames)
            rows_into(frames, n, packed, 3 + 21 * n, 12 + 21 * n, out[t], 0)
        else:
            forward_into(packed, joints, q[t], dq[t], ddq[t], frames)
            rows_into(frames, joints, packed, 3 + 12 * n + 9 * (joints - 1), -1, out[t], 0)


@numba.njit(
    "void(float64[::1], int64, float64[:, ::1], float64[:, ::1], float64[:, ::1], float64[:, :, ::1])",
    cache=True,
    fastmath={"contract"},
    nogil=True,
)
def _body_batch(packed, n, q, dq, ddq, out):  # type: ignore[no-untyped-def]
    """Regressors of all links side by side, per sample into zeroed out (N, n, 10 n)."""
    frames = np.empty((n, FRAME_NUMBERS))
    for t in range(q.shape[0]):
        forward_into(packed, n, q[t], dq[t], ddq[t], frames)
        for i in range(n):
            rows_into(frames, i + 1, packed, 3 + 12 * n + 9 * i, -1, out[t], 10 * i)


@numba.njit(
    "void(float64[::1], float64[::1], float64[::1], float64[::1], float64[:, ::1])",
    cache=True,
    fastmath={"contract"},
)
def payload_torque_into(model, q, dq, ddq, work):  # type: ignore[no-untyped-def]  # noqa: PLR0915
    """Payload torque of one sample, without any allocation: the feed-forward's kernel.

    Args:
        model: What `feedforward_model` made of chain and payload.
        q: (n,) joint positions in rad.
        dq: (n,) velocities in rad/s.
        ddq: (n,) accelerations in rad/s2.
        work: (FEEDFORWARD_ROWS, n), C-contiguous. The torque in N m is in row 0 afterwards; the others are the
            kernel's own.

    Raises:
        ValueError: a state that is not of n joints.
    """
    n = work.shape[1]
    if q.shape[0] != n or dq.shape[0] != n or ddq.shape[0] != n:
        raise ValueError("position, velocity and acceleration must have one number per joint of the chain")
    torque, cosine, sine = work[0], work[1], work[2]
    wx, wy, wz, ex, ey, ez = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    ax, ay, az = model[0], model[1], model[2]
    # outwards in each frame's own coordinates; the step n goes to the flange, which does not turn
    for i in range(n + 1):
        k = 3 + 12 * i if i < n else 3 + 21 * n
        x, y, z = model[k + 9], model[k + 10], model[k + 11]
        vx, vy, vz = wy * z - wz * y, wz * x - wx * z, wx * y - wy * x
        bx = ax + ey * z - ez * y + wy * vz - wz * vy
        by = ay + ez * x - ex * z + wz * vx - wx * vz
        bz = az + ex * y - ey * x + wx * vy - wy * vx
        r00, r01, r02 = model[k], model[k + 1], model[k + 2]
        r10, r11, r12 = model[k + 3], model[k + 4], model[k + 5]
        r20, r21, r22 = model[k + 6], model[k + 7], model[k + 8]
        ax, ay, az = (
            r00 * bx + r10 * by + r20 * bz,
            r01 * bx + r11 * by + r21 * bz,
            r02 * bx + r12 * by + r22 * bz,
        )
        wx, wy, wz = (
            r00 * wx + r10 * wy + r20 * wz,
            r01 * wx + r11 * wy + r21 * wz,
            r02 * wx + r12 * wy + r22 * wz,
        )
        ex, ey, ez = (
            r00 * ex + r10 * ey + r20 * ez,
            r01 * ex + r11 * ey + r21 * ez,
            r02 * ex + r12 * ey + r22 * ez,
        )
        if i < n:
            c, s = math.cos(q[i]), math.sin(q[i])
            cosine[i], sine[i] = c, s
            ax, ay = c * ax + s * ay, c * ay - s * ax
            wx, wy = c * wx + s * wy, c * wy - s * wx
            ex, ey = c * ex + s * ey, c * ey - s * ex
            ex += wy * dq[i]
            ey -= wx * dq[i]
            ez += ddq[i]
            wz += dq[i]
    # force and moment of the payload about the flange's origin
    k = 15 + 21 * n
    m, sx, sy, sz = model[k], model[k + 1], model[k + 2], model[k + 3]
    ixx, iyy, izz, ixy, ixz, iyz = (
        model[k + 4],
        model[k + 5],
        model[k + 6],
        model[k + 7],
        model[k + 8],
        model[k + 9],
    )
    vx, vy, vz = wy * sz - wz * sy, wz * sx - wx * sz, wx * sy - wy * sx
    fx = m * ax + ey * sz - ez * sy + wy * vz - wz * vy
    fy = m * ay + ez * sx - ex * sz + wz * vx - wx * vz
    fz = m * az + ex * sy - ey * sx + wx * vy - wy * vx
    hx, hy, hz = (
        ixx * wx + ixy * wy + ixz * wz,
        ixy * wx + iyy * wy + iyz * wz,
        ixz * wx + iyz * wy + izz * wz,
    )
    nx = ixx * ex + ixy * ey + ixz * ez + wy * hz - wz * hy + sy * az - sz * ay
    ny = ixy * ex + iyy * ey + iyz * ez + wz * hx - wx * hz + sz * ax - sx * az
    nz = ixz * ex + iyz * ey + izz * ez + wx * hy - wy * hx + sx * ay - sy * ax
    # inwards: the wrench about each joint's origin, in that joint's coordinates
    k = 3 + 21 * n
    for i in range(n - 1, -1, -1):
        bx = model[k] * fx + model[k + 1] * fy + model[k + 2] * fz
        by = model[k + 3] * fx + model[k + 4] * fy + model[k + 5] * fz
        bz = model[k + 6] * fx + model[k + 7] * fy + model[k + 8] * fz
        x, y, z = model[k + 9], model[k + 10], model[k + 11]
        vx = model[k] * nx + model[k + 1] * ny + model[k + 2] * nz + y * bz - z * by
        vy = model[k + 3] * nx + model[k + 4] * ny + model[k + 5] * nz + z * bx - x * bz
        nz = model[k + 6] * nx + model[k + 7] * ny + model[k + 8] * nz + x * by - y * bx
        torque[i] = nz
        c, s = cosine[i], sine[i]
        fx, fy, fz = c * bx - s * by, s * bx + c * by, bz
        nx, ny = c * vx - s * vy, s * vx + c * vy
        k = 3 + 12 * i


@numba.njit(
    "void(float64[::1], float64[:, ::1], float64[:, ::1], float64[:, ::1], float64[:, ::1])",
    cache=True,
    fastmath={"contract"},
    nogil=True,
)
def _torque_batch(model, q, dq, ddq, out):  # type: ignore[no-untyped-def]
    """Payload torque per sample into out (N, n)."""
    work = np.empty((FEEDFORWARD_ROWS, q.shape[1]))
    for t in range(q.shape[0]):
        payload_torque_into(model, q[t], dq[t], ddq[t], work)
        out[t] = work[0]


def feedforward_model(chain: Chain, theta: ArrayLike) -> FloatArray:
    """Chain and payload as the one array that `payload_torque_into` reads.

    Args:
        chain: The arm.
        theta: (10,) payload parameters in the flange frame.

    Returns:
        Packed array; its last ten numbers are theta.

    Raises:
        ModelError: theta is not ten finite numbers.
    """
    parameters = np.asarray(theta, dtype=np.float64)
    if parameters.shape != (PARAMETERS,) or not np.all(np.isfinite(parameters)):
        raise ModelError(f"theta is {parameters.tolist()}; expected ten finite numbers")
    return np.concatenate([chain.packed, parameters])


def payload_torque(chain: Chain, theta: ArrayLike, q: ArrayLike, dq: ArrayLike, ddq: ArrayLike) -> FloatArray:
    """Joint torque that a payload asks for.

        tau = J(q)^T w(q, dq, ddq, theta)

    Args:
        chain: The arm.
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
    _torque_batch(model, *states, out)
    return out[0] if single else out


def payload_regressor(chain: Chain, q: ArrayLike, dq: ArrayLike, ddq: ArrayLike) -> FloatArray:
    """Phi_L with tau_payload = Phi_L theta_L, for a body in the flange frame.

    Args:
        chain: The arm.
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
    return _regressor(chain, 0, q, dq, ddq)


def link_regressor(chain: Chain, link: int, q: ArrayLike, dq: ArrayLike, ddq: ArrayLike) -> FloatArray:
    """Regressor of one link's ten parameters in its own joint frame.

    Args:
        chain: The arm.
        link: 1 to n; link i turns with joint i. Rows of joints beyond it are zero.
        q: (N, n) or (n,) joint positions in rad.
        dq: Velocities in rad/s, same shape.
        ddq: Accelerations in rad/s2, same shape.

    Returns:
        (N, n, 10), or (n, 10) for a single sample.

    Raises:
        ModelError: a shape that does not fit, or no such link.
    """
    if not 1 <= link <= chain.n:
        raise ModelError(f"link {link} asked of a chain of {chain.n}; expected 1 to {chain.n}")
    return _regressor(chain, link, q, dq, ddq)


def body_regressor(chain: Chain, q: ArrayLike, dq: ArrayLike, ddq: ArrayLike) -> FloatArray:
    """Regressor of all links' parameters: tau_links = body_regressor [theta_1; ...; theta_n].

    Args:
        chain: The arm.
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
    _body_batch(chain.packed, chain.n, *states, out)
    return out[0] if single else out


def _regressor(chain: Chain, joints: int, q: ArrayLike, dq: ArrayLike, ddq: ArrayLike) -> FloatArray:
    """Regressor of a link, or of the flange for joints == 0."""
    states, single = _states(chain, q, dq, ddq)
    shape = (states[0].shape[0], chain.n, PARAMETERS)
    out = np.empty(shape) if joints in (0, chain.n) else np.zeros(shape)
    _regressor_batch(chain.packed, chain.n, joints, *states, out)
    return out[0] if single else out


def _states(chain: Chain, *arrays: ArrayLike) -> tuple[list[FloatArray], bool]:
    """q, dq, ddq as C-contiguous (N, n), and whether they came as a single sample."""
    states = [np.ascontiguousarray(a, dtype=np.float64) for a in arrays]
    shape = states[0].shape
    for name, state in zip(("q", "dq", "ddq"), states, strict=True):
        if state.ndim not in (1, 2) or state.shape[-1] != chain.n or state.shape != shape:
            raise ModelError(
                f"{name} has the shape {state.shape}, q has {shape}; expected one shape (N, {chain.n}) or ({chain.n},)"
            )
    return [s.reshape(-1, chain.n) for s in states], len(shape) == 1
