"""Whether something acts on the arm that payload and friction of the last minute do not explain.

    z = mean over a window of (e - H x), minus the mean of what the bounded friction of joints that stop may be
    S = H P H' + noise + what joints that stop, and a changing acceleration, make uncertain
    z' S^-1 z > bound

References:
    Haddadin et al., "Robot collisions: a survey", IEEE T-RO 33(6), 2017.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, cached_property

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

    @cached_property
    def of_means(self) -> FloatArray:
        """(W, n) variance of means over the windows of the test."""
        ratio = _WINDOWS_S[:, None] / COLOUR_S
        coloured = 2.0 / ratio * (1.0 - (1.0 - np.exp(-ratio)) / ratio)
        return np.asarray(self.white_nm2 * WHITE_S / _WINDOWS_S[:, None] + self.coloured_nm2 * coloured)


@cache
def bounds(freedoms: int) -> FloatArray:
    """(W,) bounds of a chi-squared variable with so many degrees of freedom (Wilson and Hilferty 1931)."""
    third = 2.0 / (9.0 * freedoms)
    return np.asarray(freedoms * (1.0 - third + _TAIL_SIGMAS * np.sqrt(third)) ** 3)


def acting(rows: ForceRows, known: RememberedState, noise: ResidualNoise) -> tuple[float, FloatArray]:
    """Test the newest row.

    Args:
        rows: Rows of the last seconds.
        known: What is known of payload and friction.
        noise: The residual's noise.

    Returns:
        Greatest statistic as a share of its bound, above 1 if something acts; and (n,) residual of each joint in
        standard deviations, in the window of the greatest share.
    """
    rows = rows.since(rows.time_s[-1] - WINDOWS_S[-1])
    size, n = rows.residual_nm.shape
    starts = np.searchsorted(rows.time_s, rows.time_s[-1] - _WINDOWS_S, side="right")
    number = size - starts
    share = (np.arange(size) >= starts[:, None]) / number[:, None]
    H = (share @ rows.columns.reshape(size, -1)).reshape(len(share), n, -1)
    doubt = share @ rows.doubt_nm
    z = share @ rows.residual_nm - H @ known.value
    z = np.sign(z) * np.maximum(np.abs(z) - BOUNDED * doubt, 0.0)
    back = rows.acceleration_rad_s2[::-1]
    changed = (np.maximum.accumulate(back) - np.minimum.accumulate(back))[number - 1]
    jerk = JERK * rows.inertia_kg_m2[-1] * np.maximum(changed - QUIET_RAD_S2, 0.0)
    S = H @ known.covariance @ np.swapaxes(H, 1, 2)
    variance = np.einsum("wii->wi", S)
    variance += noise.of_means + (UNBOUNDED * doubt) ** 2 + jerk**2
    statistic = np.sum(z * np.linalg.solve(S, z[:, :, None])[:, :, 0], axis=1)
    ratio = np.where(number * 0.02 >= LEAST_FILLED * _WINDOWS_S, statistic / bounds(n), 0.0)
    best = int(np.argmax(ratio))
    return float(ratio[best]), z[best] / np.sqrt(variance[best])
