"""Rows of a calibrated arm for the question whether something acts on it: residual, columns, and their uncertainty.

    e = tau - (1 + mu s sgn(tau_l)) Y beta - rotors - friction        H = [(1 + mu s sgn(tau_l)) Phi, s, dq, 1]

The unknowns are the payload's ten parameters and three changes of friction per joint, in units of their priors. Motion
is a least-squares cubic over nine means of 10 ms, so that a row is known 40 ms after its time. Its acceleration is a
weighted mean of the true one; torque is averaged with the same weights, so that inertia leaves no residual in an abrupt
stop.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from armload_identification.calibration.calibration_result import ArmCalibration
from armload_identification.contact.contact_levels import BIN_S, BINS, HOLE_S, SLOW, STAMP_SIGMAS, STEP_S, STOPPING
from armload_identification.estimation.empty_arm.known_arm_rows import (
    MOVING,
    payload_scale,
    under_load,
    unloaded_columns,
)
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


class ForceRows(NamedTuple):
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
        inertia_kg_m2: (K, n) inertia about each joint, rotors included.
    """

    time_s: FloatArray
    position_rad: FloatArray
    residual_nm: FloatArray
    columns: FloatArray
    doubt_nm: FloatArray
    acceleration_rad_s2: FloatArray
    weight: FloatArray
    inertia_kg_m2: FloatArray

    @property
    def size(self) -> int:
        """Number of rows."""
        return int(self.time_s.size)

    def part(self, chosen: slice | NDArray[np.bool_]) -> Self:
        """Some of the rows."""
        return type(self)(*[values[chosen] for values in self])

    def since(self, time_s: float) -> Self:
        """The rows from a time on, without a copy."""
        return self.part(slice(int(np.searchsorted(self.time_s, time_s)), None))

    @classmethod
    def joined(cls, parts: Iterable[Self]) -> Self:
        """Rows in turn."""
        return cls(*map(np.concatenate, zip(*parts, strict=True)))


class MotionRow(NamedTuple):
    """A row before it is known what the arm carries.

    Attributes:
        unloaded: The row without friction under load and without the links.
        number: Number of the sample that completes it.
        links_nm: (1, n) torque of the links.
        turning: (1, n) friction per torque times the direction of motion.
        stopping: (1, n) doubt per torque.
    """

    unloaded: ForceRows
    number: float
    links_nm: FloatArray
    turning: FloatArray
    stopping: FloatArray

    def about(self, payload: FloatArray) -> ForceRows:
        """The row with friction under load linearised about a payload, (10,) in units of its prior."""
        row = self.unloaded
        columns, through, carried = under_load(row.columns, self.links_nm, self.turning, payload)
        residual, doubt = row.residual_nm - through * self.links_nm, row.doubt_nm + self.stopping * np.abs(carried)
        return row._replace(columns=columns, residual_nm=residual, doubt_nm=doubt)


class RecentRows:
    """The rows of the last seconds, in arrays with room for as many again: one more moves none.

    Attributes:
        rows: They, without a copy.
    """

    def __init__(self, n: int) -> None:
        one, columns = np.zeros((0, n)), np.zeros((0, n, PAYLOAD + 3 * n))
        self.rows = self._room = ForceRows(np.zeros(0), one, one, columns, *[one] * 4)
        self._end = 0

    def add(self, later: ForceRows) -> None:
        """Add later rows."""
        size, end = self.rows.size + later.size, self._end + later.size
        if end > self._room.size:
            self._room, end = ForceRows.joined([self.rows, later] * 2), size
        for values, fresh in zip(self._room, later, strict=True):
            values[end - later.size : end] = fresh
        self.rows, self._end = self._room.part(slice(end - size, end)), end


