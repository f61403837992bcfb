"""Finds flipped signs and exchanged columns in a run by fitting the arm's own links and friction to it.

A run follows, with or without a payload, from links and friction that are linear in their parameters:

    tau = Y(q, dq, ddq) pi + friction

With columns that are swapped or of the wrong sign, no parameters fit, or friction drives the arm. As the torque is
linear in the motors' columns, one QR decomposition gives the residual with every combination of signs:

    r(s) = sum_a s_a (I - Q Q^T) y_a,        s_a = 1 or -1

A mistake is reported only if the corrected run fits well, its friction is positive on all joints, and the run as it is
either fits much worse or has friction that drives the arm. On the UR10e's four runs the residual is 2 to 5 % of each
joint's torque. One flipped sign increases the sum of its logarithms by 1.2 or more, except on the last joint without a
load, where friction decides.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations
from typing import Final

import numpy as np

from armload_core.arrays import FloatArray
from armload_identification.estimation.empty_arm.body_fit import BodyFit
from armload_identification.identification_errors import RecordingError
from armload_identification.model.base_parameters import base_columns
from armload_identification.model.body_model import smooth_sign
from armload_identification.model.chain import Chain
from armload_identification.model.regressor import PARAMETERS, body_regressor, rotor_columns
from armload_identification.recording.recording import Recording
from armload_identification.signals.load_signal import LoadSignal
from armload_identification.signals.motion import Motion
from armload_identification.signals.reversals import reversal_speed, reversal_weights

_ROWS: Final = 400
_WIDE: Final = 1e-4
"""Prior on the normalised parameters, against directions that the motion does not determine."""
_LEAST_SHARE: Final = 0.01
"""Residuals below this share of the torque are equally good."""
_FITS: Final = 0.3
"""Greatest residual, as a share of the torque, that a correct run leaves on any joint; 0.05 on the UR10e."""
_DRIVES: Final = 0.05
"""Share of the torque from which friction that drives the arm is significant, if it also exceeds the residual."""
_MUCH: Final = 1.5
"""Decrease of the sum of the logarithms of the residuals from which a mistake is evident without friction."""
_NO_WORSE: Final = 0.5
_STRANGE: Final = 0.3
"""Share of a joint's torque that the residual of the arm's own model does not reach; at most 0.24 on the UR10e."""
_ALIKE: Final = 0.2
"""Least slope of a joint's loaded on its unloaded torque, of which the arm itself causes the greater part."""
_ALL_SIGNS: Final = 8
"""Up to this many joints every combination of signs is tried, otherwise one and two."""


@dataclass(frozen=True, eq=False)
class _Trial:
    """A correction of a run: what it is, and how the arm fits the run after it.

    Attributes:
        flipped: Motors whose sign is changed.
        cost: Sum of the logarithms of the joints' residuals, as shares of their torque.
        share: (n,) residual of each joint, as a share of its torque.
        friction: (n,) mean friction while moving, as a share of the torque; negative where it drives the arm.
    """

    flipped: tuple[int, ...]
    cost: float
    share: FloatArray
    friction: FloatArray

    @property
    def driven(self) -> bool:
        """Whether the friction of a joint drives the arm."""
        return bool((self.friction < -np.maximum(self.share, _DRIVES)).any())

    @property
    def possible(self) -> bool:
        """Whether the run could be like this."""
        return bool((self.share < _FITS).all()) and not self.driven


def looks_wrong(signal: LoadSignal, arm: BodyFit | None) -> bool:
    """Whether a pair gives cause to look for mistakes in its columns; costs nothing compared with that search.

    Args:
        signal: The pair.
        arm: The body fitted to the unloaded run; None if the arm was calibrated.
    """
    if (_slope(signal) < _ALIKE).any():
        return True
    if arm is None:
        return False
    speed = np.mean(np.abs(signal.unloaded.states.velocity_rad_s), axis=0)
    friction = arm.model.coulomb_nm + arm.model.viscous_nm_s_rad * speed
    moves = arm.torque_rms_nm > signal.averaged_noise_nm
    odd = (arm.residual_rms_nm > _STRANGE * arm.torque_rms_nm) | (friction < -_DRIVES * arm.torque_rms_nm)
    return bool((moves & odd).any())


def refuse_wrong_columns(
    signal: LoadSignal, loaded: Recording, unloaded: Recording, chain: Chain, coupling: FloatArray
) -> None:
    """Raise for a pair that links and friction of the arm explain only with other columns.

    Args:
        signal: The pair.
        loaded: Its run with the payload.
        unloaded: Its run without it.
        chain: The arm.
        coupling: (n, n) C of its motors.

    Raises:
        RecordingError: naming file, joint and remedy.
    """
    found = [set(flipped_signs(run, chain, coupling)) for run in (signal.loaded, signal.unloaded)]
    both = found[0] & found[1]
    # The sign of one run only, against the other run's evidence, shows in their comparison.
    opposed = set(map(int, np.flatnonzero(_slope(signal) < 0.0)))
    for joints, files in (
        (both, f"{loaded.source.path} and {unloaded.source.path}"),
        ((found[0] - both) & opposed, str(loaded.source.path)),
        ((found[1] - both) & opposed, str(unloaded.source.path)),
    ):
        if joints:
            raise RecordingError(f"{files}: {_flipped_text(sorted(joints))}")


