"""Torque of the whole arm, with what hangs on its flange, and its derivative along a motion.

    tau = M(q) ddq + C(q, dq) dq + g(q), rotors included                    Chen 2016, eq. (1) without friction

One pass outwards through the frames, one inwards through the joints, about 0.4 us a sample; the kernels keep the
rules of `kernels`.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numba
import numpy as np

from armload_core.arrays import FloatArray
from armload_identification.identification_errors import ModelError
from armload_identification.model.chain import Chain
from armload_identification.model.kernels import FRAME_NUMBERS, forward_into
from armload_identification.model.payload import InertialParameters


@numba.njit(
    "void(float64[::1], float64[:, ::1], float64[::1], float64[::1], float64[::1], float64[:, ::1], float64[::1])",
    cache=True,
    fastmath={"contract"},
)
def _torque_into(packed, bodies, q, dq, ddq, frames, torque):  # type: ignore[no-untyped-def]
    """Joint torque of one sample; bodies (n, 10) in the turned joint frames, frames is work space."""
    n = q.shape[0]
    forward_into(packed, n, q, dq, ddq, frames)
    fx, fy, fz, nx, ny, nz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for k in range(n):
        i = n - 1 - k
        f, b = frames[i], bodies[i]
        m, x, y, z = b[0], b[1], b[2], b[3]
        # first moment in base coordinates, and the force
        sx = f[0] * x + f[1] * y + f[2] * z
        sy = f[3] * x + f[4] * y + f[5] * z
        sz = f[6] * x + f[7] * y + f[8] * z
        wx, wy, wz, ex, ey, ez = f[12], f[13], f[14], f[15], f[16], f[17]
        ax, ay, az = f[18], f[19], f[20]
        vx, vy, vz = wy * sz - wz * sy, wz * sx - wx * sz, wx * sy - wy * sx
        gx = m * ax + ey * sz - ez * sy + wy * vz - wz * vy
        gy = m * ay + ez * sx - ex * sz + wz * vx - wx * vz
        gz = m * az + ex * sy - ey * sx + wx * vy - wy * vx
        # moment of the inertia in body coordinates, n = I dw + w x (I w)
        ux = f[0] * wx + f[3] * wy + f[6] * wz
        uy = f[1] * wx + f[4] * wy + f[7] * wz
        uz = f[2] * wx + f[5] * wy + f[8] * wz
        tx = f[0] * ex + f[3] * ey + f[6] * ez
        ty = f[1] * ex + f[4] * ey + f[7] * ez
        tz = f[2] * ex + f[5] * ey + f[8] * ez
        hx = b[4] * ux + b[7] * uy + b[8] * uz
        hy = b[7] * ux + b[5] * uy + b[9] * uz
        hz = b[8] * ux + b[9] * uy + b[6] * uz
        kx = b[4] * tx + b[7] * ty + b[8] * tz + uy * hz - uz * hy
        ky = b[7] * tx + b[5] * ty + b[9] * tz + uz * hx - ux * hz
        kz = b[8] * tx + b[9] * ty + b[6] * tz + ux * hy - uy * hx
        # summed up about the base's origin
        px, py, pz = f[9], f[10], f[11]
        nx += f[0] * kx + f[1] * ky + f[2] * kz + sy * az - sz * ay + py * gz - pz * gy
        ny += f[3] * kx + f[4] * ky + f[5] * kz + sz * ax - sx * az + pz * gx - px * gz
        nz += f[6] * kx + f[7] * ky + f[8] * kz + sx * ay - sy * ax + px * gy - py * gx
        fx += gx
        fy += gy
        fz += gz
        torque[i] = f[2] * (nx - py * fz + pz * fy) + f[5] * (ny - pz * fx + px * fz) + f[8] * (nz - px * fy + py * fx)


@numba.njit(
    "void(float64[::1], float64[:, ::1], float64[:, ::1], float64[:, ::1], float64[:, ::1], float64[:, ::1])",
    cache=True,
    fastmath={"contract"},
    nogil=True,
)
def _torque_batch(packed, bodies, q, dq, ddq, out):  # type: ignore[no-untyped-def]
    """Joint torque per sample into out (N, n)."""
    frames = np.empty((q.shape[1], FRAME_NUMBERS))
    for t in range(q.shape[0]):
        _torque_into(packed, bodies, q[t], dq[t], ddq[t], frames, out[t])


@numba.njit("float64(float64[::1], float64[::1])", cache=True, fastmath={"contract"})
def _along(weight, torque):  # type: ignore[no-untyped-def]
    """Sum of the products."""
    total = 0.0
    for i in range(weight.shape[0]):
        total += weight[i] * torque[i]
    return total


@numba.njit(
    "void(float64[::1], float64[:, ::1], float64[:, ::1], float64[:, ::1], float64[:, ::1], float64[:, ::1],"
    " float64[:, :, ::1])",
    cache=True,
    fastmath={"contract"},
    nogil=True,
)
def _slope_into(packed, bodies, weight, q, dq, ddq, slope):  # type: ignore[no-untyped-def]
    """Derivative of sum_t weight_t^T tau_t by q, dq, ddq, added to slope (3, N, n); samples of no weight cost nothing.

    The torque is affine in ddq and quadratic in dq, so that differences with a step of one are exact there; in q
    the central difference errs by about 1e-10.
    """
    n = q.shape[1]
    frames = np.empty((n, FRAME_NUMBERS))
    torque = np.empty(n)
    state = np.empty((3, n))
    for t in range(q.shape[0]):
        w = weight[t]
        used = False
        for i in range(n):
            used = used or w[i] != 0.0
        if not used:
            continue
        state[0], state[1], state[2] = q[t], dq[t], ddq[t]
        for order in range(3):
            step = 1e-5 if order == 0 else 1.0
            for j in range(n):
                here = state[order, j]
                state[order, j] = here + step
                _torque_into(packed, bodies, state[0], state[1], state[2], frames, torque)
                after = _along(w, torque)
                state[order, j] = here - step
                _torque_into(packed, bodies, state[0], state[1], state[2], frames, torque)
                slope[order, t, j] += (after - _along(w, torque)) / (2.0 * step)
                state[order, j] = here


@dataclass(frozen=True, eq=False)
class ArmBody:
    """What an arm itself is made of, as far as its torque shows it.

    Attributes:
        links: (n, 10) inertial parameters of each link in its own JOINT frame, in the order of theta.
        rotor_inertia_kg_m2: (n,) inertia of each rotor, reflected to the joint: gear ratio squared times its own.
        viscous_nm_s_rad: (n,) viscous friction.
        coulomb_nm: (n,) Coulomb friction.

    Raises:
        ModelError: shapes that do not fit, a number that is not finite, friction or a rotor below zero.
    """

    links: FloatArray
    rotor_inertia_kg_m2: FloatArray
    viscous_nm_s_rad: FloatArray
    coulomb_nm: FloatArray

    def __post_init__(self) -> None:
        links = np.array(self.links, dtype=np.float64)
        if links.ndim != 2 or links.shape[1] != 10 or not np.all(np.isfinite(links)):
            raise ModelError(f"links are {links.tolist()}; expected ten finite numbers per joint")
        object.__setattr__(self, "links", links)
        for name in ("rotor_inertia_kg_m2", "viscous_nm_s_rad", "coulomb_nm"):
            values = np.array(getattr(self, name), dtype=np.float64)
            if values.shape != links.shape[:1] or not np.all((values >= 0.0) & (values < np.inf)):
                raise ModelError(f"{name} is {values.tolist()}; expected {len(links)} numbers, none below 0")
            object.__setattr__(self, name, values)

    @classmethod
    def massless(cls, n: int) -> ArmBody:
        """An arm of n joints that weighs nothing and has no friction: what is left is the payload's torque."""
        return cls(np.zeros((n, 10)), np.zeros(n), np.zeros(n), np.zeros(n))

    @property
    def n(self) -> int:
        """Number of joints."""
        return int(self.links.shape[0])

    def carrying(self, chain: Chain, payload: InertialParameters) -> ArmBody:
        """The same arm with a body at its flange, which becomes a part of the last link.

        Args:
            chain: The arm's kinematics.
            payload: In the flange frame.
        """
        links = self.links.copy()
        links[-1] += payload.transformed(chain.flange).theta
        return ArmBody(links, self.rotor_inertia_kg_m2, self.viscous_nm_s_rad, self.coulomb_nm)


