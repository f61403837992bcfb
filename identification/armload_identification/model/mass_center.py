"""Covariance of a payload's mass and centre of mass, by which two identifications are compared."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from armload_identification.float_array import FloatArray

_NORMAL_95: Final = 1.959964
"""Half width of a 95 % interval in standard deviations."""


@dataclass(frozen=True, eq=False, slots=True)
class MassCenterCovariance:
    """Covariance of [mass, cx, cy, cz] in kg and m, with the drive gains' and the calibration's shares kept separately.

    Two results obtained with the same gains, or with the same calibration, share its errors. In a comparison only the
    difference of their effects on the two matters, which requires the slopes.

    Attributes:
        measured: (4, 4) covariance without these shares.
        freedom: Degrees of freedom of `measured`; inf if it is known exactly.
        gain_nm_a: (n,) gains by which currents, or reported torques, were multiplied; empty without any.
        gain_slope: (4, n) change of the four per change of the logarithm of each gain.
        gain_covariance: (n, n) of the logarithms of the gains.
        calibration_slope: (4, k) change of the four per standard deviation of each independent error of a calibration,
            beyond what its gains explain; k = 0 without one.
    """

    measured: FloatArray
    freedom: float
    gain_nm_a: FloatArray = field(default_factory=lambda: np.zeros(0))
    gain_slope: FloatArray = field(default_factory=lambda: np.zeros((4, 0)))
    gain_covariance: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))
    calibration_slope: FloatArray = field(default_factory=lambda: np.zeros((4, 0)))

    @classmethod
    def from_intervals(cls, interval_95: FloatArray, mass_kg: float) -> MassCenterCovariance:
        """From 95 % intervals only: without correlations, and without separating the gains' share.

        Args:
            interval_95: (4, 2) low and high; nan where a value is not determined.
        """
        deviation = 0.5 * np.diff(interval_95, axis=1)[:, 0] / _NORMAL_95
        known = np.isfinite(deviation)
        return cls(np.diag(np.where(known, deviation, unknown_deviation(mass_kg)) ** 2), np.inf)

    @property
    def held(self) -> FloatArray:
        """(4, 4) the share of gains and calibration."""
        gains = self.gain_slope @ self.gain_covariance @ self.gain_slope.T
        return np.asarray(gains + self.calibration_slope @ self.calibration_slope.T)

    @property
    def total(self) -> FloatArray:
        """(4, 4) everything."""
        return np.asarray(self.measured + self.held)

    def minus(self, other: MassCenterCovariance) -> MassCenterCovariance:
        """Covariance of the difference; its freedom is that of the less certain one, which is at most that of both."""
        measured, freedom = self.measured + other.measured, min(self.freedom, other.freedom)
        if not self.same_gains_as(other):
            return replace(self, measured=measured + other.held, freedom=freedom)
        gains = max((self.gain_covariance, other.gain_covariance), key=np.trace)
        one, two = self.calibration_slope, other.calibration_slope
        calibration = one - two if one.shape == two.shape else np.hstack([one, two])
        slope = self.gain_slope - other.gain_slope
        return MassCenterCovariance(measured, freedom, self.gain_nm_a, slope, gains, calibration)

    def same_gains_as(self, other: MassCenterCovariance) -> bool:
        """Whether both were obtained with the same gains."""
        return self.gain_nm_a.size > 0 and np.array_equal(self.gain_nm_a, other.gain_nm_a)


def moments_slope(mass_kg: float, center_m: FloatArray) -> FloatArray:
    """(4, 4) change of [m, m c] per change of [m, c] of a body."""
    slope = mass_kg * np.eye(4)
    slope[0, 0], slope[1:, 0] = 1.0, center_m
    return slope


def unknown_deviation(mass_kg: float) -> FloatArray:
    """(4,) standard deviations of undetermined values, mass (kg) and 1 m: too wide to affect a comparison."""
    return np.asarray(np.concatenate([[abs(mass_kg)], np.ones(3)]))
