"""The interface that identification and validation need of an arm, without anything that moves it."""

from __future__ import annotations

from pathlib import Path
from typing import Protocol

from armload_core.arrays import FloatArray
from armload_identification.model.chain import Chain
from armload_identification.recording.csv_columns import CsvColumns
from armload_identification.recording.recording import Recording
from armload_identification.signals.joint_torque import Transmission


class MeasuredArm(Protocol):
    """A `Robot`, or a `UrdfArm`."""

    @property
    def file(self) -> str:
        """The file it was read from, for messages."""

    @property
    def name(self) -> str:
        """Name of the robot."""

    @property
    def description(self) -> str:
        """One line that describes the robot."""

    @property
    def sha256(self) -> str:
        """SHA-256 of the file it was read from."""

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
        """Columns of other programs' logs; None if the arm's file does not state them."""

    @property
    def position_limits_rad(self) -> FloatArray:
        """(n, 2) least and greatest position of each joint."""

    @property
    def rated_payload_kg(self) -> float | None:
        """Rated payload; None if unknown."""

    @property
    def calibration_file(self) -> Path | None:
        """The calibration named in the robot file; None if it names none."""

    def own(self, recording: Recording) -> Recording:
        """A recording with this arm's joints, base first.

        Args:
            recording: Any recording; joints that it names are matched by name, others by their order.

        Raises:
            CommissioningError: the recording states another arm.
            RecordingError: the recording has other joints, or no torque usable for this arm.
        """
