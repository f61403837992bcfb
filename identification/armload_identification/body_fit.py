"""Fit an arm's body and friction to runs without a payload.

The columns are those of `body`. Which of the links' and rotors' parameters can be told apart at all is decided by
the kinematics: a QR factorisation with column pivoting at random states keeps the base parameters. How well a run
tells these is another question; a prior far wider than any arm holds what it does not tell near zero, and is not
felt elsewhere. Load-dependent friction depends on the links' torque and so on the result: it is iterated.

References:
    Gautier, Numerical calculation of the base inertial parameters of robots, Journal of Robotic Systems 8(4), 1991.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import qr

from armload_identification.body import BodyModel, rotor_columns, smooth_sign
from armload_identification.chain import Chain
from armload_identification.regressor import PARAMETERS, body_regressor

FloatArray = NDArray[np.float64]

_STATES: Final = 200
_SEED: Final = 20160606
_BASE_TOLERANCE: Final = 1e-8
_PRIOR_FACTOR: Final = 30.0
"""Width of the prior in terms of an arm whose greatest torque is its own weight at full reach."""
_TURN_OVER: Final = 0.01
"""The direction of motion turns over within this share of a joint's greatest speed."""
_REVERSAL: Final = 0.02
"""Samples slower than this share of a joint's greatest speed weigh less than half."""
_SLOWEST_RAD_S: Final = 1e-4
_ITERATIONS: Final = 8
_SETTLED: Final = 1e-4
_GREATEST_LOAD_FRICTION: Final = 0.5
_TOLD: Final = 0.1
_STRIBECK_VELOCITIES_RAD_S: Final = (0.01, 0.02, 0.05, 0.1)
_GRAVITY_M_S2: Final = 9.81
_HAND_M: Final = 0.1


@dataclass(frozen=True, eq=False)
class ArmSamples:
    """What a fit needs of a run, K samples of n joints.

    Attributes:
        position_rad: (K, n).
        velocity_rad_s: (K, n).
        acceleration_rad_s2: (K, n).
        torque_nm: (K, n) smoothed joint torque.
        valid: (K,) samples to use.
        noise_nm: (n,) standard deviation of the noise in the torque before smoothing.
    """

    position_rad: FloatArray
    velocity_rad_s: FloatArray
    acceleration_rad_s2: FloatArray
    torque_nm: FloatArray
    valid: NDArray[np.bool_]
    noise_nm: FloatArray


@dataclass(frozen=True, eq=False)
class BodyFit:
    """A body fitted to runs.

    Attributes:
        model: The body.
        residual_rms_nm: (n,) RMS of torque minus prediction over all samples used, reversals included.
        torque_rms_nm: (n,) RMS of the torque, for scale.
        base_parameters: How many parameters of links and rotors the kinematics can tell.
        determined: How many of these have a standard deviation below a tenth of the prior's.
    """

    model: BodyModel
    residual_rms_nm: FloatArray
    torque_rms_nm: FloatArray
    base_parameters: int
    determined: int


def reversal_weights(velocity_rad_s: FloatArray) -> FloatArray:
    """Weights that leave out reversals, |dq| / sqrt(dq^2 + v^2) with v a small share of the greatest speed.

    Near a reversal friction is what no model of it says: presliding, backlash and ripple. A joint that stands
    still keeps its weight.

    Args:
        velocity_rad_s: (N, n).

    Returns:
        (N, n) factors on the rows of the whitened system, 0 to 1.
    """
    peak = np.abs(velocity_rad_s).max(axis=0)
    slow = _REVERSAL * peak
    moving = peak > _SLOWEST_RAD_S
    weight = np.abs(velocity_rad_s) / np.sqrt(velocity_rad_s**2 + np.where(moving, slow, 1.0) ** 2)
    return np.asarray(np.where(moving, weight, 1.0), dtype=np.float64)


def reversal_speed(velocity_rad_s: FloatArray) -> FloatArray:
    """(n,) speed about which the direction of motion turns over, from the greatest speed of each joint.

    Args:
        velocity_rad_s: (N, n).
    """
    return np.asarray(np.maximum(_TURN_OVER * np.abs(velocity_rad_s).max(axis=0), _SLOWEST_RAD_S))


