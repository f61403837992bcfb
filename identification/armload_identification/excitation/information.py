"""How well a motion determines a payload: the information matrix, and the criteria derived from it.

    M = sum_t R_t^T W R_t,        R = Phi - F (F^T F)^-1 F^T Phi for each joint,        F_t = [sign(dq), dq, 1]

A-optimal: the trace of the covariance of the parameters' errors, each relative to a scale, with W the inverse
covariance of the joints' torque noise; for one expected payload, or its mean or its greatest value over a set.
D-optimal: the volume of the errors' ellipsoid. R is the part of the regressor that cannot be a change of the joint's
friction or offset between two runs, which the identification does not know either: without it three joints are best
moved with one harmonic, which leaves a coordinate of the centre of mass four times as uncertain.
Condition number: cond(Phi) = sqrt(cond(M)) with W = 1 and R = Phi (Chen 2016). By itself it is a poor criterion,
because it depends on neither the noise nor the payload.

Directions of the parameter space that no motion of the arm can identify (few joints, an axis along gravity) are
excluded from all criteria: they would make every motion equally bad.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from armload_core import kernels
from armload_identification.excitation.fourier import CRITERIA, ROBUST_CRITERIA
from armload_identification.float_array import FloatArray
from armload_identification.identification_errors import ExcitationError
from armload_identification.model.chain import Chain
from armload_identification.model.finite_array import finite_array
from armload_identification.model.payload import REFERENCE_LENGTH_M, InertialParameters
from armload_identification.model.regressor import payload_regressor

NOISE_RATE_HZ = 100.0
"""Sampling rate to which torque noise refers."""

SHARPNESS = 50
"""Exponent of the smooth maximum of several costs."""

_TURNS_RAD_S = 0.05
"""Speed within which friction changes its direction, as of the joints of large arms."""

_STANDING_SQUARED = 1e-6
"""Square of the speed in rad/s, and of a mean, that counts as none."""

_RANK_TOLERANCE = 1e-8
_PROBE_STATES = 200


@dataclass(frozen=True, eq=False, slots=True)
class Criterion:
    """A cost, to be minimised, of a motion of one period.

    Attributes:
        name: One of `CRITERIA`.
        chain: The arm.
        row_weight: (n,) diagonal of W for one sample at NOISE_RATE_HZ.
        bases: One (10, r) per payload: theta = basis x, over the r identifiable directions; contains the scales.
    """

    name: str
    chain: Chain
    row_weight: FloatArray
    bases: tuple[FloatArray, ...]

    @property
    def rank(self) -> int:
        """Number of identifiable directions, at most ten."""
        return int(self.bases[0].shape[1])

    def cost(self, q: FloatArray, dq: FloatArray, ddq: FloatArray, period_s: float) -> float:
        """The criterion of N equidistant samples (N, n) of a period; inf if they leave a direction undetermined.

        A-optimal: sum of the squared relative standard deviations after one period sampled at NOISE_RATE_HZ.
        D-optimal: geometric mean of the squared relative standard deviations along the ellipsoid's axes.
        """
        information = self._rows(q, dq, ddq, period_s)[0]
        values = [np.asarray(np.linalg.eigvalsh(basis.T @ information @ basis)) for basis in self.bases]
        if not all(_determines_everything(value) for value in values):
            return np.inf
        exactly = self.name == "condition-number"
        costs = [float(np.sqrt(v[-1] / v[0])) if exactly else self._smooth_cost(v)[0] for v in values]
        return max(costs) if self.name == "a-optimal-max" else float(np.mean(costs))

    def cost_and_slope(
        self, q: FloatArray, dq: FloatArray, ddq: FloatArray, period_s: float
    ) -> tuple[float, FloatArray]:
        """The criterion and its derivative by the samples.

        Maximum and minimum are not differentiable, which would stop an optimiser. They are replaced by the smooth
        (sum x^k)^(1/k) and (sum x^-k)^(-1/k), k = SHARPNESS, at most a factor P^(1/k) too large or too small for P
        numbers. The greatest cost of three payloads is at most 2 % too large here, and the condition number, from the
        largest and smallest of ten eigenvalues, at most 5 %.

        Returns:
            The cost, and (3, N, n) its derivative by q, dq and ddq.
        """
        slope = np.zeros((3, *q.shape))
        information, weighted, share_of_friction, friction_slope = self._rows(q, dq, ddq, period_s)
        costs, gains = [], []
        for basis in self.bases:
            value, vector = np.linalg.eigh(basis.T @ information @ basis)
            if not _determines_everything(value):
                return np.inf, slope
            cost, by_value = self._smooth_cost(np.asarray(value, dtype=np.float64))
            costs.append(cost)
            gains.append(basis @ (vector * by_value) @ vector.T @ basis.T)
        if self.name == "a-optimal-max":
            total, shares = _smooth_greatest(np.array(costs))
        else:
            total, shares = float(np.mean(costs)), np.full(len(costs), 1.0 / len(costs))
        by_phi = 2.0 * weighted @ sum(share * part for share, part in zip(shares, gains, strict=True))
        q, dq, ddq = (np.ascontiguousarray(a) for a in (q, dq, ddq))
        kernels.regressor_slope_into(self.chain.packed, by_phi.transpose(1, 0, 2).copy(), q, dq, ddq, slope)
        # dM at a constant share of friction, which is the best one
        slope[1] -= np.sum(by_phi @ share_of_friction.transpose(0, 2, 1) * friction_slope, axis=2).T
        return total, slope

    def _rows(self, q: FloatArray, dq: FloatArray, ddq: FloatArray, period_s: float) -> tuple[FloatArray, ...]:
        """What N samples show that weigh as much as a period sampled at NOISE_RATE_HZ.

        Returns:
            (10, 10) M; (n, N, 10) W R; (n, 3, 10) share of the regressor in the three columns of friction; (n, N, 3)
            derivative of these columns by the speed.
        """
        phi = payload_regressor(self.chain, q, dq, ddq).transpose(1, 0, 2)
        speed = dq.T
        smooth, one, none = np.sqrt(speed**2 + _TURNS_RAD_S**2), np.ones_like(speed), np.zeros_like(speed)
        friction = np.stack([speed / smooth, speed, one], axis=2)
        friction_slope = np.stack([_TURNS_RAD_S**2 / smooth**3, one, none], axis=2)
        if self.name == "condition-number":
            friction[:] = 0.0
        columns = friction.transpose(0, 2, 1)
        share = np.asarray(np.linalg.solve(columns @ friction + _STANDING_SQUARED * len(dq) * np.eye(3), columns @ phi))
        weight = self.row_weight * (period_s * NOISE_RATE_HZ / len(q))
        weighted = weight[:, None, None] * (phi - friction @ share)
        return np.tensordot(weighted, phi, axes=((0, 1), (0, 1))), weighted, share, friction_slope

    def _smooth_cost(self, value: FloatArray) -> tuple[float, FloatArray]:
        """The smooth criterion from the eigenvalues (r,) of one information matrix, and its derivative by these."""
        if self.name == "condition-number":
            (greatest, up), (least, down) = _smooth_greatest(value), _smooth_greatest(1.0 / value)
            condition = float(np.sqrt(greatest * least))
            return condition, 0.5 * condition * (up / greatest - down / (least * value**2))
        if self.name == "d-optimal":
            mean = float(np.exp(-np.mean(np.log(value))))
            return mean, -mean / (len(value) * value)
        return float(np.sum(1.0 / value)), -1.0 / value**2


def named_criterion(
    name: str,
    chain: Chain,
    torque_noise_nm: FloatArray,
    expected_payload: InertialParameters,
    payload_set: Sequence[InertialParameters] = (),
) -> Criterion:
    """A criterion by its name in `CRITERIA`.

    Each parameter's error is relative to its expected value, but at least to the scale that defines "determined": the
    mass m, the first moment m (0.1 m), the inertia m (0.1 m)^2. Otherwise infinite accuracy would be required of a
    parameter that is expected to be zero. The scale affects the optimum of the A-optimal criteria, only the unit of
    the D-optimal cost, and not the condition number.

    Args:
        name: "a-optimal", the program's default; "a-optimal-mean" or "a-optimal-max" over a set of payloads;
            "d-optimal"; "condition-number".
        torque_noise_nm: (n,) standard deviation of one raw torque sample at NOISE_RATE_HZ.
        expected_payload: In the flange frame.
        payload_set: In the flange frame; for the robust criteria.

    Raises:
        ExcitationError: an unknown name, an empty set, or a noise or a mass that is not above zero.
    """
    if name not in CRITERIA:
        raise ExcitationError(f"criterion is {name!r}; expected one of {', '.join(CRITERIA)}")
    if name == "condition-number":
        return condition_number(chain)
    noise = finite_array("torque_noise_nm", torque_noise_nm, (chain.n,), above=0.0, error=ExcitationError)
    payloads = tuple(payload_set) if name in ROBUST_CRITERIA else (expected_payload,)
    if not payloads:
        raise ExcitationError(f"criterion {name} needs a set of payloads; none is given")
    return _criterion(name, chain, 1.0 / noise**2, tuple(_scale(payload) for payload in payloads))


def condition_number(chain: Chain) -> Criterion:
    """The paper's criterion, cond(Phi) in SI units.

    References:
        Chen 2016, eq. (7).
    """
    return _criterion("condition-number", chain, np.ones(chain.n), (np.ones(10),))


def _determines_everything(value: FloatArray) -> bool:
    """Whether no eigenvalue (ascending) of an information matrix is zero to within rounding."""
    return bool(value[0] > 1e-14 * value[-1])


def _smooth_greatest(values: FloatArray) -> tuple[float, FloatArray]:
    """(sum x^k)^(1/k) of positive numbers with k = SHARPNESS, and its derivative by each."""
    greatest = values.max()
    relative = (values / greatest) ** SHARPNESS
    total = float(greatest * np.sum(relative) ** (1.0 / SHARPNESS))
    return total, np.asarray(relative / np.sum(relative) * total / values)


def _scale(payload: InertialParameters) -> FloatArray:
    """(10,) scale of each parameter's error."""
    mass_kg = payload.mass_kg
    if not mass_kg > 0.0:
        raise ExcitationError(f"the expected payload's mass is {mass_kg} kg; expected a number above 0")
    least = mass_kg * np.repeat([1.0, REFERENCE_LENGTH_M, REFERENCE_LENGTH_M**2], [1, 3, 6])
    return np.maximum(np.abs(payload.theta), least)


def _criterion(name: str, chain: Chain, row_weight: FloatArray, scales: tuple[FloatArray, ...]) -> Criterion:
    """The criterion over the identifiable directions."""
    rng = np.random.default_rng(0)
    q = rng.uniform(-np.pi, np.pi, (_PROBE_STATES, chain.n))
    dq, ddq = rng.normal(size=(2, _PROBE_STATES, chain.n))
    phi = payload_regressor(chain, q, dq, ddq) * np.sqrt(row_weight)[:, None]
    bases = []
    for scale in scales:
        _, singular, directions = np.linalg.svd((phi * scale).reshape(-1, 10), full_matrices=False)
        visible = directions[singular > _RANK_TOLERANCE * singular[0]]
        bases.append(np.ascontiguousarray(scale[:, None] * visible.T))
    return Criterion(name, chain, row_weight, tuple(bases))
