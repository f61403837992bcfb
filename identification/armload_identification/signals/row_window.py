"""Rows of a run of any motion: means over a third of a second, of what was measured and of what a model makes of it.

Torque, and all that explains it, goes through one kernel, (1 - u^2)^2: the one that a cubic's second derivative
implies, as in the recursive estimator, whose window is shorter, as its user waits for it. A filter that torque alone
goes through takes from jerky motion what the model still has: 10 kg on a simulated arm with elastic joints came out as
10.6 kg, and as 10.1 kg through this one.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from armload_core.arrays import FloatArray

HALF_S: Final = 0.16
_ONWARD: Final = 0.95
"""Share of the window for which a joint moves one way, from which on its row counts."""


@dataclass(frozen=True, eq=False)
class RowWindow:
    """R rows of K equidistant samples.

    Attributes:
        middle: (R,) the sample in the middle of each row.
        offset: (w,) samples of a row, from its middle on.
        weight: (w,) of these; their sum is 1.
        samples: K.
    """

    middle: NDArray[np.intp]
    offset: NDArray[np.intp]
    weight: FloatArray
    samples: int

    @classmethod
    def of(cls, samples: int, interval_s: float, step: int) -> RowWindow:
        """Rows about every `step`-th sample.

        Args:
            samples: K.
            interval_s: Time between samples.
            step: How many of them from row to row.
        """
        reach = int(HALF_S / interval_s)
        offset = np.arange(-reach, reach + 1)
        weight = (1.0 - (offset * interval_s / HALF_S) ** 2) ** 2
        return cls(np.arange(0, samples, step), offset, weight / weight.sum(), samples)

    @property
    def whole(self) -> NDArray[np.bool_]:
        """(R,) False at either end of the run, where a part of the window is missing."""
        return np.asarray((self.middle + self.offset[0] >= 0) & (self.middle + self.offset[-1] < self.samples))

    def mean(self, values: FloatArray) -> FloatArray:
        """(R, ...) weighted means.

        Args:
            values: (K, ...).
        """
        found = np.zeros((self.middle.size, *values.shape[1:]))
        for offset, weight in zip(self.offset, self.weight, strict=True):
            found += weight * values[np.clip(self.middle + offset, 0, self.samples - 1)]
        return found

    def usable(self, valid: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """(R,) rows whose window is whole and without a hole.

        Args:
            valid: (K,) False in a hole.
        """
        return np.asarray(self.whole & (self.mean(np.asarray(~valid, dtype=np.float64)) == 0.0))

    def onward(self, direction: FloatArray) -> FloatArray:
        """(R, n) weight, 0 to 1, of rows in whose window a joint moves one way; where it turns or stands it is 0.

        Args:
            direction: (K, n) of the motion, -1 to 1.
        """
        return np.asarray(np.maximum((np.abs(self.mean(direction)) - _ONWARD) / (1.0 - _ONWARD), 0.0))
