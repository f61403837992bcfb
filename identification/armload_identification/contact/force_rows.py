"""Rows of a calibrated arm for the question whether something acts on it: residual, columns, and their uncertainty.

    e = tau - (1 + mu s sgn(tau_l)) Y beta - rotors - friction        H = [(1 + mu s sgn(tau_l)) Phi, s, dq, 1]

The unknowns are the payload's ten parameters and three changes of friction per joint, in units of their priors. Motion
is a least-squares cubic over nine means of 10 ms, so that a row is known 40 ms after its time. Its acceleration is a
weighted mean of the true one; torque is averaged with the same weights, so that inertia leaves no residual in an abrupt
stop.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Final, Self

import numpy as np
from numpy.typing import NDArray

from armload_identification.calibration.calibration_result import ArmCalibration
from armload_identification.contact.contact_levels import BIN_S, BINS, HOLE_S, SLOW, STAMP_SIGMAS, STEP_S, STOPPING
from armload_identification.estimation.empty_arm.known_arm_rows import MOVING, known_arm_columns, payload_scale
from armload_identification.float_array import FloatArray
from armload_identification.model.chain import Chain
from armload_identification.model.joint_states import JointStates
from armload_identification.model.smooth_sign import smooth_sign
from armload_identification.signals.reversals import moving_weights

PAYLOAD: Final = 10
"""Number of a payload's parameters."""
_HALF: Final = BINS // 2
_CURVATURE: Final = np.linalg.pinv(np.arange(-_HALF, _HALF + 1)[:, None] ** np.arange(4.0))[2]
_SEEN_ACCELERATION: Final = 2.0 * np.cumsum(np.cumsum(_CURVATURE))[: BINS - 2]
"""Weights of the true acceleration at the inner means in that of the fit."""


@dataclass(frozen=True, eq=False)
class ForceRows:
    """K rows of n joints.

    Attributes:
        time_s: (K,) their times.
        position_rad: (K, n) positions.
        residual_nm: (K, n) e.
        columns: (K, n, 10 + 3 n) H.
        doubt_nm: (K, n) torque by which a joint is uncertain because it stops, starts or reverses, or because
            the stamps of its samples scatter.
        acceleration_rad_s2: (K, n) acceleration.
        weight: (K, n) 0 to 1, how well a row shows a joint's friction.
    """

    time_s: FloatArray
    position_rad: FloatArray
    residual_nm: FloatArray
    columns: FloatArray
    doubt_nm: FloatArray
    acceleration_rad_s2: FloatArray
    weight: FloatArray

    @classmethod
    def none(cls, n: int) -> Self:
        """No rows of n joints."""
        nothing = np.zeros((0, n))
        return cls(np.zeros(0), nothing, nothing, np.zeros((0, n, PAYLOAD + 3 * n)), nothing, nothing, nothing)

    @property
    def size(self) -> int:
        """Number of rows."""
        return int(self.time_s.size)

    def part(self, chosen: slice | NDArray[np.bool_]) -> Self:
        """Some of the rows."""
        return type(self)(*(getattr(self, field.name)[chosen] for field in fields(self)))

    def since(self, time_s: float) -> Self:
        """The rows from a time on, without a copy."""
        return self.part(slice(int(np.searchsorted(self.time_s, time_s)), None))

    def and_then(self, later: Self) -> Self:
        """These rows and later ones."""
        pairs = ((getattr(self, field.name), getattr(later, field.name)) for field in fields(self))
        return type(self)(*(np.concatenate(pair) for pair in pairs))


