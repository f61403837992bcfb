"""Rows of a run of any motion: means over a third of a second of measured and of modelled quantities.

Torque and regressor pass through the same kernel, (1 - u^2)^2. It is the kernel implied by a cubic's second derivative,
as in the recursive estimator, whose window is shorter to reduce the delay. If only the torque were filtered, jerky
motion would remain in the model: 10 kg on a simulated arm with elastic joints was then identified as 10.6 kg, and with
this kernel as 10.1 kg.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray

from armload_core.arrays import FloatArray
from armload_identification.signals.signal_constants import RowMean

HALF_S: Final = RowMean.half_s
"""For the rooms above."""


@dataclass(frozen=True, eq=False)
class RowWindow:
    """R rows of K equidistant samples.

    Attributes:
        middle: (R,) index of the sample in the middle of each row.
        offset: (w,) indices of a row's samples relative to its middle.
        interval_s: Time between samples.
        length: K.
        periodic: The last sample is followed by the first.
        half_s: Half of the window.
    """

    middle: NDArray[np.intp]
    offset: NDArray[np.intp]
    interval_s: float
    length: int
    periodic: bool
    half_s: float

    @classmethod
    def of(
        cls, length: int, interval_s: float, step: int, *, periodic: bool = False, half_s: float = HALF_S
    ) -> RowWindow:
        """Rows about every `step`-th of `length` samples; in a periodic run the last is followed by the first."""
        reach = int(half_s / interval_s)
        return cls(np.arange(0, length, step), np.arange(-reach, reach + 1), interval_s, length, periodic, half_s)

    def only(self, rows: NDArray[np.bool_]) -> RowWindow:
        """The rows for which (R,) is True."""
        return replace(self, middle=self.middle[rows])

    def every(self, step: int) -> RowWindow:
        """The same rows of every `step`-th sample of their windows, counted from the middle."""
        reach = int(self.offset[-1]) // step
        return replace(self, offset=step * np.arange(-reach, reach + 1))

    @cached_property
    def weight(self) -> FloatArray:
        """(w,) weights of a row's samples, with a sum of 1."""
        weight = (1.0 - self._share**2) ** 2
        return np.asarray(weight / weight.sum())

    @cached_property
    def slope_weight(self) -> FloatArray:
        """(w,) weights of a row's samples that give the derivative of its mean, per s; exact for a straight line.

        They are 0 if a row has a single sample.
        """
        slope = self._share * (1.0 - self._share**2)
        rise = np.full_like(slope, slope @ self._share * self.half_s)
        return np.divide(slope, rise, out=np.zeros_like(slope), where=rise > 0.0)

    @property
    def _share(self) -> FloatArray:
        """(w,) u: time from the row's middle as a share of half the window."""
        return np.asarray(self.offset * self.interval_s / self.half_s)

    @cached_property
    def samples(self) -> NDArray[np.intp]:
        """(R, w) indices of each row's samples; beyond either end of the run, of its last one."""
        at = self.middle[:, None] + self.offset
        return np.asarray(at % self.length if self.periodic else np.clip(at, 0, self.length - 1))

    @property
    def whole(self) -> NDArray[np.bool_]:
        """(R,) False at both ends of a run that is not periodic, where the window is incomplete."""
        inside = (self.middle + self.offset[0] >= 0) & (self.middle + self.offset[-1] < self.length)
        return np.asarray(inside | self.periodic)

    def mean(self, values: FloatArray) -> FloatArray:
        """(R, ...) weighted means of (K, ...) values."""
        return weighted_sums(values, self.samples, self.weight)

    def slope(self, values: FloatArray) -> FloatArray:
        """(R, ...) derivatives of the weighted means of (K, ...) values, per s."""
        return weighted_sums(values, self.samples, self.slope_weight)

    def usable(self, valid: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """(R,) True for rows with a complete window of samples that are all True in (K,)."""
        return np.asarray(self.whole & (self.mean(np.asarray(~valid, dtype=np.float64)) == 0.0))

    def onward(self, direction: FloatArray) -> FloatArray:
        """(R, n) weights by (K, n) directions, -1 to 1: 1 if a joint keeps its own, 0 if it reverses or stands."""
        return np.asarray(np.maximum((np.abs(self.mean(direction)) - RowMean.onward) / (1.0 - RowMean.onward), 0.0))


def weighted_sums(values: FloatArray, samples: NDArray[np.intp], weights: FloatArray) -> FloatArray:
    """(R, ...) sums over the (R, w) samples of each row of (K, ...) values, with (w,) weights."""
    found = np.zeros((len(samples), *values.shape[1:]))
    for places, weight in zip(samples.T, weights, strict=True):
        found += weight * values[places]
    return found
