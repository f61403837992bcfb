"""Drift of a pair's gains from one of its runs to the other: a factor on all torque of the loaded run.

The difference of the runs then contains that share of the arm's own torque, which is many times the payload's. With x
the logarithm of the gains' factor, beside all other unknowns,

    loaded = exp(-x) (arm + payload),        unloaded = arm

The rows say x +- s. Gears that turn more heavily in the loaded run do so as a whole, their losses by the load included:
a common factor on all friction is estimated beside x, without which 3 % more look like x = -1 % on a simulated prbt.
So are the errors of a calibration: a drift of both runs by 1 % since then would be up to 1 % of x.

x is allowed for and not corrected, as what no friction law describes looks the same: the UR10e's pairs say -0.1 to
-0.4 %, where the weighed payload shows none. With nominal gains only a drift that is noted is allowed for; where a
usual one would matter, a note says so.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from armload_identification.estimation.empty_arm.known_arm import KnownArm
from armload_identification.estimation.estimation_constants import Drift, Payloads
from armload_identification.estimation.normal_equations import GroupState
from armload_identification.estimation.payload_intervals import NORMAL_HALF_WIDTH, ONE_SIDED
from armload_identification.estimation.posterior import Posterior
from armload_identification.estimation.solve import solve
from armload_identification.float_array import FloatArray


@dataclass(frozen=True)
class RunDrift:
    """What a pair says of the drift.

    Attributes:
        log_factor: x, the gains of the loaded run over those of the unloaded one, by the rows alone.
        deviation: s, its standard deviation.
        usual: Standard deviation of the drift that is expected; 0 of nominal gains.
        heard: Whether at least half of the joints fit about as well as in the calibration, if there is one, once the
            drift is corrected. Gears that lose more in one direction look like a drift, but fit no better for it.
    """

    log_factor: float
    deviation: float
    usual: float = 0.0
    heard: bool = True

    @classmethod
    def of(cls, posterior: Posterior, arm: KnownArm | None) -> RunDrift:
        """The drift of a pair's solution."""
        found = cls._from_posterior(posterior, arm)
        if found.size <= Drift.refined:
            return found
        # the other unknowns have taken up a part of it: once more from where it is corrected
        factor = float(np.exp(found.log_factor))
        groups = [group.with_effort(factor * group.runs[0].rows.effort_nm) for group in posterior.problem.groups]
        rest = cls._from_posterior(solve(replace(posterior.problem, groups=groups), rough=True), arm)
        return replace(rest, log_factor=found.log_factor + rest.log_factor)

    @classmethod
    def _from_posterior(cls, posterior: Posterior, arm: KnownArm | None) -> RunDrift:
        """To first order, beside a common factor on the loaded run's friction."""
        pull, information = posterior.beside(
            *(np.stack([state.torque[0].predicted_nm, _friction_nm(state, posterior.x)]) for state in posterior.groups),
            errors=None if arm is None else arm.errors,
        )
        covariance = np.linalg.inv(information + np.diag([0.0, Drift.friction**-2.0]))
        found = -float(covariance[0] @ pull), float(covariance[0, 0]) ** 0.5
        if arm is None:
            return cls(*found)
        noisier = float(np.median(posterior.noise_nm[0] / arm.noise_nm))
        return cls(*found, Drift.between_runs, noisier <= Payloads.noisier)

    @property
    def size(self) -> float:
        """|x| in standard deviations of a pair whose gains drift as usual."""
        return abs(self.log_factor) / float(np.hypot(self.deviation, Drift.between_runs))

    @property
    def allowed(self) -> float:
        """Standard deviation for the intervals: what the rows leave of the usual drift, or all that they say."""
        if self.heard and self.size > (ONE_SIDED if self.usual else Drift.noted):
            return (abs(self.log_factor) + ONE_SIDED * self.deviation) / NORMAL_HALF_WIDTH
        share = self.usual**2 / (self.usual**2 + self.deviation**2)
        return float(np.hypot(share * self.log_factor, np.sqrt(share) * self.deviation))

    def notes(self) -> list[str]:
        """A note if the runs certainly differ."""
        if not self.heard or self.size <= Drift.noted:
            return []
        factor, half_width = 100.0 * np.expm1(self.log_factor), 100.0 * NORMAL_HALF_WIDTH * self.deviation
        return [
            f"The loaded run is as if all gains had drifted by {factor:+.1f} +- {half_width:.1f} % since the unloaded "
            "one, and the intervals allow for that. A constant force on the arm or colder gears look the same. Record "
            "both runs again, one right after the other."
        ]


def _friction_nm(state: GroupState, x: FloatArray) -> FloatArray:
    """(N, n) axis torque by all friction of the loaded run, at the unknowns x."""
    torque = state.torque[0]
    of_joints = [np.einsum("mj,mtj->tj", x[place].reshape(len(term), -1), term) for place, term, _ in torque.joints]
    return np.asarray(torque.gain * (np.sum(of_joints, axis=0) @ state.coupling))
