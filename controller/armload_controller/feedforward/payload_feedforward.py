"""The payload's torque for a control loop: give joint state, get joint torque.

Made to be imported into other people's control processes: numpy, numba and the model's kernels are all it
loads, and a call allocates nothing.
"""

from __future__ import annotations

from collections import deque

import numpy as np

from armload_core.arrays import FloatArray
from armload_identification.model.chain import Chain
from armload_identification.model.payload import InertialParameters
from armload_identification.model.regressor import FEEDFORWARD_ROWS, feedforward_model, payload_torque_into

NOTHING = InertialParameters(np.zeros(10))
"""The empty flange, to begin with or to change to."""


class PayloadFeedforward:
    """Torque that a payload at the flange asks of the joints.

        tau = J(q)^T w(q, dq, ddq, theta)

    `torque_nm` belongs to one thread, the loop's; `set_payload` may be called from any.

    Args:
        chain: The arm, n joints.
        payload: The payload, in the flange frame.

    References:
        Chen 2016, eq. (2).
    """

    __slots__ = ("_calls", "_changing", "_from", "_left", "_model", "_requests", "_theta", "_to", "_torque", "_work")

    def __init__(self, chain: Chain, payload: InertialParameters) -> None:
        self._model = feedforward_model(chain, payload.theta)
        self._theta = self._model[-len(payload.theta) :]
        self._work = np.zeros((FEEDFORWARD_ROWS, chain.n))
        self._torque: FloatArray = self._work[0]
        self._requests: deque[tuple[FloatArray, int]] = deque()
        self._from = self._to = self._theta.copy()
        self._calls = self._left = 0
        self._changing = False

    def torque_nm(
        self, position_rad: FloatArray, velocity_rad_s: FloatArray, acceleration_rad_s2: FloatArray
    ) -> FloatArray:
        """Joint torques for one state.

        Args:
            position_rad: (n,) joint positions; arrays of float64 side by side are the fast way.
            velocity_rad_s: (n,) joint velocities.
            acceleration_rad_s2: (n,) joint accelerations.

        Returns:
            (n,) torques; the array is this object's own and changes with the next call.

        Raises:
            ValueError: a state that is not of n joints.
        """
        if self._changing:
            self._change()
        try:
            payload_torque_into(self._model, position_rad, velocity_rad_s, acceleration_rad_s2, self._work)
        except TypeError:
            states = (position_rad, velocity_rad_s, acceleration_rad_s2)
            payload_torque_into(self._model, *(np.array(x, dtype=np.float64) for x in states), self._work)
        return self._torque

    def set_payload(self, payload: InertialParameters, transition_s: float, cycle_s: float) -> None:
        """Change the payload while running, without a step in torque: after a grasp, after a release.

        The parameters go from what they are at the next call to the new ones, with rest at both ends. Torque is
        linear in them, and everything in between is a possible body. A second change takes up where the first is.

        Args:
            payload: The new payload, in the flange frame; `NOTHING` for an empty one.
            transition_s: Time that the change takes; 0 for at once.
            cycle_s: Time between two calls of `torque_nm`.

        Raises:
            ValueError: a time below zero.
        """
        if not (transition_s >= 0.0 and cycle_s > 0.0):
            raise ValueError(f"transition_s = {transition_s} and cycle_s = {cycle_s}: expected >= 0 and > 0")
        self._requests.append((payload.theta, max(1, round(transition_s / cycle_s))))
        self._changing = True

    def _change(self) -> None:
        """One call's part of a change."""
        # Before the requests are looked at: one that comes later sets it again.
        self._changing = False
        while self._requests:
            self._to, self._calls = self._requests.popleft()
            self._from = self._theta.copy()
            self._left = self._calls
        if not self._left:
            return
        self._left -= 1
        if self._left:
            self._changing = True
        done = 1.0 - self._left / self._calls
        self._theta[:] = self._from + (3.0 - 2.0 * done) * done**2 * (self._to - self._from)
