"""Whether the joints are strong enough for a motion of the arm with the heaviest payload expected.

The same path is driven empty and loaded, and at any speed from standstill to full. At a constant share r of the full
speed and with a share c of the payload, links, rotors and payload require

    tau(r, c) = (1 - r^2) (g_arm + c g_load) + r^2 (tau_arm + c tau_load),

linear in r^2 and in c: a bound for standstill and full speed, each empty and fully loaded, holds for everything in
between. These four cases are bounded here. Friction is added with its maximum: viscous friction as at full speed,
Coulomb friction at all times. Without a body model, links, rotors and friction are a stated share of each joint's
limit, and the four cases become two.

Between samples: a function whose second derivative is at most B is nowhere further than B h^2 / 8 from the straight
line between two samples a time h apart, and a straight line is nowhere above its ends. The demand is the maximum of
+-tau +-f_v dq, each with the B of torque and of speed from `derivative_bounds`; hence for every time t

    |tau(t)| + f_v |dq(t)| <= max_j (|tau(t_j)| + f_v |dq(t_j)|) + B h^2 / 8.

Coupled motors, q_joint = C q_axis, must provide C^T tau, whose bounds are |C|^T times those of tau.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import ceil

import numpy as np

from armload_identification.excitation.derivative_bounds import rate_bounds, torque_curvature
from armload_identification.excitation.fourier import FourierTrajectory
from armload_identification.float_array import FloatArray
from armload_identification.model.chain import Chain
from armload_identification.model.dynamics import ArmBody, ArmDynamics
from armload_identification.model.finite_array import finite_array, set_fields
from armload_identification.model.payload import InertialParameters

SURPLUS_SHARE = 0.002
"""Allowed surplus of the bound between samples, as a share of a joint's torque; it determines the number of samples."""
MOST_SAMPLES = 65536
"""Upper limit: a motion far beyond the limits, which is useless anyway, is bounded more coarsely."""
_FEWEST_SAMPLES = 256


