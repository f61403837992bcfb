"""An arm known from a calibration: its torque, and the errors of that torque."""

from __future__ import annotations

from dataclasses import dataclass

from armload_identification.estimation.problem import Known
from armload_identification.estimation.term_kinds import Term
from armload_identification.float_array import FloatArray
from armload_identification.model.body_model import BodyModel
from armload_identification.recording.reading_options import Effort


@dataclass(frozen=True, eq=False)
class KnownArm:
    """What is known of the empty arm from a calibration.

    Attributes:
        effort: Quantity that its runs contained, and to which the calibrated gains refer.
        body: Its links, rotors, friction and delay.
        level_nm: (n,) RMS torque of its joints in the calibration, for scale.
        drift: (3, n) standard deviation, over the runs of the calibration, of a run's Coulomb friction (N m), viscous
            friction (N m s/rad) and offset (N m) minus the body's.
        friction_spread: (3, n) the same for a run of any day, cold arms included: the prior.
        load_friction_spread: (n,) the same of mu.
        noise_nm: (n,) standard deviation of a joint's torque minus the arm's model, far from reversals.
        correlation_s: (n,) correlation time of that residual.
        terms: The terms of the arm, its gains relative to those of the calibration.
        known: Their values, held far more firmly than they are known: their errors are considered, not estimated.
        errors: (k, p) change of these values for one standard deviation of each independent error.
    """

    effort: Effort
    body: BodyModel
    level_nm: FloatArray
    drift: FloatArray
    friction_spread: FloatArray
    load_friction_spread: FloatArray
    noise_nm: FloatArray
    correlation_s: FloatArray
    terms: tuple[Term, ...]
    known: Known
    errors: FloatArray
