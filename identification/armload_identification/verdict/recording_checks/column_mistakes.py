"""Finds flipped signs and exchanged columns in a run by fitting the arm's own links and friction to it.

A run follows, with or without a payload, from links and friction that are linear in their parameters:

    tau = Y(q, dq, ddq) pi + friction

With columns that are exchanged or of the wrong sign, no parameters fit, or friction drives the arm. As the torque is
linear in the motors' columns, one QR decomposition gives the residual with any choice of columns and signs. With y_ac
the torque of motor a if column c of the recording were its own:

    r(s) = sum_ac s_ac (I - Q Q^T) y_ac,        s_ac = 1, -1 or 0

Exchanged or reversed positions need a decomposition each. They are tried only if no signs explain the run. It is no
problem of terms and priors (`estimation.solve`): that solves for one choice of columns, and here 64 signs and 103
orders of six joints are compared, each by a sum of columns that are decomposed once.

A mistake is reported only if the corrected run fits well, its friction is positive on all joints, and the run as it is
either fits much worse or has friction that drives the arm; for a sign, by more than its error from the residual's
spectrum, as a second of motion can show any friction. On the UR10e's four runs the residual is 2 to 5 % of each
joint's torque. One flipped sign increases the sum of its logarithms by 1.2 or more, except on the last joint without a
load, where friction decides.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations
from typing import Final

import numpy as np
from numpy.typing import NDArray

from armload_identification.estimation.empty_arm.known_arm import KnownArm
from armload_identification.estimation.empty_arm.unloaded_arm import BodyFit, fit_body
from armload_identification.estimation.payload_intervals import NORMAL_HALF_WIDTH, student_half_width
from armload_identification.estimation.residual_spectrum import ResidualSpectrum
from armload_identification.float_array import FloatArray
from armload_identification.identification_errors import RecordingError
from armload_identification.model.base_parameters import base_columns
from armload_identification.model.body_model import BodyModel
from armload_identification.model.chain import Chain
from armload_identification.model.joint_states import JointStates
from armload_identification.model.other_mountings import directions
from armload_identification.model.regressor import PARAMETERS, body_regressor, rotor_columns
from armload_identification.model.smooth_sign import smooth_sign
from armload_identification.signals.load_signal import LoadSignal
from armload_identification.signals.motion import Motion
from armload_identification.signals.recorded_run import Run
from armload_identification.signals.reversals import reversal_speed
from armload_identification.verdict.decision_levels import ArmFit, FalseAlarms
from armload_identification.verdict.joint_words import named_joints

_TORQUES: Final = "the currents or torques"


@dataclass(frozen=True, eq=False)
class _Correction:
    """How the arm fits a run after a correction."""

    cost: float
    """Sum of the logarithms of the joints' residuals, as shares of their torque."""
    share: FloatArray
    """(n,) residual of each joint, as a share of its torque."""
    friction: FloatArray
    """(n,) mean friction while moving, as a share of the torque; negative where it drives the arm, 0 for joints at
    rest: what their servos do to tiny vibrations is no friction."""

    def driven(self, beyond: FloatArray | float = 0.0) -> bool:
        """Whether the friction of a joint drives the arm, by more than (n,) half widths of the friction's shares."""
        return bool((self.friction < -np.maximum(np.maximum(self.share, beyond), ArmFit.driven_share)).any())

    @property
    def possible(self) -> bool:
        """Whether the run could be like this."""
        return bool((self.share < ArmFit.residual_share).all()) and not self.driven()


@dataclass(frozen=True)
class _Exchange:
    """Two joints whose columns are exchanged, torques of three in a cycle, one joint reversed, or another mounting."""

    joints: tuple[int, ...]
    what: str
    """Which of their columns: positions, currents or torques, or all; without joints, how the arm was mounted."""

    @property
    def said(self) -> str:
        """The mistake, and its remedy."""
        if not self.joints:
            return (
                f"the arm was mounted {self.what}: its links and friction explain the torque only so. Correct gravity."
            )
        how, order = ("reversed", "direction") if len(self.joints) == 1 else ("exchanged", "order")
        return (
            f"{self.what} of {named_joints([str(joint + 1) for joint in self.joints])} are {how}: links and friction "
            f"of the arm explain the torque only in the other {order}. Correct the joint {order} in the configuration "
            "or the log."
        )


