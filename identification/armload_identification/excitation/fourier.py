"""Finite Fourier series of the joints and their derivatives.

q_i(t) = q_i0 + sum_k a_ik sin(k w_f t) + b_ik cos(k w_f t)            Chen 2016, eq. (6)
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import accumulate
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from armload_identification.float_array import FloatArray
from armload_identification.identification_errors import ModelError
from armload_identification.model.finite_array import finite_array, set_fields

if TYPE_CHECKING:
    from armload_identification.excitation.limit_margins import LimitMargins

CRITERIA = ("a-optimal", "a-optimal-mean", "a-optimal-max", "d-optimal", "condition-number")
"""Criteria of the design of an excitation."""
MASS_CRITERION = "mass"
"""Criterion of a motion about one configuration: the relative half width of the mass's interval."""
ROBUST_CRITERIA = ("a-optimal-mean", "a-optimal-max")
"""Criteria for a set of payloads."""


class FourierState(NamedTuple):
    """State of a trajectory.

    Attributes:
        position_rad: (n,) for one time, (N, n) for N times; the others alike.
        velocity_rad_s: First derivative.
        acceleration_rad_s2: Second derivative.
        jerk_rad_s3: Third derivative.
    """

    position_rad: FloatArray
    velocity_rad_s: FloatArray
    acceleration_rad_s2: FloatArray
    jerk_rad_s3: FloatArray


@dataclass(frozen=True, eq=False, slots=True)
class FourierBounds:
    """Bounds of a trajectory at all times; each (n,).

    Attributes:
        position_min_rad: Lower bound of the position.
        position_max_rad: Upper bound of the position.
        velocity_max_rad_s: Bound of the speed.
        acceleration_max_rad_s2: Bound of the acceleration's size.
        jerk_max_rad_s3: Bound of the jerk's size.
    """

    position_min_rad: FloatArray
    position_max_rad: FloatArray
    velocity_max_rad_s: FloatArray
    acceleration_max_rad_s2: FloatArray
    jerk_max_rad_s3: FloatArray


