"""How much a motion tells about a payload: the information matrix, and the two criteria made from it.

    M = sum_t Phi_t^T W Phi_t

A-optimal: the trace of the covariance of the parameters' errors, each relative to a scale, with W the inverse
covariance of the joints' torque noise. Condition number: cond(Phi) = sqrt(cond(M)) with W = 1 (Chen 2016).
METHOD: the condition number alone is a poor criterion, because it knows neither the noise nor the payload.

Directions of the parameter space that no motion of the arm can show (few joints, an axis along gravity) are
left out of both: they would make every motion equally bad.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray

from armload_identification.chain import Chain
from armload_identification.errors import ExcitationError
from armload_identification.kernels import FRAME_NUMBERS, forward_into, rows_into
from armload_identification.payload import InertialParameters
from armload_identification.regressor import payload_regressor

FloatArray = NDArray[np.float64]

NOISE_RATE_HZ = 100.0
"""Sampling rate at which a torque noise is told."""

_ARM_LENGTH_M = 0.1  # a centre of mass this far out, for the scale of parameters that are expected to be about zero
_RANK_TOLERANCE = 1e-8
_PROBE_STATES = 200


@numba.njit("float64(float64[:, ::1], float64[:, ::1])", cache=True, fastmath={"contract"}, nogil=True)
def _contract(a, b):  # type: ignore[no-untyped-def]
    """Sum of the products of all elements."""
    total = 0.0
    for i in range(a.shape[0]):
        for k in range(a.shape[1]):
            total += a[i, k] * b[i, k]
    return total


@numba.njit(
    "void(float64[::1], float64[::1], float64[:, ::1], float64[:, ::1], float64[:, ::1], float64[:, ::1])",
    cache=True,
    fastmath={"contract"},
    nogil=True,
)
def _information_into(packed, weight, q, dq, ddq, information):  # type: ignore[no-untyped-def]
    """M of the flange's regressor, into information (10, 10)."""
    n = weight.shape[0]
    frames = np.empty((n, FRAME_NUMBERS))
    phi = np.empty((n, 10))
    information[:] = 0.0
    for t in range(q.shape[0]):
        forward_into(packed, n, q[t], dq[t], ddq[t], frames)
        rows_into(frames, n, packed, 3 + 21 * n, 12 + 21 * n, phi, 0)
        for i in range(n):
            for k in range(10):
                left = weight[i] * phi[i, k]
                for m in range(k + 1):
                    information[k, m] += left * phi[i, m]
    for k in range(10):
        for m in range(k):
            information[m, k] = information[k, m]


@numba.njit(
    "void(float64[::1], float64[::1], float64[:, ::1], float64[:, ::1], float64[:, ::1], float64[:, ::1],"
    " float64[:, :, ::1])",
    cache=True,
    fastmath={"contract"},
    nogil=True,
)
def _slope_into(packed, weight, gain, q, dq, ddq, slope):  # type: ignore[no-untyped-def]
    """Derivative of tr(gain M) by q, dq, ddq, into slope (3, N, n); gain is symmetric and constant.

    tr(gain dM) = 2 <W Phi gain, dPhi>. Phi is affine in ddq and quadratic in dq, so that differences with a
    step of one are exact there; in q the central difference errs by about 1e-10.
    """
    n = weight.shape[0]
    frames = np.empty((n, FRAME_NUMBERS))
    phi = np.empty((n, 10))
    adjoint = np.empty((n, 10))
    state = np.empty((3, n))
    zero = np.zeros(n)
    for t in range(q.shape[0]):
        state[0], state[1], state[2] = q[t], dq[t], ddq[t]
        forward_into(packed, n, state[0], state[1], state[2], frames)
        rows_into(frames, n, packed, 3 + 21 * n, 12 + 21 * n, phi, 0)
        for i in range(n):
            for k in range(10):
                total = 0.0
                for m in range(10):
                    total += phi[i, m] * gain[m, k]
                adjoint[i, k] = 2.0 * weight[i] * total
        forward_into(packed, n, state[0], state[1], zero, frames)
        rows_into(frames, n, packed, 3 + 21 * n, 12 + 21 * n, phi, 0)
        without = _contract(adjoint, phi)
        for j in range(n):
            state[2] = 0.0
            state[2, j] = 1.0
            forward_into(packed, n, state[0], state[1], state[2], frames)
            rows_into(frames, n, packed, 3 + 21 * n, 12 + 21 * n, phi, 0)
            slope[2, t, j] = _contract(adjoint, phi) - without
        state[2] = ddq[t]
        for order in range(2):
            step = 1.0 if order == 1 else 1e-5
            for j in range(n):
                here = state[order, j]
                state[order, j] = here + step
                forward_into(packed, n, state[0], state[1], state[2], frames)
                rows_into(frames, n, packed, 3 + 21 * n, 12 + 21 * n, phi, 0)
                after = _contract(adjoint, phi)
                state[order, j] = here - step
                forward_into(packed, n, state[0], state[1], state[2], frames)
                rows_into(frames, n, packed, 3 + 21 * n, 12 + 21 * n, phi, 0)
                slope[order, t, j] = (after - _contract(adjoint, phi)) / (2.0 * step)
                state[order, j] = here


