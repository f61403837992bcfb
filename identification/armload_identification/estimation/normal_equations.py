"""The normal equations of a group of runs at given unknowns: torque, derivatives, weights, and elimination.

The torque of a run follows from the terms that act on it (`term_kinds`). Rows are weighted by the speed of the joint
and by Huber's weight; samples close to a blow have none. The unknowns that only the group has are eliminated.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from armload_identification.estimation.blows import struck_samples
from armload_identification.estimation.estimation_constants import Solver
from armload_identification.estimation.problem import Group
from armload_identification.estimation.term_kinds import Joint, Load, LoadColumns, Motor, Placed, Shared
from armload_identification.float_array import FloatArray

if TYPE_CHECKING:
    from armload_identification.estimation.arm_rows import ArmRows

_ROUNDING: Final = 1e-13
_NONE: Final = np.zeros(0, dtype=np.intp)
_MOVED: Final = {Shared.DELAY: slice(1), Shared.TILT: slice(1, 3)}
"""Places of delay and tilts in what moves the torque of links and payload."""


@dataclass(frozen=True, eq=False)
class TorqueAt:
    """Torque of a run of n axes, N rows, and what its derivatives are made of.

    Attributes:
        predicted_nm: (N, n) axis torque with nominal gains.
        gain: (n,) factor of each axis.
        factor: (N, n) derivative of a joint's torque, friction included, by the torque that its gear carries.
        moved: (3,) delay of the torque in s and tilts of the base in rad.
        moved_nm: (N, n, 3) carried torque per unit of them.
        motor_rate_nm: (N, n) torque on the motors' side per second of delay.
        loads: Place and columns of each term that passes the gears.
        joints: Place and columns of each term of the joints.
        motors: Place and columns of each term of the motors.
    """

    predicted_nm: FloatArray
    gain: FloatArray
    factor: FloatArray
    moved: FloatArray
    moved_nm: FloatArray
    motor_rate_nm: FloatArray
    loads: list[tuple[slice, LoadColumns]]
    joints: list[tuple[slice, FloatArray, FloatArray | None]]
    motors: list[tuple[slice, FloatArray, FloatArray]]


AxisInformation = Mapping[tuple[int, int], tuple[NDArray[np.intp], FloatArray]]
"""By combination and axis: (k,) indices of the unknowns of its rows, and their (k, k) information."""
AxisColumns = tuple[FloatArray, NDArray[np.intp]]
"""(N, k) derivatives of an axis's torque, and (k,) indices of their unknowns."""


@dataclass(frozen=True, eq=False)
class Eliminated:
    """Normal equations of a group with its own unknowns eliminated.

    Attributes:
        information: (s, s) of the shared unknowns.
        gradient: (s,) of these.
        follow: (o, s) dependence of its own unknowns on the shared ones, with the opposite sign.
        own_step: (o,) step of its own unknowns if the shared ones do not change.
        own_gradient: (o,) gradient of its own unknowns.
        own_covariance: (o, o) of its own unknowns if the shared ones are known.
        axes: Information of each axis and combination alone.
    """

    information: FloatArray
    gradient: FloatArray
    follow: FloatArray
    own_step: FloatArray
    own_gradient: FloatArray
    own_covariance: FloatArray
    axes: AxisInformation

    def covariance(self, bread: FloatArray) -> FloatArray:
        """(s + o, s + o) covariance of shared and own unknowns.

        Args:
            bread: (s, s) that of the shared ones.
        """
        across = -bread @ self.follow.T
        own = self.own_covariance - self.follow @ across
        return np.block([[bread, across], [across.T, own]])

    def covariance_root(self, information: FloatArray) -> FloatArray:
        """(s + o, s + o) R with R R^T the covariance of shared and own unknowns.

        From the information: of its inverse, rounding spoils what is known well if other unknowns are hardly known.

        Args:
            information: (s, s) of the shared ones, from all groups.
        """
        scale = np.diag(information) ** -0.5
        power, axes = np.linalg.eigh(information * scale[:, None] * scale)
        shared = scale[:, None] * axes / np.sqrt(np.maximum(power, 0.0) + _ROUNDING)
        own = np.linalg.cholesky(self.own_covariance)
        return np.block([[shared, np.zeros((len(shared), len(own)))], [-self.follow @ shared, own]])


