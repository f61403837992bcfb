"""The decision table written a second time, so that it is not changed by accident."""

import pytest

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
from armload_controller.cycle.stop_decisions import Cause, PathDeviation, StopCategory, StopStep, cause_of
from armload_controller.cycle.torque_monitor import TorqueError
from armload_controller.motion.joint_limits import BeyondLimit, LimitViolation
from armload_controller.motion.motion_control import OperatorStop, PluginStop, StopRequested, TerminationStop
from armload_controller.motion.paths import BlockedWay, InfeasibleMotion
from armload_drivers.driver_errors import (
    AxisMoves,
    BusError,
    BusOverload,
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
    StatuswordError,
    TransitionError,
    WorkingCounterWrong,
)

DRIVE = (3, "elbow", "streaming", "what", "advice")
ALONG, QUICK, OFF = StopCategory.ALONG_PATH, StopCategory.QUICK_STOP, StopCategory.TORQUE_OFF


def bare(kind):
    """An error of some type, made without its constructor."""
    return kind.__new__(kind)


@pytest.mark.parametrize(
    ("error", "cause", "category"),
    [
        (KeyboardInterrupt(), Cause.OPERATOR_AGAIN, QUICK),
        (OperatorStop("Ctrl-C"), Cause.OPERATOR, ALONG),
        (StopRequested("somebody"), Cause.OPERATOR, ALONG),
        (TerminationStop("SIGTERM"), Cause.TERMINATION, ALONG),
        (PluginStop("stranger", "enough"), Cause.PLUGIN_REQUEST, ALONG),
        (PluginFailed("stranger", "raised"), Cause.PLUGIN_FAILED, ALONG),
        (PluginTooSlow("stranger", "slow"), Cause.PLUGIN_TOO_SLOW, ALONG),
        (RecordingFailed("disk full"), Cause.RECORDING, ALONG),
        (bare(OffsetRefused), Cause.OFFSET, ALONG),
        (bare(BlockedWay), Cause.BLOCKED, ALONG),
        (bare(BeyondLimit), Cause.BEYOND_LIMIT, ALONG),
        (bare(LimitViolation), Cause.LIMIT, QUICK),
        (PathDeviation("off"), Cause.DEVIATION, QUICK),
        (bare(InfeasibleMotion), Cause.DEVIATION, QUICK),
        (bare(FollowingError), Cause.FOLLOWING_ERROR, QUICK),
        (bare(TorqueError), Cause.TORQUE, QUICK),
        (StaleFeedback("again"), Cause.STALE, QUICK),
        (bare(LoopLost), Cause.LOOP_LOST, StopCategory.EMERGENCY_STOP),
        (bare(VelocityContradicts), Cause.VELOCITY, QUICK),
        (bare(TorqueMissing), Cause.TORQUE_MISSING, ALONG),
        (bare(TorqueReversed), Cause.TORQUE_REVERSED, ALONG),
        (bare(VoltageLost), Cause.VOLTAGE, QUICK),
        (bare(RemoteLost), Cause.REMOTE, QUICK),
        (bare(InternalLimit), Cause.INTERNAL_LIMIT, QUICK),
        (bare(DriveLag), Cause.DRIVE_LAG, QUICK),
        (bare(LateCycle), Cause.LATE, QUICK),
        (ServoTimeout(*DRIVE), Cause.MISSING_FEEDBACK, QUICK),
        (ServoFault(*DRIVE), Cause.DRIVE_FAULT, QUICK),
        (SettingChanged(*DRIVE), Cause.OTHER_MASTER, QUICK),
        (ServoError(*DRIVE), Cause.DRIVE, QUICK),
        (bare(AxisMoves), Cause.DRIVE, QUICK),
        (bare(StatuswordError), Cause.DRIVE, QUICK),
        (bare(TransitionError), Cause.DRIVE, QUICK),
        (ForeignMaster("another master"), Cause.OTHER_MASTER, QUICK),
        (DriverError("whatever"), Cause.DRIVE, QUICK),
        (CommandError("no 60B2"), Cause.REFUSED, QUICK),
        (FramesLost("4 in a row"), Cause.FRAMES, QUICK),
        (LinkDown("unplugged"), Cause.LINK, OFF),
        (WorkingCounterWrong("15 instead of 18"), Cause.WORKING_COUNTER, QUICK),
        (DriveLeftOp(*DRIVE), Cause.LEFT_OP, QUICK),
        (DriveHung(*DRIVE), Cause.HUNG, QUICK),
        (BusError("bus-off"), Cause.BUS, OFF),
        (BusOverload("full"), Cause.BUS, OFF),
        (StateError("not enabled"), Cause.PROGRAM, QUICK),
        (ControlError("whatever"), Cause.PROGRAM, QUICK),
        (ZeroDivisionError(), Cause.PROGRAM, QUICK),
        (SystemExit(1), Cause.PROGRAM, QUICK),
    ],
    ids=lambda value: type(value).__name__ if isinstance(value, BaseException) else "",
)
def test_every_error_has_its_cause_and_every_cause_its_stop(error, cause, category):
    assert cause_of(error) is cause
    assert cause.category is category


def test_what_a_stop_consists_of():
    assert ALONG.sequence == (StopStep.RAMP_DOWN, StopStep.QUICK_STOP, StopStep.DISABLE)
    assert QUICK.sequence == (StopStep.QUICK_STOP, StopStep.DISABLE)
    assert OFF.sequence == (StopStep.DISABLE,)
    assert StopCategory.EMERGENCY_STOP.sequence == (StopStep.EMERGENCY_STOP, StopStep.DISABLE)
