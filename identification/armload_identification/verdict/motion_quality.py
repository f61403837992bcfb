"""Whether a motion shows what a payload weighs, and which motion is missing where it does not."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from armload_core.arrays import FloatArray
from armload_identification.estimation.empty_arm.known_arm_fit import MOVING
from armload_identification.identification_errors import EstimationError
from armload_identification.model.body_model import BodyModel
from armload_identification.signals.motion import Motion

_COUNTS_S: Final = 1.0
"""A joint that moves for less says nothing."""
_LEAST_JOINTS: Final = 2
_ENOUGH_S: Final = 5.0
_BRISK_RAD_S: Final = 0.3
_OF_PEAK: Final = 0.5
_LONG_S: Final = 10.0


@dataclass(frozen=True, eq=False)
class MotionQuality:
    """How much the joints move, n joints.

    Attributes:
        moving_s: (n,) time for which each joint is faster than where its friction is known.
        brisk_rad_s: (n,) speed at which a joint shows its load well.
    """

    moving_s: FloatArray
    brisk_rad_s: FloatArray

    @classmethod
    def of(cls, motion: Motion, body: BodyModel) -> MotionQuality:
        """The quality of a motion.

        Args:
            motion: What was measured.
            body: The calibrated arm.
        """
        slowest = MOVING * body.reversal_speed_rad_s
        fast = np.abs(motion.states.velocity_rad_s[motion.valid]) > slowest
        peak = MOVING * slowest
        return cls(motion.interval_s * np.count_nonzero(fast, axis=0), np.minimum(_BRISK_RAD_S, _OF_PEAK * peak))

    @property
    def share(self) -> float:
        """0 to 1: how many of the joints move for long enough."""
        return float(np.mean(np.minimum(self.moving_s / _ENOUGH_S, 1.0)))

    @property
    def missing(self) -> str:
        """What to do for a better estimate: 'move joints 4 to 6 at 0.3 rad/s for 10 s'; empty where all joints move."""
        lazy = self.moving_s < _ENOUGH_S
        if not lazy.any():
            return ""
        return f"move {_joints(lazy)} at {self.brisk_rad_s[lazy].min():.2g} rad/s for {_LONG_S:g} s"

    def require_enough(self, name: str) -> None:
        """Refuse standstill, and motion of a single joint.

        Args:
            name: What messages call the run.

        Raises:
            EstimationError: saying which motion is missing.
        """
        moves = self.moving_s >= _COUNTS_S
        if np.count_nonzero(moves) >= min(_LEAST_JOINTS, moves.size):
            return
        seen = f"only {_joints(moves)} moves" if moves.any() else "the arm is at rest, or nearly so"
        raise EstimationError(
            f"{name}: {seen}, and friction at rest hides the payload. To determine the payload, {self.missing}."
        )

    def undetermined(self, name: str, mass_kg: float, half_width_kg: float) -> EstimationError:
        """The error for a mass that the motion does not determine.

        Args:
            name: What messages call the run.
            mass_kg: The mass as it comes out.
            half_width_kg: Half width of its 95 % interval.
        """
        remedy = self.missing or "record a longer run"
        return EstimationError(
            f"{name}: the mass is not determined: the estimate is {mass_kg:.3g} kg +- {half_width_kg:.2g} kg. Either "
            f"nothing is mounted, or the motion is insufficient: {remedy}."
        )


def _joints(chosen: NDArray[np.bool_]) -> str:
    """'joint 2', 'joints 4 to 6', 'joints 1, 3 and 5'."""
    numbers = [int(joint) + 1 for joint in np.flatnonzero(chosen)]
    if len(numbers) == 1:
        return f"joint {numbers[0]}"
    if len(numbers) > 2 and numbers[-1] - numbers[0] == len(numbers) - 1:
        return f"joints {numbers[0]} to {numbers[-1]}"
    return f"joints {', '.join(map(str, numbers[:-1]))} and {numbers[-1]}"