@dataclass(frozen=True, eq=False)
class WeightedRows:
    """Weighted rows of an axis in a group.

    Attributes:
        combination: Number of the combination of the group's runs.
        axis: Number of the axis.
        rows: (N, k) derivatives.
        target: (N,) residual.
        weight: (N,) their weights.
        place: (k,) indices of the unknowns, the group's own after the shared ones.
    """

    combination: int
    axis: int
    rows: FloatArray
    target: FloatArray
    weight: FloatArray
    place: NDArray[np.intp]


@dataclass(eq=False)
class GroupState:
    """A group at given unknowns, during and after the iteration.

    Attributes:
        group: Its rows.
        acting: The terms that act on each of its runs.
        coupling: (n, n) C of the motors.
        shared: (s,) places of the shared unknowns that are not known exactly, among all.
        own: (o,) places of its own.
        residual_nm: (g, N, n) measured minus predicted torque, as its rows are combined.
        torque: Predicted torque of each run.
        struck: (N,) rows excluded as blows.
        trust: Weight of the group; 1 unless it deviates as a whole.
    """

    group: Group
    acting: tuple[Placed, ...]
    coupling: FloatArray
    shared: NDArray[np.intp]
    own: NDArray[np.intp]
    residual_nm: FloatArray = field(init=False)
    torque: list[TorqueAt] = field(init=False)
    struck: NDArray[np.bool_] = field(init=False)
    trust: float = 1.0

    def __post_init__(self) -> None:
        self.struck = np.zeros(len(self.group.time_s), dtype=bool)

    @property
    def weighted_nm(self) -> FloatArray:
        """(g, N, n) residual, less where a joint turns or stands."""
        return self.residual_nm * self.group.weight

    def move_to(self, x: FloatArray) -> None:
        """Take all unknowns."""
        runs = zip(self.group.runs, self.acting, strict=True)
        self.torque = [torque_at(run.rows, placed, x, self.coupling) for run, placed in runs]
        predicted = np.stack([torque.predicted_nm for torque in self.torque])
        self.residual_nm = self.group.effort_nm - self.group.mixed(predicted)

    def relative_residual(self, noise_nm: FloatArray) -> FloatArray:
        """(c, n) RMS over the rows, relative to the noise."""
        relative = self.weighted_nm[:, ~self.struck] / noise_nm[self.group.noises, None]
        return np.asarray(np.sqrt(np.sum(relative**2, axis=1) / max(relative.shape[1], 1)))

    def judge(self, noise_nm: FloatArray, *, blows: bool) -> None:
        """Set the weight of the group, and if `blows` which rows are close to one."""
        if blows:
            # A blow hits one run. What the mean of two shows and their difference does not, the model lacks.
            self.struck = struck_samples(self.weighted_nm[0] / noise_nm[self.group.first_noise], self.group.time_s)
        self.trust = 1.0 / max(float(self.relative_residual(noise_nm).max()) / Solver.deviates, 1.0) ** 2

    def row_weights(self, noise_nm: FloatArray, correlation: FloatArray, *, robust: bool) -> FloatArray:
        """(g, N, n) weight of every row: root of its inverse variance."""
        noises = self.group.noises
        noise = noise_nm[noises, None]
        weight = self.group.weight * (np.sqrt(self.trust) / (noise * np.sqrt(correlation[noises, None])))
        if robust:
            weight = weight * huber_weight(self.weighted_nm / noise)
        return np.asarray(np.where(self.struck[:, None], 0.0, weight))

    def weighted_rows(self, weight: FloatArray) -> Iterator[WeightedRows]:
        """Rows of every axis and combination with (g, N, n) weights."""
        free = np.concatenate([self.shared, self.own])
        runs = zip(self.torque, self.acting, strict=True)
        found = (torque_derivatives(torque, placed, self.coupling) for torque, placed in runs)
        for axis, of_runs in enumerate(zip(*found, strict=True)):
            columns, place = joined_columns(of_runs)
            at = np.searchsorted(free, place)
            kept = free[np.minimum(at, free.size - 1)] == place
            for combination, rows in enumerate(self.group.mixed(columns[:, :, kept])):
                of_rows = weight[combination, :, axis]
                target = self.residual_nm[combination, :, axis] * of_rows
                yield WeightedRows(combination, axis, rows * of_rows[:, None], target, of_rows, at[kept])

    def eliminated(self, weight: FloatArray, precision: FloatArray, pull: FloatArray) -> Eliminated:
        """Its normal equations with (g, N, n) weights, and (o,) precision and gradient of its own unknowns' priors."""
        shared = self.shared.size
        whole = shared + self.own.size
        information, gradient = np.zeros((whole, whole)), np.zeros(whole)
        axes = {}
        for axis in self.weighted_rows(weight):
            of_axis = axis.rows.T @ axis.rows
            axes[axis.combination, axis.axis] = axis.place, of_axis
            information[np.ix_(axis.place, axis.place)] += of_axis
            gradient[axis.place] += axis.rows.T @ axis.target
        at = np.arange(shared, whole)
        information[at, at] += precision
        gradient[at] += pull
        return eliminate(information, gradient, shared, axes)


