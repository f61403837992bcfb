"""Terms of an arm's torque: unknowns with columns, a prior and a scope.

    y = exp(gains) [C^T (tau + friction(tau)) + rotors],        tau = links + payload, shifted by delay and tilt

A term acts at one of these places, its law. What the law does not say (which runs share it, what is known of it
beforehand, and from where) is in the term. A new term needs a law's columns and one line in the list of terms that a
problem is made of: `CONTRIBUTING.md` shows one.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from armload_core.arrays import FloatArray

if TYPE_CHECKING:
    from armload_identification.estimation.arm_rows import ArmRows


class Scope(StrEnum):
    """What shares the values of a term."""

    ARM = "arm"
    MOUNTING = "mounting"
    RUN = "run"


LoadColumns = tuple[FloatArray, FloatArray, FloatArray]


@dataclass(frozen=True)
class Load:
    """Torque that is linear in the values and passes the gears: links and payloads.

    Attributes:
        columns: Of N rows: (N, n, k) columns, (N, n, k) their change per second of delay, and (2, N, n, k) per rad of
            tilt.
    """

    columns: Callable[[ArmRows], LoadColumns]


@dataclass(frozen=True)
class Joint:
    """Torque of each joint that is linear in m values per joint and may depend on the torque its gear carries.

    Attributes:
        columns: Of N rows and the (N, n) carried torque: (m, N, n) torque per unit, and (m, N, n) its derivative with
            respect to the carried torque, None where it does not depend on it.
    """

    columns: Callable[[ArmRows, FloatArray], tuple[FloatArray, FloatArray | None]]


@dataclass(frozen=True)
class Motor:
    """Torque of each axis on the motor's side of the coupling.

    Attributes:
        columns: Of N rows: (N, n) torque per unit, and (N, n) its change per second of delay.
    """

    columns: Callable[[ArmRows], tuple[FloatArray, FloatArray]]


class Shared(StrEnum):
    """Laws without columns of their own: they act on all of the torque."""

    GAIN = "logarithm of the factor of each axis"
    DELAY = "delay of the torque"
    TILT = "tilt of the base"


Law = Load | Joint | Motor | Shared
Values = Mapping[str, FloatArray]
"""Values of the arm's terms by name."""


@dataclass(frozen=True, eq=False)
class Term:
    """An unknown of k values.

    Attributes:
        name: Its name, unique in a problem.
        scope: What shares its values.
        law: How it acts.
        mean: (k,) expected values.
        deviation: (k,) their standard deviations; 0 where a value is known exactly, inf where nothing is known.
        origin: Where the standard deviation comes from.
        rescaled: The (k,) standard deviations for other values of the arm's terms, if they are shares of these.
        pooled: (k,) number, from 0, of the factor on its standard deviation that is estimated from all values with the
            same number; None if the standard deviations are as given.
        freedom: Degrees of freedom that the stated standard deviation of a pooled term is worth.
    """

    name: str
    scope: Scope
    law: Law
    mean: FloatArray
    deviation: FloatArray
    origin: str
    rescaled: Callable[[Values], FloatArray] | None = None
    pooled: NDArray[np.intp] | None = None
    freedom: float = 0.0


@dataclass(frozen=True, eq=False)
class TorqueAt:
    """Torque of a run of n axes, N rows, and what its derivatives are made of.

    Attributes:
        predicted_nm: (N, n) axis torque with nominal gains.
        gain: (n,) factor of each axis.
        factor: (N, n) derivative of a joint's torque, friction included, by the torque that its gear carries.
        delay_s: Delay of the torque.
        tilt_rad: (2,) tilt of the base.
        rate_nm: (N, n) carried torque per second of delay.
        tilt_nm: (N, n, 2) carried torque per rad of tilt.
        motor_rate_nm: (N, n) torque on the motors' side per second of delay.
        loads: Place and columns of each term that passes the gears.
        joints: Place and (m, N, n) columns of each term of the joints.
        motors: Place and (N, n) column of each term of the motors.
    """

    predicted_nm: FloatArray
    gain: FloatArray
    factor: FloatArray
    delay_s: float
    tilt_rad: FloatArray
    rate_nm: FloatArray
    tilt_nm: FloatArray
    motor_rate_nm: FloatArray
    loads: list[tuple[slice, LoadColumns]]
    joints: list[tuple[slice, FloatArray]]
    motors: list[tuple[slice, FloatArray]]


@dataclass(frozen=True, eq=False)
class Derivatives:
    """Derivatives of a run's torque.

    Attributes:
        columns: Per axis (N, k).
        place: Per axis (k,) indices of their unknowns.
    """

    columns: tuple[FloatArray, ...]
    place: tuple[NDArray[np.intp], ...]


Placed = tuple[tuple[Term, slice], ...]
"""The terms that act on a run, and where the values of each are."""

_NONE: Final = np.zeros(0, dtype=np.intp)