def _flipped_text(joints: list[int]) -> str:
    """What is wrong with the signs of joints, and the remedy."""
    if len(joints) == 1:
        return (
            f"joint {joints[0] + 1} measures the opposite of the torque that the arm's links and friction require. "
            "The sign of its current or torque is flipped: correct it in the configuration or the log."
        )
    listed = ", ".join(str(joint + 1) for joint in joints[:-1]) + f" and {joints[-1] + 1}"
    return (
        f"joints {listed} measure the opposite of the torque that the arm's links and friction require. "
        "The sign of the current or torque is flipped on each of them: correct it in the configuration or the log."
    )


def _slope(signal: LoadSignal) -> FloatArray:
    """(n,) slope of each joint's loaded on its unloaded torque, without their means; 1 for a joint without torque."""
    one, other = (run.torque_nm[signal.valid] for run in (signal.loaded, signal.unloaded))
    one, other = one - one.mean(axis=0), other - other.mean(axis=0)
    size = np.sum(other**2, axis=0)
    return np.asarray(np.where(size > 0.0, np.sum(one * other, axis=0) / np.where(size > 0.0, size, 1.0), 1.0))


def flipped_signs(run: Motion, chain: Chain, coupling: FloatArray) -> tuple[int, ...]:
    """Motors whose current or torque has the wrong sign.

    Args:
        run: A run, with or without a payload.
        chain: The arm.
        coupling: (n, n) C of its motors.

    Returns:
        Their indices; none if the run is right as it is, or if no signs explain it.
    """
    as_it_is, *others = _System(run, chain, coupling).trials()
    better = [trial for trial in others if _explains(trial, as_it_is)]
    return min(better, key=lambda trial: trial.cost).flipped if better else ()


def _explains(trial: _Trial, as_it_is: _Trial) -> bool:
    """Whether a correction is needed, and is right."""
    if not trial.possible:
        return False
    gained = as_it_is.cost - trial.cost
    return gained > _MUCH or (as_it_is.driven and gained > -_NO_WORSE)


class _System:
    """Links and friction, linear in their parameters, and the residuals of every motor's column."""

    def __init__(self, run: Motion, chain: Chain, coupling: FloatArray) -> None:
        n = chain.n
        usable = np.flatnonzero(run.valid)
        rows = usable[:: max(1, usable.size // _ROWS)]
        q, dq, ddq = (state[rows] for state in run.states)
        base = base_columns(chain, coupling)
        weight = reversal_weights(run.states.velocity_rad_s)[rows]
        torque = run.torque_nm[rows]
        level = np.sqrt(np.mean((torque * weight) ** 2, axis=0))
        self._weight = weight / np.where(level > 0.0, level, np.inf)
        direction = smooth_sign(dq, reversal_speed(run.states.velocity_rad_s))
        own = np.zeros((len(q), n, 3, n))
        for joint in range(n):
            own[:, joint, :, joint] = np.column_stack([direction[:, joint], dq[:, joint], np.ones(len(q))])
        columns = np.concatenate(
            [
                body_regressor(chain, q, dq, ddq)[:, :, base[: PARAMETERS * n]],
                rotor_columns(ddq, coupling).transpose(0, 2, 1)[:, :, base[PARAMETERS * n :]],
                own.reshape(len(q), n, 3 * n),
            ],
            axis=2,
        )
        whole = (columns * self._weight[:, :, None]).reshape(-1, columns.shape[2])
        length = np.linalg.norm(whole, axis=0)
        length[length == 0.0] = 1.0
        orthogonal, triangle = np.linalg.qr(np.vstack([whole / length, _WIDE * np.eye(length.size)]))
        orthogonal = orthogonal[: len(whole)]
        # Torque of each motor's column on all joints, tau = C^-T tau_axis.
        of_motor = (torque @ coupling).T[:, :, None] * np.linalg.inv(coupling)[:, None, :]
        wanted = (of_motor * self._weight).reshape(n, -1)
        along = wanted @ orthogonal
        left = (wanted - along @ orthogonal.T).reshape(n, -1, n)
        self._n = n
        self._gram = np.einsum("akj,bkj->jab", left, left) / len(q)
        coefficient = np.linalg.solve(triangle, along.T) / length[:, None]
        # Mean friction while moving: its work, divided by the distance.
        distance = np.maximum(np.mean(np.abs(dq), axis=0), np.finfo(float).tiny)
        coulomb = np.mean(direction * dq, axis=0) / distance
        viscous = np.mean(dq**2, axis=0) / distance
        self._friction = coulomb[:, None] * coefficient[-3 * n : -2 * n] + viscous[:, None] * coefficient[-2 * n : -n]
        self._friction *= np.where(level > 0.0, 1.0 / np.where(level > 0.0, level, 1.0), 0.0)[:, None]

    def trials(self) -> Iterator[_Trial]:
        """The run as it is, then every correction of signs."""
        most = self._n if self._n <= _ALL_SIGNS else 2
        for count in range(most + 1):
            for flipped in combinations(range(self._n), count):
                sign = np.ones(self._n)
                sign[list(flipped)] = -1.0
                share = np.sqrt(np.maximum(np.einsum("jab,a,b->j", self._gram, sign, sign), 0.0))
                cost = float(np.sum(np.log(np.hypot(share, _LEAST_SHARE))))
                yield _Trial(flipped, cost, share, self._friction @ sign)
