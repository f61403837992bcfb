"""The terms of an arm and their priors: wide for what the runs determine, narrow where physics or a scale informs.

    y = h C^T [tau + mu s |tau| + Fc s + Fv dq + Fs s sqrt|dq| + (changes of the run)] + h I_r C^-1 ddq,
    tau = Y(q, dq, ddq) beta + Phi(q, dq, ddq) theta,      h = nominal gain / gain

with s the direction of motion. Common to all runs are log h, the links' base parameters beta, the rotors I_r, mu,
friction, one delay of the torque and two tilt angles of the base; common to the runs of one mounting are the ten
parameters theta. Every run has its own changes of Coulomb and viscous friction, which drift as an arm warms up, and of
the offset.

No number is specific to one arm. A joint's friction drifts between runs by shares of itself: over weeks, the changes of
the UR10e's six joints had similar shares of the friction at half the greatest speed, 1.8 % in Coulomb friction, 5.5 %
in viscous friction and 0.55 % in offset.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING, Final

import msgspec
import numpy as np
from numpy.typing import NDArray

from armload_identification.estimation.estimation_constants import Priors
from armload_identification.estimation.term_kinds import Joint, Law, Load, Motor, Scope, Shared, Term, Values
from armload_identification.float_array import FloatArray
from armload_identification.model.chain import Chain
from armload_identification.model.regressor import PARAMETERS

if TYPE_CHECKING:
    from armload_identification.estimation.arm_rows import ArmLayout, ArmRows

CHANGES: Final = 3
"""Changes of a run's friction per joint: Coulomb, viscous, offset."""
GAIN, LINKS, ROTORS, LOAD_FRICTION = "log_h", "links", "rotors", "load"
COULOMB, VISCOUS, ROOT, DELAY, TILT = "coulomb", "viscous", "root", "delay", "tilt"
PAYLOAD, FRICTION_CHANGE = "payload", "friction change"
SESSION_FRICTION, SESSION_LOAD = "friction of the session", "load friction of the session"
RECORDER: Final = "recorder"
ARM_TERMS: Final = (GAIN, LINKS, ROTORS, LOAD_FRICTION, COULOMB, VISCOUS, ROOT, DELAY, TILT)
"""In the order of a calibration's covariance. Its file does not name them: in another order, existing files would be
read wrongly."""
TILT_DEVIATION_RAD: Final = float(np.radians(0.5))
"""Standard deviation of each tilt angle of the base."""
LEVELLED_RAD: Final = float(np.radians(0.1))
"""The same where one motion is all there is: friction that the model lacks would otherwise be read as a tilt, 0.13 % of
the mass on er50."""
DRIFT: Final = np.array([0.018, 0.055, 0.0055])
"""Standard deviation of a run's Coulomb, viscous and offset changes, as shares of the joint's friction."""
WITHIN_HOURS: Final = np.array([0.007, 0.02, 0.0015])
"""The same between runs that follow each other: estimated from the UR10e's runs of February, days apart from each other
by session; a prior for other arms."""
_ZERO: Final = 1e-9
_WIDE: Final = "ten times what alone would explain the torque"


