"""Position, velocity and acceleration of all joints as one value."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from armload_identification.float_array import FloatArray


class JointStates(NamedTuple):
    """N states of n joints; a function of q, dq and ddq is called as `f(chain, *states)`.

    Attributes:
        position_rad: (N, n) q.
        velocity_rad_s: (N, n) dq.
        acceleration_rad_s2: (N, n) ddq.
    """

    position_rad: FloatArray
    velocity_rad_s: FloatArray
    acceleration_rad_s2: FloatArray

    def earlier(self, by_s: float, interval_s: float) -> JointStates:
        """The states a short time earlier, by a Taylor series with the motion's own derivatives.

        Args:
            by_s: How much earlier, far less than the time in which the motion changes.
            interval_s: Time between the equidistant states.

        Returns:
            Position and velocity to the second order of `by_s`, acceleration to the first.
        """
        position, velocity, acceleration = self
        jerk = np.gradient(acceleration, interval_s, axis=0)
        half = 0.5 * by_s**2
        return JointStates(
            position - by_s * velocity + half * acceleration,
            velocity - by_s * acceleration + half * jerk,
            acceleration - by_s * jerk,
        )