@dataclass(frozen=True, eq=False)
class RunColumns:
    """The columns of a pair of runs, on the arm that the unloaded one shows; what they contain is searched once.

    Attributes:
        signal: The torque difference of the loaded and the unloaded run.
        runs: Both.
        chain: The arm.
        coupling: (n, n) C of its motors.
        known: The calibrated arm; None if it was not calibrated.
    """

    signal: LoadSignal
    runs: tuple[Run, Run]
    chain: Chain
    coupling: FloatArray
    known: KnownArm | None

    @cached_property
    def arm(self) -> BodyFit:
        """The arm as the unloaded run shows it."""
        return fit_body([self.signal.empty_arm], self.chain, self.coupling)

    @property
    def body(self) -> BodyModel:
        """Its body, or the calibration's."""
        return self.arm.model if self.known is None else self.known.body

    @property
    def look_right(self) -> bool:
        """Whether there is no cause to search for mistakes."""
        signal = self.signal
        opposed = signal.unloaded.moves & (_loaded_over_unloaded(signal) < ArmFit.loaded_over_unloaded)
        if opposed.any() or self.known is not None:
            return not opposed.any()
        return not strange_joints(signal, self.arm, 1.0, ArmFit.driven_share).any()

    def require_right(self) -> None:
        """Refuse a pair that only another sign or order of columns can explain.

        Raises:
            RecordingError: naming file, joint and remedy.
        """
        if self._mistake:
            raise RecordingError(self._mistake)

    @cached_property
    def _mistake(self) -> str:
        """What is wrong, and its remedy; empty if nothing is."""
        # The sign of one run only, against the other run's evidence, shows in their comparison.
        opposed = np.flatnonzero(_loaded_over_unloaded(self.signal) < 0.0).tolist()
        return _mistake_in(self.runs, (self.signal.loaded, self.signal.unloaded), self.chain, self.coupling, opposed)


def require_right_columns(run: Run, motion: Motion, chain: Chain, coupling: FloatArray) -> None:
    """Refuse a run that only another sign or order of columns can explain.

    Args:
        run: The run.
        motion: Its motion and torque.
        chain: The arm.
        coupling: (n, n) C of its motors.

    Raises:
        RecordingError: naming file, joint and remedy.
    """
    if mistake := _mistake_in([run], [motion], chain, coupling):
        raise RecordingError(mistake)


def _mistake_in(
    runs: Sequence[Run], motions: Sequence[Motion], chain: Chain, coupling: FloatArray, opposed: Sequence[int] = ()
) -> str:
    """What is wrong with runs of one motion; with opposed joints, the torque of one of two runs against the other's."""
    paths = [str(run.recording.source.path) for run in runs]
    found = [set(flipped_signs(motion, chain, coupling)) for motion in motions]
    all_runs = set.intersection(*found)
    own = [((joints - all_runs) & set(opposed), path) for joints, path in zip(found, paths, strict=True)]
    for joints, files in ((all_runs, " and ".join(paths)), *own):
        if joints:
            names = named_joints([str(joint + 1) for joint in sorted(joints)])
            verb, whose = ("measures", "its") if len(joints) == 1 else ("measure", "their")
            return (
                f"{files}: {names} {verb} the opposite of the torque that the arm's links and friction require. "
                f"The sign of {whose} current or torque is flipped: correct it in the drive (607E) or recording."
            )
    exchanges = [exchanged_columns(motion, chain, coupling) for motion in motions]
    place, exchange = next(((place, one) for place, one in enumerate(exchanges) if one), (0, None))
    if exchange is None:
        return ""
    # Runs of the same motion have exchanged positions all or not at all.
    only_one = len(set(exchanges)) > 1 and exchange.what == _TORQUES
    return f"{paths[place] if only_one else ' and '.join(paths)}: {exchange.said}"


