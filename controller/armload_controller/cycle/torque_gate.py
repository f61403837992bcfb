"""The only path of added torque (60B2) to the drives: clamped, rate limited, ramped in and out.

    requested -> clamp to a share of the joint's greatest torque -> limit the change per cycle -> times the opening

The gate's opening goes from 0 to 1 and back within `OPENING_S`. Every stop releases the gate: the last torque is then
ramped to zero, whatever plug-ins still request.
"""

from __future__ import annotations

import numpy as np

from armload_identification.float_array import FloatArray

TORQUE_SHARE = 0.8
"""Share of a joint's greatest torque that may be added; the rest is the servo's margin."""
FULL_SWING_S = 0.5
"""Shortest time in which added torque may rise from zero to the joint's greatest torque."""
OPENING_S = 0.4
"""Duration of the ramps in and out."""


class TorqueGate:
    """Limits the added torque of one arm.

    Args:
        torque_max_nm: (n,) greatest torque of each joint: the lesser of its own limit and its drive's (6072).
        cycle_s: Duration of a cycle.

    Attributes:
        released: Whether the torque is being ramped out, until `close`.
        torque_nm: (n,) the torque that passed last.
    """

    def __init__(self, torque_max_nm: FloatArray, cycle_s: float) -> None:
        self._limit = TORQUE_SHARE * torque_max_nm
        self._step = torque_max_nm * (cycle_s / FULL_SWING_S)
        self._opening_step = cycle_s / OPENING_S
        self.close()

    def close(self) -> None:
        """Reset to no torque, ready to open; called whenever the arm is enabled."""
        self.released = False
        self._opening = 0.0
        self._followed = np.zeros_like(self._limit)
        self.torque_nm: FloatArray = np.zeros_like(self._limit)

    def release(self) -> None:
        """Ramp to zero from now on, whatever is requested."""
        self.released = True

    @property
    def empty(self) -> bool:
        """Whether no torque is being added."""
        return not self.torque_nm.any()

    def passed(self, wanted_nm: FloatArray) -> FloatArray:
        """The part of a requested torque that is added in this cycle.

        Args:
            wanted_nm: (n,) requested joint torque.

        Returns:
            (n,) a new array.
        """
        if self.released:
            self._opening = max(0.0, self._opening - self._opening_step)
        else:
            if np.count_nonzero(wanted_nm):
                self._opening = min(1.0, self._opening + self._opening_step)
            change = _within(wanted_nm, self._limit) - self._followed
            self._followed = self._followed + _within(change, self._step)
        self.torque_nm = self._followed * self._opening
        return self.torque_nm


def _within(values: FloatArray, bound: FloatArray) -> FloatArray:
    """Values clamped to +- their bounds; for a few values three times as fast as `np.clip`."""
    return np.minimum(np.maximum(values, -bound), bound)
