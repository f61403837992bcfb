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

from dataclasses import dataclass
from enum import Enum

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


class Cause(Enum):
    """Reason why the motion ends early."""

    OPERATOR = "the operator requested a stop"
    OPERATOR_AGAIN = "the operator requested an immediate stop"
    TERMINATION = "the system requested termination"
    PLUGIN_REQUEST = "a plug-in requested a stop"
    PLUGIN_FAILED = "a plug-in failed"
    PLUGIN_TOO_SLOW = "a plug-in is too slow"
    RECORDING = "the run cannot be recorded"
    LIMIT = "a setpoint exceeds a limit"
    DEVIATION = "the motion would leave the checked path"
    FOLLOWING_ERROR = "a joint does not follow"
    TORQUE = "a joint's torque is not as expected"
    OFFSET = "added torque does not have the expected effect"
    BLOCKED = "the path to the start is blocked"
    BEYOND_LIMIT = "the arm stands beyond a limit"
    STALE = "the drives' feedback is frozen"
    LOOP_LOST = "an axis does not move as commanded"
    VELOCITY = "a velocity contradicts its position"
    TORQUE_MISSING = "a current or torque is not measured"
    TORQUE_REVERSED = "a current or torque has the wrong sign"
    VOLTAGE = "a drive has lost its voltage"
    REMOTE = "a drive takes no commands from the bus"
    INTERNAL_LIMIT = "a drive limits the motion on its own"
    DRIVE_LAG = "a drive reports a following error"
    LATE = "the program is late"
    MISSING_FEEDBACK = "a drive does not answer"
    DRIVE_FAULT = "a drive reports a fault"
    OTHER_MASTER = "another program or tool commands the drives"
    FRAMES = "frames of the bus are lost"
    LINK = "the cable to the drives is unplugged"
    WORKING_COUNTER = "a drive takes no part in the frames"
    LEFT_OP = "a drive has left operation by itself"
    HUNG = "the firmware of a drive hangs"
    DRIVE = "a drive does not behave as expected"
    REFUSED = "a setpoint cannot be sent"
    BUS = "the bus failed"
    PROGRAM = "the program failed"


@dataclass(frozen=True, slots=True)
class Reaction:
    """One row of the table.

    Attributes:
        category: How the arm is stopped; defines the steps.
        advice: What the operator can do.
    """

    category: StopCategory
    advice: str


_ALONG, _QUICK, _OFF = StopCategory.ALONG_PATH, StopCategory.QUICK_STOP, StopCategory.TORQUE_OFF
_EMERGENCY = StopCategory.EMERGENCY_STOP

DECISIONS: dict[Cause, Reaction] = {
    Cause.OPERATOR: Reaction(_ALONG, "start again when ready"),
    Cause.OPERATOR_AGAIN: Reaction(_QUICK, "start again when ready"),
    Cause.TERMINATION: Reaction(_ALONG, "start again when the system allows it to run"),
    Cause.PLUGIN_REQUEST: Reaction(_ALONG, "read the plug-in's message, then start again"),
    Cause.PLUGIN_FAILED: Reaction(_ALONG, "correct the plug-in or run without it"),
    Cause.PLUGIN_TOO_SLOW: Reaction(_ALONG, "make it faster, move its work to another process, or lower --cycle-hz"),
    Cause.RECORDING: Reaction(_ALONG, "free disk space, or choose another --output"),
    Cause.LIMIT: Reaction(_QUICK, "correct the excitation or the limits in the configuration"),
    Cause.DEVIATION: Reaction(_QUICK, "the reference exceeds the joints' limits: design a slower excitation"),
    Cause.FOLLOWING_ERROR: Reaction(
        _QUICK, "look for a collision, an engaged brake, a wrong gear ratio or too small a following error window"
    ),
    Cause.TORQUE: Reaction(_QUICK, "look for a collision, an unexpected payload, or a torque of wrong scale or sign"),
    Cause.OFFSET: Reaction(_ALONG, "correct the drive's or the configuration's scaling, or run without feed-forward"),
    Cause.BLOCKED: Reaction(_ALONG, "move the arm by other means to where the straight path to the start is free"),
    Cause.BEYOND_LIMIT: Reaction(_ALONG, "move the arm back within its limits by other means"),
    Cause.STALE: Reaction(_QUICK, "check the bus interface and its driver"),
    Cause.LOOP_LOST: Reaction(
        _EMERGENCY,
        "press the emergency stop, and keep clear: an axis without a brake falls. Look for a collision. Before the arm "
        "moves again, check encoder, its cable and reference, direction (607E), commutation and brake of this axis",
    ),
    Cause.VELOCITY: Reaction(_QUICK, "check the drive's velocity scale and its encoder"),
    Cause.TORQUE_MISSING: Reaction(_ALONG, "check that the drive reports its actual current or torque (6078, 6077)"),
    Cause.TORQUE_REVERSED: Reaction(
        _ALONG, "check the sign of current or torque in the drive and in the configuration"
    ),
    Cause.VOLTAGE: Reaction(_QUICK, "check the drive's power supply and its safe-torque-off"),
    Cause.REMOTE: Reaction(_QUICK, "set the drive to remote control: another panel or program has taken it over"),
    Cause.INTERNAL_LIMIT: Reaction(_QUICK, "check the drive's own limits of position, speed and torque"),
    Cause.DRIVE_LAG: Reaction(
        _QUICK, "look for a collision, an engaged brake, or too small a window (6065) in the drive"
    ),
    Cause.LATE: Reaction(_QUICK, "close other programs, lower --cycle-hz, or give the process a real-time priority"),
    Cause.MISSING_FEEDBACK: Reaction(_QUICK, "check the drive's supply, its cable and the bus load"),
    Cause.DRIVE_FAULT: Reaction(_QUICK, "clear the cause at the drive, then reset that drive (armload drives reset)"),
    Cause.OTHER_MASTER: Reaction(_QUICK, "stop the other program, or unplug its tool, then repeat the command"),
    Cause.FRAMES: Reaction(_QUICK, "check cables, plugs and the network interface; nothing else may use it"),
    Cause.LINK: Reaction(_OFF, "plug the cable in; the drives have stopped by their watchdogs"),
    Cause.WORKING_COUNTER: Reaction(_QUICK, "check the drives' cables and mappings; reconnect"),
    Cause.LEFT_OP: Reaction(
        _QUICK,
        "if its watchdog has acted, give the program a real-time priority or a longer watchdog_s",
    ),
    Cause.HUNG: Reaction(
        _QUICK, "press the emergency stop: this drive obeys nobody, and may carry torque; then switch it off and on"
    ),
    Cause.DRIVE: Reaction(_QUICK, "inspect the drive; reconnect"),
    Cause.REFUSED: Reaction(_QUICK, "correct the scaling in the configuration, or run without added torque"),
    Cause.BUS: Reaction(_OFF, "check cable, termination and interface"),
    Cause.PROGRAM: Reaction(_QUICK, "report this bug with the recording"),
}


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
