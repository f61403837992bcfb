"""Drift of the gains of a calibrated arm: one factor that all its gains have in common in a session.

An error of 1 % of the arm's own torque reads as 3 to 10 % of the payload. Its prior is the scatter between the
calibration's sessions. With x the logarithm of the factor, beside the run's own friction and what the arm carries,

    measured = exp(-x) (arm + payload)

A reference of the same session, empty or with a weighed tool, measures it. The identified run itself says how large it
can be, because the arm's torque has another course than the payload's. It is not corrected by that: gears that are
still cold look the same (on the UR10e, 0.5 % on 31 January, where there was no drift).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np

from armload_identification.calibration.calibration_result import FEWEST_SESSIONS, ArmCalibration
from armload_identification.estimation.empty_arm.known_arm import KnownArm
from armload_identification.estimation.estimation_constants import Drift
from armload_identification.estimation.payload_intervals import NORMAL_HALF_WIDTH, ONE_SIDED
from armload_identification.estimation.payload_problem import single_problem
from armload_identification.estimation.prior_knowledge import KnownPayload
from armload_identification.estimation.problem import Group, RunRows
from armload_identification.estimation.solve import solve
from armload_identification.float_array import FloatArray
from armload_identification.model.chain import Chain
from armload_identification.recording.recording import Recording
from armload_identification.signals.joint_torque import Transmission
from armload_identification.verdict.recording_checks.usable_runs import usable_runs

ASSUMED: Final = 0.01
"""Standard deviation where a calibration has fewer than three sessions."""
LARGEST: Final = 0.2
"""Greatest standard deviation that can be stated."""
LEAST: Final = 0.001
"""Of the calibration's sessions, which seem alike because the arm's links are fitted to them, and of what a run says: a
standard deviation for what no term describes on another motion."""
OF_REFERENCE: Final = 0.003
"""The same of a drift that a reference has measured: on 31 January the UR10e's empty run says -0.4 %, the loaded one
-0.5 %, where the weighed payload shows none."""
REFERENCE: Final = "`--reference` / `StatedDrift(reference=...)`"
"""How such a run is given, on the command line and in Python."""
_STEPS: Final = 3
"""Linearisations: with 5 % of drift the second changes it by 0.1 %."""


class ConfiguredArm(NamedTuple):
    """An arm as configured, and its calibration.

    Attributes:
        calibration: Its calibration.
        chain: Its kinematics, without the tilt of the calibration.
        transmission: Nominal gains, and coupling.
    """

    calibration: ArmCalibration
    chain: Chain
    transmission: Transmission


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
            return cls(0.0, float(np.hypot(known, LEAST)), "the scatter between the calibration's sessions")
        return cls(0.0, ASSUMED, f"assumed because the calibration has fewer than {FEWEST_SESSIONS} dated sessions")

    def measured(self, reference: Recording, arm: ConfiguredArm, mass_kg: float | None) -> SessionGains:
        """The factor from a reference run of the same session.

        Args:
            reference: A run of any motion, empty or with a weighed tool.
            arm: Its arm.
            mass_kg: Mass of the tool; None if the reference is empty.

        Raises:
            RecordingError: a recording that does not fit the arm, or is invalid.
        """
        tool = None if mass_kg is None else KnownPayload(mass_kg=mass_kg)
        found, deviation = self._with_prior(*_factor_in(reference, arm, tool))
        whole = float(np.hypot(deviation, min(OF_REFERENCE, self.deviation)))
        origin = f"measured by {reference.source.path.name}"
        if abs(found) > Drift.noted * np.hypot(self.deviation, OF_REFERENCE):
            origin += ", far more than expected: check that it is of the same day and carried what is stated"
        return SessionGains(found, whole, origin)

    def within(self, run: Recording, arm: ConfiguredArm, *, loaded: bool) -> SessionGains:
        """As much of it as a run of the session leaves possible, as of `beside`.

        Args:
            run: The run.
            arm: Its arm.
            loaded: Whether it carried the payload; else nothing.
        """
        return self.beside(*_factor_in(run, arm, KnownPayload() if loaded else None))

    def beside(self, said: float, deviation: float) -> SessionGains:
        """The same from what a motion with the gains of this session says of an error of the factor.

        The interval is from zero, because the error is not corrected, to where the factor may be. A motion that
        certainly contradicts what was known before counts alone.

        Args:
            said: Its logarithm if nothing else is known of it.
            deviation: Standard deviation of that.
        """
        if self.log_factor:
            return self
        percent, known = 100.0 * np.expm1(said), f"{100.0 * self.deviation:.2g} %, {self.origin}"
        if abs(said) > Drift.noted * np.hypot(deviation, self.deviation):
            found, left, origin = said, deviation, f"the run indicates {percent:+.1f} %, which contradicts {known}"
        else:
            found, left = self._with_prior(said, deviation)
            speaks = f", which alone indicates {percent:+.1f} %" if abs(found) > Drift.noted * left else ""
            origin = f"from {known}, and from the run itself{speaks}"
        reach = max(NORMAL_HALF_WIDTH * left, abs(found) + ONE_SIDED * left)
        return SessionGains(self.log_factor, reach / NORMAL_HALF_WIDTH, origin)

    def _with_prior(self, said: float, deviation: float) -> tuple[float, float]:
        """What a run says by itself and its standard deviation, together with what is assumed."""
        precision = deviation**-2.0 + self.deviation**-2.0
        return said * deviation**-2.0 / precision, precision**-0.5

    def corrected(self, calibration: ArmCalibration) -> ArmCalibration:
        """The calibration with the gains of the session."""
        return replace(calibration, gain_nm_a=float(np.exp(self.log_factor)) * calibration.gain_nm_a)

    def note(self, mass_kg: float, considered_kg: float) -> str:
        """What is assumed of the drift, and what it means for the mass.

        Args:
            considered_kg: Its change for one standard deviation of the drift.
        """
        per_percent = abs(considered_kg) / mass_kg / self.deviation
        if self.log_factor:
            found = f"{100.0 * np.expm1(self.log_factor):+.2f} +- {NORMAL_HALF_WIDTH * 100.0 * self.deviation:.2f} %"
            return f"The drift of all gains together since the calibration is corrected: {found} ({self.origin})."
        return (
            "The intervals allow for a drift of all gains together since the calibration: one standard deviation is "
            f"{100.0 * self.deviation:.2g} % ({self.origin}); a drift of 1 % would change the mass by "
            f"{per_percent:.1f} %. A run of the same day, empty or with a weighed tool, measures it: {REFERENCE}."
        )

    def arm(self, known: KnownArm) -> KnownArm:
        """The arm with the factor's error as one of its independent errors."""
        error: FloatArray = np.where(np.arange(known.errors.shape[1]) < known.body.n, self.deviation, 0.0)
        return replace(known, errors=np.vstack([known.errors, error]))