@dataclass(frozen=True, eq=False)
class TorqueLimits:
    """Torque that the joints can provide, and that arm and payload require.

    Attributes:
        chain: The arm.
        body: The arm itself; massless if a share of the torque is reserved for it.
        payload: The heaviest one expected, in the flange frame.
        available_nm: (n,) greatest torque for body, payload and viscous friction.
        coupling: (n, n) C if the torques are those of the motors' axes; None if they are the joints'.

    Raises:
        ModelError: shapes that do not fit, or a joint without available torque.
    """

    chain: Chain
    body: ArmBody
    payload: InertialParameters
    available_nm: FloatArray
    coupling: FloatArray | None = None
    _models: tuple[ArmDynamics, ...] = field(init=False, repr=False)
    _mixing: FloatArray = field(init=False, repr=False)

    def __post_init__(self) -> None:
        available = finite_array("torque for arm and payload, in N m,", self.available_nm, (self.chain.n,), above=0.0)
        mixing = np.eye(self.chain.n) if self.coupling is None else self.coupling.copy()
        loaded = ArmDynamics(self.chain, self.body.carrying(self.chain, self.payload))
        empty = ArmDynamics(self.chain, self.body)
        models = (loaded, empty) if np.any(self.body.links) else (loaded,)
        set_fields(self, {"available_nm": available, "_mixing": mixing, "_models": models})

    @classmethod
    def from_share(
        cls, chain: Chain, arm_share: FloatArray, payload: InertialParameters, torque_max_nm: FloatArray
    ) -> TorqueLimits:
        """Limits from a stated share of the torque that the arm itself requires.

        Args:
            arm_share: (n,) greatest share of each joint's torque for links, rotors and friction, in [0, 1).
            payload: The heaviest one expected, in the flange frame.
            torque_max_nm: (n,) greatest torque of each joint.

        Raises:
            ModelError: a share out of range, or shapes that do not fit.
        """
        share = finite_array("the arm's share of the torque", arm_share, (chain.n,), least=0.0, below=1.0)
        return cls(chain, ArmBody.massless(chain.n), payload, (1.0 - share) * np.asarray(torque_max_nm))

    @property
    def cases(self) -> int:
        """Number of cases of load and speed that are bounded."""
        return 2 * len(self._models)

    def demand(self, q: FloatArray, dq: FloatArray, ddq: FloatArray) -> FloatArray:
        """Magnitude of the torque in every case: loaded in motion, loaded at rest, then the same empty.

        Args:
            q: (N, n) positions in rad.
            dq: (N, n) velocities in rad/s.
            ddq: (N, n) accelerations in rad/s2.

        Returns:
            (N, cases n) in N m, viscous friction included.
        """
        return np.asarray(np.abs(self._torque(q, dq, ddq)) + self.friction(dq))

    def friction(self, dq: FloatArray) -> FloatArray:
        """Magnitude of viscous friction, the same in every case.

        Args:
            dq: (N, n) velocities in rad/s.

        Returns:
            (N, cases n) in N m.
        """
        return np.tile(self._sizes(self.body.viscous_nm_s_rad * np.abs(dq)), self.cases)

    def slope(self, weight: FloatArray, q: FloatArray, dq: FloatArray, ddq: FloatArray) -> FloatArray:
        """Derivative of the weighted sum of all demands by the samples.

        Args:
            weight: (N, cases n) weight of each.
            q: (N, n) positions in rad.
            dq: (N, n) velocities in rad/s.
            ddq: (N, n) accelerations in rad/s2.

        Returns:
            (3, N, n) derivative by q, dq and ddq.
        """
        total = np.zeros((3, *q.shape))
        if not np.any(weight):
            return total
        still = np.zeros_like(q)
        parts = np.split(weight * np.sign(self._torque(q, dq, ddq)), self.cases, axis=1)
        for case, moving, resting in zip(self._models, parts[0::2], parts[1::2], strict=True):
            total += case.slope(moving @ self._mixing.T, q, dq, ddq)
            total[0] += case.slope(resting @ self._mixing.T, q, still, still)[0]
        pressing = sum(np.split(weight, self.cases, axis=1)) @ np.abs(self._mixing).T
        total[1] += pressing * self.body.viscous_nm_s_rad * np.sign(dq)
        return total

    def greatest(self, trajectory: FourierTrajectory) -> FloatArray:
        """Upper bound of the demand in every case along a trajectory, also between samples.

        Args:
            trajectory: One period of the motion at full speed.

        Returns:
            (cases n,) in N m, in the order of `demand`.
        """
        rates = rate_bounds(trajectory)
        friction = self.body.viscous_nm_s_rad * rates[2]
        curved = [self._sizes(torque_curvature(model, rates) + friction) for model in self._models]
        curvature = np.concatenate([np.tile(sizes, 2) for sizes in curved])
        allowed = 8.0 * SURPLUS_SHARE * np.tile(self.available_nm, self.cases)
        wanted = ceil(trajectory.period_s * float(np.sqrt(np.max(curvature / allowed))))
        samples = min(max(_FEWEST_SAMPLES, wanted), MOST_SAMPLES)
        step_s = trajectory.period_s / samples
        state = trajectory.evaluate(np.arange(samples) * step_s)
        return np.asarray(self.demand(*state[:3]).max(axis=0) + curvature * step_s**2 / 8.0)

    def _torque(self, q: FloatArray, dq: FloatArray, ddq: FloatArray) -> FloatArray:
        """(N, cases n) torque of links, rotors and payload, with its sign."""
        both = np.zeros((3, 2, *q.shape))
        both[0], both[1, 0], both[2, 0] = q, dq, ddq
        motions = both.reshape(3, -1, q.shape[1])
        torques = [(model.torque(*motions) @ self._mixing).reshape(2, *q.shape) for model in self._models]
        return np.concatenate([part for torque in torques for part in torque], axis=1)

    def _sizes(self, joints: FloatArray) -> FloatArray:
        """Greatest magnitudes at the motors' axes (or joints) for given magnitudes (..., n) at the joints."""
        return joints @ np.abs(self._mixing)