class RowMaker:
    """Makes rows of samples.

    Args:
        chain: The configured arm.
        from_effort: (n, n) joint torque is effort @ from_effort.
    """

    def __init__(self, calibration: ArmCalibration, chain: Chain, from_effort: FloatArray) -> None:
        self.chain = calibration.level(chain)
        self._body, self._from_effort = calibration.body, from_effort
        self._units = calibration.friction_spread, payload_scale(calibration.level_nm)
        self._weightless = self.chain.under(np.zeros(3))
        self._gathered = self._bins = np.zeros((0, 2 + 2 * chain.n))
        self._count, self._sample_s, self._row_s = 0, np.nan, -np.inf

    def take(self, time_s: FloatArray, position: FloatArray, effort: FloatArray) -> list[MotionRow]:
        """The rows that samples complete, one by one.

        Args:
            time_s: (N,) stamps, increasing.
            position: (N, n) joint positions in rad.
            effort: (N, n) as the drives report it.
        """
        number = np.arange(self._count, self._count + time_s.size)
        fresh = np.column_stack([number, time_s, position, effort @ self._from_effort])
        self._count += time_s.size
        self._bins = np.concatenate([self._bins, self._means(fresh[np.isfinite(fresh).all(axis=1)])])
        times, at = self._bins[:, 1].tolist(), []
        for k in range(_HALF, len(times) - _HALF):
            if times[k] - self._row_s >= STEP_S and 0.0 < times[k + _HALF] - times[k - _HALF] < HOLE_S:
                at.append(k)
                self._row_s = times[k]
        windows = self._bins[np.array(at, dtype=np.intp)[:, None] + np.arange(-_HALF, _HALF + 1)]
        self._bins = self._bins[-2 * _HALF :]
        return self._rows(windows) if at else []

    def _means(self, fresh: FloatArray) -> FloatArray:
        """(B, 2 + 2 n) means of samples over `BIN_S`, each with the number of the sample with which it is known.

        The last samples wait where another one would belong to them.
        """
        begin, waiting, samples = 0, len(self._gathered), np.concatenate([self._gathered, fresh])
        times, means = samples[:, 1].tolist(), []
        for k in range(waiting, len(times)):
            for end, until_s in ((k, times[k]), (k + 1, times[k] + (times[k] - self._sample_s))):
                if begin < end and until_s - times[begin] >= BIN_S:
                    means.append(np.add.reduce(samples[begin:end]) / (end - begin))
                    means[-1][0] = samples[k, 0]
                    begin = end
            self._sample_s = times[k]
        self._gathered = samples[begin:]
        return np.array(means).reshape(-1, samples.shape[1])

    def _rows(self, windows: FloatArray) -> list[MotionRow]:
        """Rows of windows of means."""
        n, body = self.chain.n, self._body
        middle, position, torque = windows[:, _HALF, 1], windows[:, :, 2 : 2 + n], windows[:, 1:-1, 2 + n :]
        away = windows[:, :, 1] - (middle - body.torque_delay_s)[:, None]
        span = np.maximum(np.abs(away).max(axis=1), BIN_S)
        powers = (away / span[:, None])[:, :, None] ** np.arange(4)
        turned = np.swapaxes(powers, 1, 2)
        uncertain = np.linalg.inv(turned @ powers)
        cubic = uncertain @ (turned @ position)
        q, dq, ddq = cubic[:, 0].copy(), cubic[:, 1] / span[:, None], 2.0 * cubic[:, 2] / span[:, None] ** 2
        direction = smooth_sign(dq, body.reversal_speed_rad_s)
        steady = body.coulomb_nm + body.root_nm * np.sqrt(np.abs(dq))
        friction = direction * steady + body.viscous_nm_s_rad * dq + body.offset_nm
        shaken = dq * _scatter_per_s(position - powers @ cubic, dq, uncertain, span)[:, None]
        unit = np.tile(np.eye(n), (len(q), 1))
        inertia = body.link_torque(self._weightless, np.repeat(q, n, axis=0), 0.0 * unit, unit).reshape(-1, n, n)
        inertia += body.rotor_mass_kg_m2
        uneven = (shaken[:, None] @ inertia)[:, 0]
        slowest = np.maximum(np.abs(dq) - span[:, None] * np.abs(ddq), 0.0)
        slow = 1.0 - np.tanh(slowest / (SLOW * body.reversal_speed_rad_s))
        unloaded = ForceRows(
            time_s=middle,
            position_rad=q,
            residual_nm=_SEEN_ACCELERATION @ torque - ddq @ body.rotor_mass_kg_m2 - friction,
            columns=unloaded_columns(self.chain, body, *self._units, JointStates(q, dq, ddq)),
            doubt_nm=STOPPING * body.coulomb_nm * slow + STAMP_SIGMAS * np.abs(uneven),
            acceleration_rad_s2=ddq,
            weight=moving_weights(dq, MOVING * body.reversal_speed_rad_s),
            inertia_kg_m2=np.diagonal(inertia, axis1=1, axis2=2),
        )
        links, load = body.link_torque(self.chain, q, dq, ddq), body.load_friction
        rows = windows[:, -1, 0], links[:, None], (load * direction)[:, None], (STOPPING * load * slow)[:, None]
        return [MotionRow(unloaded.part(slice(k, k + 1)), *row) for k, row in enumerate(zip(*rows, strict=True))]


def _scatter_per_s(left: FloatArray, dq: FloatArray, uncertain: FloatArray, span: FloatArray) -> FloatArray:
    """(K,) standard deviation of the acceleration per speed, in 1/s, by stamps that scatter.

    A stamp's error moves all joints along their speeds. What the cubic leaves of a smooth motion has small second
    differences.

    Args:
        left: (K, B, n) positions minus the cubic.
        dq: (K, n) speeds.
        uncertain: (K, 4, 4) inverse of the cubic's normal matrix.
        span: (K,) its unit of time.
    """
    late_s = (left @ dq[:, :, None])[:, :, 0] / np.maximum(np.sum(dq**2, axis=1), 1e-12)[:, None]
    deviation_s = np.sqrt(np.mean(np.diff(late_s, 2, axis=1) ** 2, axis=1) / 6.0)
    return np.asarray(2.0 * np.sqrt(uncertain[:, 2, 2]) / span**2 * deviation_s)
