"""The reaction to every fault: one table from cause to stop.

Categories, mildest first. ALONG_PATH: the phase rate goes to zero and the arm comes to rest on the checked path.
QUICK_STOP: the drives decelerate on their own ramps (605A) and hold with torque on. TORQUE_OFF: no more commands can be
sent and the drives are disabled at once; if the bus is lost, their own reaction to the lost master (1016, 6007) stops
the arm. EMERGENCY_STOP: the loop of a drive has failed, so its axis loses its torque at once, with its brake, and the
others are quick-stopped; if more than one has failed, all lose it.

If a step fails, the next one follows: an arm that cannot be ramped down is quick-stopped, and one that cannot be
quick-stopped is disabled. Every stop escalates: an axis that leaves its predicted course during any of these steps
makes it an emergency stop. Added torque (60B2) is ramped to zero while the arm ramps down.

Whatever the category, the arm is then disabled at standstill with its brakes engaged, and is never re-enabled
automatically.
"""

from __future__ import annotations

from enum import Enum
from importlib.resources import files

from armload_controller.control_errors import ControlError, OffsetRefused, RecordingFailed
from armload_controller.cycle.feedback_truth import (
    DriveLag,
    InternalLimit,
    RemoteLost,
    TorqueMissing,
    TorqueReversed,
    VelocityContradicts,
    VoltageLost,
)
from armload_controller.cycle.monitors import FollowingError, LateCycle, StaleFeedback, TorqueError
from armload_controller.cycle.plugins import PluginFailed, PluginTooSlow
from armload_controller.motion.joint_limits import BeyondLimit, LimitViolation
from armload_controller.motion.motion_control import OperatorStop, PluginStop, StopRequested, TerminationStop
from armload_controller.motion.paths import BlockedWay, InfeasibleMotion
from armload_drivers.driver_errors import (
    BusError,
    CommandError,
    DriveHung,
    DriveLeftOp,
    DriverError,
    ForeignMaster,
    FramesLost,
    LinkDown,
    LoopLost,
    ServoError,
    ServoFault,
    ServoTimeout,
    SettingChanged,
    StateError,
    WorkingCounterWrong,
)


class StopStep(Enum):
    """One step of bringing the arm to rest."""

    RAMP_DOWN = "ramp down along the path, added torque to zero"
    QUICK_STOP = "quick stop, torque on"
    EMERGENCY_STOP = "torque off and brake on at once where a loop has failed, quick stop of the others"
    DISABLE = "brakes on, torque off, at standstill"


class StopCategory(Enum):
    """How the arm is brought to rest."""

    ALONG_PATH = "along the path"
    QUICK_STOP = "quick stop"
    TORQUE_OFF = "torque off"
    EMERGENCY_STOP = "emergency stop"

    @property
    def sequence(self) -> tuple[StopStep, ...]:
        """The steps, in this order."""
        return _SEQUENCES[self]


_SEQUENCES = {
    StopCategory.ALONG_PATH: (StopStep.RAMP_DOWN, StopStep.QUICK_STOP, StopStep.DISABLE),
    StopCategory.QUICK_STOP: (StopStep.QUICK_STOP, StopStep.DISABLE),
    StopCategory.TORQUE_OFF: (StopStep.DISABLE,),
    StopCategory.EMERGENCY_STOP: (StopStep.EMERGENCY_STOP, StopStep.DISABLE),
}


_ALONG, _QUICK, _OFF = StopCategory.ALONG_PATH, StopCategory.QUICK_STOP, StopCategory.TORQUE_OFF
_EMERGENCY = StopCategory.EMERGENCY_STOP
_ADVICE = files("armload_controller.cycle").joinpath("stop_advice.txt").read_text("ascii")
"""Read with the module: a stop waits for no file."""
_ADVICE_BY_NAME = {name: advice for name, _, advice in (line.partition(" ") for line in _ADVICE.splitlines())}