class RowMaker:
    """Makes rows of samples.

    Args:
        chain: The configured arm.
        from_effort: (n, n) joint torque is effort @ from_effort.
    """

    def __init__(self, calibration: ArmCalibration, chain: Chain, from_effort: FloatArray) -> None:
        self.chain = calibration.level(chain)
        self.scale = payload_scale(calibration.level_nm)
        self._body, self._from_effort = calibration.body, from_effort
        self._spread = calibration.friction_spread
        n = chain.n
        self._gathered: list[FloatArray] = []
        self._sample_s = np.nan
        self._bins = np.zeros((0, 1 + 2 * n))
        self._row_s = -np.inf

    def take(self, time_s: FloatArray, position: FloatArray, effort: FloatArray, theta: FloatArray) -> ForceRows:
        """The rows that samples complete.

        Args:
            time_s: (N,) stamps, increasing.
            position: (N, n) joint positions in rad.
            effort: (N, n) as the drives report it.
            theta: (10,) the payload about which friction under load is linearised.
        """
        n = self.chain.n
        fresh = np.column_stack([time_s, position, effort @ self._from_effort])
        self._bins = np.concatenate([self._bins, self._means(fresh[np.isfinite(fresh).all(axis=1)])])
        times = self._bins[:, 0]
        at = []
        for k in range(_HALF, len(times) - _HALF):
            if times[k] - self._row_s >= STEP_S and 0.0 < times[k + _HALF] - times[k - _HALF] < HOLE_S:
                at.append(k)
                self._row_s = times[k]
        windows = self._bins[np.array(at, dtype=np.intp)[:, None] + np.arange(-_HALF, _HALF + 1)]
        self._bins = self._bins[-2 * _HALF :]
        return self._rows(windows, theta) if at else ForceRows.none(n)

    def _means(self, samples: FloatArray) -> FloatArray:
        """(B, 1 + 2 n) means of samples over `BIN_S`; the last samples wait where another one would belong to them."""
        means = []
        for row in samples:
            if self._gathered and row[0] - self._gathered[0][0] >= BIN_S:
                means.append(self._mean())
            self._gathered.append(row)
            next_s = row[0] + (row[0] - self._sample_s)
            if next_s - self._gathered[0][0] >= BIN_S:
                means.append(self._mean())
            self._sample_s = row[0]
        return np.array(means).reshape(-1, self._bins.shape[1])

    def _mean(self) -> FloatArray:
        """Mean of the gathered samples."""
        mean = np.asarray(np.mean(self._gathered, axis=0))
        self._gathered = []
        return mean

    def _rows(self, windows: FloatArray, theta: FloatArray) -> ForceRows:
        """Rows of windows of means."""
        n, body = self.chain.n, self._body
        middle = windows[:, _HALF, 0]
        away = windows[:, :, 0] - (middle - body.torque_delay_s)[:, None]
        span = np.maximum(np.abs(away).max(axis=1), BIN_S)
        powers = (away / span[:, None])[:, :, None] ** np.arange(4)
        normal = np.swapaxes(powers, 1, 2) @ powers
        cubic = np.linalg.solve(normal, np.swapaxes(powers, 1, 2) @ windows[:, :, 1 : 1 + n])
        q, dq, ddq = (
            np.ascontiguousarray(factor * cubic[:, order] / (span**order)[:, None])
            for order, factor in enumerate((1.0, 1.0, 2.0))
        )
        tau = np.tensordot(windows[:, 1:-1, 1 + n :], _SEEN_ACCELERATION, (1, 0))
        direction = smooth_sign(dq, body.reversal_speed_rad_s)
        states = JointStates(q, dq, ddq)
        columns, through, links, carried = known_arm_columns(self.chain, body, self._spread, self.scale, states, theta)
        steady = body.coulomb_nm + body.root_nm * np.sqrt(np.abs(dq))
        friction = direction * steady + body.viscous_nm_s_rad * dq + body.offset_nm
        shaken = dq * _scatter_per_s(windows[:, :, 1 : 1 + n] - powers @ cubic, dq, normal, span)[:, None]
        uneven = body.link_torque(self.chain, q, dq, ddq + shaken) - links + shaken @ body.rotor_mass_kg_m2
        slowest = np.maximum(np.abs(dq) - span[:, None] * np.abs(ddq), 0.0)
        slow = 1.0 - np.tanh(slowest / (SLOW * body.reversal_speed_rad_s))
        return ForceRows(
            time_s=middle,
            position_rad=q,
            residual_nm=tau - through * links - ddq @ body.rotor_mass_kg_m2 - friction,
            columns=columns,
            doubt_nm=STOPPING * (body.coulomb_nm + body.load_friction * np.abs(carried)) * slow
            + STAMP_SIGMAS * np.abs(uneven),
            acceleration_rad_s2=ddq,
            weight=moving_weights(dq, MOVING * body.reversal_speed_rad_s),
        )

    def inertia_kg_m2(self, position: FloatArray) -> FloatArray:
        """(n,) inertia about each joint in one position, rotors included."""
        n, still = self.chain.n, np.zeros((self.chain.n + 1, self.chain.n))
        unit = np.vstack([np.eye(n), np.zeros(n)])
        torque = self._body.link_torque(self.chain, np.tile(position, (n + 1, 1)), still, unit)
        return np.asarray(np.diag(torque[:n] - torque[n]) + np.diag(self._body.rotor_mass_kg_m2))


def _scatter_per_s(left: FloatArray, dq: FloatArray, normal: FloatArray, span: FloatArray) -> FloatArray:
    """(K,) standard deviation of the acceleration per speed, in 1/s, by stamps that scatter.

    A stamp's error moves all joints along their speeds. What the cubic leaves of a smooth motion has small second
    differences.

    Args:
        left: (K, B, n) positions minus the cubic.
        dq: (K, n) speeds.
        normal: (K, 4, 4) normal matrix of the cubic.
        span: (K,) its unit of time.
    """
    late_s = np.einsum("kbj,kj->kb", left, dq) / np.maximum(np.sum(dq**2, axis=1), 1e-12)[:, None]
    deviation_s = np.sqrt(np.mean(np.diff(late_s, 2, axis=1) ** 2, axis=1) / 6.0)
    return np.asarray(2.0 * np.sqrt(np.linalg.inv(normal)[:, 2, 2]) / span**2 * deviation_s)
