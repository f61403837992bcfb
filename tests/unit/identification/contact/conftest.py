"""A motion of Pinocchio's arm, and the same motion with a push or with a payload that is grasped and dropped."""

from dataclasses import dataclass

import numpy as np
import pytest

from armload_identification.pipeline.estimator_constants import estimator_constants


@dataclass(frozen=True, eq=False)
class Moved:
    """Stamps, positions and currents; the same with a payload; the arm."""

    time_s: np.ndarray
    position: np.ndarray
    empty: np.ndarray
    loaded: np.ndarray
    calibration: object
    arm: object

    @property
    def watched_arm(self):
        return self.calibration, self.arm.chain, self.arm.transmission

    def at(self, seconds):
        """Stamp of a time since the beginning."""
        return self.time_s[0] + seconds

    def pushed(self, force_n, begin_s, end_s):
        """Currents of the empty arm with a push on its flange, which the motors resist."""
        current = self.empty.copy()
        inverse = np.linalg.inv(estimator_constants(*self.watched_arm).from_effort)
        for k in np.flatnonzero((self.time_s >= self.at(begin_s)) & (self.time_s < self.at(end_s))):
            current[k] -= force_n @ self.arm.chain.jacobian(self.position[k])[:3] @ inverse
        return current

    def grasped(self, begin_s, end_s=np.inf):
        """Currents with the payload in between."""
        inside = (self.time_s >= self.at(begin_s)) & (self.time_s < self.at(end_s))
        return np.where(inside[:, None], self.loaded, self.empty)

    def until(self, seconds, current):
        """The motion up to a time, with these currents."""
        end = int(np.searchsorted(self.time_s, self.at(seconds)))
        return self.time_s[:end], self.position[:end], current[:end]


@pytest.fixture(scope="session")
def moved(pinocchio_arm, calibration):
    trajectory = pinocchio_arm.trajectory(6, period_s=10.0)
    empty, loaded = (pinocchio_arm.run(trajectory, load, seed=8 + load, with_phase=False) for load in (False, True))
    rows = min(empty.size, loaded.size)
    return Moved(
        empty.time_s[:rows],
        empty.position_rad[:rows],
        empty.current_a[:rows],
        loaded.current_a[:rows],
        calibration,
        pinocchio_arm,
    )
