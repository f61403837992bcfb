"""Whether something acts on the arm that payload and friction of the last minute do not explain.

    z = mean over a window of (e - H x), minus the mean of what the bounded friction of joints that stop may be
    S = H P H' + noise + what joints that stop, and a changing acceleration, make uncertain
    z' S^-1 z > bound

References:
    Haddadin et al., "Robot collisions: a survey", IEEE T-RO 33(6), 2017.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from armload_identification.contact.arm_memory import RememberedState
from armload_identification.contact.contact_levels import (
    BOUNDED,
    COLOUR_S,
    JERK,
    QUIET_RAD_S2,
    TAIL_SIGMAS,
    UNBOUNDED,
    WHITE_S,
    WINDOWS_S,
)
from armload_identification.contact.force_rows import ForceRows
from armload_identification.float_array import FloatArray

LEAST_FILLED = 0.6
"""Share of a window that must have rows."""
_WINDOWS_S, _TAIL_SIGMAS = np.array(WINDOWS_S), np.array(TAIL_SIGMAS)


@dataclass(frozen=True, eq=False)
class ResidualNoise:
    """The residual's noise.

    Attributes:
        white_nm2: (n,) variance of a mean over `WHITE_S` of the part that has no memory.
        coloured_nm2: (n,) variance of the rest, with a correlation time of `COLOUR_S`.
    """

    white_nm2: FloatArray
    coloured_nm2: FloatArray

    @property
    def density(self) -> FloatArray:
        """(n,) spectral density at frequency zero, (N m)^2 s."""
        return np.asarray(self.white_nm2 * WHITE_S + self.coloured_nm2 * 2.0 * COLOUR_S)

    def of_means(self, windows_s: FloatArray) -> FloatArray:
        """(W, n) variance of means over W windows."""
        ratio = windows_s[:, None] / COLOUR_S
        coloured = 2.0 / ratio * (1.0 - (1.0 - np.exp(-ratio)) / ratio)
        return np.asarray(self.white_nm2 * WHITE_S / windows_s[:, None] + self.coloured_nm2 * coloured)


@dataclass(frozen=True, eq=False)
class Test:
    """The test at K times.

    Attributes:
        ratio: (K,) greatest statistic as a share of its bound; above 1 something acts.
        joints: (K, n) residual of each joint in standard deviations, in the window of the greatest ratio.
    """

    ratio: FloatArray
    joints: FloatArray


def bound(sigmas: FloatArray, freedoms: int) -> FloatArray:
    """Bound of a chi-squared variable (Wilson and Hilferty 1931).

    Args:
        sigmas: Standard deviations of a normal variable with the same probability.
        freedoms: Degrees of freedom.
    """
    third = 2.0 / (9.0 * freedoms)
    return np.asarray(freedoms * (1.0 - third + sigmas * np.sqrt(third)) ** 3)


def acting(
    rows: ForceRows, since: int, known: RememberedState, noise: ResidualNoise, inertia_kg_m2: FloatArray
) -> Test:
    """Test the newest rows.

    Args:
        rows: Rows of the last seconds.
        since: Index of the first row to test.
        known: What is known of payload and friction.
        inertia_kg_m2: (n,) inertia about each joint.
    """
    tested = rows.size - since
    rows = rows.since(rows.time_s[since] - WINDOWS_S[-1])
    n = rows.residual_nm.shape[1]
    stacked = np.concatenate([rows.columns, np.stack([rows.residual_nm, rows.doubt_nm], axis=2)], axis=2)
    sums = np.concatenate([np.zeros((1, *stacked.shape[1:])), np.cumsum(stacked, axis=0)])
    ends = np.arange(rows.size - tested, rows.size) + 1
    # (W, K) from here on
    starts = np.searchsorted(rows.time_s, rows.time_s[ends - 1] - _WINDOWS_S[:, None], side="right")
    number = ends - starts
    mean = (sums[ends] - sums[starts]) / number[:, :, None, None]
    H, doubt = mean[..., :-2], mean[..., -1]
    z = mean[..., -2] - H @ known.value
    z = np.sign(z) * np.maximum(np.abs(z) - BOUNDED * doubt, 0.0)
    changed = [[np.ptp(rows.acceleration_rad_s2[a:b], axis=0) for a, b in zip(of, ends, strict=True)] for of in starts]
    jerk = JERK * inertia_kg_m2 * np.maximum(np.array(changed) - QUIET_RAD_S2, 0.0)
    own = noise.of_means(_WINDOWS_S)[:, None] + (UNBOUNDED * doubt) ** 2 + jerk**2
    S = H @ known.covariance @ np.swapaxes(H, 2, 3) + own[..., None] * np.eye(n)
    statistic = np.einsum("wki,wki->wk", z, np.linalg.solve(S, z[..., None])[..., 0])
    filled = number * 0.02 >= LEAST_FILLED * _WINDOWS_S[:, None]
    ratio = np.where(filled, statistic / bound(_TAIL_SIGMAS, n)[:, None], 0.0)
    best = np.argmax(ratio, axis=0), np.arange(ends.size)
    return Test(ratio[best], (z / np.sqrt(np.diagonal(S, axis1=2, axis2=3)))[best])
