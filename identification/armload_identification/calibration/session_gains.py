"""Drift of the gains of a calibrated arm: one factor that all its gains have in common in a session.

A run alone cannot show it beside a payload: an error of 1 % of the arm's own torque reads as 3 to 10 % of the payload.
Its prior is the scatter between the calibration's sessions. A reference of the same session, empty or with a weighed
tool, measures it: with x the logarithm of the factor, beside the run's own friction (and the tool),

    measured = exp(-x) (arm + tool)
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from armload_core.arrays import FloatArray
from armload_identification.calibration.calibration_result import FEWEST_SESSIONS, ArmCalibration
from armload_identification.estimation.arm_terms import GAIN
from armload_identification.estimation.empty_arm.known_arm import KnownArm
from armload_identification.estimation.payload_problem import single_problem
from armload_identification.estimation.prior_knowledge import KnownPayload
from armload_identification.estimation.problem import Group, RunRows
from armload_identification.estimation.solve import solve
from armload_identification.estimation.uncertainty import NORMAL_HALF_WIDTH
from armload_identification.model.chain import Chain
from armload_identification.recording.recording import Recording, check_joints
from armload_identification.signals.joint_torque import Transmission
from armload_identification.signals.motion import motion_of
from armload_identification.verdict.recording_checks.effort_mismatch import require_effort
from armload_identification.verdict.recording_checks.sanity import check_run

ASSUMED: Final = 0.01
"""Standard deviation where a calibration has fewer than three sessions."""
LARGEST: Final = 0.2
"""Greatest standard deviation that can be stated."""
LEAST: Final = 0.001
"""Least standard deviation that is not stated: the calibration's own errors, on another motion. Sessions of one
calibration seem alike because the arm's links are fitted to them."""
_STEPS: Final = 3
"""Linearisations: with 5 % of drift the second changes it by 0.1 %."""


@dataclass(frozen=True)
class SessionGains:
    """The common factor of an arm's gains in a session, relative to its calibration.

    Attributes:
        log_factor: Its logarithm; 0 if it was not measured.
        deviation: Standard deviation of that.
        origin: Where the standard deviation is from, in words.
    """

    log_factor: float
    deviation: float
    origin: str

    @classmethod
    def assumed(cls, calibration: ArmCalibration, stated: float | None = None) -> SessionGains:
        """The prior: as stated, else the scatter of the calibration's sessions, else 1 %."""
        if stated is not None:
            return cls(0.0, stated, "as stated")
        known = calibration.session_drift
        if known is not None:
            return cls(0.0, float(np.hypot(known, LEAST)), "as between the sessions of the calibration")
        return cls(0.0, ASSUMED, f"assumed, because the calibration has fewer than {FEWEST_SESSIONS} dated sessions")

    def measured(
        self,
        reference: Recording,
        calibration: ArmCalibration,
        chain: Chain,
        transmission: Transmission,
        mass_kg: float | None,
    ) -> SessionGains:
        """The factor from a reference run of the same session.

        Args:
            reference: A run of any motion, empty or with a weighed tool.
            calibration: The arm.
            chain: The arm as configured.
            transmission: Nominal gains, and coupling.
            mass_kg: Mass of the tool; None if the reference is empty.

        Raises:
            RecordingError: a recording that does not fit the arm, or is invalid.
        """
        check_joints(reference, chain.n)
        known, level = calibration.known_arm(chain), calibration.level(chain)
        require_effort(reference, known.effort)
        found, information = self.log_factor, 0.0
        for _ in range(_STEPS):
            gains = replace(self, log_factor=found).transmission(calibration.transmission(transmission))
            check_run(reference, gains)
            problem = single_problem(motion_of(reference, gains), level, gains.coupling, known)
            (group,) = problem.problem.groups
            empty = replace(problem.problem, groups=[Group((RunRows(group.runs[0].rows),))])
            tool = None if mass_kg is None else KnownPayload(mass_kg=mass_kg).prior()
            posterior = solve(empty if mass_kg is None else problem.knowing(tool), rough=True)
            pull, left = posterior.beside(posterior.groups[0].torque[0].predicted_nm[None])
            information = float(left[0, 0])
            prior = self.deviation**-2.0
            found -= (float(pull[0]) + prior * (found - self.log_factor)) / (information + prior)
        deviation = float(np.hypot((information + self.deviation**-2.0) ** -0.5, min(LEAST, self.deviation)))
        return SessionGains(found, deviation, f"measured by {reference.source.path.name}")

    def transmission(self, calibrated: Transmission) -> Transmission:
        """The gains of the session."""
        factor = float(np.exp(self.log_factor))
        return replace(calibrated, gain_nm_a=factor * calibrated.gain_nm_a, torque_gain=factor * calibrated.torque_gain)

    def note(self, mass_kg: float, considered_kg: float) -> str:
        """What is assumed of the drift, and what it means for the mass.

        Args:
            mass_kg: The mass.
            considered_kg: Its change for one standard deviation of the drift.
        """
        per_percent = abs(considered_kg) / mass_kg / self.deviation
        text = f"Drift of all gains together since the calibration: {100.0 * self.deviation:.2g} % ({self.origin})"
        if self.log_factor:
            found = f"{100.0 * np.expm1(self.log_factor):+.2f} +- {NORMAL_HALF_WIDTH * 100.0 * self.deviation:.2f} %"
            return f"Drift of all gains together since the calibration: {found} ({self.origin}), which is corrected."
        return (
            f"{text}, one standard deviation, is part of the intervals; each 1 % would change the mass by "
            f"{per_percent:.1f} %. A run of the same day, empty or with a weighed tool, measures it: `reference=`."
        )

    def arm(self, known: KnownArm) -> KnownArm:
        """The arm with the factor's error as one of its independent errors."""
        size = known.errors.shape[1]
        gains = next(term.mean.size for term in known.terms if term.name == GAIN)
        error: FloatArray = np.where(np.arange(size) < gains, self.deviation, 0.0)
        return replace(known, errors=np.vstack([known.errors, error]))
