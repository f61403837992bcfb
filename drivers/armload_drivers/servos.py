"""The hardware abstraction: all joint servos of an arm, exchanged cyclically as a unit.

One `exchange` per cycle. The drives latch the given command at the next SYNC; the returned feedback was sampled at that
same SYNC, or, where one frame carries setpoints out and feedback in (EtherCAT), at the one before; its time says which.
Values are in SI units and refer to the JOINTS, with coupling resolved, except `current_a`, which is the current of each
MOTOR, because torque constants belong to the identification.

Sequence: `connect` -> `enable` -> `exchange` ... -> `stop` -> `disable` -> `close`. `close` is allowed in every state
and leaves the arm at standstill without torque. While no drive is enabled, `standing_rad` returns the arm's position.
`take_remarks` is allowed at any time.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol, TypeAlias, runtime_checkable

import numpy as np
from numpy.typing import NDArray

FloatArray: TypeAlias = NDArray[np.float64]
"""An array of float64; shape and unit are where it is used."""


class JointCommand(NamedTuple):
    """Setpoints of one cycle, for n joints.

    Attributes:
        position_rad: (n,) target positions.
        velocity_rad_s: (n,) their derivative, for drives that take a velocity offset (60B1).
        torque_offset_nm: (n,) joint torque for the servo loops to add (60B2).
    """

    position_rad: FloatArray
    velocity_rad_s: FloatArray
    torque_offset_nm: FloatArray


class JointFeedback(NamedTuple):
    """Feedback of one cycle, for n joints.

    A joint that is `missing` repeats its last values.

    Attributes:
        cycle: Number of the SYNC since `connect`.
        time_s: Time stamp of that SYNC on the servos' clock.
        position_rad: (n,) measured joint positions.
        velocity_rad_s: (n,) measured joint velocities, or None if the drives do not send them.
        current_a: (n,) measured MOTOR currents, or None on arms that send torque.
        torque_nm: (n,) measured JOINT torques, or None on arms that send current.
        statusword: (n,) CiA 402 statusword (6041).
        missing: (n,) True where this cycle's feedback did not arrive in time.
        skipped_cycles: SYNC periods that passed unused before this one because the caller was late.
    """

    cycle: int
    time_s: float
    position_rad: FloatArray
    velocity_rad_s: FloatArray | None
    current_a: FloatArray | None
    torque_nm: FloatArray | None
    statusword: NDArray[np.uint16]
    missing: NDArray[np.bool_]
    skipped_cycles: int = 0


@runtime_checkable
class JointServos(Protocol):
    """All joint servos of one arm.

    Attributes:
        n: Number of joints.
        cycle_s: Duration of one cycle.
        simulated: True if every drive has the simulation's identity (no real arm can move).
    """

    n: int
    cycle_s: float
    simulated: bool

    def connect(self) -> None:
        """Boot, identify, configure and verify every drive; nothing is energised.

        Raises:
            DriverError: naming node, joint and step.
        """

    def standing_rad(self) -> FloatArray:
        """(n,) positions of the joints while connected and not enabled.

        Raises:
            StateError: not connected, or enabled.
            DriverError: a drive does not report its position.
        """

    def enable(self) -> JointFeedback:
        """Bring every drive to OPERATION ENABLED, holding its present position.

        Returns:
            Feedback of the first enabled cycle.
        """

    def exchange(self, command: JointCommand) -> JointFeedback:
        """Send one cycle's setpoints and return the feedback sampled at the SYNC that latched them, or the one before.

        Raises:
            StateError: not enabled.
            CommandError: a setpoint cannot be sent, or no axis could follow it in a cycle; nothing was sent.
            LoopLost: an axis has left its predicted course; `stop` removes its torque at once.
            ServoFault: a drive left OPERATION ENABLED by itself.
            ServoTimeout: a drive's feedback was missing too many cycles in a row.
            BusError: the bus failed.
        """

    def stop(self, suspect: int | None = None) -> None:
        """Quick stop: decelerate every drive on its own ramp and hold, with torque on.

        The torque of an axis that leaves its predicted course, before or during the stop, is removed at once, and its
        brake engages; if there is more than one, the torque of all.

        Args:
            suspect: Index of an axis with an unexpected torque or following error. If its position stands while its
                setpoints move, it has left its course.

        Raises:
            LoopLost: an axis left its course during the stop, or did not come to rest in time.
        """

    def disable(self) -> None:
        """Engage brakes and remove torque once the arm is at standstill, or when it does not come to rest in time.

        Raises:
            TorqueRemains: it could not be read back that a drive carries no torque.
        """

    def take_remarks(self) -> tuple[str, ...]:
        """Lines for the operator about what happened since the last call without being an error; usually none."""

    def close(self) -> None:
        """Leave the bus, after stopping and disabling if necessary. Idempotent."""
