"""What the motion of the last minute says about payload and friction, as a prediction of the residual.

    A <- f A + H' W H, b <- f b + H' W e, x = (1 + A)^-1 b, P = (1 + A)^-1, f = exp(-dt / memory)

W is the square of a row's weight over the residual's spectral density at frequency zero, to which a joint's doubt adds.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from armload_identification.contact.contact_levels import CHECKPOINT_S, MEMORY_S, OLD_S, PART_ROWS
from armload_identification.contact.force_rows import PAYLOAD, ForceRows
from armload_identification.float_array import FloatArray


@dataclass(frozen=True, eq=False)
class RememberedState:
    """Payload and friction as known at a time.

    Attributes:
        value: (m,) in units of the priors.
        covariance: (m, m) likewise.
    """

    time_s: float
    value: FloatArray
    covariance: FloatArray


class ArmMemory:
    """Collects rows.

    Args:
        states: Number of unknowns.
    """

    def __init__(self, states: int) -> None:
        self._prior = np.eye(states)
        self._information = np.zeros((states, states))
        self._right = np.zeros(states)
        self._last_s: float | None = None
        self._known: list[RememberedState] = []

    def add(self, rows: ForceRows, density: FloatArray) -> None:
        """Add rows.

        Args:
            density: (n,) spectral density of the residual, (N m)^2 s.
        """
        # in parts, as what is learnt fades, and what was known is kept
        for start in range(0, rows.size, PART_ROWS):
            part = slice(start, start + PART_ROWS)
            time_s, tall = rows.time_s[part], rows.columns[part].reshape(-1, rows.columns.shape[2])
            before = time_s[0] if self._last_s is None else self._last_s
            steps = np.clip(np.diff(time_s, prepend=before), 0.0, 0.1)
            self._last_s = float(time_s[-1])
            fade = float(np.exp(-(self._last_s - before) / MEMORY_S))
            uncertain = density + rows.doubt_nm[part] ** 2 * steps[:, None]
            weighted = tall * (rows.weight[part] ** 2 / uncertain * steps[:, None]).reshape(-1, 1)
            self._information = fade * self._information + weighted.T @ tall
            self._right = fade * self._right + weighted.T @ rows.residual_nm[part].ravel()
            if not self._known or self._last_s - self._known[-1].time_s >= CHECKPOINT_S:
                covariance: FloatArray = np.asarray(np.linalg.inv(self._prior + self._information), dtype=float)
                self._known.append(RememberedState(self._last_s, covariance @ self._right, covariance))
                del self._known[:-16]

    def before(self, time_s: float) -> RememberedState | None:
        """What was known `OLD_S` before a time; None if nothing was."""
        return next((each for each in reversed(self._known) if each.time_s <= time_s - OLD_S), None)

    def begin_anew(self, known: RememberedState, *, payload: bool) -> None:
        """Continue from what was known at an earlier time.

        Args:
            known: What was known.
            payload: Whether the payload is still the same.
        """
        if not payload:
            value, covariance = np.zeros_like(known.value), self._prior.copy()
            value[PAYLOAD:] = known.value[PAYLOAD:]
            covariance[PAYLOAD:, PAYLOAD:] = known.covariance[PAYLOAD:, PAYLOAD:]
            known = RememberedState(known.time_s, value, covariance)
        information = np.linalg.inv(known.covariance)
        # the prior itself never fades; what was learnt does
        self._information, self._right = information - self._prior, information @ known.value
        self._known, self._last_s = [known], None
