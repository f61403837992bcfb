"""The information matrix of a motion and its derivative by the motion: numba kernels.

The kernels keep the rules of `kernels`. The derivative goes through the mechanics backwards once per sample, about
1.4 us for six joints, where differences of the regressor took 10 us.
"""

from __future__ import annotations

import numba
import numpy as np

from armload_identification.model.kernels import FRAME_NUMBERS, forward_into, rows_into


@numba.njit(
    "void(float64[::1], float64[::1], float64[:, ::1], float64[:, ::1], float64[:, ::1], float64[:, ::1])",
    cache=True,
    fastmath={"contract"},
    nogil=True,
)
def information_into(packed, weight, q, dq, ddq, information):  # type: ignore[no-untyped-def]
    """M of the flange's regressor, into information (10, 10)."""
    n = weight.shape[0]
    frames = np.empty((n, FRAME_NUMBERS))
    phi = np.empty((n, 10))
    information[:] = 0.0
    for t in range(q.shape[0]):
        forward_into(packed, n, q[t], dq[t], ddq[t], frames)
        rows_into(frames, n, packed, 3 + 21 * n, 12 + 21 * n, phi, 0)
        for i in range(n):
            for k in range(10):
                left = weight[i] * phi[i, k]
                for m in range(k + 1):
                    information[k, m] += left * phi[i, m]
    for k in range(10):
        for m in range(k):
            information[m, k] = information[k, m]


