"""One complete commissioning over CANopen: master and simulated drives, recorder, files, identification."""

from __future__ import annotations

import tempfile
from concurrent.futures import Executor
from dataclasses import replace
from pathlib import Path

import msgspec

from armload_controller.config.robot import Robot, load_robot
from armload_controller.session.arm_access import simulated_arm
from armload_controller.session.commissioning import CommissioningPlan, read_pair, record_half
from armload_controller.session.run_session import no_operator
from armload_controller.session.session_load import SessionLoad
from armload_identification.excitation.fourier import Excitation
from armload_identification.pipeline.identification_result import Identification
from armload_identification.pipeline.payload_identification import identify_runs
from armload_identification.signals.joint_torque import Transmission


def commissioned(pool: Executor, robot_name: str, transmission: Transmission, seed: int) -> Identification:
    """Both halves of a commissioning over CANopen, and the identification from them.

    Args:
        pool: Processes.
        robot_name: Name of a shipped robot.
        transmission: Gains for the identification.
        seed: Decides the noise; 0 is that of the shipped simulation.
    """
    with tempfile.TemporaryDirectory() as directory:
        # The loaded half reads the unloaded one's slow round: one after the other.
        for load in (SessionLoad.UNLOADED, SessionLoad.LOADED):
            pool.submit(_record, robot_name, load, directory, seed).result()
        robot = load_robot(robot_name)
        return identify_runs(*read_pair(robot, Path(directory), "identification"), robot.chain, transmission)


def _record(robot_name: str, load: SessionLoad, directory: str, seed: int) -> None:
    """One half; the validation run, which is not needed here, is a single period."""
    robot = load_robot(robot_name)
    short = Excitation(robot.excitations["validation"].trajectory, 1)
    simulation = robot.simulation_table
    noisy = msgspec.structs.replace(simulation, seed=simulation.seed + len(SessionLoad) * seed)
    robot = replace(robot, excitations=robot.excitations | {"validation": short}).with_tables(simulation=noisy)
    record_half(
        robot, load, lambda which: simulated_arm(robot, which), no_operator(), CommissioningPlan(Path(directory))
    )


def motion_seconds(robot: Robot) -> float:
    """Duration of the measured periods of both runs, s."""
    excitation = robot.excitations["identification"]
    return 2.0 * excitation.periods * excitation.trajectory.period_s
