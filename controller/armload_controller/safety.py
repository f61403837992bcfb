"""What is done when something goes wrong: one table from cause to stop.

Categories, mildest first. ALONG_PATH: the phase rate goes to zero, the arm comes to rest on the path that was
checked. QUICK_STOP: the drives decelerate on their own ramps (605A) and hold with torque on. TORQUE_OFF:
nothing is left to command, the drives are disabled at once; their own reaction to the lost master (1016,
6007) stops the arm if the bus is gone.

Whatever the category, the arm is disabled afterwards at standstill with its brakes engaged, and nothing
enables it again by itself.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from armload_controller.errors import ControlError
from armload_controller.limits import LimitViolation
from armload_controller.setpoints import InfeasibleMotion
from armload_drivers.errors import BusError, DriverError, ServoFault, ServoTimeout


class StopCategory(Enum):
    """How the arm is brought to rest."""

    ALONG_PATH = "along the path"
    QUICK_STOP = "quick stop"
    TORQUE_OFF = "torque off"


class Cause(Enum):
    """Why the motion ends before its time."""

    OPERATOR = "the operator asked for a stop"
    LIMIT = "a setpoint breaks a limit"
    DEVIATION = "the motion would leave the checked path"
    FOLLOWING_ERROR = "a joint does not follow"
    MISSING_FEEDBACK = "a drive does not answer"
    DRIVE_FAULT = "a drive reports a fault"
    BUS = "the bus failed"
    PROGRAM = "the program failed"


@dataclass(frozen=True, slots=True)
class Decision:
    """One row of the table.

    Attributes:
        category: How to stop.
        advice: What the operator can do.
    """

    category: StopCategory
    advice: str


DECISIONS: dict[Cause, Decision] = {
    Cause.OPERATOR: Decision(StopCategory.ALONG_PATH, "start again when ready"),
    Cause.LIMIT: Decision(StopCategory.QUICK_STOP, "correct the excitation or the limits in the configuration"),
    Cause.DEVIATION: Decision(
        StopCategory.QUICK_STOP,
        "the reference asks for more than the joints' limits allow: design a slower excitation",
    ),
    Cause.FOLLOWING_ERROR: Decision(
        StopCategory.QUICK_STOP,
        "look for a collision, an engaged brake, a wrong gear ratio or too small a window",
    ),
    Cause.MISSING_FEEDBACK: Decision(StopCategory.QUICK_STOP, "check the drive's supply, its cable and the bus load"),
    Cause.DRIVE_FAULT: Decision(StopCategory.QUICK_STOP, "clear the cause at the drive, then reset it by name"),
    Cause.BUS: Decision(StopCategory.TORQUE_OFF, "check cable, termination and interface"),
    Cause.PROGRAM: Decision(StopCategory.QUICK_STOP, "report this with the recording"),
}


class FollowingError(ControlError):
    """A joint is farther from its target than its window.

    Attributes:
        joint: Name of the joint.
        error_rad: Distance between target and measured position.
        window_rad: Greatest distance allowed.
    """

    def __init__(self, joint: str, error_rad: float, window_rad: float) -> None:
        super().__init__(f"{joint}: {error_rad:.4f} rad behind its target, {window_rad:.4f} rad allowed")
        self.joint = joint
        self.error_rad = error_rad
        self.window_rad = window_rad


class PathDeviation(ControlError):
    """What Ruckig would send is not on the path that was checked."""


def cause_of(error: BaseException) -> Cause:
    """The row of the table that an exception belongs to."""
    for kind, cause in (
        (KeyboardInterrupt, Cause.OPERATOR),
        (LimitViolation, Cause.LIMIT),
        (PathDeviation, Cause.DEVIATION),
        (InfeasibleMotion, Cause.DEVIATION),
        (FollowingError, Cause.FOLLOWING_ERROR),
        (ServoFault, Cause.DRIVE_FAULT),
        (ServoTimeout, Cause.MISSING_FEEDBACK),
        (BusError, Cause.BUS),
        (DriverError, Cause.MISSING_FEEDBACK),
    ):
        if isinstance(error, kind):
            return cause
    return Cause.PROGRAM
