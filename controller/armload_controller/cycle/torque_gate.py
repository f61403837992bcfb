"""The one way by which added torque (60B2) reaches the drives: clamped, rate limited, ramped in, ramped out.

    wanted -> clamp to a share of the joint's greatest torque -> limit the change per cycle -> times the gate's opening

The opening goes from 0 to 1 and back within `OPENING_S`. Once it is released, on every stop, the last torque is
ramped to zero whatever plug-ins still want.
"""

from __future__ import annotations

import numpy as np

from armload_core.arrays import FloatArray

TORQUE_SHARE = 0.8
"""Share of a joint's greatest torque that may be added; the rest is the servo's margin."""
FULL_SWING_S = 0.5
"""Added torque may go from zero to the joint's greatest torque within this time, not faster."""
OPENING_S = 0.4
"""Time of ramping in and out."""


class TorqueGate:
    """Added torque of one arm.

    Args:
        torque_max_nm: (n,) greatest torque of each joint, 6072 and the joint's own limit considered.
        cycle_s: Duration of a cycle.

    Attributes:
        released: The torque is being ramped out for good.
        torque_nm: (n,) what was passed last.
    """

    def __init__(self, torque_max_nm: FloatArray, cycle_s: float) -> None:
        self._limit = TORQUE_SHARE * torque_max_nm
        self._step = torque_max_nm * (cycle_s / FULL_SWING_S)
        self._opening_step = cycle_s / OPENING_S
        self.close()

    def close(self) -> None:
        """No torque, and ready to open: what an arm that is enabled begins with."""
        self.released = False
        self._opening = 0.0
        self._followed = np.zeros_like(self._limit)
        self.torque_nm: FloatArray = np.zeros_like(self._limit)

    def release(self) -> None:
        """From now on to zero, whatever is wanted."""
        self.released = True

    @property
    def empty(self) -> bool:
        """Whether no torque is being added."""
        return not self.torque_nm.any()

    def passed(self, wanted_nm: FloatArray) -> FloatArray:
        """What of a wanted torque is added in this cycle.

        Args:
            wanted_nm: (n,) joint torque.

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
    """Values clamped to +- their bounds; for a handful of them a third of what `np.clip` takes."""
    return np.minimum(np.maximum(values, -bound), bound)
