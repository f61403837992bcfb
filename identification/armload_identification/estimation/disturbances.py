"""What disturbs a payload's run: a joint's zero, the base, a hose, or a force that the model does not have.

The torque of links and payload changes by tau(q + x e_k) - tau(q) if joint k does not stand where its position says,
and by gravity from the side if the base tilted: between the runs of a pair, or after the calibration. A hose holds a
joint back like a spring, and a force on the flange is a weight without inertia; both act in the loaded run alone. With
nominal gains the links are fitted to the same zeros, and only the payload shows them. A gear that gives way under the
load looks like a zero.

Beside all other unknowns, a calibration's errors included, the rows say x +- s of each disturbance if it is the only
one. What rows and prior leave of zeros and tilts is allowed for and not corrected; hoses and forces have no prior that
would suit every cell. If any is certain, each that alone explains all that is certain is named, and allowed for as a
whole; if none does, the most certain one is, with a warning. A vertical force is named and not allowed for: what hangs
on the flange counts as payload.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import cached_property, partial

import numpy as np

from armload_identification.estimation.arm_rows import ArmRows
from armload_identification.estimation.base_tilt import sideways, tilt_axes
from armload_identification.estimation.carried_torque import carried_torque, first_run_torque
from armload_identification.estimation.estimation_constants import DisturbanceLimits, Elasticity
from armload_identification.estimation.payload_intervals import NORMAL_HALF_WIDTH, ONE_SIDED
from armload_identification.estimation.posterior import Posterior
from armload_identification.estimation.solve import solve
from armload_identification.float_array import FloatArray
from armload_identification.model.body_model import BodyModel
from armload_identification.model.chain import Chain
from armload_identification.model.regressor import PARAMETERS, payload_torque

_STEP_RAD = 1e-5
"""Of the finite difference."""


class Disturbed(StrEnum):
    """What a disturbance is of."""

    ZERO = "zero"
    TILT = "tilt"
    HOSE = "hose"
    PULL = "vertical force"
    FORCE = "force"


@dataclass(frozen=True, eq=False)
class Disturbance:
    """A disturbance by the rows, if it is the only one.

    Attributes:
        of: What it is of.
        joint: Its joint, from 0, of a zero or a hose.
        error: (d,) position that the joint has beyond the recorded one and tilts in rad, torque of a hose at one
            standard deviation of the position in N m, force in the base frame or downwards in N.
        deviation: Standard deviation of its size.
        reach: (r, k) independent errors of one standard deviation that allow for the whole of it.
        pull: (k,) its share of the gradient.
    """

    of: Disturbed
    joint: int
    error: FloatArray
    deviation: float
    reach: FloatArray
    pull: FloatArray

    @property
    def size(self) -> float:
        """Its size, in the unit of `error`."""
        return float(np.linalg.norm(self.error))


@dataclass(frozen=True)
class Candidate:
    """A disturbance among the errors.

    Attributes:
        of: What it is of.
        joint: Its joint, from 0, of a zero or a hose.
        place: Its place among them.
        usual: Size that is usual, one standard deviation.
        worth: Least size that is worth a word.
        most: Greatest size.
    """

    of: Disturbed
    joint: int
    place: slice
    usual: float
    worth: float
    most: float


@dataclass(frozen=True, eq=False)
class Disturbances:
    """What the rows say of k errors: zeros of n joints, two tilts, hoses at n joints, and a force.

    Attributes:
        torque_nm: (k, N, n) axis torque per unit of each, on the first run of every group.
        gradient: (k,) and
        information: (k, k) of them, beside all other unknowns.
        level_nm: (n,) RMS torque of the joints.
        force_axes: (3, 3) directions of the force's components in the base frame: two sideways, and down.
    """

    torque_nm: Sequence[FloatArray]
    gradient: FloatArray
    information: FloatArray
    level_nm: FloatArray
    force_axes: FloatArray

    @classmethod
    def of(cls, found: Posterior, chain: Chain, body: BodyModel, errors: FloatArray | None = None) -> Disturbances:
        """From a solution.

        Args:
            found: The solution.
            chain: The arm, with the tilt of its calibration.
            body: The arm's links.
            errors: (m, p) errors of a calibrated arm, as of `KnownArm`.
        """
        look = partial(cls._of_solution, chain=chain, body=body, errors=errors)
        first = look(found)
        likely = sorted(first.candidates, key=first.certainty)[: -DisturbanceLimits.tried - 1 : -1]
        if first.certainty(likely[0]) < DisturbanceLimits.suspect:
            return first
        # while it is in the residual, it counts as noise and hides itself: once more without each that may be the one
        without = [(one, first.without(one, found, look)) for one in likely]
        return max(without, key=lambda each: each[1].certainty(each[0]))[1]

    def without(self, one: Candidate, found: Posterior, look: Callable[[Posterior], Disturbances]) -> Disturbances:
        """The same by the noise that is left without a disturbance.

        Args:
            one: The disturbance.
            found: The solution with it.
            look: What another solution of the same arm says.
        """
        error, _ = _alone(one, self.gradient, self.information)
        groups = [
            group.with_effort(group.runs[0].rows.effort_nm - np.tensordot(error, torque_nm[one.place], axes=1))
            for torque_nm, group in zip(self.torque_nm, found.problem.groups, strict=True)
        ]
        rest = look(solve(replace(found.problem, groups=groups), rough=True, start=found))
        gradient = rest.gradient + rest.information[:, one.place] @ error
        return replace(rest, torque_nm=self.torque_nm, gradient=gradient)

    @classmethod
    def _of_solution(cls, found: Posterior, chain: Chain, body: BodyModel, errors: FloatArray | None) -> Disturbances:
        """To first order, with what disturbs in the residual."""
        rows = found.problem.groups[0].runs[0].rows
        spread_rad = np.maximum(rows.position_rad.std(axis=0), _STEP_RAD)
        of_all = first_run_torque(found, body, lambda run, theta: _torque_by_zeros(run, chain, body, theta))
        of_one = first_run_torque(
            found, body, lambda run, theta: _torque_in_one_run(run, chain, body, theta, spread_rad), of_all=False
        )
        torque_nm = [np.concatenate(both) for both in zip(of_all, of_one, strict=True)]
        level_nm = np.sqrt(np.mean((rows.effort_nm @ np.linalg.inv(body.coupling)) ** 2, axis=0))
        return cls(torque_nm, *found.beside(*torque_nm, errors=errors), level_nm, _force_axes(chain))

    @cached_property
    def most_certain(self) -> Disturbance | None:
        """The disturbance that is most certain; None if none is certain."""
        one = max(self.candidates, key=self.certainty)
        return self._found(one) if self.certainty(one) > 1.0 else None

    @cached_property
    def explanations(self) -> list[Disturbance]:
        """Disturbances of which each alone explains all that is certain; none if nothing is, or if two are needed."""
        if self.most_certain is None:
            return []
        found = [one for one in self.candidates if self._explains(one)]
        vertical = any(one.of is Disturbed.PULL for one in found)
        return [self._found(one) for one in found if not (vertical and one.of is Disturbed.FORCE)]

    @property
    def named(self) -> list[Disturbance]:
        """The explanations; without any the most certain disturbance, if one is."""
        return self.explanations or ([] if self.most_certain is None else [self.most_certain])

    def certainty(self, one: Candidate) -> float:
        """Size of a disturbance relative to that from which it is certain."""
        return _certainty(one, *_alone(one, self.gradient, self.information))

    def _found(self, one: Candidate) -> Disturbance:
        """A disturbance by the rows, if it is the only one."""
        error, _ = _alone(one, self.gradient, self.information)
        covariance = np.linalg.inv(_bounded(one, self.information[one.place, one.place]))
        size = float(np.linalg.norm(error))
        along = error / size
        deviation = float(np.sqrt(along @ covariance @ along))
        own = [along * (size + ONE_SIDED * deviation) / NORMAL_HALF_WIDTH]
        if len(error) > 1:
            own.extend(np.linalg.cholesky(covariance).T)
        reach = np.zeros((len(own), self.gradient.size))
        reach[:, one.place] = own
        pull = self.information[:, one.place] @ error
        if one.of is Disturbed.FORCE:
            error = error @ self.force_axes
        return Disturbance(one.of, one.joint, error, deviation, reach, pull)

    def doubts(self) -> list[FloatArray]:
        """(d, N, n) axis torque of one standard deviation of d independent errors, on the first run of every group.

        A vertical force is not among them: it counts as payload.
        """
        gradient = self.gradient
        if self.most_certain is not None:  # what it causes is not read as zeros and tilts once more
            gradient = gradient - self.most_certain.pull
        placed = slice(0, self.level_nm.size + 2)
        prior = np.eye(placed.stop) / DisturbanceLimits.usual_rad**2
        covariance = np.linalg.inv(self.information[placed, placed] + prior)
        mean = covariance @ gradient[placed]
        errors = np.zeros((placed.stop, self.gradient.size))
        errors[:, placed] = np.linalg.cholesky(covariance + np.outer(mean, mean)).T
        errors = np.vstack([errors, *(one.reach for one in self.named if one.of is not Disturbed.PULL)])
        return [np.tensordot(errors, torque, axes=1) for torque in self.torque_nm]

    @cached_property
    def candidates(self) -> list[Candidate]:
        """All disturbances that are looked for."""
        limits, n = DisturbanceLimits, self.level_nm.size
        angle = limits.worth_rad, limits.most_rad
        sags = float(np.hypot(limits.usual_rad, Elasticity.lag_rad))
        force = limits.usual_n, limits.worth_n, limits.most_n
        zeros = [Candidate(Disturbed.ZERO, joint, slice(joint, joint + 1), sags, *angle) for joint in range(n)]
        hoses = [
            Candidate(
                Disturbed.HOSE, joint, slice(n + 2 + joint, n + 3 + joint), 0.0, limits.worth_share * level, level
            )
            for joint, level in enumerate(self.level_nm.tolist())
        ]
        tilt = Candidate(Disturbed.TILT, 0, slice(n, n + 2), limits.usual_rad, *angle)
        pull = Candidate(Disturbed.PULL, 0, slice(2 * n + 4, 2 * n + 5), *force)
        return [*zeros, tilt, *hoses, pull, Candidate(Disturbed.FORCE, 0, slice(2 * n + 2, 2 * n + 5), *force)]

    def _explains(self, one: Candidate) -> bool:
        """Whether it is likely, worth a word, and no other disturbance is certain where this one is unknown."""
        across, (error, deviation) = self.information[:, one.place], _alone(one, self.gradient, self.information)
        size, likely = float(np.linalg.norm(error)), NORMAL_HALF_WIDTH * float(np.hypot(deviation, one.usual))
        if size < max(one.worth, likely):
            return False
        gradient = self.gradient - across @ error
        information = self.information - across @ np.linalg.solve(_bounded(one, across[one.place]), across.T)
        others = (other for other in self.candidates if other.place != one.place)
        return all(_certainty(other, *_alone(other, gradient, information)) <= 1.0 for other in others)


def _bounded(one: Candidate, information: FloatArray) -> FloatArray:
    """(d, d) information of a disturbance that is at most as large as it can be."""
    return information + np.eye(len(information)) / max(one.most, _STEP_RAD) ** 2


def _alone(one: Candidate, gradient: FloatArray, information: FloatArray) -> tuple[FloatArray, float]:
    """(d,) the error of a disturbance without the others, and the standard deviation of its size."""
    own = _bounded(one, information[one.place, one.place])
    error = np.asarray(np.linalg.solve(own, gradient[one.place]))
    size = float(np.linalg.norm(error))
    along = error / size if size > 0.0 else np.eye(len(error))[0]
    return error, float((along @ own @ along) ** -0.5)


def _certainty(one: Candidate, error: FloatArray, deviation: float) -> float:
    """Size of an error relative to what is usual, chance, and what is worth a word."""
    expected = DisturbanceLimits.certain[len(error) - 1] * float(np.hypot(deviation, one.usual))
    return float(np.linalg.norm(error)) / max(one.worth, expected)


def _torque_by_zeros(rows: ArmRows, chain: Chain, body: BodyModel, theta: FloatArray) -> FloatArray:
    """(n, N, n) change of a run's joint torque per rad of each joint's position."""
    rates = rows.velocity_rad_s, rows.axis_acceleration_rad_s2 @ body.coupling.T
    moved = [rows.position_rad, *(rows.position_rad + _STEP_RAD * joint for joint in np.eye(chain.n))]
    carried_nm, *others = (carried_torque(chain, body, theta, position_rad, *rates) for position_rad in moved)
    return np.asarray((np.stack(others) - carried_nm) / _STEP_RAD)


def _torque_in_one_run(
    rows: ArmRows, chain: Chain, body: BodyModel, theta: FloatArray, spread_rad: FloatArray
) -> FloatArray:
    """(n + 5, N, n) joint torque: tilts per rad, hoses per N m at (n,) rad from the middle, and forces per N."""
    still = np.zeros_like(rows.position_rad)
    held, unit = (rows.position_rad, still, still), np.eye(1, PARAMETERS)[0]
    tilts = (carried_torque(side, body, theta, *held) for side in sideways(chain))
    away = (rows.position_rad - rows.position_rad.mean(axis=0)) / spread_rad
    forces = (payload_torque(chain.under(axis), unit, *held) for axis in _force_axes(chain))
    return np.stack([*tilts, *(away * joint for joint in np.eye(chain.n)), *forces])


def _force_axes(chain: Chain) -> FloatArray:
    """(3, 3) directions of force: two sideways, and down."""
    down = chain.gravity_m_s2 / np.linalg.norm(chain.gravity_m_s2)
    return np.stack([*tilt_axes(down), down])