def places_of(base: NDArray[np.bool_]) -> dict[str, slice]:
    """Places of the terms of an arm of n joints in the covariance of a calibration; the last one ends it.

    Args:
        base: (10 n,) or (n, 10) True for the base parameters of the links.
    """
    sizes = dict.fromkeys(ARM_TERMS, base.size // PARAMETERS) | {LINKS: np.count_nonzero(base), DELAY: 1, TILT: 2}
    ends = np.cumsum([0, *sizes.values()]).tolist()
    return {name: slice(*ends[i : i + 2]) for i, name in enumerate(sizes)}


def _load_friction(rows: ArmRows, carried_nm: FloatArray) -> tuple[FloatArray, FloatArray]:
    return (rows.direction * np.abs(carried_nm))[None], (rows.direction * np.sign(carried_nm))[None]


def _friction_change(rows: ArmRows, carried_nm: FloatArray) -> tuple[FloatArray, None]:
    return np.stack([rows.direction, rows.velocity_rad_s, np.ones_like(rows.direction)]), None


LAWS: Final[dict[str, Law]] = {
    GAIN: Shared.GAIN,
    LINKS: Load(lambda rows: (rows.links, rows.links_moved)),
    ROTORS: Motor(lambda rows: (rows.axis_acceleration_rad_s2, rows.axis_jerk_rad_s3)),
    LOAD_FRICTION: Joint(_load_friction),
    COULOMB: Joint(lambda rows, _: (rows.direction[None], None)),
    VISCOUS: Joint(lambda rows, _: (rows.velocity_rad_s[None], None)),
    ROOT: Joint(lambda rows, _: (rows.root[None], None)),
    DELAY: Shared.DELAY,
    TILT: Shared.TILT,
}
_PAYLOAD_LAW: Final = Load(lambda rows: (rows.payload, rows.payload_moved))


def arm_terms(
    runs: Sequence[ArmRows], arm: ArmLayout, deviations: Mapping[str, FloatArray] = MappingProxyType({})
) -> list[Term]:
    """The terms of an arm of which nothing is known but its kinematics and nominal gains, and of its payloads.

    Args:
        runs: All runs, whose torques and motions set the scale.
        deviations: Standard deviations of some terms, by name, in place of the usual ones.
    """
    n, level, base = arm.chain.n, effort_level(runs), arm.base
    speed = np.maximum(_rms(runs, "velocity_rad_s"), _ZERO)
    reach, mass = _greatest_body(level, arm.chain)
    zero = np.zeros(n)
    # A rotor that cannot be separated from a link is determined, poorly, only by the gear's friction: with a wide prior
    # link and rotor would diverge in opposite directions.
    rotors = level / np.maximum(_rms(runs, "axis_acceleration_rad_s2"), _ZERO)
    load = np.full(n, Priors.load_friction)
    priors: dict[str, tuple[FloatArray, FloatArray, str]] = {
        GAIN: (zero, np.full(n, Priors.gain), "catalogue values of torque constants"),
        LINKS: (np.zeros(int(np.count_nonzero(base))), np.tile(_body(mass, reach), n)[base], _WIDE),
        ROTORS: (Priors.rotor * rotors, rotors, "a rotor that alone would explain the torque"),
        LOAD_FRICTION: (load, load, "gears lose 0 to 15 % of their load"),
        COULOMB: (zero, Priors.wide * level, _WIDE),
        VISCOUS: (zero, Priors.wide * level / speed, _WIDE),
        ROOT: (zero, Priors.wide * level / np.sqrt(speed), _WIDE),
        DELAY: (np.zeros(1), np.array([Priors.delay_s]), "some cycles of a drive"),
        TILT: (np.zeros(2), np.full(2, TILT_DEVIATION_RAD), "a base set up with a spirit level"),
    }
    terms = [
        Term(name, Scope.ARM, LAWS[name], mean, deviations.get(name, deviation), origin)
        for name, (mean, deviation, origin) in priors.items()
    ]
    return [*terms, wide_payload(runs, arm.chain)]


def wide_payload(runs: Sequence[ArmRows], chain: Chain) -> Term:
    """A payload of which nothing is known, of runs on an arm."""
    _, mass = _greatest_body(effort_level(runs), chain)
    return payload_term(np.zeros(PARAMETERS), _body(mass, Priors.tool_m), _WIDE)


def friction_change(
    level_nm: FloatArray, peak_rad_s: FloatArray, drift: FloatArray = DRIFT, freedom: float = Priors.drift_freedom
) -> Term:
    """A run's own changes of friction, shares of the joint's friction at half its greatest speed.

    Args:
        level_nm: (n,) RMS torque.
        peak_rad_s: (n,) greatest speeds.
        drift: (3,) these shares.
        freedom: Degrees of freedom that they are worth.
    """
    speed = np.maximum(0.5 * peak_rad_s, _ZERO)

    def shares(arm: Values) -> FloatArray:
        friction = np.abs(arm[COULOMB] + arm[ROOT] * np.sqrt(speed) + arm[VISCOUS] * speed)
        friction = np.maximum(friction, Priors.least_friction * level_nm)
        return np.asarray((drift[:, None] * np.stack([friction, friction / speed, friction])).ravel())

    start = shares(dict.fromkeys((COULOMB, ROOT, VISCOUS), np.zeros(level_nm.size)))
    origin = "estimated from the runs; at first those between the UR10e's, as shares of its friction"
    pooled = np.repeat(np.arange(CHANGES), level_nm.size)
    return msgspec.structs.replace(own_friction(start, origin), rescaled=shares, pooled=pooled, freedom=freedom)


def own_friction(deviation: FloatArray, origin: str) -> Term:
    """A run's own changes of Coulomb friction, viscous friction and offset.

    Args:
        deviation: (3 n,) standard deviations.
        origin: Where they come from.
    """
    return Term(FRICTION_CHANGE, Scope.RUN, Joint(_friction_change), np.zeros(deviation.size), deviation, origin)


def session_friction(deviation: FloatArray, origin: str) -> Term:
    """The changes that all runs have in common, as of `own_friction`."""
    return Term(SESSION_FRICTION, Scope.ARM, Joint(_friction_change), np.zeros(deviation.size), deviation, origin)


def session_load_friction(deviation: FloatArray, origin: str) -> Term:
    """The (n,) changes of mu that all runs have in common: a cold gear also loses more of its load."""
    return Term(SESSION_LOAD, Scope.ARM, LAWS[LOAD_FRICTION], np.zeros(deviation.size), deviation, origin)


def recorder_delay() -> Term:
    """Delay of the torque minus that of the calibration, whose runs another program may have recorded."""
    return Term(RECORDER, Scope.ARM, Shared.DELAY, np.zeros(1), np.array([Priors.recorder_s]), "recorders differ")


def known_arm_terms(values: Values, origin: str, deviation: float = 0.0) -> list[Term]:
    """The terms of an arm with known values.

    Args:
        values: Of all of them, by name.
        origin: Where the values come from.
        deviation: Of each value; inf if a Gaussian over all of them is known.
    """
    return [
        Term(name, Scope.ARM, LAWS[name], values[name], np.full(values[name].size, deviation), origin)
        for name in ARM_TERMS
    ]


def payload_term(mean: FloatArray, deviation: FloatArray, origin: str) -> Term:
    """A payload.

    Args:
        mean: (10,) expected parameters.
        deviation: (10,) their standard deviations.
        origin: Where they come from.
    """
    return Term(PAYLOAD, Scope.MOUNTING, _PAYLOAD_LAW, mean, deviation, origin)


def effort_level(runs: Sequence[ArmRows]) -> FloatArray:
    """(n,) RMS axis torque of runs, as a scale."""
    return np.maximum(_rms(runs, "effort_nm"), _ZERO)


def _greatest_body(level_nm: FloatArray, chain: Chain) -> tuple[float, float]:
    """The arm's reach in m, and ten times the mass that would explain the torque there, in kg."""
    reach = float(np.sum(np.sqrt(np.sum(chain.placement[:, :3, 3] ** 2, axis=1)))) + Priors.hand_m
    gravity = float(np.sqrt(np.sum(chain.gravity_m_s2**2)))
    return reach, Priors.wide * float(level_nm.max()) / (gravity * reach)


def _body(mass_kg: float, size_m: float) -> FloatArray:
    """(10,) size of the parameters of a body."""
    return mass_kg * np.array([1.0] + [size_m] * 3 + [size_m**2] * 6)


def _rms(runs: Sequence[ArmRows], name: str) -> FloatArray:
    """(n,) RMS over all rows; 0 without any."""
    values = np.vstack([getattr(run, name) for run in runs])
    return np.asarray(np.sqrt(np.sum(values**2, axis=0) / max(len(values), 1)))
