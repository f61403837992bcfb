"""Numba kernels under the regressor: the motion of an arm's frames, and a body's ten columns.

Rules. Kernels have explicit signatures and a cache, take packed arrays and no `@`, np.dot or np.linalg;
multiply and add may be fused. One forward pass in base coordinates gives every frame's motion; every row is
then the joint's motion at the body, contracted with the body's momentum balance. Gravity is an upward
acceleration of the base. The layout of `packed` is told where it is made, in `chain`.
numba's cache looks at a kernel's own file alone: after a change here, touch the files that import this one too.
"""

from __future__ import annotations

import math

import numba

FRAME_NUMBERS = 21
"""A frame in numbers: rotation 9, position 3, angular velocity, angular and linear acceleration 3 each."""


@numba.njit(
    "void(float64[::1], int64, float64[::1], float64[::1], float64[::1], float64[:, ::1])",
    cache=True,
    fastmath={"contract"},
)
def forward_into(packed, n, q, dq, ddq, frames):  # type: ignore[no-untyped-def]
    """Pose and motion of every (turned) joint frame in base coordinates, one row of `frames` per joint."""
    r00, r01, r02, r10, r11, r12, r20, r21, r22 = 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0
    px, py, pz = 0.0, 0.0, 0.0
    wx, wy, wz, ex, ey, ez = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    ax, ay, az = packed[0], packed[1], packed[2]
    for i in range(n):
        k = 3 + 12 * i
        # the joint's origin in base coordinates, and the acceleration there
        x, y, z = packed[k + 9], packed[k + 10], packed[k + 11]
        dx = r00 * x + r01 * y + r02 * z
        dy = r10 * x + r11 * y + r12 * z
        dz = r20 * x + r21 * y + r22 * z
        px += dx
        py += dy
        pz += dz
        vx, vy, vz = wy * dz - wz * dy, wz * dx - wx * dz, wx * dy - wy * dx
        ax += ey * dz - ez * dy + wy * vz - wz * vy
        ay += ez * dx - ex * dz + wz * vx - wx * vz
        az += ex * dy - ey * dx + wx * vy - wy * vx
        # R <- R placement Rz(q)
        c, s = math.cos(q[i]), math.sin(q[i])
        a00 = packed[k] * c + packed[k + 1] * s
        a10 = packed[k + 3] * c + packed[k + 4] * s
        a20 = packed[k + 6] * c + packed[k + 7] * s
        a01 = packed[k + 1] * c - packed[k] * s
        a11 = packed[k + 4] * c - packed[k + 3] * s
        a21 = packed[k + 7] * c - packed[k + 6] * s
        a02, a12, a22 = packed[k + 2], packed[k + 5], packed[k + 8]
        x, y, z = r00, r01, r02
        r00 = x * a00 + y * a10 + z * a20
        r01 = x * a01 + y * a11 + z * a21
        r02 = x * a02 + y * a12 + z * a22
        x, y, z = r10, r11, r12
        r10 = x * a00 + y * a10 + z * a20
        r11 = x * a01 + y * a11 + z * a21
        r12 = x * a02 + y * a12 + z * a22
        x, y, z = r20, r21, r22
        r20 = x * a00 + y * a10 + z * a20
        r21 = x * a01 + y * a11 + z * a21
        r22 = x * a02 + y * a12 + z * a22
        # the joint's own motion about its z axis
        v, acc = dq[i], ddq[i]
        ex += r02 * acc + (wy * r22 - wz * r12) * v
        ey += r12 * acc + (wz * r02 - wx * r22) * v
        ez += r22 * acc + (wx * r12 - wy * r02) * v
        wx += r02 * v
        wy += r12 * v
        wz += r22 * v
        f = frames[i]
        f[0], f[1], f[2], f[3], f[4], f[5], f[6], f[7], f[8] = r00, r01, r02, r10, r11, r12, r20, r21, r22
        f[9], f[10], f[11] = px, py, pz
        f[12], f[13], f[14], f[15], f[16], f[17] = wx, wy, wz, ex, ey, ez
        f[18], f[19], f[20] = ax, ay, az