def torque_at(rows: ArmRows, terms: Placed, x: FloatArray, coupling: FloatArray) -> TorqueAt:
    """The torque, and what its derivatives are made of.

    Args:
        rows: The run.
        terms: The terms that act on it.
        x: All unknowns.
        coupling: (n, n) C of the motors.
    """
    shape = rows.effort_nm.shape
    moved = np.zeros(3)
    for law, of_law in _MOVED.items():
        for place in _acting(terms, law):
            moved[of_law] += x[place]
    tau, moved_nm = np.zeros(shape), np.zeros((*shape, 3))
    loads = [(place, term.law.columns(rows)) for term, place in terms if isinstance(term.law, Load)]
    for place, (level, change) in loads:
        change_nm = np.moveaxis(change @ x[place], 1, 2)
        tau += level @ x[place] + moved[0] * change_nm[:, :, 0] + change_nm[:, :, 1:] @ moved[1:]
        moved_nm += change_nm
    friction, factor = np.zeros(shape), np.ones(shape)
    joints = [(place, *term.law.columns(rows, tau)) for term, place in terms if isinstance(term.law, Joint)]
    for place, columns, slopes in joints:
        values = x[place].reshape(len(columns), 1, rows.n)
        friction += np.sum(columns * values, axis=0)
        if slopes is not None:
            factor += np.sum(slopes * values, axis=0)
    axis_nm, motor_rate_nm = (tau + friction) @ coupling, np.zeros(shape)
    motors = [(place, *term.law.columns(rows)) for term, place in terms if isinstance(term.law, Motor)]
    for place, level, rate in motors:
        axis_nm += (level + moved[0] * rate) * x[place]
        motor_rate_nm += rate * x[place]
    gain = np.exp(sum((x[place] for place in _acting(terms, Shared.GAIN)), np.zeros(rows.n)))
    return TorqueAt(np.asarray(gain * axis_nm), gain, factor, moved, moved_nm, motor_rate_nm, loads, joints, motors)