@dataclass(frozen=True, eq=False)
class FourierTrajectory:
    """Periodic motion of n joints with H harmonics of one base frequency.

    Attributes:
        base_frequency_hz: w_f / (2 pi).
        offset_rad: (n,) q_i0.
        sin_rad: (n, H) a_ik.
        cos_rad: (n, H) b_ik.

    Raises:
        ModelError: shapes that do not fit, no harmonic, a number that is not finite, a frequency not above 0.
    """

    base_frequency_hz: float
    offset_rad: FloatArray
    sin_rad: FloatArray
    cos_rad: FloatArray
    _all_orders: FloatArray = field(init=False, repr=False)

    def __post_init__(self) -> None:
        if not (np.isfinite(self.base_frequency_hz) and self.base_frequency_hz > 0.0):
            raise ModelError(f"base_frequency_hz is {self.base_frequency_hz}; expected a number above 0")
        sine = finite_array("sin_rad", self.sin_rad, (None, None))
        if not sine.size:
            raise ModelError(f"sin_rad has shape {sine.shape}; expected a joint and a harmonic or more")
        cosine = finite_array("cos_rad", self.cos_rad, sine.shape)
        offset = finite_array("offset_rad", self.offset_rad, sine.shape[:1])
        omega = 2.0 * np.pi * self.base_frequency_hz * np.arange(1, sine.shape[1] + 1)
        # q = Im((a + i b) exp(i k w_f t)), and each derivative has i k w_f times the factor of the one before
        rates = accumulate([1j * omega] * 3, np.multiply, initial=sine + 1j * cosine)
        orders = np.hstack([np.hstack([rate.real, rate.imag]).T for rate in rates])
        set_fields(self, {"offset_rad": offset, "sin_rad": sine, "cos_rad": cosine, "_all_orders": orders})

    @property
    def n(self) -> int:
        """Number of joints."""
        return int(self.sin_rad.shape[0])

    @property
    def harmonics(self) -> int:
        """H."""
        return int(self.sin_rad.shape[1])

    @property
    def period_s(self) -> float:
        """Duration of one period."""
        return 1.0 / self.base_frequency_hz

    def evaluate(self, t_s: ArrayLike) -> FourierState:
        """Position and its first three derivatives, analytically.

        Args:
            t_s: One time, or (N,) times.

        Returns:
            Arrays (n,) or (N, n).
        """
        omega = 2.0 * np.pi * self.base_frequency_hz * np.arange(1, self.harmonics + 1)
        angle = np.asarray(t_s, dtype=np.float64)[..., None] * omega
        return self._state(np.concatenate([np.sin(angle), np.cos(angle)], axis=-1) @ self._all_orders)

    def period(self, samples: int) -> FourierState:
        """One period, by a fast Fourier transform if N > 2 H.

        Args:
            samples: N equidistant samples, the first at time 0.

        Returns:
            Arrays (N, n).
        """
        harmonics = self.harmonics
        if samples <= 2 * harmonics:
            return self.evaluate(np.arange(samples) * (self.period_s / samples))
        spectrum = np.zeros((samples // 2 + 1, self._all_orders.shape[1]), dtype=np.complex128)
        spectrum[1 : harmonics + 1].real = self._all_orders[harmonics:]
        spectrum[1 : harmonics + 1].imag = -self._all_orders[:harmonics]
        return self._state(np.fft.irfft(spectrum * (0.5 * samples), samples, axis=0))

    def _state(self, values: FloatArray) -> FourierState:
        """State of (..., 4 n) values without the offset."""
        position, *rates = np.split(values, 4, axis=-1)
        return FourierState(position + self.offset_rad, *rates)

    def bounds(self) -> FourierBounds:
        """Bounds of the motion at all times, at most 5e-6 of the amplitude too wide.

        A trigonometric polynomial p of degree H, sampled at N > 2 H equidistant points of its period, obeys

            max |p(t)| <= max |p(t_j)| / cos(pi H / N)

        References:
            Ehlich, Zeller, Schwankung von Polynomen zwischen Gitterpunkten, Math. Zeitschrift 86, 1964.
        """
        samples = 1024 * self.harmonics
        widen = 1.0 / np.cos(np.pi * self.harmonics / samples)
        state = self.evaluate(np.arange(samples) * (self.period_s / samples))
        low, high = state.position_rad.min(axis=0), state.position_rad.max(axis=0)
        middle, half = 0.5 * (low + high), 0.5 * (high - low) * widen
        velocity, acceleration, jerk = (np.abs(d).max(axis=0) * widen for d in state[1:])
        return FourierBounds(middle - half, middle + half, velocity, acceleration, jerk)


def fourier_basis(base_frequency_hz: float, harmonics: int, t_s: ArrayLike) -> FloatArray:
    """The columns 1, sin(k w_f t), cos(k w_f t), k = 1 to H, and their first three derivatives.

    Args:
        base_frequency_hz: w_f / (2 pi).
        harmonics: H.
        t_s: (N,) times.

    Returns:
        (4, N, 2 H + 1).
    """
    one, sine, cosine = np.split(np.eye(2 * harmonics + 1), [1, harmonics + 1])
    return np.stack(FourierTrajectory(base_frequency_hz, one[0], sine.T, cosine.T).evaluate(t_s))


@dataclass(frozen=True, eq=False)
class Excitation:
    """A trajectory, the number of periods to drive, and its provenance.

    Attributes:
        trajectory: One period.
        periods: Number of periods that are streamed and recorded.
        design: The file's `[design]`: criterion, cost, condition_number, seed, restarts, command,
            armload_version; empty for a trajectory that was not designed.
        history: Criterion per iteration of the design, to five digits in the file; empty if the file has none.
        margins: Margin of the design to each limit, or None.

    Raises:
        ModelError: fewer than one period.
    """

    trajectory: FourierTrajectory
    periods: int
    design: Mapping[str, str | int | float] = field(default_factory=dict)
    history: tuple[float, ...] = ()
    margins: LimitMargins | None = None

    def __post_init__(self) -> None:
        if self.periods < 1:
            raise ModelError(f"periods is {self.periods}; expected at least 1")