def strange_joints(signal: LoadSignal, arm: BodyFit, loud: float, driven: float) -> NDArray[np.bool_]:
    """(n,) True for joints of the unloaded run whose torque is not explained by the arm's links and positive friction.

    Args:
        loud: Multiple of the noise from which a joint's torque is evidence.
        driven: Share of the torque from which friction that drives the arm is.
    """
    speed = np.mean(np.abs(signal.unloaded.states.velocity_rad_s), axis=0)
    friction = arm.model.coulomb_nm + arm.model.viscous_nm_s_rad * speed
    unexplained = arm.residual_rms_nm > ArmFit.residual_share * arm.torque_rms_nm
    evident = signal.unloaded.moves & (arm.torque_rms_nm > loud * signal.averaged_noise_nm)
    return np.asarray(evident & (unexplained | (friction < -driven * arm.torque_rms_nm)))


def _loaded_over_unloaded(signal: LoadSignal) -> FloatArray:
    """(n,) slope of each joint's loaded on its unloaded torque, without their means; 1 for a joint without torque."""
    one, other = (run.torque_nm[signal.valid] for run in (signal.loaded, signal.unloaded))
    one, other = one - one.mean(axis=0), other - other.mean(axis=0)
    size = np.sum(other**2, axis=0)
    return np.asarray(np.where(size > 0.0, np.sum(one * other, axis=0) / np.where(size > 0.0, size, 1.0), 1.0))


def flipped_signs(run: Motion, chain: Chain, coupling: FloatArray) -> tuple[int, ...]:
    """Moving motors, from 0, with current or torque of the wrong sign; none if no other signs explain the run."""
    n, moving = chain.n, np.flatnonzero(run.moves).tolist()
    system = _LinksAndFriction(run, chain, coupling, base_columns(chain, coupling))
    as_it_is = system.trial(np.eye(n))
    most = len(moving) if n <= ArmFit.all_signs_joints else 2
    found: dict[tuple[int, ...], float] = {(): np.inf}
    for joints in (joints for count in range(1, most + 1) for joints in combinations(moving, count)):
        signs = np.diag(np.where(np.isin(np.arange(n), joints), -1.0, 1.0))
        trial = system.trial(signs)
        gained = as_it_is.cost - trial.cost
        if not trial.possible or gained <= -ArmFit.no_worse:
            continue
        evident = gained > ArmFit.evident_gain
        if evident or (as_it_is.driven() and as_it_is.driven(system.friction_half_width(signs))):
            found[joints] = trial.cost
    return min(found, key=lambda joints: found[joints])


def exchanged_columns(run: Motion, chain: Chain, coupling: FloatArray) -> _Exchange | None:
    """Moving joints whose columns are exchanged or reversed, or another mounting; None if nothing explains the run."""
    one = np.eye(chain.n)
    base = base_columns(chain, coupling)
    system = _LinksAndFriction(run, chain, coupling, base)
    moving = np.flatnonzero(run.moves).tolist()
    trials: dict[_Exchange, _Correction] = {}
    for joints in (*combinations(moving, 2), *combinations(moving, 1)):
        order = reordered(chain.n, joints, 1)
        reordered_run = replace(run, states=JointStates(*(state @ order.T for state in run.states)))
        moved = _LinksAndFriction(reordered_run, chain, coupling, base)
        trials[_Exchange(joints, _TORQUES)] = system.trial(order)
        trials[_Exchange(joints, "the positions")] = moved.trial(one)
        trials[_Exchange(joints, "all columns")] = moved.trial(order)
    for three in combinations(moving, 3):
        both_ways = [system.trial(reordered(chain.n, three, shift)) for shift in (1, 2)]
        trials[_Exchange(three, _TORQUES)] = min(both_ways, key=lambda trial: (not trial.possible, trial.cost))
    for how, gravity in directions(chain.gravity_m_s2).items():
        other = chain.under(gravity)
        trials[_Exchange((), how)] = _LinksAndFriction(run, other, coupling, base_columns(other, coupling)).trial(one)
    least = system.trial(one).cost - ArmFit.evident_gain
    found = {exchange: trial.cost for exchange, trial in trials.items() if trial.possible and trial.cost < least}
    return min(found, key=lambda exchange: found[exchange], default=None)


def reordered(n: int, joints: tuple[int, ...], shift: int) -> FloatArray:
    """(n, n) matrix that moves some joints on in a cycle, or reverses one."""
    order = np.eye(n)
    order[list(joints)] = np.roll(order[list(joints)], shift, axis=0) if len(joints) > 1 else -order[list(joints)]
    return order


