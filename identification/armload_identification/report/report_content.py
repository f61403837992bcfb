"""Content of a report, without its layout: the payload and its arm, and the available runs and validation."""

from __future__ import annotations

from dataclasses import dataclass

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
class ReportContent:
    """Content of a report besides the payload; each part may be missing.

    Attributes:
        fitted: The runs from which the payload was identified: their fit if that was in this run of the program, else
            a comparison of them with the payload.
        validation: How well the payload predicts another motion.
    """

    fitted: Identification | Validation | None = None
    validation: Validation | None = None

    @property
    def identification(self) -> Identification | None:
        """The fit, if the payload was identified in this run of the program."""
        return self.fitted if isinstance(self.fitted, Identification) else None

    @property
    def sources(self) -> tuple[tuple[RecordingSource, ...], tuple[RecordingSource, ...]]:
        """Sources of the recordings fitted, and of those of the validation."""
        fitted, validating = (() if runs is None else runs.sources for runs in (self.fitted, self.validation))
        return fitted, validating

    @property
    def motion(self) -> tuple[LoadSignal, RecordingSource] | None:
        """The motion to show, and the recording that contains its excitation."""
        runs = self.fitted or self.validation
        return None if runs is None else (runs.signal, runs.sources[0])
