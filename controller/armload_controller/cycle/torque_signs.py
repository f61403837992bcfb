"""Check the sign of measured torques: a motor that moves a joint to and fro works against its friction.

Gravity may drive or oppose a joint, and the payload is unknown; but gravity torque depends on position, friction on
direction. After a slow round, in which only these two matter, every joint's torque is fitted with

    tau = G(q) phi + f tanh(dq / v)

where the columns G describe arbitrary masses on every link, and v is a share of the joint's greatest speed. f must not
be below zero by more than the residual explains, and a torque that never changes was not measured.
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
"""Interval between the rows used."""
SPEED_SHARE = 0.05
"""Share of a joint's greatest speed at which friction reaches most of its value."""
LEAST_TRAVEL_RAD = 0.2
"""A joint with less total travel is not checked."""
CORRELATED_ROWS = 10.0
"""Number of consecutive rows whose errors are assumed to be fully correlated."""
SURE = 4.0
"""Friction this many standard errors below zero counts as negative."""
_FIRST_MOMENTS = 4
"""Mass and first moments: the parameters that gravity torque depends on."""


class TorqueSigns:
    """Plug-in that collects torques during a slow round, to be checked afterwards.

    Args:
        joint_names: Names, for messages.
        chain: The arm.
        transmission: Converts motor current to joint torque.
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
        """Keep one row if due."""
        reference = step.sent_reference
        if reference is None or reference.segment is not Segment.SLOW:
            return
        self._calls += 1
        if self._calls % self._every == 0:
            self._position.append(step.feedback.position_rad)
            self._torque.append(measured_torque(step.feedback, self._transmission))

    def judge(self) -> None:
        """Check the collected rows.

        Raises:
            TorqueMissing: a joint's torque never changed.
            TorqueReversed: a joint's torque has the wrong sign.
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
    """(N, n, K) gravity torque of unit masses and first moments of every link."""
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
    """Least-squares estimate of friction and its standard error, both in N m."""
    direction = np.tanh(speed / (SPEED_SHARE * np.abs(speed).max()))
    known = np.column_stack([np.ones_like(speed), weight])
    # Project gravity out of both signals: the remaining direction is orthogonal to its columns.
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
