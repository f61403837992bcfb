"""An arm that is known beforehand, from a calibration: its torque, and by how much that torque may be off."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from armload_core.arrays import FloatArray
from armload_identification.estimation.empty_arm.body_fit import BodyFit
from armload_identification.model.joint_states import JointStates

TorqueDoubts = Callable[[JointStates, float, FloatArray], FloatArray]
"""From K states, the time between them and the (K, n) measured torque to (k, K, n): the torque of one standard
deviation of each independent error of what is left when the empty arm's torque is taken away, gains included; the run's
own friction is not among them."""


@dataclass(frozen=True, eq=False)
class KnownArm:
    """What is known of the empty arm from a calibration.

    Attributes:
        fit: Its body, and how well load-dependent friction, rotors and delay are known.
        doubts: By how much a payload's torque is off where this body is taken away from one run.
        drift: (3, n) standard deviation of what a run's Coulomb friction (N m), viscous friction (N m s/rad) and offset
            (N m) differ by from the body's between the runs of the calibration.
        friction_spread: (3, n) the same of a run of any day, of a cold arm too: what is known of it beforehand.
        noise_nm: (n,) standard deviation of what the arm's model leaves of a joint's torque far from reversals.
        correlation_s: (n,) time for which that stays like itself.
    """

    fit: BodyFit
    doubts: TorqueDoubts
    drift: FloatArray
    friction_spread: FloatArray
    noise_nm: FloatArray
    correlation_s: FloatArray