def torque_derivatives(at: TorqueAt, terms: Placed, coupling: FloatArray) -> Iterator[AxisColumns]:
    """Derivatives of every axis's torque by the values of the terms that act on the run."""
    whole = [
        (sum((by * part for by, part in zip(at.moved, np.moveaxis(change, 1, 0), strict=True)), level), place)
        for place, (level, change) in at.loads
    ]
    for law, of_law in _MOVED.items():
        whole += [(at.moved_nm[:, :, of_law], place) for place in _acting(terms, law)]
    n = at.predicted_nm.shape[1]
    nothing = np.zeros((*at.predicted_nm.shape, 0))
    through = np.concatenate([nothing, *(columns for columns, _ in whole)], axis=2) * at.factor[:, :, None]
    place_through = _indices(place for _, place in whole)
    delayed = (place_through[:, None] == _indices(_acting(terms, Shared.DELAY))).any(axis=1)
    own = np.concatenate([np.zeros((0, *at.predicted_nm.shape)), *(columns for _, columns, _ in at.joints)])
    starts = _indices(slice(place.start, place.start + n * len(columns), n) for place, columns, _ in at.joints)
    for axis, column in enumerate(coupling.T):
        joints = np.flatnonzero(column)
        share = column[joints] * at.gain[axis]
        ahead = np.einsum("tjk,j->tk", through[:, joints], share) if joints.size > 1 else through[:, joints[0]] * share
        ahead[:, delayed] += at.gain[axis] * at.motor_rate_nm[:, axis, None]
        parts = [
            (ahead, place_through),
            *((own[:, :, j].T * c, starts + j) for j, c in zip(joints, share, strict=True)),
        ]
        for place, level, rate in at.motors:
            of_motor = at.gain[axis] * (level + at.moved[0] * rate)[:, axis, None]
            parts.append((of_motor, np.array([place.start + axis])))
        predicted_nm = at.predicted_nm[:, axis, None]
        parts += [(predicted_nm, np.array([place.start + axis])) for place in _acting(terms, Shared.GAIN)]
        yield np.hstack([columns for columns, _ in parts]), np.concatenate([place for _, place in parts])


def _acting(terms: Placed, law: Shared) -> list[slice]:
    """Places of the terms with a law."""
    return [place for term, place in terms if term.law is law]


def _indices(places: Iterable[slice]) -> NDArray[np.intp]:
    """Indices of several places, one after the other."""
    return np.concatenate([_NONE, *(np.arange(place.start, place.stop, place.step) for place in places)])


def joined_columns(parts: Sequence[AxisColumns]) -> AxisColumns:
    """(g, N, k) columns of the runs of a group for all their unknowns, and (k,) indices of these."""
    if len(parts) == 1:
        return parts[0][0][None], parts[0][1]
    place = np.unique(np.concatenate([where for _, where in parts]))
    joined = np.zeros((len(parts), len(parts[0][0]), place.size))
    for run, (columns, where) in zip(joined, parts, strict=True):
        run[:, np.searchsorted(place, where)] = columns
    return joined, place


def huber_weight(relative: FloatArray) -> FloatArray:
    """Root of Huber's weight: 1 up to `Solver.huber`, from where a residual counts as its size, not its square.

    Args:
        relative: Residuals divided by their standard deviation.
    """
    return np.asarray(1.0 / np.sqrt(np.maximum(np.abs(relative) / Solver.huber, 1.0)))


def eliminate(information: FloatArray, gradient: FloatArray, shared: int, axes: AxisInformation) -> Eliminated:
    """Schur complement: the shared unknowns with the group's own eliminated."""
    own = len(gradient) - shared
    right = np.column_stack([information[shared:, :shared], gradient[shared:], np.eye(own)])
    solution = solved(information[shared:, shared:], right)
    follow, own_step, inverse = solution[:, :shared], solution[:, shared], solution[:, shared + 1 :]
    across = information[:shared, shared:]
    left, pull = information[:shared, :shared] - across @ follow, gradient[:shared] - across @ own_step
    return Eliminated(left, pull, follow, own_step, gradient[shared:], inverse, axes)


def solved(information: FloatArray, right: FloatArray) -> FloatArray:
    """Solution of the normal equations, scaled to unit diagonal, with a small regularisation against rounding."""
    scale = 1.0 / np.sqrt(np.diag(information))
    scaled = information * scale[:, None] * scale + _ROUNDING * np.eye(len(scale))
    tall = scale[:, None] if right.ndim > 1 else scale
    return np.asarray(tall * np.linalg.solve(scaled, right * tall))