def _factor_in(run: Recording, arm: ConfiguredArm, carried: KnownPayload | None) -> tuple[float, float]:
    """The logarithm of the factor by a run alone, with a payload or without, and its standard deviation.

    The prior counts only afterwards: held by it, 5 % would remain as residual, count as noise, and hide themselves.
    """
    calibration, chain, nominal = arm
    known, level, gains = calibration.known_arm, calibration.level(chain), calibration.transmission(nominal)
    motion = usable_runs([run], chain.n, gains, known.effort)[0].motion
    # Errors of the calibration count in a loaded run, where they look like the payload. An empty run shows them itself.
    errors = None if carried is None else known.errors
    found, information, free = 0.0, 0.0, LARGEST**-2.0
    for _ in range(_STEPS):
        now = motion.with_torque_times(np.exp(found) * np.eye(chain.n))
        problem = single_problem(now, level, gains.coupling, known).knowing(carried.prior() if carried else None)
        if carried is None:
            (group,) = problem.groups
            problem = replace(problem, groups=[Group((RunRows(group.runs[0].rows),))])
        posterior = solve(problem, rough=True)
        pull, left = posterior.beside(posterior.groups[0].torque[0].predicted_nm[None], errors=errors)
        information = float(left[0, 0])
        found -= (float(pull[0]) + free * found) / (information + free)
    return found, float(np.hypot(information**-0.5, LEAST))
