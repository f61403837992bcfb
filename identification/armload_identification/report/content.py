"""What a report is about: the payload and its arm, and the runs and judgements there are. Nothing here draws."""

from __future__ import annotations

from dataclasses import dataclass

from armload_core.arrays import FloatArray
from armload_identification.model.payload import InertialParameters, PayloadResult
from armload_identification.pipeline.identification import Identification
from armload_identification.pipeline.payload_validation import Validation
from armload_identification.recording.recording import RecordingSource
from armload_identification.signals.load_signal import LoadSignal


@dataclass(frozen=True)
class ReportSubject:
    """What the report is about.

    Attributes:
        robot: Name of the robot.
        description: What it is, in a line.
        joint_names: Names of the joints, from the base to the flange.
        created: Date and time, as they are to be printed.
        armload_version: Version of the program.
        simulated: The recordings are of a simulated arm.
        truth: In simulation, the payload in the frame of the result; else None.
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
    """A pair of runs and what a payload makes of it.

    Attributes:
        signal: The measured torque difference.
        predicted_nm: (K, n) torque that is predicted at its samples.
        residual_rms_nm: (n,) RMS of the raw single-sample torque difference minus prediction.
        sources: Of the loaded and, where there is one, the unloaded recording.
    """

    signal: LoadSignal
    predicted_nm: FloatArray
    residual_rms_nm: FloatArray
    sources: tuple[RecordingSource, ...]


@dataclass(frozen=True, eq=False)
class ReportContent:
    """What there is to report beside the payload; each part may be missing.

    Attributes:
        identification: The fit, where the payload was identified in this run of the program.
        fitted: The runs that the payload was identified from, where they are at hand.
        validation: How well the payload predicts another motion.
        validation_sources: Of the validation's recordings.
    """

    identification: Identification | None = None
    fitted: ShownRuns | None = None
    validation: Validation | None = None
    validation_sources: tuple[RecordingSource, ...] = ()

    @classmethod
    def of_identification(
        cls,
        identification: Identification,
        validation: Validation | None = None,
        validation_sources: tuple[RecordingSource, ...] = (),
    ) -> ReportContent:
        """An identification, and its validation where there is one."""
        fitted = ShownRuns(
            identification.signal,
            identification.predicted_nm,
            identification.residual_rms_nm,
            identification.sources,
        )
        return cls(identification, fitted, validation, validation_sources)

    @property
    def motion(self) -> tuple[LoadSignal, RecordingSource | None] | None:
        """The motion to show, and the recording that says how it was planned."""
        if self.fitted is not None:
            return self.fitted.signal, self.fitted.sources[0]
        if self.validation is not None:
            return self.validation.signal, self.validation_sources[0] if self.validation_sources else None
        return None
