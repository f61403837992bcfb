"""The drift of a calibrated arm's gains, as stated by a number or to be measured by a reference run of the session."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from armload_controller.analysis.arm_in_use import ArmInUse
from armload_controller.config.objects_or_paths import RunSource, recording_of
from armload_controller.config.robot_recordings import MeasuredArm
from armload_identification.calibration.session_gains import LARGEST, ConfiguredArm, SessionGains
from armload_identification.identification_errors import EstimationError
from armload_identification.recording.recording import Recording


@dataclass(frozen=True, eq=False)
class StatedDrift:
    """What is stated of the drift.

    Attributes:
        gain_drift: Standard deviation of the drift that all gains have in common since the calibration, such as 0.03;
            None for that between the calibration's sessions, else 1 %.
        reference: A run of the same day and of any motion, empty or with a weighed tool, which measures the drift.
        reference_mass_kg: Mass of that tool; None if the reference is empty.

    Examples:
        >>> import armload
        >>> run = "runs/today/{}_identification.mcap".format
        >>> calibration = armload.calibrate("er50", [run("unloaded"), run("loaded")])
        >>> stated = armload.StatedDrift(0.03, reference=run("unloaded"))
        >>> result = armload.identify("er50", run("loaded"), calibration=calibration, drift=stated)
        >>> 9 < result.payload.model.mass_kg < 11
        True
    """

    gain_drift: float | None = None
    reference: RunSource | None = None
    reference_mass_kg: float | None = None

    def session(
        self, arm: MeasuredArm, used: ArmInUse, loaded: Recording | None = None, empty: Recording | None = None
    ) -> SessionGains | None:
        """The drift as measured by the reference, else as far as runs leave it possible; None without a calibration.

        Args:
            arm: The arm.
            used: Its model in use.
            loaded: The run with the payload, to see how large the drift can be.
            empty: The run without it, instead; it measures the drift if that is stated without a reference.

        Raises:
            EstimationError: a value that cannot be used, or a statement about an arm that is not calibrated.
            RecordingError: the reference does not fit the arm, or is invalid.
        """
        drift, mass_kg = self.gain_drift, self.reference_mass_kg
        if drift is not None and not 0.0 < drift <= LARGEST:
            raise EstimationError(
                f"gain_drift is {drift:g}: expected a standard deviation above 0 and at most {LARGEST:g}, such as "
                "0.03 for 3 %"
            )
        if mass_kg is not None and (self.reference is None or not mass_kg > 0.0):
            raise EstimationError(
                f"reference_mass_kg is {mass_kg:g}: expected the tool's mass in kg, above 0, and the run that carries "
                "it as `reference=`"
            )
        if used.calibration is None:
            if drift is None and self.reference is None:
                return None
            raise EstimationError(
                "a drift of the gains since a calibration, or a reference for it, requires the arm's calibration: "
                "give that file as `calibration=`, or omit `gain_drift=` and `reference=`."
            )
        session = SessionGains.assumed(used.calibration, drift)
        about = ConfiguredArm(used.calibration, arm.chain, arm.transmission)
        if self.reference is not None:
            return session.measured(recording_of(arm, self.reference, "reference"), about, mass_kg)
        if empty is not None and drift is not None:
            return session.measured(empty, about, None)
        run = loaded if empty is None else empty
        return session if run is None else session.within(run, about, loaded=empty is None)


NOTHING_STATED: Final = StatedDrift()
"""The drift is assumed."""
