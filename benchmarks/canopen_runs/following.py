"""Reduction by feed-forward of the following error that a payload causes: er50 with 10 kg, prbt with 5 kg.

The payload, and the arm's body from the empty half, are identified by a commissioning over CANopen. Then one
trajectory is run empty, loaded, and loaded with the torque of the identified payload, of the true one, of the
identified one and its friction in the gears, and of payload and arm. Two trajectories: the robot's own validation
excitation, and a sweep of one harmonic in the same ten seconds, designed here, with a fifth of the reversals.

The remaining error occurs at reversals. There the arm sticks, and its breakaway depends on the inertia moved by the
servo: with the payload it is a few milliseconds later, with longer ringing. On prbt's validation excitation half
(joint 5) to three quarters (2, 3) of the residual's energy are within 0.15 s of reversals, and the true payload's
torque reduces the error by only 50 to 53 % even if the gears' friction does not grow with the load (load_friction = 0).
"""

from __future__ import annotations

import tempfile
from contextlib import AbstractContextManager
from dataclasses import replace
from pathlib import Path

import numpy as np

from armload_controller.analysis.robot_excitation import POSITION_MARGIN_RAD, RATE_SHARE, TORQUE_SHARE
from armload_controller.config.robot import Robot, load_robot
from armload_controller.feedforward.body_torque import ArmTorque, LoadFriction, held_torque
from armload_controller.motion.checked_path import check_path
from armload_controller.session.arm_access import simulated_arm
from armload_controller.session.commissioning import ROLES, CommissioningPlan, read_pair, record_half
from armload_controller.session.feedforward_comparison import ComparisonRuns
from armload_controller.session.run_session import no_operator, run_session
from armload_controller.session.session_load import SessionLoad
from armload_drivers.servos import JointServos
from armload_identification.calibration.mounted_runs import MountedRun
from armload_identification.excitation.design import optimal_excitation
from armload_identification.excitation.design_search import PeriodRange, SearchSettings
from armload_identification.excitation.fourier import Excitation
from armload_identification.excitation.information import named_criterion
from armload_identification.model.body_model import BodyModel
from armload_identification.model.payload import PayloadResult, Provenance
from armload_identification.pipeline.identification_result import payload_result
from armload_identification.pipeline.payload_identification import identify_runs
from benchmarks.arms.calibrated import calibrated

ARMS = (("er50", "paper"), ("prbt", "block"))
TARGET = {"er50": 75.0, "prbt": 65.0}
SWEEP_HZ = 0.1
IDENTIFIED, TRUE, FRICTION, ARM = "identified", "true", "with friction", "with arm"


def run() -> None:
    """Print the tables."""
    print("Feed-forward: RMS over time of e_loaded - e_unloaded, in per cent less than without; * carries the weight")
    print("beyond lag: the loaded arm's own error, what follows from the servo's lag taken off")
    for name, payload in ARMS:
        robot = load_robot(name).with_simulated_payload(payload)
        identified, body = _identify(robot)
        for label, excitation in (("validation excitation", robot.excitations["validation"]), ("sweep", _sweep(robot))):
            _compare(robot, identified, body, label, Excitation(excitation.trajectory, 1))


def _identify(robot: Robot) -> tuple[PayloadResult, BodyModel]:
    """The payload identified by a commissioning, and the body from its empty half: one run alone is too short."""
    with tempfile.TemporaryDirectory() as folder:
        for load in SessionLoad:
            record_half(
                robot, load, lambda which: simulated_arm(robot, which), no_operator(), CommissioningPlan(Path(folder))
            )
        (loaded, unloaded), (_, other) = (read_pair(robot, Path(folder), role) for role in ROLES)
        found = identify_runs(loaded, unloaded, robot.chain, robot.drives.transmission)
        arm = calibrated([MountedRun(unloaded, ""), MountedRun(other, "")], {}, robot.chain, robot.drives.transmission)
        return payload_result(found, Provenance("benchmark", robot.sha256, {})), arm.body


def _sweep(robot: Robot) -> Excitation:
    """An excitation of one harmonic."""
    payload = robot.payloads.expected
    criterion = named_criterion(
        "a-optimal", robot.chain, robot.limits.torque_noise_nm, payload, robot.payloads.design_set
    )
    envelope = robot.envelope(POSITION_MARGIN_RAD, RATE_SHARE, TORQUE_SHARE)
    result = optimal_excitation(criterion, envelope, SearchSettings(1, PeriodRange(*[1.0 / SWEEP_HZ] * 3), 3, 4))
    return result.excitation(1, "benchmark", "benchmark")


def _compare(robot: Robot, identified: PayloadResult, body: BodyModel, label: str, excitation: Excitation) -> None:
    cycle_s = 1 / robot.bus.cycle_hz
    path = check_path(excitation, robot.motion_constraints, cycle_s, file=robot.file, key=label)
    runs = ComparisonRuns(robot, path, held_torque(body))

    def open_servos(load: SessionLoad) -> AbstractContextManager[JointServos]:
        return simulated_arm(robot, load)

    with run_session(robot, SessionLoad.UNLOADED, open_servos, no_operator()) as session:
        empty = runs.plain(session, "empty")
    truth = robot.simulation.payload(robot.simulation.payload_name)
    known = replace(identified, model=truth, determined=np.ones(10, dtype=np.bool_))
    with run_session(robot, SessionLoad.LOADED, open_servos, no_operator()) as session:
        without = runs.plain(session, "loaded")
        first, tried = runs.with_feedforward(session, identified, IDENTIFIED, None)
        fed = {IDENTIFIED: first, TRUE: runs.with_feedforward(session, known, TRUE, tried)[0]}
        chain = robot.chain
        for key, term in ((FRICTION, LoadFriction(chain, body)), (ARM, ArmTorque(chain, body))):
            fed[key] = runs.with_feedforward(session, identified, key, tried, term)[0]
    added = runs.compare(without, fed, empty, identified)
    beyond = runs.compare(without, fed, None, identified)
    print(f"\n  {robot.name}, {identified.model.mass_kg:.2f} kg, {label}; wanted: {TARGET[robot.name]:.0f} % less")
    for i, joint in enumerate(added.joint_names):
        mark = "*" if i in added.gravity_loaded else " "
        shares = "  ".join(f"{key} {100 * added.reduction(key)[i]:5.1f} %" for key in (IDENTIFIED, TRUE, FRICTION))
        own = "  ".join(f"{key} {100 * beyond.reduction(key)[i]:5.1f} %" for key in (IDENTIFIED, ARM))
        print(
            f"  {joint:14s}{mark} {1e3 * added.without_rms_rad[i]:6.3f} mrad  {shares}   "
            f"beyond lag {1e3 * beyond.without_rms_rad[i]:6.3f} mrad  {own}"
        )


if __name__ == "__main__":
    run()
