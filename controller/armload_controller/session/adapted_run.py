"""One run with feed-forward that adapts to the estimated payload."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from armload_controller.config.robot import Robot
from armload_controller.cycle.control_cycle import Hold
from armload_controller.feedforward.adaptation import AdaptationDecision, Beside, PayloadAdaptation
from armload_controller.feedforward.adaptation_rules import AdaptationRules, DeclaredMass
from armload_controller.feedforward.feedforward_plugin import CheckedFeedforward, FeedforwardPlugin
from armload_controller.feedforward.offset_check import OffsetCheck, OffsetVerdict
from armload_controller.motion.checked_path import CheckedPath
from armload_controller.session.run_session import AddedTorque, RunSession
from armload_identification.calibration.calibration_result import ArmCalibration
from armload_identification.contact.watched_payload import WatchedPayload
from armload_identification.model.payload import InertialParameters


def adapted_run(
    path: CheckedPath,
    calibration: ArmCalibration,
    declared: DeclaredMass,
    session: RunSession,
    beside: Beside,
    report: Callable[[AdaptationDecision], None],
) -> tuple[OffsetVerdict, tuple[AdaptationDecision, ...]]:
    """Run a path; the torque offset is tried first, as before any feed-forward.

    Args:
        declared: The expected range of mass.
        session: Session with the arm.
        beside: Computes estimates outside the cycle.
        report: Called with every decision.

    Raises:
        CommissioningError: the operator does not agree.
        MotionError: the motion was stopped, for example because of a wrong torque offset.
    """
    robot = session.robot
    added = FeedforwardPlugin(
        robot.chain, robot.name, None, path.cycle_s, commanded=calibration.commanded(robot.drives.coupling)
    )
    adaptation = PayloadAdaptation(
        WatchedPayload(calibration, robot.chain, robot.drives.transmission),
        calibration.effort,
        AdaptationRules(declared, calibration, robot.joint_names),
        added,
        beside=beside,
        report=report,
    )
    check = OffsetCheck.along(path, robot, greatest_body(robot, declared), np.zeros(robot.n))
    checked = CheckedFeedforward(adaptation, check)
    verdicts = []

    def before(hold: Hold) -> None:
        verdicts.append(checked.try_offset(hold))
        checked.fade_in(hold, verdicts[0])

    warning = (
        f"Torque for up to {declared.most_kg:g} kg will be added while the arm moves, following the estimated payload, "
        "and removed again. "
    )
    session.run(path, "adaptive payload torque", plugins=[checked], added=AddedTorque(before, warning))
    return verdicts[0], tuple(adaptation.decisions)


def greatest_body(robot: Robot, declared: DeclaredMass) -> InertialParameters:
    """The heaviest body that may be fed forward: the robot's heaviest payload, scaled to the greatest declared mass."""
    heaviest = robot.payloads.heaviest
    return InertialParameters(heaviest.theta * (declared.most_kg / heaviest.mass_kg))