def base_columns(chain: Chain, coupling: FloatArray) -> NDArray[np.bool_]:
    """Which parameters of links and rotors an arm's motion can tell apart.

    Args:
        chain: The arm.
        coupling: (n, n) C of its motors.

    Returns:
        (11 n,) True for the base parameters: ten per link, then the rotors. Where a rotor turns with a link
        as one, the link's inertia stands for both.
    """
    n = chain.n
    rng = np.random.default_rng(_SEED)
    q, dq, ddq = rng.uniform(-np.pi, np.pi, (3, _STATES, n))
    links = body_regressor(chain, q, dq, ddq).reshape(-1, PARAMETERS * n)
    rotors = rotor_columns(ddq, coupling).transpose(0, 2, 1).reshape(-1, n)
    base = np.zeros((PARAMETERS + 1) * n, dtype=bool)
    base[_independent(links)] = True
    # Rotors come second: whatever a link can stand for stays with the link.
    orthogonal, _ = np.linalg.qr(links[:, base[: PARAMETERS * n]])
    left = rotors - orthogonal @ (orthogonal.T @ rotors)
    told = _independent(left / np.sqrt(np.sum(rotors**2, axis=0)), unit=False)
    base[PARAMETERS * n + told] = True
    return base


def _independent(columns: FloatArray, *, unit: bool = True) -> NDArray[np.intp]:
    """Indices of a largest well-conditioned set of independent columns."""
    length = np.sqrt(np.sum(columns**2, axis=0)) if unit else np.ones(columns.shape[1])
    scaled = columns / np.where(length > 0.0, length, 1.0)
    triangle, order = qr(scaled, mode="r", pivoting=True)
    diagonal = np.abs(np.diag(triangle))
    return np.asarray(order[: int(np.count_nonzero(diagonal > _BASE_TOLERANCE * max(diagonal[0], 1.0)))])


def fit_body(
    runs: Sequence[ArmSamples],
    chain: Chain,
    coupling: FloatArray,
    *,
    stribeck: bool = False,
    load_friction: bool = True,
) -> BodyFit:
    """Fit links, rotors and friction to runs without a payload.

    Args:
        runs: What was measured.
        chain: The arm.
        coupling: (n, n) C of its motors.
        stribeck: Whether friction near standstill has a column of its own.
        load_friction: Whether friction grows with the links' torque.

    Returns:
        The body.
    """
    q, dq, ddq, torque = (
        np.vstack([getattr(run, name)[run.valid] for run in runs])
        for name in ("position_rad", "velocity_rad_s", "acceleration_rad_s2", "torque_nm")
    )
    noise = np.sqrt(np.mean([run.noise_nm**2 for run in runs], axis=0))
    system = _System(chain, coupling, q, dq, ddq, torque, noise)
    fits = [system.solve(velocity, load_friction) for velocity in (_STRIBECK_VELOCITIES_RAD_S if stribeck else (None,))]
    return min(fits, key=lambda fit: fit[0])[1]


