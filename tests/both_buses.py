"""er50 commissioned over EtherCAT and over CANopen, in virtual time: for a test, and a benchmark of whole excitations.

Runs below `python -m tests.ethercat_drives er50`; CANopen's half runs beside it in a process of its own.
"""

from concurrent.futures import ProcessPoolExecutor
from contextlib import closing, contextmanager
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import msgspec

from armload_controller.analysis.robot_identification import identify
from armload_controller.config.robot import load_robot
from armload_controller.config.robot_simulation import NO_PAYLOAD
from armload_controller.session.arm_access import simulated_arm
from armload_controller.session.commissioning import ROLES, CommissioningPlan, read_pair, record_half
from armload_controller.session.run_session import no_operator
from armload_controller.session.session_load import SessionLoad
from armload_drivers.ethercat.ethercat_servos import EthercatServos
from tests.ethercat_plant import plant_behind, shortened, write_robot
from tests.lockstep_line import LockstepLine, VirtualFrames

ROBOT = "er50"


def _twin(noisy):
    """er50, simulated with or without noise."""
    robot = load_robot(ROBOT)
    if noisy:
        return robot
    joints = [msgspec.structs.replace(joint, torque_noise_nm=0.0) for joint in robot.tables.joints]
    return replace(robot, tables=msgspec.structs.replace(robot.tables, joints=joints))


@contextmanager
def _ethercat_arm(robot, load, twin):
    """Servos with the drives of with-ethercat, and er50's plant behind them."""
    arm = robot.drives.settings
    payload = twin.payload_name if load is SessionLoad.LOADED else NO_PAYLOAD
    with (
        closing(LockstepLine(plant_behind(arm, payload, twin))) as line,
        closing(EthercatServos(arm, line, VirtualFrames())) as servos,
    ):
        yield servos


def _commissioned(robot, folder, open_servos):
    """Findings of all four runs."""
    folder.mkdir()
    for load in SessionLoad:
        record_half(robot, load, open_servos, no_operator(), CommissioningPlan(folder))
    first, second = (read_pair(robot, folder, role) for role in ROLES)
    return identify(robot, *first, validation=second)


def _judged(findings):
    """What is compared, in a form that crosses processes."""
    model = findings.payload.model
    values = {"mass": model.mass_kg} | dict(zip(("cx", "cy", "cz"), model.center_of_mass_m, strict=True))
    return values, findings.intervals, findings.verdict.title


def _over_canopen(folder, periods, noisy):
    """The same arm on the virtual CAN bus."""
    robot, twin = shortened(load_robot(ROBOT), periods), _twin(noisy)
    return _judged(_commissioned(robot, folder, lambda load: simulated_arm(twin, load)))


def commissioned_twice(folder: Path, periods: int, *, noisy: bool = True) -> Any:
    """Over EtherCAT, over CANopen: each values, intervals and the title of the verdict; and the true payload."""
    robot, twin = load_robot(str(write_robot(folder, periods))), _twin(noisy).simulation
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as beside:
        canopen = beside.submit(_over_canopen, folder / "canopen", periods, noisy)
        ethercat = _judged(_commissioned(robot, folder / "ethercat", lambda load: _ethercat_arm(robot, load, twin)))
        return ethercat, canopen.result(), twin.payload(twin.payload_name)
