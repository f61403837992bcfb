"""What acts on the arm: another payload, or a push.

    e = H x + w X b + noise                    x from before the onset
    another payload: X = H_payload, w rises from 0 to 1 after t0, at once or within the time of a grasp
    a push: X = -J', a constant force and moment on the flange, which the motors resist, w = 1 within [t0, t1)

The log marginal likelihood of each is averaged over t0 and t1, or the time of the rise, on a grid. With N = noise + H P
H' and r = e - H x, summed over the means,

    v = sum_i w_i X_i' (N^-1 r)_i        B = sum_ij w_i w_j X_i' (N^-1)_ij X_j
    ln L = v' (1 + B)^-1 v / 2 - ln det(1 + B) / 2
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from armload_identification.contact.arm_memory import RememberedState
from armload_identification.contact.contact_levels import (
    BACK_S,
    COLOUR_S,
    DECISION_STEP_S,
    FAVOUR,
    FORCE_N,
    GRASPED_S,
    INEXACT,
    LEAST_SINCE,
    MOMENT_NM,
    PAYLOAD_SIZES,
)
from armload_identification.contact.force_rows import PAYLOAD, ForceRows
from armload_identification.contact.something_acts import ResidualNoise
from armload_identification.float_array import FloatArray
from armload_identification.model.chain import Chain

_FORCE: Final = np.array([FORCE_N] * 3 + [MOMENT_NM] * 3)


@dataclass(frozen=True, eq=False)
class Assessment:
    """What the rows since an onset say.

    Attributes:
        odds: Log likelihood of another payload less that of a push, plus what favours the payload: above 0 a payload.
        evidence: Log likelihood of another payload less that of nothing at all.
        push_evidence: The same of a push.
        payload_since_s: Most likely onset if it is a payload.
        push_s: Most likely onset and end if it is a push; the end is infinite while it lasts.
        force_n: (3,) its force on the arm in the base frame.
        force_deviation_n: (3,) standard deviations.
    """

    odds: float
    evidence: float
    push_evidence: float
    payload_since_s: float
    push_s: tuple[float, float]
    force_n: FloatArray
    force_deviation_n: FloatArray


class _Fits(NamedTuple):
    """Fits of one family in several windows: ln of the mean L, the best one, its b and the covariance."""

    logarithm: float
    best: int
    b: FloatArray
    covariance: FloatArray


def _fits(columns: FloatArray, inverse: FloatArray, residual: FloatArray, shares: FloatArray) -> _Fits:
    """The fits with (W, K) shares of (K, n, m) columns, from (K n, K n) N^-1 and (K n,) residual."""
    count, n, m = columns.shape
    right = np.einsum("iam,ia->im", columns, (inverse @ residual).reshape(count, n))
    pairs = np.einsum("iam,iajb,jbl->ijml", columns, inverse.reshape(count, n, count, n), columns, optimize=True)
    v = shares @ right
    B = ((shares[:, :, None] * shares[:, None]).reshape(-1, count**2) @ pairs.reshape(-1, m * m)).reshape(-1, m, m)
    covariance = np.linalg.inv(np.eye(m) + B)
    b = np.einsum("wij,wj->wi", covariance, v)
    logarithm = 0.5 * np.einsum("wi,wi->w", v, b) + 0.5 * np.linalg.slogdet(covariance)[1]
    best = int(np.argmax(logarithm))
    top = float(logarithm[best])
    return _Fits(top + float(np.log(np.mean(np.exp(logarithm - top)))), best, b[best], covariance[best])


def assess(rows: ForceRows, known: RememberedState, noise: ResidualNoise, chain: Chain, noticed_s: float) -> Assessment:
    """Compare the explanations.

    Args:
        rows: Rows from before the earliest onset until now.
        known: What was known of payload and friction before.
        noticed_s: Time of the notice.
    """
    means = _means(rows.since(noticed_s - BACK_S))
    count = means.size
    residual, inverse = _residual_of(means, known, noise)
    onsets = np.arange(max(int(np.searchsorted(means.time_s, noticed_s + DECISION_STEP_S, side="right")), 1))
    payloads = _payloads(means, inverse, residual, onsets, GRASPED_S)
    start, end = (each.ravel() for each in np.meshgrid(onsets, np.arange(1, count + 1), indexing="ij"))
    start, end = start[end > start], end[end > start]
    within = (np.arange(count) >= start[:, None]) & (np.arange(count) < end[:, None])
    torque = -np.swapaxes(chain.jacobian(means.position_rad), 1, 2)
    pushes = _fits(torque * _FORCE, inverse, residual, within.astype(float))
    first, last = int(start[pushes.best]), int(end[pushes.best])
    size = PAYLOAD_SIZES[payloads.best % len(PAYLOAD_SIZES)]
    change, spread = size * payloads.b[0], size * np.sqrt(payloads.covariance[0, 0])
    negative = known.value[0] + change + 3.0 * spread + INEXACT * abs(change) < 0.0
    odds = -np.inf if negative else payloads.logarithm + FAVOUR - pushes.logarithm
    return Assessment(
        odds=odds,
        evidence=payloads.logarithm,
        push_evidence=pushes.logarithm,
        payload_since_s=float(means.time_s[payloads.best // (len(GRASPED_S) * len(PAYLOAD_SIZES))]),
        push_s=(float(means.time_s[first]), np.inf if last == count else float(means.time_s[last])),
        force_n=_FORCE[:3] * pushes.b[:3],
        force_deviation_n=_FORCE[:3] * np.sqrt(np.diag(pushes.covariance)[:3]),
    )


def payload_evidence(rows: ForceRows, known: RememberedState, noise: ResidualNoise, now_s: float) -> float:
    """Log likelihood of another payload since some time of the last `BACK_S`, less that of nothing at all.

    Args:
        rows: Rows until now.
        known: What was known of payload and friction before them.
        now_s: Time of the newest row.
    """
    means = _means(rows.since(now_s - BACK_S))
    if means.size <= LEAST_SINCE:
        return -np.inf
    residual, inverse = _residual_of(means, known, noise)
    return _payloads(means, inverse, residual, np.arange(means.size - LEAST_SINCE), (0.0,)).logarithm


def _residual_of(means: ForceRows, known: RememberedState, noise: ResidualNoise) -> tuple[FloatArray, FloatArray]:
    """(K n,) residuals that are not known, and (K n, K n) N^-1: noise with its memory, and what was not known."""
    count, n = means.residual_nm.shape
    tall = means.columns.reshape(count * n, -1)
    together = np.exp(-np.abs(means.time_s[:, None] - means.time_s) / COLOUR_S)
    # the noise of each joint is inverted alone, and what was not known joins it by Woodbury's identity
    apart = np.zeros((count, n, count, n))
    for j in range(n):
        white = np.diag(noise.white_nm2[j] + means.doubt_nm[:, j] ** 2)
        apart[:, j, :, j] = np.linalg.inv(noise.coloured_nm2[j] * together + white)
    seen = apart.reshape(count * n, -1) @ tall
    unknown = known.covariance @ np.linalg.inv(np.eye(tall.shape[1]) + tall.T @ seen @ known.covariance)
    return means.residual_nm.ravel() - tall @ known.value, apart.reshape(count * n, -1) - seen @ unknown @ seen.T


def _payloads(
    means: ForceRows,
    inverse: FloatArray,
    residual: FloatArray,
    onsets: NDArray[np.intp],
    rises_s: tuple[float, ...],
) -> _Fits:
    """The fits of payloads of each size that rise from each onset within each time."""
    middle_s, since_s = means.time_s + 0.5 * DECISION_STEP_S, np.repeat(means.time_s[onsets], len(rises_s))[:, None]
    over_s = np.maximum(np.tile(rises_s, onsets.size), 0.5 * DECISION_STEP_S)[:, None]
    shares = np.clip((middle_s - since_s) / over_s, 0.0, 1.0)
    of_sizes = (shares[:, None] * np.array(PAYLOAD_SIZES)[:, None]).reshape(-1, means.size)
    return _fits(means.columns[:, :, :PAYLOAD], inverse, residual, of_sizes)


def _means(rows: ForceRows) -> ForceRows:
    """Means of rows over `DECISION_STEP_S`; the doubt is the greatest of a mean and the one before."""
    if not rows.size:
        return rows
    step = np.floor((rows.time_s - rows.time_s[0]) / DECISION_STEP_S).astype(int)
    starts = np.flatnonzero(np.diff(step, prepend=-1))
    counts = np.diff(np.append(starts, rows.size))

    means = ForceRows(*[(np.add.reduceat(values, starts, axis=0).T / counts).T for values in rows])
    doubt = np.maximum.reduceat(rows.doubt_nm, starts, axis=0)
    # a row's window still holds the stop or start of 40 ms ago: the newest mean may be of a single such row
    doubt[1:] = np.maximum(doubt[1:], doubt[:-1])
    return means._replace(time_s=rows.time_s[starts], doubt_nm=doubt)
