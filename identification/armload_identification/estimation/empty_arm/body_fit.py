"""Fit an arm's body and friction to runs without a payload.

The columns are those of `BodyModel`. The kinematics decide which parameters of links and rotors are identifiable, and
the run how well these are determined: a prior far wider than any arm keeps undetermined ones near zero and has no
noticeable effect on the others.

Load-dependent friction mu |tau_link| depends on the links' torque without the rotors'. It therefore makes rotors
identifiable that the torque of links and rotors cannot separate from their link. The problem becomes bilinear and is
solved by the Gauss-Newton method. A drive may report torque and position of different instants; that delay, one for
the arm, is also fitted: each millisecond shifts a payload's centre of mass by 4 % on the paper's motion.

The equations are means over windows (`body_rows`). Sample by sample, two effects were taken for a delay and for rotors.
For 0.1 s after a reversal a servo makes up for what friction held back: the torque of `prbt` and of a drafted arm
seemed 5 and 1.4 ms early. And torque ripple shakes the arm, which responds with an acceleration that the ripple
explains, not the reported torque: 5 ms on `er50`, with rotors 1.6 times too heavy.

References:
    Gautier, Numerical calculation of the base inertial parameters of robots, Journal of Robotic Systems 8(4), 1991.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from armload_core.arrays import FloatArray
from armload_identification.estimation.empty_arm.body_rows import BodyRows, BodySamples
from armload_identification.estimation.uncertainty import coefficient_deviation
from armload_identification.model.base_parameters import base_columns
from armload_identification.model.body_model import BodyModel
from armload_identification.model.chain import Chain
from armload_identification.model.regressor import PARAMETERS, body_regressor, rotor_columns
from armload_identification.signals.motion import Motion
from armload_identification.signals.reversals import moving_joints, reversal_speed

_PRIOR_FACTOR: Final = 30.0
"""Width of the prior, relative to an arm whose greatest torque is its own weight at full reach."""
_PRIOR_DELAY_S: Final = 0.02
_LEAST_NOISE: Final = 0.01
"""Initial noise as a share of a joint's torque; no fit is expected to get below it."""
_ITERATIONS: Final = 30
_SEARCHES: Final = 4
_GRID: Final = 33
GREATEST_LOAD_FRICTION: Final = 0.5
"""No gear of an arm loses a greater share of its load to friction."""
_SETTLED: Final = 1e-4
_ZERO: Final = 1e-9
_SHORTEST: Final = 0.05
_STATES: Final = 100
_DETERMINED: Final = 0.1
_GRAVITY_M_S2: Final = 9.81
_HAND_M: Final = 0.1


@dataclass(frozen=True, eq=False)
class BodyFit:
    """A body fitted to runs.

    Attributes:
        model: The body.
        residual_rms_nm: (n,) RMS of torque minus prediction over all samples used, reversals included.
        torque_rms_nm: (n,) RMS of the torque, for scale.
        base_parameters: Number of parameters of links and rotors that the kinematics make identifiable.
        determined: Number of these with a standard deviation below a tenth of the prior's.
        rotor_deviation_kg_m2: (n,) robust standard deviations; 0 where no rotor was fitted.
        load_deviation: (n,) those of the load-dependent friction; inf where none was fitted.
        delay_deviation_s: That of the torque's delay.
    """

    model: BodyModel
    residual_rms_nm: FloatArray
    torque_rms_nm: FloatArray
    base_parameters: int
    determined: int
    rotor_deviation_kg_m2: FloatArray
    load_deviation: FloatArray
    delay_deviation_s: float


def fit_body(runs: Sequence[Motion], chain: Chain, coupling: FloatArray) -> BodyFit:
    """Fit links, rotors and friction to runs without a payload.

    Args:
        runs: Runs without a payload.
        chain: The arm.
        coupling: (n, n) C of its motors.
    """
    system = _System(runs, chain, coupling)
    return system.named(system.fit())