class TorqueModel:
    """Axis torque with nominal gains from the terms that act on a run.

    Args:
        coupling: (n, n) C of the motors.
    """

    def __init__(self, coupling: FloatArray) -> None:
        self._coupling = coupling
        self._joints = [np.flatnonzero(column) for column in coupling.T]

    def derivatives(self, at: TorqueAt, terms: Placed) -> Derivatives:
        """Derivatives of the torque.

        Args:
            at: Where they are taken.
            terms: The terms that act on the run.
        """
        whole, places = [], []
        for place, (level, rate, tilted) in at.loads:
            moved = level + at.delay_s * rate
            moved += at.tilt_rad[0] * tilted[0]
            moved += at.tilt_rad[1] * tilted[1]
            whole.append(moved)
            places.append(_indices(place))
        for law, torque in ((Shared.DELAY, at.rate_nm[:, :, None]), (Shared.TILT, at.tilt_nm)):
            for _, place in _acting(terms, law):
                whole.append(torque)
                places.append(_indices(place))
        through = np.concatenate([np.zeros((*at.predicted_nm.shape, 0)), *whole], axis=2) * at.factor[:, :, None]
        place_through = np.concatenate([_NONE, *places])
        delays = np.concatenate([_NONE, *(_indices(place) for _, place in _acting(terms, Shared.DELAY))])
        own = np.concatenate([np.zeros((0, *at.predicted_nm.shape)), *(columns for _, columns in at.joints)])
        n = at.predicted_nm.shape[1]
        starts = np.concatenate(
            [_NONE, *(place.start + n * np.arange(len(columns)) for place, columns in at.joints)]
        ).astype(np.intp)
        gains = [place.start for _, place in _acting(terms, Shared.GAIN)]
        found, where = [], []
        for axis, joints in enumerate(self._joints):
            share = self._coupling[joints, axis] * at.gain[axis]
            ahead = (
                np.einsum("tjk,j->tk", through[:, joints], share) if joints.size > 1 else through[:, joints[0]] * share
            )
            ahead[:, np.isin(place_through, delays)] += at.gain[axis] * at.motor_rate_nm[:, axis, None]
            parts = [ahead, *(own[:, :, j].T * c for j, c in zip(joints, share, strict=True))]
            indices = [place_through, *(starts + j for j in joints)]
            for place in gains:
                parts.append(at.predicted_nm[:, axis, None])
                indices.append(np.array([place + axis]))
            for place, columns in at.motors:
                parts.append(at.gain[axis] * columns[:, axis, None])
                indices.append(np.array([place.start + axis]))
            found.append(np.hstack(parts))
            where.append(np.concatenate(indices).astype(np.intp))
        return Derivatives(tuple(found), tuple(where))

    def predict(self, rows: ArmRows, terms: Placed, x: FloatArray) -> TorqueAt:
        """The torque, and what its derivatives are made of.

        Args:
            rows: The run.
            terms: The terms that act on it.
            x: All unknowns.
        """
        shape = rows.effort_nm.shape
        delay = sum((float(x[place][0]) for _, place in _acting(terms, Shared.DELAY)), 0.0)
        tilt = sum((x[place] for _, place in _acting(terms, Shared.TILT)), np.zeros(2))
        tau, rate_nm, tilt_nm = np.zeros(shape), np.zeros(shape), np.zeros((*shape, 2))
        loads: list[tuple[slice, LoadColumns]] = []
        joints: list[tuple[slice, FloatArray]] = []
        motors: list[tuple[slice, FloatArray]] = []
        for term, place in terms:
            if isinstance(term.law, Load):
                of_load = term.law.columns(rows)
                level, rate, tilted = of_load
                values = x[place]
                of_rate, of_tilt = rate @ values, np.moveaxis(tilted @ values, 0, 2)
                tau += level @ values + delay * of_rate + of_tilt @ tilt
                rate_nm += of_rate
                tilt_nm += of_tilt
                loads.append((place, of_load))
        friction, factor = np.zeros(shape), np.ones(shape)
        for term, place in terms:
            if isinstance(term.law, Joint):
                columns, slopes = term.law.columns(rows, tau)
                values = x[place].reshape(len(columns), 1, rows.n)
                friction += np.sum(columns * values, axis=0)
                if slopes is not None:
                    factor += np.sum(slopes * values, axis=0)
                joints.append((place, columns))
        axis_nm = (tau + friction) @ self._coupling
        motor_rate_nm = np.zeros(shape)
        for term, place in terms:
            if isinstance(term.law, Motor):
                level, rate = term.law.columns(rows)
                moved = level + delay * rate
                axis_nm += moved * x[place]
                motor_rate_nm += rate * x[place]
                motors.append((place, moved))
        gain = np.exp(sum((x[place] for _, place in _acting(terms, Shared.GAIN)), np.zeros(rows.n)))
        predicted = np.asarray(gain * axis_nm)
        return TorqueAt(predicted, gain, factor, delay, tilt, rate_nm, tilt_nm, motor_rate_nm, loads, joints, motors)


def _acting(terms: Placed, law: Shared) -> list[tuple[Term, slice]]:
    """The terms with a law."""
    return [(term, place) for term, place in terms if term.law is law]


def _indices(place: slice) -> NDArray[np.intp]:
    return np.arange(place.start, place.stop)
