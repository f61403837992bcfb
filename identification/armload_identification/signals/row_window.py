"""Rows of a run of any motion: means over a third of a second of measured and of modelled quantities.

Torque and regressor pass through the same kernel, (1 - u^2)^2. It is the kernel implied by a cubic's second derivative,
as in the recursive estimator, whose window is shorter to reduce the delay. If only the torque were filtered, jerky
motion would remain in the model: 10 kg on a simulated arm with elastic joints was then identified as 10.6 kg, and with
this kernel as 10.1 kg.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from armload_core.arrays import FloatArray

HALF_S: Final = 0.16
_ONWARD: Final = 0.95
"""Mean direction over the window from which a joint's row has a weight."""


@dataclass(frozen=True, eq=False)
class RowWindow:
    """R rows of K equidistant samples.

    Attributes:
        middle: (R,) index of the sample in the middle of each row.
        offset: (w,) indices of a row's samples relative to its middle.
        weight: (w,) their weights, with a sum of 1.
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
            step: Samples from row to row.
        """
        reach = int(HALF_S / interval_s)
        offset = np.arange(-reach, reach + 1)
        weight = (1.0 - (offset * interval_s / HALF_S) ** 2) ** 2
        return cls(np.arange(0, samples, step), offset, weight / weight.sum(), samples)

    @property
    def whole(self) -> NDArray[np.bool_]:
        """(R,) False at both ends of the run, where the window is incomplete."""
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
        """(R,) True for rows with a complete window of valid samples.

        Args:
            valid: (K,) False for invalid samples.
        """
        return np.asarray(self.whole & (self.mean(np.asarray(~valid, dtype=np.float64)) == 0.0))

    def onward(self, direction: FloatArray) -> FloatArray:
        """(R, n) weight: 1 if a joint keeps its direction in the row's window, 0 if it reverses or stands still.

        Args:
            direction: (K, n) direction of motion, -1 to 1.
        """
        return np.asarray(np.maximum((np.abs(self.mean(direction)) - _ONWARD) / (1.0 - _ONWARD), 0.0))
