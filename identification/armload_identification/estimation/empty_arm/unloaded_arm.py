"""An arm's body and friction from runs without a payload, with the gains as they are.

Load-dependent friction mu |tau_link| depends on the links' torque without the rotors'. It therefore makes rotors
identifiable that the torque of links and rotors cannot separate from their link. A drive may report torque and position
of different instants; that delay, one for the arm, is fitted too: each millisecond shifts a payload's centre of mass by
4 % on the paper's motion.

The equations are means over windows (`arm_rows`). Sample by sample, two effects were taken for a delay and for rotors.
For 0.1 s after a reversal a servo makes up for what friction held back: the torque of `prbt` and of a drafted arm
seemed 5 and 1.4 ms early. And torque ripple shakes the arm, which responds with an acceleration that the ripple
explains, not the reported torque: 5 ms on `er50`, with rotors 1.6 times too heavy.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from armload_identification.estimation.arm_from_posterior import identified_body
from armload_identification.estimation.arm_rows import ArmLayout, ArmRows
from armload_identification.estimation.arm_terms import (
    GAIN,
    ROOT,
    TILT,
    arm_terms,
    effort_level,
)
from armload_identification.estimation.estimation_constants import Priors
from armload_identification.estimation.problem import Group, Noise, Problem, RunRows
from armload_identification.estimation.solve import solve
from armload_identification.estimation.term_kinds import Joint, Scope, Term
from armload_identification.float_array import FloatArray
from armload_identification.model.body_model import BodyModel
from armload_identification.model.chain import Chain
from armload_identification.signals.motion import Motion
from armload_identification.signals.reversals import reversal_speed

_OFFSET: Final = "offset"


@dataclass(frozen=True, eq=False)
class BodyFit:
    """A body fitted to runs.

    Attributes:
        model: The body.
        residual_rms_nm: (n,) RMS of torque minus prediction where a joint moves; 0 for a joint at rest.
        torque_rms_nm: (n,) RMS of the torque, for scale.
    """

    model: BodyModel
    residual_rms_nm: FloatArray
    torque_rms_nm: FloatArray


def fit_body(runs: Sequence[Motion], chain: Chain, coupling: FloatArray) -> BodyFit:
    """Fit links, rotors and friction to runs without a payload.

    Args:
        runs: Runs without a payload.
        coupling: (n, n) C of its motors.
    """
    n, arm = chain.n, ArmLayout.of(runs, chain, coupling)
    rows = [arm.rows(run, loaded=False) for run in runs]
    level = effort_level(rows)
    # one run cannot show gains, a tilted base and the friction law
    terms = arm_terms(rows, arm, {GAIN: np.zeros(n), TILT: np.zeros(2), ROOT: np.zeros(n)})
    terms.append(Term(_OFFSET, Scope.ARM, Joint(_offset), np.zeros(n), Priors.wide * level, "any"))
    problem = Problem(terms, [Group((RunRows(part),)) for part in rows], Noise.unknown(level), coupling)
    found = solve(problem, rough=True)
    slowest = reversal_speed(np.vstack([run.states.velocity_rad_s for run in runs]))
    model = identified_body(found, arm.base, slowest, np.stack([np.zeros(n), np.zeros(n), found.value(_OFFSET)]))
    moving = np.vstack([run.reversal_weight[run.valid] for run in runs])
    left = [
        (run.torque_nm - model.torque(chain, *run.with_delay(model.torque_delay_s).states))[run.valid] for run in runs
    ]
    torque = np.vstack([run.torque_nm[run.valid] for run in runs])
    residual_nm = np.sqrt(np.sum((moving * np.vstack(left)) ** 2, axis=0) / np.maximum(np.sum(moving**2, axis=0), 1.0))
    return BodyFit(model, residual_nm, np.sqrt(np.mean(torque**2, axis=0)))


def _offset(rows: ArmRows, carried_nm: FloatArray) -> tuple[FloatArray, None]:
    return np.ones((1, *carried_nm.shape)), None