class _System:
    """The columns of one fit, and its solution for one Stribeck velocity.

    Columns in this order: links, rotors, Coulomb, viscous, offset, Stribeck, load-dependent friction. Every joint's
    rows are compressed once; what changes in the iteration, the joints' weights and the last columns, costs little.
    """

    def __init__(
        self,
        chain: Chain,
        coupling: FloatArray,
        q: FloatArray,
        dq: FloatArray,
        ddq: FloatArray,
        torque: FloatArray,
        noise: FloatArray,
    ) -> None:
        n = chain.n
        self._n, self._coupling, self._torque, self._noise, self._dq = n, coupling, torque, noise, dq
        self._base = base_columns(chain, coupling)
        links = body_regressor(chain, q, dq, ddq)[:, :, self._base[: PARAMETERS * n]]
        rotors = rotor_columns(ddq, coupling).transpose(0, 2, 1)[:, :, self._base[PARAMETERS * n :]]
        self._link_count = links.shape[2]
        self._turn_over = reversal_speed(dq)
        self._direction = smooth_sign(dq, self._turn_over)
        friction = [_per_joint(column) for column in (self._direction, dq, np.ones_like(dq))]
        self._columns = np.concatenate([links, rotors, *friction], axis=2)
        self._weight = reversal_weights(dq)
        greatest = float(np.abs(torque).max())
        mass, reach = _size(chain, greatest)
        link = mass * np.array([1.0] + [reach] * 3 + [reach**2] * 6)
        inertias = np.concatenate([np.tile(link, n), np.full(n, mass * reach**2)])
        self._width = np.concatenate([inertias[self._base], np.full(3 * n, _PRIOR_FACTOR * greatest)])

    def solve(self, stribeck_velocity: float | None, load_friction: bool) -> tuple[float, BodyFit]:
        """The fit and its cost; iterated over load-dependent friction and the joints' weights."""
        n = self._n
        columns, width = self._columns, self._width
        if stribeck_velocity is not None:
            extra = _per_joint(self._direction * np.exp(-((self._dq / stribeck_velocity) ** 2)))
            columns = np.concatenate([columns, extra], axis=2)
            width = np.concatenate([width, np.full(n, width[-1])])
        rows = [_JointRows(columns[:, j] * width, self._torque[:, j], self._weight[:, j]) for j in range(n)]
        noise, friction = self._noise, np.zeros(n)
        allowed = np.full(n, load_friction)
        carried = np.zeros_like(self._dq)
        for iteration in range(_ITERATIONS):
            loaded = self._direction * np.abs(carried) * allowed
            stack = [row.with_column(loaded[:, j], j, n) / noise[j] for j, row in enumerate(rows)]
            solution, deviation = _ridge(np.vstack(stack))
            x, before, friction = solution[:-n] * width, friction, solution[-n:]
            carried = columns[:, :, : self._link_count] @ x[: self._link_count]
            left = self._torque - columns @ x - self._direction * np.abs(carried) * friction
            noise = np.maximum(np.sqrt(np.mean((left * self._weight) ** 2, axis=0)), 1e-9)
            if iteration == 0:
                continue  # the links' torque was not known yet
            allowed = allowed & (friction > 0.0)
            if np.abs(friction - before).max() < _SETTLED:
                break
        friction = np.clip(friction, 0.0, _GREATEST_LOAD_FRICTION)
        told = int(np.count_nonzero(deviation[: np.count_nonzero(self._base)] < _TOLD))
        return float(np.sum(np.log(noise))), self._fit(x, told, left, friction, stribeck_velocity)

    def _fit(
        self,
        x: FloatArray,
        told: int,
        left: FloatArray,
        friction: FloatArray,
        stribeck_velocity: float | None,
    ) -> BodyFit:
        """The solution by name."""
        n = self._n
        inertias = np.zeros(self._base.size)
        count = int(np.count_nonzero(self._base))
        inertias[self._base] = x[:count]
        own = x[count:].reshape(-1, n)
        model = BodyModel(
            links=inertias[: PARAMETERS * n].reshape(n, PARAMETERS),
            base=self._base[: PARAMETERS * n].reshape(n, PARAMETERS),
            rotor_inertia_kg_m2=inertias[PARAMETERS * n :],
            coulomb_nm=own[0],
            viscous_nm_s_rad=own[1],
            offset_nm=own[2],
            stribeck_nm=own[3] if stribeck_velocity is not None else np.zeros(n),
            stribeck_velocity_rad_s=np.full(n, stribeck_velocity or _STRIBECK_VELOCITIES_RAD_S[0]),
            load_friction=friction,
            reversal_speed_rad_s=self._turn_over,
            coupling=self._coupling,
        )
        return BodyFit(
            model=model,
            residual_rms_nm=np.sqrt(np.mean(left**2, axis=0)),
            torque_rms_nm=np.sqrt(np.mean(self._torque**2, axis=0)),
            base_parameters=count,
            determined=told,
        )


class _JointRows:
    """One joint's rows of the system, compressed by an orthogonal factorisation."""

    def __init__(self, columns: FloatArray, torque: FloatArray, weight: FloatArray) -> None:
        self._weight, self._target = weight, torque * weight
        self._orthogonal, self._triangle = np.linalg.qr(columns * weight[:, None])
        self._seen = self._orthogonal.T @ self._target

    def with_column(self, column: FloatArray, joint: int, joints: int) -> FloatArray:
        """(k, p + joints + 1) equations that stand for all rows, one more column on this joint; last the target."""
        weighted = column * self._weight
        share = self._orthogonal.T @ weighted
        new = weighted - self._orthogonal @ share
        length = float(np.sqrt(new @ new))
        rows, count = self._triangle.shape
        equations = np.zeros((rows + 1, count + joints + 1))
        equations[:rows, :count] = self._triangle
        equations[:rows, count + joint] = share
        equations[:rows, -1] = self._seen
        equations[rows, count + joint] = length
        equations[rows, -1] = float(new @ self._target) / length if length > 0.0 else 0.0
        return equations


def _per_joint(values: FloatArray) -> FloatArray:
    """(N, n) one column per joint as (N, n, n)."""
    return values[:, :, None] * np.eye(values.shape[1])


def _size(chain: Chain, torque_nm: float) -> tuple[float, float]:
    """Mass and length that no link of an arm of such torque exceeds by far."""
    reach = float(np.sum(np.sqrt(np.sum(chain.placement[:, :3, 3] ** 2, axis=1)))) + _HAND_M
    return _PRIOR_FACTOR * torque_nm / (_GRAVITY_M_S2 * reach), reach


def _ridge(equations: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Least squares with a prior of unit width about zero, and standard deviations; the last column is the target."""
    parameters = equations.shape[1] - 1
    prior = np.eye(parameters, parameters + 1)
    triangle = np.asarray(np.linalg.qr(np.vstack([equations, prior]), mode="r"))
    inverse = np.linalg.inv(triangle[:parameters, :parameters])
    return inverse @ triangle[:parameters, -1], np.sqrt(np.sum(inverse**2, axis=1))