class _LinksAndFriction:
    """Residuals of every motor's column by (11 n,) base parameters."""

    def __init__(self, run: Motion, chain: Chain, coupling: FloatArray, base: NDArray[np.bool_]) -> None:
        n = chain.n
        usable = np.flatnonzero(run.valid)
        rows = usable[:: max(1, usable.size // ArmFit.rows)]
        q, dq, ddq = (state[rows] for state in run.states)
        direction = smooth_sign(dq, reversal_speed(run.states.velocity_rad_s))
        weight, torque = run.reversal_weight[rows], run.torque_nm[rows]
        links = body_regressor(chain, q, dq, ddq)[:, :, base[: PARAMETERS * n]]
        rotors = rotor_columns(ddq, coupling).transpose(0, 2, 1)[:, :, base[PARAMETERS * n :]]
        of_friction = np.hstack([direction, dq, np.ones_like(dq)])[:, None, :] * np.tile(np.eye(n), 3)
        columns = np.concatenate([links, rotors, of_friction], axis=2)
        level = np.sqrt(np.mean((torque * weight) ** 2, axis=0))
        weight = weight / np.where(level > 0.0, level, np.inf)
        whole = (columns * weight[:, :, None]).reshape(-1, columns.shape[2])
        length = np.sqrt(np.sum(whole**2, axis=0))
        length[length == 0.0] = 1.0
        orthogonal, triangle = np.linalg.qr(np.vstack([whole / length, ArmFit.ridge * np.eye(length.size)]))
        orthogonal = orthogonal[: len(whole)]
        # Torque of each of the recording's columns at each motor, tau = C^-T tau_axis.
        at_motor = (torque @ coupling).T[None, :, :, None] * np.linalg.inv(coupling)[:, None, None, :]
        wanted = (at_motor * weight).reshape(n * n, -1)
        along = wanted @ orthogonal
        self._left, self._wanted, self._n = wanted - along @ orthogonal.T, wanted, n
        inverse = np.linalg.inv(triangle) / length[:, None]
        # Mean friction while moving: its work, divided by the distance.
        distance = np.maximum(np.mean(np.abs(dq), axis=0), np.finfo(float).tiny)
        coulomb = np.mean(direction * dq, axis=0) / distance
        viscous = np.mean(dq**2, axis=0) / distance
        friction = coulomb[:, None] * inverse[-3 * n : -2 * n] + viscous[:, None] * inverse[-2 * n : -n]
        self._friction = friction / np.where(level > 0.0, level, np.inf)[:, None]
        self._along, self._basis, self._weight = along, orthogonal.reshape(-1, n, length.size), weight

    def trial(self, columns: FloatArray) -> _Correction:
        """The fit with (n, n) signs: how each recorded column is taken as each motor's, 0 where it is not."""
        chosen = columns.ravel()
        taken = np.flatnonzero(chosen)
        left, size = (
            np.sqrt(np.mean((chosen[taken] @ part[taken]).reshape(-1, self._n) ** 2, axis=0))
            for part in (self._left, self._wanted)
        )
        relative = np.where(size > 0.0, 1.0 / np.where(size > 0.0, size, 1.0), 0.0)
        share = left * relative
        cost = float(np.sum(np.log(np.hypot(share, ArmFit.equally_good))))
        return _Correction(cost, share, self._friction @ (chosen @ self._along) * relative)

    def friction_half_width(self, columns: FloatArray) -> FloatArray:
        """(n,) half width of the friction of the run as it is, as a share of the torque, if such a trial is the truth.

        Its residual contains noise, its correlation by the low-pass, and late or early time stamps. What only the run
        as it is leaves unexplained is no noise, if the trial explains it.
        """
        left = (columns.ravel() @ self._left).reshape(-1, self._n)
        spectrum = ResidualSpectrum(self._basis, left, self._weight)
        quantile = student_half_width(spectrum.freedom(self._friction)) / NORMAL_HALF_WIDTH
        return np.asarray(FalseAlarms.deviations(self._n) * quantile * np.sqrt(spectrum.variance(self._friction)))