@numba.njit(
    "void(float64[:, ::1], int64, float64[::1], int64, int64, float64[:, ::1], int64)",
    cache=True,
    fastmath={"contract"},
)
def rows_into(frames, joints, packed, rotation_at, position_at, out, column):  # type: ignore[no-untyped-def]  # noqa: PLR0915
    """Ten columns of the regressor of a body fixed to joint `joints`, into out[:joints, column:column + 10].

    The body's frame lies in the turned joint frame at the rotation and the position that stand in `packed`
    at the given places; position_at < 0 is none.
    """
    f = frames[joints - 1]
    k = rotation_at
    b00, b01, b02 = packed[k], packed[k + 1], packed[k + 2]
    b10, b11, b12 = packed[k + 3], packed[k + 4], packed[k + 5]
    b20, b21, b22 = packed[k + 6], packed[k + 7], packed[k + 8]
    # rotation of the body frame
    r00 = f[0] * b00 + f[1] * b10 + f[2] * b20
    r01 = f[0] * b01 + f[1] * b11 + f[2] * b21
    r02 = f[0] * b02 + f[1] * b12 + f[2] * b22
    r10 = f[3] * b00 + f[4] * b10 + f[5] * b20
    r11 = f[3] * b01 + f[4] * b11 + f[5] * b21
    r12 = f[3] * b02 + f[4] * b12 + f[5] * b22
    r20 = f[6] * b00 + f[7] * b10 + f[8] * b20
    r21 = f[6] * b01 + f[7] * b11 + f[8] * b21
    r22 = f[6] * b02 + f[7] * b12 + f[8] * b22
    px, py, pz = f[9], f[10], f[11]
    gx, gy, gz = f[12], f[13], f[14]
    hx, hy, hz = f[15], f[16], f[17]
    ux, uy, uz = f[18], f[19], f[20]
    if position_at >= 0:
        x, y, z = packed[position_at], packed[position_at + 1], packed[position_at + 2]
        dx = f[0] * x + f[1] * y + f[2] * z
        dy = f[3] * x + f[4] * y + f[5] * z
        dz = f[6] * x + f[7] * y + f[8] * z
        px += dx
        py += dy
        pz += dz
        vx, vy, vz = gy * dz - gz * dy, gz * dx - gx * dz, gx * dy - gy * dx
        ux += hy * dz - hz * dy + gy * vz - gz * vy
        uy += hz * dx - hx * dz + gz * vx - gx * vz
        uz += hx * dy - hy * dx + gx * vy - gy * vx
    # motion in body coordinates
    wx = r00 * gx + r10 * gy + r20 * gz
    wy = r01 * gx + r11 * gy + r21 * gz
    wz = r02 * gx + r12 * gy + r22 * gz
    ex = r00 * hx + r10 * hy + r20 * hz
    ey = r01 * hx + r11 * hy + r21 * hz
    ez = r02 * hx + r12 * hy + r22 * hz
    ax = r00 * ux + r10 * uy + r20 * uz
    ay = r01 * ux + r11 * uy + r21 * uz
    az = r02 * ux + r12 * uy + r22 * uz
    wxx, wyy, wzz, wxy, wxz, wyz = wx * wx, wy * wy, wz * wz, wx * wy, wx * wz, wy * wz
    # force of the first moment, f = A s with A = [dw]x + [w]x [w]x
    s00, s01, s02 = -wyy - wzz, wxy - ez, wxz + ey
    s10, s11, s12 = wxy + ez, -wxx - wzz, wyz - ex
    s20, s21, s22 = wxz - ey, wyz + ex, -wxx - wyy
    # moment of the inertia, n = I dw + w x (I w), per tensor element
    for i in range(joints):
        g = frames[i]
        lx, ly, lz = px - g[9], py - g[10], pz - g[11]
        x, y, z = g[2], g[5], g[8]
        ix, iy, iz = y * lz - z * ly, z * lx - x * lz, x * ly - y * lx
        # axis and its velocity at the body's origin, in body coordinates
        zx = r00 * x + r10 * y + r20 * z
        zy = r01 * x + r11 * y + r21 * z
        zz = r02 * x + r12 * y + r22 * z
        vx = r00 * ix + r10 * iy + r20 * iz
        vy = r01 * ix + r11 * iy + r21 * iz
        vz = r02 * ix + r12 * iy + r22 * iz
        row = out[i]
        row[column] = vx * ax + vy * ay + vz * az
        row[column + 1] = vx * s00 + vy * s10 + vz * s20 + zz * ay - zy * az
        row[column + 2] = vx * s01 + vy * s11 + vz * s21 + zx * az - zz * ax
        row[column + 3] = vx * s02 + vy * s12 + vz * s22 + zy * ax - zx * ay
        row[column + 4] = zx * ex + zy * wxz - zz * wxy
        row[column + 5] = zy * ey + zz * wxy - zx * wyz
        row[column + 6] = zz * ez + zx * wyz - zy * wxz
        row[column + 7] = zx * (ey - wxz) + zy * (ex + wyz) + zz * (wxx - wyy)
        row[column + 8] = zx * (ez + wxy) + zy * (wzz - wxx) + zz * (ex - wyz)
        row[column + 9] = zx * (wyy - wzz) + zy * (ez - wxy) + zz * (ey + wxz)
