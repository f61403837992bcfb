"""The runs that an arm is calibrated from, and what it carried in each."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from armload_identification.estimation.prior_knowledge import KnownPayload, Prior
from armload_identification.estimation.problem import Known
from armload_identification.model.payload import InertialParameters
from armload_identification.model.regressor import PARAMETERS
from armload_identification.recording.recording import Recording

WEIGHED_WITHIN: Final = 1e-3
"""Relative standard deviation of a weighed mass, and of a completely known payload."""


@dataclass(frozen=True, eq=False)
class MountedRun:
    """A run and its payload.

    Attributes:
        recording: The run.
        mounting: Name of the payload as mounted; empty for an empty arm.
        recorded: Date and time of its start, ISO 8601; from the recording if empty.
    """

    recording: Recording
    mounting: str
    recorded: str = ""


@dataclass(frozen=True, eq=False)
class WeighedPayload:
    """A payload with known mass.

    Attributes:
        mass_kg: From a scale.
        whole: All ten parameters, in the flange frame; None if only the mass is known.
    """

    mass_kg: float
    whole: InertialParameters | None = None

    def known(self, mounting: str) -> Known:
        """As knowledge of the payload of a mounting.

        Args:
            mounting: Its name.
        """
        if self.whole is not None:
            return KnownPayload(cad=self.whole, confidence=WEIGHED_WITHIN).prior().known(mounting)
        mass = np.eye(1, PARAMETERS) / (WEIGHED_WITHIN * self.mass_kg)
        return Prior(mass, np.array([1.0 / WEIGHED_WITHIN])).known(mounting)


@dataclass(frozen=True, eq=False)
class ArmRuns:
    """All runs of an arm.

    Attributes:
        runs: Runs with their mounting.
        weighed: Known payloads, by mounting.
        left_out: File name and reason for each recording that could not be read.
    """

    runs: tuple[MountedRun, ...]
    weighed: Mapping[str, WeighedPayload]
    left_out: tuple[tuple[str, str], ...] = ()