@dataclass(frozen=True, eq=False)
class ArmDynamics:
    """Torque that links and rotors ask of the motors, without friction.

    Attributes:
        chain: Kinematics and gravity.
        body: Links, rotors and friction.

    Raises:
        ModelError: numbers of joints that differ.
    """

    chain: Chain
    body: ArmBody
    _bodies: FloatArray = field(init=False, repr=False)

    def __post_init__(self) -> None:
        if self.chain.n != self.body.n:
            raise ModelError(f"a body of {self.body.n} links for a chain of {self.chain.n} joints")
        turned = np.empty_like(self.body.links)
        for i, theta in enumerate(self.body.links):
            into_turned = np.eye(4)
            into_turned[:3, :3] = self.chain.turned_back(i)
            turned[i] = InertialParameters(theta).transformed(into_turned).theta
        object.__setattr__(self, "_bodies", turned)

    def torque(self, q: FloatArray, dq: FloatArray, ddq: FloatArray) -> FloatArray:
        """Joint torque of links and rotors.

        Args:
            q: (N, n) positions in rad.
            dq: (N, n) velocities in rad/s.
            ddq: (N, n) accelerations in rad/s2.

        Returns:
            (N, n) torques in N m.
        """
        q, dq, ddq = (np.ascontiguousarray(a) for a in (q, dq, ddq))
        out = np.empty_like(q)
        _torque_batch(self.chain.packed, self._bodies, q, dq, ddq, out)
        return np.asarray(out + self.body.rotor_inertia_kg_m2 * ddq)

    def slope(self, weight: FloatArray, q: FloatArray, dq: FloatArray, ddq: FloatArray) -> FloatArray:
        """Derivative of the weighted sum of all torques by the samples.

        Args:
            weight: (N, n) weight of each torque.
            q: (N, n) positions in rad.
            dq: (N, n) velocities in rad/s.
            ddq: (N, n) accelerations in rad/s2.

        Returns:
            (3, N, n) derivative by q, dq and ddq.
        """
        q, dq, ddq, weight = (np.ascontiguousarray(a) for a in (q, dq, ddq, weight))
        slope = np.zeros((3, *q.shape))
        _slope_into(self.chain.packed, self._bodies, weight, q, dq, ddq, slope)
        slope[2] += weight * self.body.rotor_inertia_kg_m2
        return slope
