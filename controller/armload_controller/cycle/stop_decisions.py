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
from armload_controller.cycle.following_monitor import FollowingError, LateCycle, StaleFeedback
from armload_controller.cycle.plugins import PluginFailed, PluginTooSlow
from armload_controller.cycle.torque_monitor import TorqueError
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
    """How the arm is brought to rest.

    Attributes:
        sequence: The steps, in this order.
    """

    ALONG_PATH = "along the path", StopStep.RAMP_DOWN, StopStep.QUICK_STOP, StopStep.DISABLE
    QUICK_STOP = "quick stop", StopStep.QUICK_STOP, StopStep.DISABLE
    TORQUE_OFF = "torque off", StopStep.DISABLE
    EMERGENCY_STOP = "emergency stop", StopStep.EMERGENCY_STOP, StopStep.DISABLE

    def __init__(self, title: str, *sequence: StopStep) -> None:
        self.title, self.sequence = title, sequence


_ALONG, _QUICK, _OFF = StopCategory.ALONG_PATH, StopCategory.QUICK_STOP, StopCategory.TORQUE_OFF
_EMERGENCY = StopCategory.EMERGENCY_STOP
_ADVICE = files("armload_controller.cycle").joinpath("stop_advice.txt").read_text("ascii")
"""Read with the module: a stop waits for no file."""
_ADVICE_BY_NAME = {name: advice for name, _, advice in (line.partition(" ") for line in _ADVICE.splitlines())}


class PathDeviation(ControlError):
    """A setpoint from Ruckig is off the checked path."""


class Cause(Enum):
    """Reason why the motion ends early, and the reaction to it.

    Attributes:
        words: The reason.
        category: How the arm is stopped; defines the steps.
        errors: Exceptions that have it; of an exception's classes the nearest one counts.
    """

    OPERATOR = "the operator requested a stop", _ALONG, OperatorStop, StopRequested
    OPERATOR_AGAIN = "the operator requested an immediate stop", _QUICK, KeyboardInterrupt
    TERMINATION = "the system requested termination", _ALONG, TerminationStop
    PLUGIN_REQUEST = "a plug-in requested a stop", _ALONG, PluginStop
    PLUGIN_FAILED = "a plug-in failed", _ALONG, PluginFailed
    PLUGIN_TOO_SLOW = "a plug-in is too slow", _ALONG, PluginTooSlow
    RECORDING = "the run cannot be recorded", _ALONG, RecordingFailed
    LIMIT = "a setpoint exceeds a limit", _QUICK, LimitViolation
    DEVIATION = "the motion would leave the checked path", _QUICK, PathDeviation, InfeasibleMotion
    FOLLOWING_ERROR = "a joint does not follow", _QUICK, FollowingError
    TORQUE = "a joint's torque is not as expected", _QUICK, TorqueError
    OFFSET = "added torque does not have the expected effect", _ALONG, OffsetRefused
    BLOCKED = "the path to the start is blocked", _ALONG, BlockedWay
    BEYOND_LIMIT = "the arm stands beyond a limit", _ALONG, BeyondLimit
    STALE = "the drives' feedback is frozen", _QUICK, StaleFeedback
    LOOP_LOST = "an axis does not move as commanded", _EMERGENCY, LoopLost
    VELOCITY = "a velocity contradicts its position", _QUICK, VelocityContradicts
    TORQUE_MISSING = "a current or torque is not measured", _ALONG, TorqueMissing
    TORQUE_REVERSED = "a current or torque has the wrong sign", _ALONG, TorqueReversed
    VOLTAGE = "a drive has lost its voltage", _QUICK, VoltageLost
    REMOTE = "a drive takes no commands from the bus", _QUICK, RemoteLost
    INTERNAL_LIMIT = "a drive limits the motion on its own", _QUICK, InternalLimit
    DRIVE_LAG = "a drive reports a following error", _QUICK, DriveLag
    LATE = "the program is late", _QUICK, LateCycle
    MISSING_FEEDBACK = "a drive does not answer", _QUICK, ServoTimeout
    DRIVE_FAULT = "a drive reports a fault", _QUICK, ServoFault
    OTHER_MASTER = "another program or tool commands the drives", _QUICK, ForeignMaster, SettingChanged
    FRAMES = "frames of the bus are lost", _QUICK, FramesLost
    LINK = "the cable to the drives is unplugged", _OFF, LinkDown
    WORKING_COUNTER = "a drive takes no part in the frames", _QUICK, WorkingCounterWrong
    LEFT_OP = "a drive has left operation by itself", _QUICK, DriveLeftOp
    HUNG = "the firmware of a drive hangs", _QUICK, DriveHung
    DRIVE = "a drive does not behave as expected", _QUICK, ServoError, DriverError
    REFUSED = "a setpoint cannot be sent", _QUICK, CommandError
    BUS = "the bus failed", _OFF, BusError
    PROGRAM = "the program failed", _QUICK, StateError

    def __init__(self, words: str, category: StopCategory, *errors: type[BaseException]) -> None:
        self.words, self.category, self.errors = words, category, errors

    @property
    def advice(self) -> str:
        """What the operator can do, as `stop_advice.txt` says."""
        return _ADVICE_BY_NAME[self.name]


def cause_of(error: BaseException) -> Cause:
    """The cause of an exception."""
    return next((_CAUSE_OF[kind] for kind in type(error).__mro__ if kind in _CAUSE_OF), Cause.PROGRAM)


_CAUSE_OF = {kind: cause for cause in Cause for kind in cause.errors}
