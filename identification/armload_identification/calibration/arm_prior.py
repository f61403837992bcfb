"""Prior of an arm: wide for what the runs determine, narrow where physics or a scale provides information.

No number is specific to one arm. A joint's friction drifts between runs by shares of itself: over weeks, the changes of
the UR10e's six joints had similar shares of the friction at half the greatest speed, 1.8 % in Coulomb friction, 5.5 %
in viscous friction and 0.55 % in offset.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from armload_core.arrays import FloatArray
from armload_identification.calibration.arm_model import PER_RUN, Unknowns
from armload_identification.calibration.arm_rows import ArmRows
from armload_identification.estimation.least_squares import Prior
from armload_identification.model.chain import Chain

GAIN_DEVIATION: Final = 0.05
"""Relative standard deviation of a nominal gain."""
TILT_DEVIATION_RAD: Final = float(np.radians(0.5))
"""Standard deviation of each tilt angle of the base."""
_DELAY_DEVIATION_S: Final = 0.02
_LOAD: Final = 0.05
"""Mean and standard deviation of mu: gears lose 0 to 15 % of their load."""
_WIDE: Final = 10.0
"""Standard deviation of other parameters, in multiples of the value that alone would explain a joint's torque."""
_HAND_M: Final = 0.1
_TOOL_M: Final = 0.5
"""Size of an arm's last link, and of a payload."""
_DRIFT: Final = np.array([0.018, 0.055, 0.0055])
"""Standard deviation of a run's Coulomb, viscous and offset changes, as shares of the joint's friction."""
_LEAST_FRICTION: Final = 0.01
"""Least friction, as a share of the joint's torque."""
_ZERO: Final = 1e-9


@dataclass(frozen=True, eq=False)
class ArmPrior:
    """Knowledge of the shared unknowns as a quadratic form.

    Attributes:
        precision: (p, p) inverse covariance.
        target: (p,) precision times mean.
        level_nm: (n,) RMS axis torque, as a scale.
    """

    precision: FloatArray
    target: FloatArray
    level_nm: FloatArray


def arm_prior(
    of: Unknowns, runs: Sequence[ArmRows], chain: Chain, base: NDArray[np.bool_], known: Mapping[str, Prior]
) -> ArmPrior:
    """The prior of an arm.

    Args:
        of: The layout of the unknowns.
        runs: All runs, whose torques and motions set the scale.
        chain: The arm.
        base: (10 n,) True for the base parameters of the links.
        known: Priors of the payloads, by mounting.
    """
    level = np.maximum(np.sqrt(np.mean(np.vstack([run.effort_nm for run in runs]) ** 2, axis=0)), _ZERO)
    speed = np.maximum(_rms(runs, "velocity_rad_s"), _ZERO)
    deviation = np.ones(of.size)
    deviation[of.log_h] = GAIN_DEVIATION
    reach = float(np.sum(np.sqrt(np.sum(chain.placement[:, :3, 3] ** 2, axis=1)))) + _HAND_M
    gravity = float(np.sqrt(np.sum(chain.gravity_m_s2**2)))
    mass = _WIDE * float(level.max()) / (gravity * reach)
    size = mass * np.array([1.0] + [reach] * 3 + [reach**2] * 6)
    deviation[of.links] = np.tile(size, of.n)[base]
    # A rotor that cannot be separated from a link is determined, poorly, only by the gear's friction: with a wide prior
    # link and rotor would diverge in opposite directions.
    deviation[of.rotors] = level / np.maximum(_rms(runs, "axis_acceleration_rad_s2"), _ZERO)
    deviation[of.load] = _LOAD
    deviation[of.coulomb] = _WIDE * level
    deviation[of.viscous] = _WIDE * level / speed
    deviation[of.root] = _WIDE * level / np.sqrt(speed)
    deviation[of.delay] = _DELAY_DEVIATION_S
    deviation[of.tilt] = TILT_DEVIATION_RAD
    mean = np.zeros(of.size)
    mean[of.load] = _LOAD
    for mounting in of.mountings:
        deviation[of.payload(mounting)] = mass * np.array([1.0] + [_TOOL_M] * 3 + [_TOOL_M**2] * 6)
    precision = np.diag(deviation**-2.0)
    target = precision @ mean
    for mounting, prior in known.items():
        place = of.payload(mounting)
        precision[place, place] += prior.rows.T @ prior.rows
        target[place] += prior.rows.T @ prior.target
    return ArmPrior(precision, target, level)


def change_deviation(of: Unknowns, x: FloatArray, level_nm: FloatArray, peak_rad_s: FloatArray) -> FloatArray:
    """Expected differences of a run's friction from that of all runs.

    Args:
        of: The layout.
        x: The unknowns.
        level_nm: (n,) RMS torque.
        peak_rad_s: (n,) greatest speeds.

    Returns:
        (3 n,) standard deviations of the run's changes.
    """
    speed = np.maximum(0.5 * peak_rad_s, _ZERO)
    friction = np.abs(x[of.coulomb] + x[of.root] * np.sqrt(speed) + x[of.viscous] * speed)
    friction = np.maximum(friction, _LEAST_FRICTION * level_nm)
    scale = np.stack([friction, friction / speed, friction])
    return np.asarray((_DRIFT[:PER_RUN, None] * scale).ravel())


def _rms(runs: Sequence[ArmRows], name: str) -> FloatArray:
    """(n,) RMS over all rows."""
    return np.asarray(np.sqrt(np.mean(np.vstack([getattr(run, name) for run in runs]) ** 2, axis=0)))
