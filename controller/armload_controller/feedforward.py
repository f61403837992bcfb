"""The payload's torque for a control loop: give joint state, get joint torque.

Made to be imported into other people's control processes: numpy, numba and the model's kernels are all it
loads, and a call allocates nothing.
"""

from __future__ import annotations

import numpy as np

from armload_identification.chain import Chain, FloatArray
from armload_identification.payload import InertialParameters
from armload_identification.regressor import FEEDFORWARD_ROWS, feedforward_model, payload_torque_into


class PayloadFeedforward:
    """Torque that a payload at the flange asks of the joints.

        tau = J(q)^T w(q, dq, ddq, theta)

    Args:
        chain: The arm, n joints.
        payload: The payload, in the flange frame.

    References:
        Chen 2016, eq. (2).
    """

    def __init__(self, chain: Chain, payload: InertialParameters) -> None:
        self._model = feedforward_model(chain, payload.theta)
        self._work = np.zeros((FEEDFORWARD_ROWS, chain.n))
        self._position, self._velocity, self._acceleration = self._work[:3]
        self._torque: FloatArray = self._work[3]

    def torque_nm(
        self, position_rad: FloatArray, velocity_rad_s: FloatArray, acceleration_rad_s2: FloatArray
    ) -> FloatArray:
        """Joint torques for one state.

        Args:
            position_rad: (n,) joint positions.
            velocity_rad_s: (n,) joint velocities.
            acceleration_rad_s2: (n,) joint accelerations.

        Returns:
            (n,) torques; the array is this object's own and changes with the next call.
        """
        self._position[:] = position_rad
        self._velocity[:] = velocity_rad_s
        self._acceleration[:] = acceleration_rad_s2
        payload_torque_into(self._model, self._work)
        return self._torque
