"""Friction of an arm's gears that changes from day to day and from run to run, as the priors state it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from armload_drivers.simulation.plant_spec import PlantJoint
from armload_identification.calibration.calibration_result import COLD
from armload_identification.estimation.arm_terms import WITHIN_HOURS
from armload_identification.float_array import FloatArray
from benchmarks.arms.steady_state import SteadyPeriod

_TURNS = 0.01
"""Share of the greatest speed around a reversal in which a change of Coulomb friction turns over."""


@dataclass(frozen=True, eq=False)
class Gears:
    """Friction of n gears.

    Attributes:
        coulomb_nm: (n,) Coulomb friction.
        viscous_nm_s_rad: (n,) viscous friction.
    """

    coulomb_nm: FloatArray
    viscous_nm_s_rad: FloatArray

    @staticmethod
    def of(joints: Sequence[PlantJoint]) -> Gears:
        """The gears of simulated joints."""
        return Gears(*(np.array([getattr(one, name) for one in joints]) for name in ("coulomb_nm", "viscous_nm_s_rad")))

    def day(self, rng: np.random.Generator) -> FloatArray:
        """(3, n) changes of a day's Coulomb friction, viscous friction and offset."""
        steady = np.stack([self.coulomb_nm, self.viscous_nm_s_rad, 0.0 * self.coulomb_nm])
        return np.asarray(COLD * steady * rng.normal(size=steady.shape))

    def changed_nm(self, speed: FloatArray, day: FloatArray | float, rng: np.random.Generator) -> FloatArray:
        """(K, n) torque of one run beyond that of the friction.

        Args:
            speed: (K, n) of the joints, of all samples of a run.
            day: (3, n) changes of the day; 0 for none.
        """
        peak = np.abs(speed).max(axis=0)
        friction = self.coulomb_nm + 0.5 * self.viscous_nm_s_rad * peak
        size = WITHIN_HOURS[:, None] * np.stack([friction, 2.0 * friction / peak, friction])
        coulomb, viscous, offset = day + size * rng.normal(size=size.shape)
        return np.asarray(coulomb * speed / np.hypot(speed, _TURNS * peak) + viscous * speed + offset)

    def run(
        self, period: SteadyPeriod, coupling: FloatArray, day: FloatArray | float, rng: np.random.Generator
    ) -> SteadyPeriod:
        """A period and its slow round with the friction of a day and of one run."""
        n = self.coulomb_nm.size
        slow = period.slow_position_rad.reshape(-1, n)
        slowly = np.asarray(np.gradient(slow, axis=0)) if len(slow) else slow
        ends = np.vstack([period.axis_position_rad[-1:], period.axis_position_rad, period.axis_position_rad[:1]])
        speed = np.vstack([slowly, np.gradient(ends, axis=0)[1:-1]]) @ coupling.T / period.sample_s
        changed = self.changed_nm(speed, day, rng) @ coupling
        return replace(
            period,
            axis_torque_nm=period.axis_torque_nm + changed[len(slow) :],
            slow_torque_nm=period.slow_torque_nm.reshape(-1, n) + changed[: len(slow)],
        )
