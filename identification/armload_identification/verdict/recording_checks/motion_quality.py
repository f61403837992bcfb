"""Whether a motion suffices to determine a payload's mass, and which motion is missing otherwise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from armload_identification.estimation.empty_arm.known_arm_rows import MOVING
from armload_identification.float_array import FloatArray
from armload_identification.identification_errors import EstimationError, NoPayloadMass
from armload_identification.model.body_model import BodyModel
from armload_identification.signals.motion import Motion
from armload_identification.verdict.decision_levels import EnoughMotion
from armload_identification.verdict.joint_words import numbered_joints


@dataclass(frozen=True, eq=False)
class MotionQuality:
    """Amount of motion of n joints.

    Attributes:
        moving_s: (n,) time during which each joint is fast enough for its friction to be known.
        brisk_rad_s: (n,) speed at which a joint's load can be determined well.
    """

    moving_s: FloatArray
    brisk_rad_s: FloatArray

    @classmethod
    def of(cls, motion: Motion, body: BodyModel) -> MotionQuality:
        """The quality of a motion, by the speeds that are usual in the arm's calibration."""
        slowest = MOVING * body.reversal_speed_rad_s
        fast = np.abs(motion.states.velocity_rad_s[motion.valid]) > slowest
        peak = MOVING * slowest
        return cls(
            motion.interval_s * motion.periods * np.count_nonzero(fast, axis=0),
            np.minimum(EnoughMotion.brisk_rad_s, EnoughMotion.brisk_share * peak),
        )

    @property
    def missing(self) -> str:
        """Motion for a better estimate: 'move joints 4 to 6 at 0.3 rad/s for 10 s'; empty if all joints move."""
        lazy = self.moving_s < EnoughMotion.enough_s
        if not lazy.any():
            return ""
        speed = f"{self.brisk_rad_s[lazy].min():.2g} rad/s"
        return f"move {numbered_joints(lazy)} at {speed} for {EnoughMotion.recommended_s:g} s"

    def require_enough(self, name: str) -> None:
        """Raise for standstill, and for motion of a single joint of several, naming the run.

        Raises:
            EstimationError: naming the missing motion.
        """
        moves = self.moving_s >= EnoughMotion.joint_counts_s
        if np.count_nonzero(moves) >= min(EnoughMotion.fewest_joints, moves.size):
            return
        seen = f"only {numbered_joints(moves)} moves" if moves.any() else "the arm is at rest, or nearly so"
        raise EstimationError(
            f"{name}: {seen}, and friction at rest hides the payload. To determine the payload, {self.missing}."
        )

    def undetermined(self, name: str, mass_kg: float, half_width_kg: float) -> NoPayloadMass:
        """The error for a mass that the motion does not determine, or that is negative, with the half width of 95 %."""
        estimate = f"{mass_kg:.3g} kg +- {half_width_kg:.2g} kg"
        if mass_kg < -half_width_kg:
            said = (
                f"the mass is negative, {estimate}: the torque is not that of the calibrated arm. Check the joint "
                "order, units and signs of the recording, that it is of this arm, and that nothing was taken off the "
                "arm, or its base tilted, since the calibration."
            )
        else:
            cause = "the payload is light for this arm" if mass_kg > half_width_kg else "nothing is mounted"
            said = (
                f"the mass is not determined: the estimate is {estimate}. Either {cause}, or the motion is "
                f"insufficient: {self.missing or 'record a longer run'}, or add an unloaded run of the same motion."
            )
        return NoPayloadMass(f"{name}: {said}", mass_kg, half_width_kg)