@dataclass(frozen=True, eq=False, slots=True)
class Criterion:
    """A cost of a motion of one period, to be made small.

    Attributes:
        name: "a-optimal" or "condition-number".
        chain: The arm.
        row_weight: (n,) diagonal of W for one sample at NOISE_RATE_HZ.
        basis: (10, r) theta = basis x, over the r directions that the arm can show; carries the scales.
    """

    name: str
    chain: Chain
    row_weight: FloatArray
    basis: FloatArray

    @property
    def rank(self) -> int:
        """How many directions of the ten the arm can show."""
        return int(self.basis.shape[1])

    def cost(self, q: FloatArray, dq: FloatArray, ddq: FloatArray, period_s: float) -> float:
        """The criterion of N equidistant samples (N, n) of a period; inf where they do not show everything.

        A-optimal: sum of the squared relative standard deviations after one period sampled at NOISE_RATE_HZ.
        """
        return self._cost_and_gain(self._reduced(q, dq, ddq, period_s), slope=False)[0]

    def cost_and_slope(
        self, q: FloatArray, dq: FloatArray, ddq: FloatArray, period_s: float
    ) -> tuple[float, FloatArray]:
        """The criterion and its derivative by the samples.

        Returns:
            The cost, and (3, N, n) its derivative by q, dq and ddq.
        """
        q, dq, ddq = (np.ascontiguousarray(a) for a in (q, dq, ddq))
        cost, gain = self._cost_and_gain(self._reduced(q, dq, ddq, period_s), slope=True)
        slope = np.zeros((3, *q.shape))
        if np.isfinite(cost):
            weight = self.row_weight * (period_s * NOISE_RATE_HZ / len(q))
            full = np.ascontiguousarray(self.basis @ gain @ self.basis.T)
            _slope_into(self.chain.packed, weight, full, q, dq, ddq, slope)
        return cost, slope

    def _reduced(self, q: FloatArray, dq: FloatArray, ddq: FloatArray, period_s: float) -> FloatArray:
        """(r, r) information about x."""
        information = np.empty((10, 10))
        weight = self.row_weight * (period_s * NOISE_RATE_HZ / len(q))
        states = [np.ascontiguousarray(a) for a in (q, dq, ddq)]
        _information_into(self.chain.packed, weight, *states, information)
        return np.asarray(self.basis.T @ information @ self.basis)

    def _cost_and_gain(self, reduced: FloatArray, *, slope: bool) -> tuple[float, FloatArray]:
        """The criterion of the reduced information, and its derivative by it."""
        value, vector = np.linalg.eigh(reduced)
        if not value[0] > 1e-14 * value[-1]:
            return np.inf, np.zeros_like(reduced)
        if self.name == "a-optimal":
            gain = -(vector / value**2) @ vector.T if slope else reduced
            return float(np.sum(1.0 / value)), gain
        condition = float(np.sqrt(value[-1] / value[0]))
        high, low = vector[:, -1], vector[:, 0]
        gain = 0.5 * condition * (np.outer(high, high) / value[-1] - np.outer(low, low) / value[0])
        return condition, gain


def a_optimal(chain: Chain, torque_noise_nm: FloatArray, expected_payload: InertialParameters) -> Criterion:
    """The default criterion: how well the expected payload's parameters can be told apart from the noise.

    Each parameter's error is taken relative to its expected value, but at least to the scale that "determined"
    is measured by: the mass m, the first moment m (0.1 m), the inertia m (0.1 m)^2. Otherwise a parameter that
    is expected to be zero would be asked for with infinite accuracy.

    Args:
        chain: The arm.
        torque_noise_nm: (n,) standard deviation of one raw torque sample at NOISE_RATE_HZ.
        expected_payload: In the flange frame.

    Raises:
        ExcitationError: a noise or the mass is not above zero.
    """
    noise = np.asarray(torque_noise_nm, dtype=np.float64)
    mass_kg = expected_payload.mass_kg
    if noise.shape != (chain.n,) or not np.all(noise > 0.0):
        raise ExcitationError(f"torque_noise_nm is {noise.tolist()}; expected {chain.n} numbers above 0")
    if not mass_kg > 0.0:
        raise ExcitationError(f"the expected payload's mass is {mass_kg} kg; expected a number above 0")
    least = mass_kg * np.repeat([1.0, _ARM_LENGTH_M, _ARM_LENGTH_M**2], [1, 3, 6])
    scale = np.maximum(np.abs(expected_payload.theta), least)
    return _criterion("a-optimal", chain, 1.0 / noise**2, scale)


def condition_number(chain: Chain) -> Criterion:
    """The paper's criterion, cond(Phi) in SI units.

    References:
        Chen 2016, eq. (7).
    """
    return _criterion("condition-number", chain, np.ones(chain.n), np.ones(10))


def _criterion(name: str, chain: Chain, row_weight: FloatArray, scale: FloatArray) -> Criterion:
    """The criterion over the directions that some motion can show."""
    rng = np.random.default_rng(0)
    q = rng.uniform(-np.pi, np.pi, (_PROBE_STATES, chain.n))
    dq, ddq = rng.normal(size=(2, _PROBE_STATES, chain.n))
    phi = payload_regressor(chain, q, dq, ddq) * np.sqrt(row_weight)[:, None] * scale
    _, singular, directions = np.linalg.svd(phi.reshape(-1, 10), full_matrices=False)
    visible = directions[singular > _RANK_TOLERANCE * singular[0]]
    return Criterion(name, chain, row_weight, np.ascontiguousarray(scale[:, None] * visible.T))