@numba.njit(
    "void(float64[::1], float64[::1], float64[:, ::1], float64[:, ::1], float64[:, ::1], float64[:, ::1],"
    " float64[:, :, ::1])",
    cache=True,
    fastmath={"contract"},
    nogil=True,
)
def slope_into(packed, weight, gain, q, dq, ddq, slope):  # type: ignore[no-untyped-def]  # noqa: PLR0915
    """Derivative of tr(gain M) by q, dq, ddq, into slope (3, N, n); gain is symmetric and constant.

    tr(gain dM) = sum_i <a_i, dPhi_i> with a_i = 2 W_i Phi_i gain: the torque at joint i of a body with the ten
    parameters a_i. Written with the screws S_i = (z_i, v_i) of the joints in flange coordinates,

        V = sum_i S_i dq_i,    dV = sum_i S_i ddq_i + sum_{i<j} (S_i x S_j) dq_i dq_j,    dS_i/dq_j = S_i x S_j, i < j,

    and gone through backwards, bar_x being the derivative by x (Griewank, Walther, Evaluating Derivatives, 2008).
    """
    n = weight.shape[0]
    frames = np.empty((n, FRAME_NUMBERS))
    phi = np.empty((n, 10))
    screw = np.empty((n, 6))
    ahead = np.empty((n, 6))  # sum of S_j dq_j over j > i
    bar = np.empty((n, 6))
    a = np.empty(10)
    gx, gy, gz = -packed[0], -packed[1], -packed[2]
    for t in range(q.shape[0]):
        forward_into(packed, n, q[t], dq[t], ddq[t], frames)
        rows_into(frames, n, packed, 3 + 21 * n, 12 + 21 * n, phi, 0)
        # flange rotation and position
        f = frames[n - 1]
        k = 3 + 21 * n
        r00 = f[0] * packed[k] + f[1] * packed[k + 3] + f[2] * packed[k + 6]
        r01 = f[0] * packed[k + 1] + f[1] * packed[k + 4] + f[2] * packed[k + 7]
        r02 = f[0] * packed[k + 2] + f[1] * packed[k + 5] + f[2] * packed[k + 8]
        r10 = f[3] * packed[k] + f[4] * packed[k + 3] + f[5] * packed[k + 6]
        r11 = f[3] * packed[k + 1] + f[4] * packed[k + 4] + f[5] * packed[k + 7]
        r12 = f[3] * packed[k + 2] + f[4] * packed[k + 5] + f[5] * packed[k + 8]
        r20 = f[6] * packed[k] + f[7] * packed[k + 3] + f[8] * packed[k + 6]
        r21 = f[6] * packed[k + 1] + f[7] * packed[k + 4] + f[8] * packed[k + 7]
        r22 = f[6] * packed[k + 2] + f[7] * packed[k + 5] + f[8] * packed[k + 8]
        x, y, z = packed[k + 9], packed[k + 10], packed[k + 11]
        px = f[9] + f[0] * x + f[1] * y + f[2] * z
        py = f[10] + f[3] * x + f[4] * y + f[5] * z
        pz = f[11] + f[6] * x + f[7] * y + f[8] * z
        # screws in flange coordinates, and the twist V = (w, u) they add up to, from the last joint back
        wx, wy, wz, ux, uy, uz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        ex, ey, ez, bx, by, bz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for m in range(n):
            i = n - 1 - m
            g, s, c = frames[i], screw[i], ahead[i]
            x, y, z = g[2], g[5], g[8]
            lx, ly, lz = px - g[9], py - g[10], pz - g[11]
            ix, iy, iz = y * lz - z * ly, z * lx - x * lz, x * ly - y * lx
            s0, s1, s2 = r00 * x + r10 * y + r20 * z, r01 * x + r11 * y + r21 * z, r02 * x + r12 * y + r22 * z
            s3, s4, s5 = r00 * ix + r10 * iy + r20 * iz, r01 * ix + r11 * iy + r21 * iz, r02 * ix + r12 * iy + r22 * iz
            s[0], s[1], s[2], s[3], s[4], s[5] = s0, s1, s2, s3, s4, s5
            c[0], c[1], c[2], c[3], c[4], c[5] = wx, wy, wz, ux, uy, uz
            v, acc = dq[t, i], ddq[t, i]
            # dV += S_i ddq_i + (S_i x ahead_i) dq_i
            ex += s0 * acc + (s1 * wz - s2 * wy) * v
            ey += s1 * acc + (s2 * wx - s0 * wz) * v
            ez += s2 * acc + (s0 * wy - s1 * wx) * v
            bx += s3 * acc + (s1 * uz - s2 * uy + s4 * wz - s5 * wy) * v
            by += s4 * acc + (s2 * ux - s0 * uz + s5 * wx - s3 * wz) * v
            bz += s5 * acc + (s0 * uy - s1 * ux + s3 * wy - s4 * wx) * v
            wx += s0 * v
            wy += s1 * v
            wz += s2 * v
            ux += s3 * v
            uy += s4 * v
            uz += s5 * v
        # gravity in flange coordinates, and the acceleration that a body feels
        hx, hy, hz = r00 * gx + r10 * gy + r20 * gz, r01 * gx + r11 * gy + r21 * gz, r02 * gx + r12 * gy + r22 * gz
        bx += wy * uz - wz * uy - hx
        by += wz * ux - wx * uz - hy
        bz += wx * uy - wy * ux - hz
        # backwards through tau_i = v_i . F(a_i) + z_i . N(a_i)
        cax, cay, caz, cex, cey, cez = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        cwx, cwy, cwz = 0.0, 0.0, 0.0
        for i in range(n):
            row, s, o = phi[i], screw[i], bar[i]
            for c in range(10):
                total = 0.0
                for m in range(10):
                    total += row[m] * gain[m, c]
                a[c] = 2.0 * weight[i] * total
            mass, sx, sy, sz = a[0], a[1], a[2], a[3]
            zx, zy, zz, vx, vy, vz = s[0], s[1], s[2], s[3], s[4], s[5]
            # I w, I e, I z
            jx = a[4] * wx + a[7] * wy + a[8] * wz
            jy = a[7] * wx + a[5] * wy + a[9] * wz
            jz = a[8] * wx + a[9] * wy + a[6] * wz
            kx = a[4] * ex + a[7] * ey + a[8] * ez
            ky = a[7] * ex + a[5] * ey + a[9] * ez
            kz = a[8] * ex + a[9] * ey + a[6] * ez
            lx = a[4] * zx + a[7] * zy + a[8] * zz
            ly = a[7] * zx + a[5] * zy + a[9] * zz
            lz = a[8] * zx + a[9] * zy + a[6] * zz
            ws, ww = wx * sx + wy * sy + wz * sz, wx * wx + wy * wy + wz * wz
            vw, vs = vx * wx + vy * wy + vz * wz, vx * sx + vy * sy + vz * sz
            # N and F: what the screw is multiplied with
            o[0] = sy * bz - sz * by + kx + wy * jz - wz * jy
            o[1] = sz * bx - sx * bz + ky + wz * jx - wx * jz
            o[2] = sx * by - sy * bx + kz + wx * jy - wy * jx
            o[3] = mass * bx + ey * sz - ez * sy + wx * ws - sx * ww
            o[4] = mass * by + ez * sx - ex * sz + wy * ws - sy * ww
            o[5] = mass * bz + ex * sy - ey * sx + wz * ws - sz * ww
            cax += mass * vx + zy * sz - zz * sy
            cay += mass * vy + zz * sx - zx * sz
            caz += mass * vz + zx * sy - zy * sx
            cex += sy * vz - sz * vy + lx
            cey += sz * vx - sx * vz + ly
            cez += sx * vy - sy * vx + lz
            # z x w, for I (z x w)
            tx, ty, tz = zy * wz - zz * wy, zz * wx - zx * wz, zx * wy - zy * wx
            cwx += vx * ws + sx * vw - 2.0 * wx * vs + jy * zz - jz * zy + a[4] * tx + a[7] * ty + a[8] * tz
            cwy += vy * ws + sy * vw - 2.0 * wy * vs + jz * zx - jx * zz + a[7] * tx + a[5] * ty + a[9] * tz
            cwz += vz * ws + sz * vw - 2.0 * wz * vs + jx * zy - jy * zx + a[8] * tx + a[9] * ty + a[6] * tz
        # the acceleration holds w x u - gravity
        cwx += uy * caz - uz * cay
        cwy += uz * cax - ux * caz
        cwz += ux * cay - uy * cax
        cux, cuy, cuz = cay * wz - caz * wy, caz * wx - cax * wz, cax * wy - cay * wx
        # backwards through twist and screws, from the first joint; behind = sum of S_i dq_i over i < j
        ox, oy, oz, qx, qy, qz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        m0, m1, m2, m3, m4, m5 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for i in range(n):
            s, o, c = screw[i], bar[i], ahead[i]
            zx, zy, zz, vx, vy, vz = s[0], s[1], s[2], s[3], s[4], s[5]
            v, acc = dq[t, i], ddq[t, i]
            # q_i moves every screw before it, and gravity
            slope[0, t, i] = (
                zx * m0
                + zy * m1
                + zz * m2
                + vx * m3
                + vy * m4
                + vz * m5
                - cax * (hy * zz - hz * zy)
                - cay * (hz * zx - hx * zz)
                - caz * (hx * zy - hy * zx)
            )
            # S_i x (ahead - behind)
            dx, dy, dz = c[0] - ox, c[1] - oy, c[2] - oz
            fx, fy, fz = c[3] - qx, c[4] - qy, c[5] - qz
            slope[1, t, i] = (
                cwx * zx
                + cwy * zy
                + cwz * zz
                + cux * vx
                + cuy * vy
                + cuz * vz
                + cex * (zy * dz - zz * dy)
                + cey * (zz * dx - zx * dz)
                + cez * (zx * dy - zy * dx)
                + cax * (zy * fz - zz * fy + vy * dz - vz * dy)
                + cay * (zz * fx - zx * fz + vz * dx - vx * dz)
                + caz * (zx * fy - zy * fx + vx * dy - vy * dx)
            )
            slope[2, t, i] = cex * zx + cey * zy + cez * zz + cax * vx + cay * vy + caz * vz
            o0 = o[0] + cex * acc + cwx * v + v * (dy * cez - dz * cey + fy * caz - fz * cay)
            o1 = o[1] + cey * acc + cwy * v + v * (dz * cex - dx * cez + fz * cax - fx * caz)
            o2 = o[2] + cez * acc + cwz * v + v * (dx * cey - dy * cex + fx * cay - fy * cax)
            o3 = o[3] + cax * acc + cux * v + v * (dy * caz - dz * cay)
            o4 = o[4] + cay * acc + cuy * v + v * (dz * cax - dx * caz)
            o5 = o[5] + caz * acc + cuz * v + v * (dx * cay - dy * cax)
            m0 += o1 * zz - o2 * zy + o4 * vz - o5 * vy
            m1 += o2 * zx - o0 * zz + o5 * vx - o3 * vz
            m2 += o0 * zy - o1 * zx + o3 * vy - o4 * vx
            m3 += o4 * zz - o5 * zy
            m4 += o5 * zx - o3 * zz
            m5 += o3 * zy - o4 * zx
            ox += zx * v
            oy += zy * v
            oz += zz * v
            qx += vx * v
            qy += vy * v
            qz += vz * v
