"""A payload with everything that is reported of it, without layout: its arm, runs and validation."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from armload_identification.model.payload import InertialParameters, PayloadResult
from armload_identification.pipeline.identification_result import Identification
from armload_identification.pipeline.payload_validation import Validation
from armload_identification.recording.recording import RecordingSource
from armload_identification.report.verdict_box import VerdictBox, verdict_box
from armload_identification.signals.motion import Motion


class ArmDescription(Protocol):
    """What results contain about an arm; implemented by a robot of the configuration."""

    @property
    def name(self) -> str:
        """Name of the robot."""

    @property
    def description(self) -> str:
        """Description of the robot, in one line."""

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints, from the base to the flange."""


@dataclass(frozen=True, eq=False, repr=False)
class ReportedPayload:
    """A payload with everything known about it; runs and validation may be missing.

    Attributes:
        arm: The arm that carried it.
        payload: Its values, intervals and provenance: the content of the payload file.
        fitted: The runs from which the payload was identified: their fit if that was in this run of the program, else
            a comparison of them with the payload.
        validation: How well the payload predicts another motion.
        truth: In simulation, the mounted payload in the frame of the result; else None.
    """

    arm: ArmDescription
    payload: PayloadResult
    fitted: Identification | Validation | None = None
    validation: Validation | None = None
    truth: InertialParameters | None = None

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
    def motion(self) -> tuple[Motion, RecordingSource] | None:
        """The motion to show, and the recording that contains its excitation."""
        runs = self.fitted or self.validation
        return None if runs is None else (runs.signal.loaded, runs.sources[0])

    @property
    def verdict(self) -> VerdictBox:
        """Result of the validation in words."""
        return verdict_box(self.validation, self.arm.joint_names)

    @property
    def simulated(self) -> bool:
        """Whether every recording is marked as made with a simulated arm."""
        sources = [source for of_runs in self.sources for source in of_runs]
        return bool(sources) and all(source.run().get("simulated", False) for source in sources)
