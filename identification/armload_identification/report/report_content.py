"""Content of a report, without its layout: the payload and its arm, and the available runs and validation."""

from __future__ import annotations

from dataclasses import dataclass

from armload_core.arrays import FloatArray
from armload_identification.model.payload import InertialParameters, PayloadResult
from armload_identification.pipeline.identification_result import Identification
from armload_identification.pipeline.payload_validation import Validation
from armload_identification.recording.recording import RecordingSource
from armload_identification.signals.load_signal import LoadSignal


@dataclass(frozen=True)
class ReportSubject:
    """Subject of the report.

    Attributes:
        robot: Name of the robot.
        description: Description of the robot, in one line.
        joint_names: Names of the joints, from the base to the flange.
        created: Date and time, as printed.
        armload_version: Version of the program.
        simulated: Whether the recordings are of a simulated arm.
        truth: In simulation, the mounted payload in the frame of the result; else None.
        payload: The result, as in the payload file.
    """

    robot: str
    description: str
    joint_names: tuple[str, ...]
    created: str
    armload_version: str
    simulated: bool
    truth: InertialParameters | None
    payload: PayloadResult


@dataclass(frozen=True, eq=False)
class ShownRuns:
    """A pair of runs and a payload's prediction for it.

    Attributes:
        signal: The measured torque difference.
        predicted_nm: (K, n) predicted torque at its samples.
        residual_rms_nm: (n,) RMS of the raw single-sample torque difference minus prediction.
        sources: Sources of the loaded and, if there is one, the unloaded recording.
    """

    signal: LoadSignal
    predicted_nm: FloatArray
    residual_rms_nm: FloatArray
    sources: tuple[RecordingSource, ...]


@dataclass(frozen=True, eq=False)
class ReportContent:
    """Content of a report besides the payload; each part may be missing.

    Attributes:
        identification: The fit, if the payload was identified in this run of the program.
        fitted: The runs from which the payload was identified, if available.
        validation: How well the payload predicts another motion.
        validation_sources: Sources of the validation's recordings.
    """

    identification: Identification | None = None
    fitted: ShownRuns | None = None
    validation: Validation | None = None
    validation_sources: tuple[RecordingSource, ...] = ()

    @classmethod
    def of_identification(cls, identification: Identification, validation: Validation | None = None) -> ReportContent:
        """From an identification, and its validation if there is one."""
        fit = identification
        return cls(fit, ShownRuns(fit.signal, fit.predicted_nm, fit.residual_rms_nm, fit.sources), validation)

    @property
    def motion(self) -> tuple[LoadSignal, RecordingSource | None] | None:
        """The motion to show, and the recording that contains its excitation."""
        if self.fitted is not None:
            return self.fitted.signal, self.fitted.sources[0]
        if self.validation is not None:
            return self.validation.signal, self.validation_sources[0] if self.validation_sources else None
        return None