class Cause(Enum):
    """Reason why the motion ends early, and the reaction to it.

    Attributes:
        words: The reason.
        category: How the arm is stopped; defines the steps.
    """

    OPERATOR = "the operator requested a stop", _ALONG
    OPERATOR_AGAIN = "the operator requested an immediate stop", _QUICK
    TERMINATION = "the system requested termination", _ALONG
    PLUGIN_REQUEST = "a plug-in requested a stop", _ALONG
    PLUGIN_FAILED = "a plug-in failed", _ALONG
    PLUGIN_TOO_SLOW = "a plug-in is too slow", _ALONG
    RECORDING = "the run cannot be recorded", _ALONG
    LIMIT = "a setpoint exceeds a limit", _QUICK
    DEVIATION = "the motion would leave the checked path", _QUICK
    FOLLOWING_ERROR = "a joint does not follow", _QUICK
    TORQUE = "a joint's torque is not as expected", _QUICK
    OFFSET = "added torque does not have the expected effect", _ALONG
    BLOCKED = "the path to the start is blocked", _ALONG
    BEYOND_LIMIT = "the arm stands beyond a limit", _ALONG
    STALE = "the drives' feedback is frozen", _QUICK
    LOOP_LOST = "an axis does not move as commanded", _EMERGENCY
    VELOCITY = "a velocity contradicts its position", _QUICK
    TORQUE_MISSING = "a current or torque is not measured", _ALONG
    TORQUE_REVERSED = "a current or torque has the wrong sign", _ALONG
    VOLTAGE = "a drive has lost its voltage", _QUICK
    REMOTE = "a drive takes no commands from the bus", _QUICK
    INTERNAL_LIMIT = "a drive limits the motion on its own", _QUICK
    DRIVE_LAG = "a drive reports a following error", _QUICK
    LATE = "the program is late", _QUICK
    MISSING_FEEDBACK = "a drive does not answer", _QUICK
    DRIVE_FAULT = "a drive reports a fault", _QUICK
    OTHER_MASTER = "another program or tool commands the drives", _QUICK
    FRAMES = "frames of the bus are lost", _QUICK
    LINK = "the cable to the drives is unplugged", _OFF
    WORKING_COUNTER = "a drive takes no part in the frames", _QUICK
    LEFT_OP = "a drive has left operation by itself", _QUICK
    HUNG = "the firmware of a drive hangs", _QUICK
    DRIVE = "a drive does not behave as expected", _QUICK
    REFUSED = "a setpoint cannot be sent", _QUICK
    BUS = "the bus failed", _OFF
    PROGRAM = "the program failed", _QUICK

    def __init__(self, words: str, category: StopCategory) -> None:
        self.words, self.category = words, category

    @property
    def advice(self) -> str:
        """What the operator can do, as `stop_advice.txt` says."""
        return _ADVICE_BY_NAME[self.name]


class PathDeviation(ControlError):
    """A setpoint from Ruckig is off the checked path."""


CAUSES: tuple[tuple[type[BaseException], Cause], ...] = (
    (KeyboardInterrupt, Cause.OPERATOR_AGAIN),
    (OperatorStop, Cause.OPERATOR),
    (TerminationStop, Cause.TERMINATION),
    (PluginStop, Cause.PLUGIN_REQUEST),
    (StopRequested, Cause.OPERATOR),
    (PluginTooSlow, Cause.PLUGIN_TOO_SLOW),
    (PluginFailed, Cause.PLUGIN_FAILED),
    (RecordingFailed, Cause.RECORDING),
    (LimitViolation, Cause.LIMIT),
    (PathDeviation, Cause.DEVIATION),
    (InfeasibleMotion, Cause.DEVIATION),
    (FollowingError, Cause.FOLLOWING_ERROR),
    (TorqueError, Cause.TORQUE),
    (OffsetRefused, Cause.OFFSET),
    (BlockedWay, Cause.BLOCKED),
    (BeyondLimit, Cause.BEYOND_LIMIT),
    (StaleFeedback, Cause.STALE),
    (VelocityContradicts, Cause.VELOCITY),
    (TorqueMissing, Cause.TORQUE_MISSING),
    (TorqueReversed, Cause.TORQUE_REVERSED),
    (VoltageLost, Cause.VOLTAGE),
    (RemoteLost, Cause.REMOTE),
    (InternalLimit, Cause.INTERNAL_LIMIT),
    (DriveLag, Cause.DRIVE_LAG),
    (LateCycle, Cause.LATE),
    (LoopLost, Cause.LOOP_LOST),
    (ForeignMaster, Cause.OTHER_MASTER),
    (SettingChanged, Cause.OTHER_MASTER),
    (ServoFault, Cause.DRIVE_FAULT),
    (ServoTimeout, Cause.MISSING_FEEDBACK),
    (CommandError, Cause.REFUSED),
    (FramesLost, Cause.FRAMES),
    (LinkDown, Cause.LINK),
    (WorkingCounterWrong, Cause.WORKING_COUNTER),
    (DriveLeftOp, Cause.LEFT_OP),
    (DriveHung, Cause.HUNG),
    (BusError, Cause.BUS),
    (ServoError, Cause.DRIVE),
    (StateError, Cause.PROGRAM),
    (DriverError, Cause.DRIVE),
)
"""Cause of each exception class; the first match applies."""


def cause_of(error: BaseException) -> Cause:
    """The cause of an exception."""
    return next((cause for kind, cause in CAUSES if isinstance(error, kind)), Cause.PROGRAM)
