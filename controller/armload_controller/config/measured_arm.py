"""An arm whose recordings are evaluated: what identification and validation need of it, and nothing that moves it."""

from __future__ import annotations

from pathlib import Path
from typing import Protocol

from armload_identification.model.chain import Chain
from armload_identification.recording.csv_columns import CsvColumns
from armload_identification.recording.recording import Recording
from armload_identification.signals.joint_torque import Transmission


class MeasuredArm(Protocol):
    """A `Robot`, or a `UrdfArm`."""

    @property
    def file(self) -> str:
        """Where it was read from, for messages."""

    @property
    def name(self) -> str:
        """Name of the robot."""

    @property
    def description(self) -> str:
        """What the robot is, in a line."""

    @property
    def sha256(self) -> str:
        """Hash of what it was read from."""

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints, from the base to the flange."""

    @property
    def chain(self) -> Chain:
        """Kinematics up to the flange, and gravity."""

    @property
    def transmission(self) -> Transmission:
        """How motor currents become joint torques."""

    @property
    def csv_columns(self) -> CsvColumns | None:
        """Columns of other programs' logs; None where the arm's file does not say."""

    @property
    def calibration_file(self) -> Path | None:
        """The calibration that the arm's file names; None where it names none."""

    def own(self, recording: Recording) -> Recording:
        """A recording as one of this arm: its joints, base first.

        Args:
            recording: Any recording; joints that it names are matched by name, others by their order.

        Raises:
            CommissioningError: it says that it was recorded on another arm.
            RecordingError: it has other joints, or nothing that is a torque for this arm.
        """