@dataclass(frozen=True, eq=False)
class _Fit:
    """A solution and its residual.

    Attributes:
        cost: Sum of the logarithms of the joints' weighted residuals.
        parameters: (p,) all parameters, in the order of `_System`.
        used: (p,) True for those that were free.
        noise_nm: (n,) weighted residual per joint.
        left: (N, n) residual.
    """

    cost: float
    parameters: FloatArray
    used: NDArray[np.bool_]
    noise_nm: FloatArray
    left: FloatArray


class _System:
    """The bilinear model of runs, and its solution by the Gauss-Newton method.

    Parameters in this order: the links' base parameters, rotors, Coulomb, viscous, offset and
    load-dependent friction, each per joint, and the delay. The links' parameters exclude the rotors, unless only
    load-dependent friction could separate the two and there is none.

    A joint's torque depends only on the links beyond it and on its own friction, so that its rows have few non-zero
    columns.
    """

    def __init__(self, runs: Sequence[Motion], chain: Chain, coupling: FloatArray) -> None:
        q, dq = (np.vstack([run.states[i] for run in runs]) for i in range(2))
        n = chain.n
        self._runs, self._chain = runs, chain
        self._n, self._coupling = n, coupling
        self._noise = np.sqrt(np.mean([run.averaged_noise_nm**2 for run in runs], axis=0))
        self._turn_over = reversal_speed(dq)
        self._moving = np.abs(dq).max(axis=0) > self._turn_over
        base = base_columns(chain, coupling)
        self._base, self._rotor_base = base[: PARAMETERS * n], base[PARAMETERS * n :]
        self._fine = [BodySamples.of(run, chain, self._base, self._turn_over) for run in runs]
        moving = moving_joints(q)
        parts = [fine.rows(run, moving) for fine, run in zip(self._fine, runs, strict=True)]
        rows = BodyRows.joined(parts)
        self._torque, self._direction, self._weight = rows.torque_nm, rows.direction, rows.weight
        self._dq, self._ddq = rows.velocity_rad_s, rows.acceleration_rad_s2
        self._used_samples = max(int(np.count_nonzero(rows.weight.any(axis=1))), 1)
        turned = rows.acceleration_rad_s2, rows.jerk_rad_s3
        rotors, rotors_rate = (rotor_columns(values, coupling).transpose(0, 2, 1) for values in turned)
        self._links, self._links_rate, self._rotors, self._rotors_rate = (
            [_Columns.of(columns[:, joint]) for joint in range(n)]
            for columns in (rows.links, rows.links_rate, rotors, rotors_rate)
        )
        thin = slice(None, None, max(len(q) // _STATES, 1))
        self._inertias = _inertia_columns(chain, q[thin])[:, :, self._base]
        # Orthonormal columns of the friction that is independent of the load.
        own = np.stack([self._direction, self._dq, np.ones_like(self._dq)], axis=2) * self._weight[:, :, None]
        self._own = [np.linalg.qr(own[:, joint])[0] for joint in range(n)]
        torque = np.vstack([run.torque_nm[run.valid] for run in runs])
        self._level = np.sqrt(np.mean(torque**2, axis=0))
        greatest = float(np.abs(torque).max())
        mass, reach = _size(chain, greatest)
        link = np.tile(mass * np.array([1.0] + [reach] * 3 + [reach**2] * 6), n)[self._base]
        own = np.full(3 * n, _PRIOR_FACTOR * greatest)
        self._width = np.concatenate([link, np.full(n, mass * reach**2), own, np.ones(n), [_PRIOR_DELAY_S]])
        edges = np.cumsum([0, link.size, *[n] * 5])
        names = ("links", "rotors", "coulomb", "viscous", "offset", "load")
        self._of = {name: slice(*pair) for name, pair in zip(names, pairwise(edges), strict=True)}
        self._place = [self._place_of(joint) for joint in range(n)]

    def fit(self) -> _Fit:
        """The best solution; a joint whose friction does not grow with its load has no such column."""
        plain = self._gauss_newton(np.zeros(self._n, dtype=bool), None)
        allowed = self._moving
        while allowed.any():
            found = self._gauss_newton(allowed, plain)
            load = found.parameters[self._of["load"]]
            possible = (load > 0.0) & (load <= GREATEST_LOAD_FRICTION)
            if (possible | ~allowed).all():
                # This one may have diverged.
                return found if found.cost <= plain.cost else plain
            allowed = allowed & possible
        return plain

    def named(self, fit: _Fit) -> BodyFit:
        """A solution as `BodyFit`."""
        n, of, x = self._n, self._of, fit.parameters
        links = np.zeros(PARAMETERS * n)
        links[self._base] = x[of["links"]]
        model = BodyModel(
            links=links.reshape(n, PARAMETERS),
            base=self._base.reshape(n, PARAMETERS),
            rotor_inertia_kg_m2=x[of["rotors"]],
            coulomb_nm=x[of["coulomb"]],
            viscous_nm_s_rad=x[of["viscous"]],
            root_nm=np.zeros(n),
            offset_nm=x[of["offset"]],
            load_friction=x[of["load"]],
            torque_delay_s=float(x[-1]),
            reversal_speed_rad_s=self._turn_over,
            coupling=self._coupling,
        )
        white, robust = self._deviations(fit)
        inertial = np.concatenate([np.ones(of["links"].stop, dtype=bool), self._rotor_base])
        rotor = robust[of["rotors"]]
        return BodyFit(
            model=model,
            residual_rms_nm=self._residual(model),
            torque_rms_nm=self._level,
            base_parameters=int(np.count_nonzero(inertial)),
            determined=int(np.count_nonzero((white / self._width)[: inertial.size][inertial] < _DETERMINED)),
            rotor_deviation_kg_m2=np.where(np.isfinite(rotor), rotor, 0.0),
            load_deviation=robust[of["load"]],
            delay_deviation_s=float(robust[-1]),
        )

    def _gauss_newton(self, allowed: NDArray[np.bool_], start: _Fit | None) -> _Fit:
        """A solution with load-dependent friction on the allowed joints."""
        of = self._of
        used = np.ones(self._width.size, dtype=bool)
        used[of["rotors"]] = self._rotor_base | allowed
        used[of["load"]] = allowed
        if start is None:
            x = np.zeros(self._width.size)
            noise = np.maximum(np.maximum(self._noise, _LEAST_NOISE * self._level), _ZERO)
        else:
            x, noise = self._searched(start, allowed, used)
        cost = np.inf
        left, carried = self._left(x)
        for _ in range(_ITERATIONS):
            step = self._step(x, left, carried, noise, used)
            share = 1.0
            while True:
                trial = x + share * step
                left, carried = self._left(trial)
                reached = self._noise_of(left)
                after = float(np.sum(np.log(reached)))
                if after < cost or share < _SHORTEST:
                    break
                share *= 0.5
            if not after < cost - _SETTLED:
                break
            x, noise, cost = trial, reached, after
        left, _ = self._left(x)
        return _Fit(cost, x, used, noise, left)

    def _searched(
        self, start: _Fit, allowed: NDArray[np.bool_], used: NDArray[np.bool_]
    ) -> tuple[FloatArray, FloatArray]:
        """The starting point: rotors and load-dependent friction searched joint by joint, the rest fitted to them.

        From other starting points Gauss-Newton may converge to a minimum with rotors as heavy as the arm.
        """
        of, x, noise = self._of, start.parameters.copy(), start.noise_nm
        others = used.copy()
        others[of["rotors"]] = others[of["load"]] = False
        for _ in range(_SEARCHES):
            inertia = self._inertias @ x[of["links"]] + x[of["rotors"]]
            greatest = np.maximum(inertia.min(axis=0), 0.0)
            without = x.copy()
            without[of["load"]] = 0.0
            left, carried = self._left(without)
            for joint in map(int, np.flatnonzero(allowed)):
                rotor = self._rotors[joint].column(joint)
                total = carried[:, joint] + rotor * x[of["rotors"]][joint]
                found = self._search(joint, total, rotor, float(greatest[joint]), left[:, joint])
                x[of["rotors"].start + joint], x[of["load"].start + joint] = found
            left, carried = self._left(x)
            x = x + self._step(x, left, carried, noise, others)
            noise = self._noise_of(self._left(x)[0])
        return x, noise

    def _search(
        self, joint: int, total: FloatArray, rotor: FloatArray, greatest: float, left: FloatArray
    ) -> tuple[float, float]:
        """Rotor and load-dependent friction of a joint, from the residual of a fit without the latter."""
        weight, direction, basis = self._weight[:, joint], self._direction[:, joint], self._own[joint]
        inertia = np.linspace(0.0, greatest, _GRID)
        columns = (direction * weight)[:, None] * np.abs(total[:, None] - rotor[:, None] * inertia)
        columns -= basis @ (basis.T @ columns)
        along = np.maximum(columns.T @ (left * weight), 0.0)
        size = np.maximum(np.sum(columns**2, axis=0), _ZERO)
        best = int(np.argmax(along**2 / size))
        return float(inertia[best]), float(min(along[best] / size[best], GREATEST_LOAD_FRICTION))

    def _left(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(N, n) residual torque, and (N, n) torque of the links."""
        of = self._of
        carried = np.column_stack([columns @ x[of["links"]] for columns in self._links])
        rotors = np.column_stack([columns @ x[of["rotors"]] for columns in self._rotors])
        friction = self._direction * x[of["coulomb"]] + self._losses(x) * x[of["load"]]
        torque = carried + rotors + friction + self._dq * x[of["viscous"]]
        torque += x[of["offset"]]
        return self._torque - torque + x[-1] * self._rate(x, carried), carried

    def _losses(self, x: FloatArray) -> FloatArray:
        """(N, n) means of s |tau_links|: that of the mean torque is smaller where the torque changes its sign."""
        links = x[self._of["links"]]
        return np.concatenate([fine.losses(links) for fine in self._fine])

    def _rate(self, x: FloatArray, carried: FloatArray) -> FloatArray:
        """(N, n) time derivative of the model's torque, for joints that keep their direction."""
        of = self._of
        links = np.column_stack([columns @ x[of["links"]] for columns in self._links_rate])
        rotors = np.column_stack([columns @ x[of["rotors"]] for columns in self._rotors_rate])
        loaded = 1.0 + x[of["load"]] * self._direction * np.sign(carried)
        return np.asarray(links * loaded + rotors + self._ddq * x[of["viscous"]])

    def _residual(self, model: BodyModel) -> FloatArray:
        """(n,) RMS of torque minus prediction over all samples used, reversals included."""
        left = [
            (run.torque_nm - model.torque(self._chain, *run.with_delay(model.torque_delay_s).states))[run.valid]
            for run in self._runs
        ]
        return np.asarray(np.sqrt(np.mean(np.vstack(left) ** 2, axis=0)))

    def _step(
        self,
        x: FloatArray,
        left: FloatArray,
        carried: FloatArray,
        noise: FloatArray,
        used: NDArray[np.bool_],
    ) -> FloatArray:
        """(p,) step, from the normal equations: the next step corrects their rounding errors."""
        gram = np.diag(np.ones(x.size))
        side = -x / self._width
        for joint, rows in enumerate(self._rows(x, left, carried)):
            place = self._place[joint]
            width = self._width[place] / noise[joint]
            gram[place[:, None], place] += rows @ rows.T * np.outer(width, width)
            side[place] += width * (rows @ (left[:, joint] * self._weight[:, joint])) / noise[joint]
        step = np.zeros_like(x)
        step[used] = self._width[used] * np.linalg.solve(gram[np.ix_(used, used)], side[used])
        return step

    def _rows(self, x: FloatArray, left: FloatArray, carried: FloatArray) -> Iterator[FloatArray]:
        """(k, N) per joint: weighted derivatives of its torque with respect to the parameters of `_place_of`."""
        weight, of_velocity = self._weight.T, (self._direction, self._dq, np.ones_like(self._dq))
        factor = self._weight * (1.0 + x[self._of["load"]] * self._direction * np.sign(carried))
        beside = (*of_velocity, self._losses(x), -self._rate(x, carried))
        others = np.ascontiguousarray((np.stack(beside) * self._weight).transpose(2, 0, 1))
        for joint, by_links in enumerate(np.ascontiguousarray(factor.T)):
            links, rotors = self._links[joint].values, self._rotors[joint].values
            yield np.concatenate([links * by_links, rotors * weight[joint], others[joint]])

    def _place_of(self, joint: int) -> NDArray[np.intp]:
        """(k,) indices of the parameters that a joint's torque depends on."""
        of = self._of
        own = [of[name].start + joint for name in ("coulomb", "viscous", "offset", "load")]
        rotors = of["rotors"].start + self._rotors[joint].place
        return np.concatenate([self._links[joint].place, rotors, own, [self._width.size - 1]])

    def _deviations(self, fit: _Fit) -> tuple[FloatArray, FloatArray]:
        """(p,) standard deviations for a white residual, and (p,) robust ones; inf where a parameter was not used."""
        x, used = fit.parameters, np.flatnonzero(fit.used)
        _, carried = self._left(x)
        everything = np.zeros((x.size, len(fit.left), self._n))
        triangles = [np.eye(x.size)]
        for joint, rows in enumerate(self._rows(x, fit.left, carried)):
            place = self._place[joint]
            columns = rows * (self._width[place] / fit.noise_nm[joint])[:, None]
            everything[place, :, joint] = columns
            # A joint's rows have few non-zero columns; the R factor of these replaces the rows.
            triangle = np.asarray(np.linalg.qr(columns.T, mode="r"))
            triangles.append(np.zeros((len(triangle), x.size)))
            triangles[-1][:, place] = triangle
        everything = everything[used].transpose(1, 2, 0)
        triangle = np.asarray(np.linalg.qr(np.vstack(triangles)[:, used], mode="r"))
        white, robust = np.full(x.size, np.inf), np.full(x.size, np.inf)
        white[used] = self._width[used] * np.sqrt(np.sum(np.linalg.inv(triangle) ** 2, axis=1))
        residual = fit.left * self._weight / fit.noise_nm
        robust[used] = self._width[used] * coefficient_deviation(everything, residual, self._weight, triangle)
        return white, robust

    def _noise_of(self, left: FloatArray) -> FloatArray:
        """(n,) weighted RMS of the residual."""
        size = np.sqrt(np.sum((left * self._weight) ** 2, axis=0) / self._used_samples)
        return np.asarray(np.maximum(size, _ZERO))


@dataclass(frozen=True, eq=False)
class _Columns:
    """The non-zero columns of a matrix.

    Attributes:
        values: (k, N) the columns.
        place: (k,) their indices.
    """

    values: FloatArray
    place: NDArray[np.intp]

    @classmethod
    def of(cls, matrix: FloatArray) -> _Columns:
        place = np.flatnonzero(np.any(matrix != 0.0, axis=0))
        return cls(np.ascontiguousarray(matrix[:, place].T), place)

    def __matmul__(self, parameters: FloatArray) -> FloatArray:
        return np.asarray(parameters[self.place] @ self.values)

    def column(self, index: int) -> FloatArray:
        """(N,) one column of the full matrix."""
        found = np.flatnonzero(self.place == index)
        return self.values[found[0]] if found.size else np.zeros(self.values.shape[1])


def _inertia_columns(chain: Chain, q: FloatArray) -> FloatArray:
    """(N, n, 10 n) slope, by the links' parameters, of the inertia that each joint turns with the others at rest."""
    still = np.zeros_like(q)
    gravity = body_regressor(chain, q, still, still)
    columns = []
    for joint, unit in enumerate(np.eye(chain.n)):
        pushed = body_regressor(chain, q, still, np.tile(unit, (len(q), 1)))
        columns.append(pushed[:, joint] - gravity[:, joint])
    return np.stack(columns, axis=1)


def _size(chain: Chain, torque_nm: float) -> tuple[float, float]:
    """Upper bounds of mass (kg) and length (m) of a link of an arm with this torque."""
    reach = float(np.sum(np.sqrt(np.sum(chain.placement[:, :3, 3] ** 2, axis=1)))) + _HAND_M
    return _PRIOR_FACTOR * torque_nm / (_GRAVITY_M_S2 * reach), reach
