"""Whether measured torques have the right sign: a motor that moves a joint to and fro works against its friction.

Weight may drive a joint or hold it back, and nothing is known of the payload; but weight depends on where the arm is,
friction on where it is going. After a slow round, in which nothing but these two counts, every joint's torque is fitted
with

    tau = G(q) phi + f tanh(dq / v)

with the columns G of any masses on any link, and v a share of the joint's greatest speed. f must not be below zero by
more than what the residual explains; and torque that never changes was not measured.
"""

from __future__ import annotations

import numpy as np

from armload_controller.cycle.feedback_truth import TorqueMissing, TorqueReversed
from armload_controller.cycle.monitors import measured_torque
from armload_controller.cycle.plugins import CycleStep
from armload_controller.motion.phase import Segment
from armload_core.arrays import FloatArray
from armload_identification.model.chain import Chain
from armload_identification.model.regressor import payload_regressor
from armload_identification.signals.joint_torque import Transmission

EVERY_S = 0.05
"""Interval at which torque is kept."""
SPEED_SHARE = 0.05
"""Share of a joint's greatest speed at which friction has most of its size."""
LEAST_TRAVEL_RAD = 0.2
"""A joint that moved less in all says nothing."""
CORRELATED_ROWS = 10.0
"""So many rows in a row are taken to share one error."""
SURE = 4.0
"""Standard errors of friction below zero at which it is not doubted."""
_FIRST_MOMENTS = 4
"""Mass and first moments: the parameters of a body that its weight depends on."""


class TorqueSigns:
    """Plug-in that keeps torques of a slow round, to be judged when it is over.

    Args:
        joint_names: Names, for messages.
        chain: The arm.
        transmission: From motor current to joint torque.
        cycle_s: Duration of a cycle.
    """

    name = "torque signs"

    def __init__(self, joint_names: tuple[str, ...], chain: Chain, transmission: Transmission, cycle_s: float) -> None:
        self._names, self._chain, self._transmission = joint_names, chain, transmission
        self._every = max(1, round(EVERY_S / cycle_s))
        self._calls = 0
        self._position: list[FloatArray] = []
        self._torque: list[FloatArray] = []

    def on_cycle(self, step: CycleStep) -> None:
        """Keep one row where one is due."""
        reference = step.sent_reference
        if reference is None or reference.segment is not Segment.SLOW:
            return
        self._calls += 1
        if self._calls % self._every == 0:
            self._position.append(step.feedback.position_rad)
            self._torque.append(measured_torque(step.feedback, self._transmission))

    def judge(self) -> None:
        """Judge what was kept.

        Raises:
            TorqueMissing: a joint's torque never changed.
            TorqueReversed: it has the wrong sign.
        """
        if len(self._position) < 2 * _FIRST_MOMENTS * self._chain.n:
            return
        position, torque = np.array(self._position), np.array(self._torque)
        if np.isnan(torque).any():
            return
        velocity = np.gradient(position, axis=0)
        travel = np.abs(np.diff(position, axis=0)).sum(axis=0)
        weight = _weight_columns(self._chain, position)
        for joint in np.flatnonzero(travel > LEAST_TRAVEL_RAD):
            if np.ptp(torque[:, joint]) <= 1e-9 * np.abs(torque[:, joint]).max():
                raise TorqueMissing(
                    self._names[joint],
                    f"current or torque stayed at {torque[0, joint]:.1f} N m during the whole slow round",
                )
            speed = velocity[:, joint]
            friction, error = _friction(weight[:, joint], speed, torque[:, joint])
            if friction < -SURE * error:
                raise TorqueReversed(
                    self._names[joint],
                    f"torque falls by {-2.0 * friction:.1f} N m when the motion reverses from negative to positive, "
                    "but friction makes it rise: the sign of current or torque is wrong",
                )


def _weight_columns(chain: Chain, position: FloatArray) -> FloatArray:
    """(N, n, K) torque of the weight of unit masses and first moments of every link."""
    still = np.zeros_like(position)
    columns = []
    for link in range(1, chain.n + 1):
        head = chain.head(link)
        part = np.zeros((*position.shape, _FIRST_MOMENTS))
        moving = position[:, :link], still[:, :link], still[:, :link]
        part[:, :link] = payload_regressor(head, *moving)[:, :, :_FIRST_MOMENTS]
        columns.append(part)
    return np.concatenate(columns, axis=2)


def _friction(weight: FloatArray, speed: FloatArray, torque: FloatArray) -> tuple[float, float]:
    """Friction that fits best, and its standard error, both in N m."""
    direction = np.tanh(speed / (SPEED_SHARE * np.abs(speed).max()))
    known = np.column_stack([np.ones_like(speed), weight])
    # What weight explains is taken out of both: what is left of the direction is orthogonal to all that.
    basis, sizes, _ = np.linalg.svd(known, full_matrices=False)
    basis = basis[:, sizes > 1e-9 * sizes[0]]
    turned, left = (signal - basis @ (basis.T @ signal) for signal in (direction, torque))
    power = float(turned @ turned)
    if power <= 1e-9 * len(speed):
        return 0.0, np.inf
    friction = float(turned @ left) / power
    residual = left - friction * turned
    free = max(1, len(speed) - basis.shape[1] - 1)
    variance = float(residual @ residual) / free
    return friction, float(np.sqrt(variance * CORRELATED_ROWS / power))
