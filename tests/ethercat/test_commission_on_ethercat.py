"""er50 commissioned over EtherCAT, and the same arm over CANopen: run with `python -m tests.ethercat_drives er50`."""

import os
from contextlib import closing, contextmanager
from dataclasses import replace

import pytest

from armload_controller.analysis.robot_identification import identify
from armload_controller.config.robot import load_robot
from armload_controller.session.arm_access import simulated_arm
from armload_controller.session.commissioning import ROLES, CommissioningPlan, read_pair, record_half
from armload_controller.session.run_session import Load, no_operator
from armload_drivers.ethercat.ethercat_servos import EthercatServos
from armload_drivers.simulation.mujoco_plant import ArmPlant
from armload_identification.excitation.excitation_file import write_excitation
from armload_identification.excitation.fourier import Excitation
from tests.ethercat_drives import er50_text
from tests.lockstep_line import UNDER_IT, WHY, LockstepLine, PlantBehindDrives, VirtualFrames

pytestmark = [pytest.mark.ethercat, pytest.mark.skipif(not UNDER_IT, reason=WHY)]

MASS_TOLERANCE = 0.015


@pytest.fixture
def robots(tmp_path):
    """er50 on EtherCAT and on the virtual bus, with one period of its excitation."""
    path = tmp_path / "er50_ethercat.toml"
    text = er50_text(os.environ["WITH_ETHERCAT"])
    for role in ROLES:
        write_excitation(tmp_path / f"er50_{role}.toml", load_robot("er50").excitations[role])
    path.write_text(text)
    return [shortened(load_robot(source)) for source in (str(path), "er50")]


def shortened(robot):
    excitations = {role: Excitation(found.trajectory, 1) for role, found in robot.excitations.items()}
    return replace(robot, excitations=excitations)


@contextmanager
def ethercat_arm(robot, load, twin):
    payload = twin.simulation.payload_name if load is Load.LOADED else None
    plant = ArmPlant(twin.simulation.plant_spec(payload, run=int(load is Load.LOADED)))
    arm = robot.drives.settings
    with (
        LockstepLine(PlantBehindDrives(plant, arm, arm.cycle_s)) as line,
        closing(EthercatServos(arm, line, VirtualFrames())) as servos,
    ):
        yield servos


def commissioned(robot, folder, open_servos):
    """Findings of all four runs."""
    folder.mkdir()
    for load in Load:
        record_half(robot, load, open_servos, no_operator(), CommissioningPlan(folder))
    first, second = (read_pair(robot, folder, role) for role in ROLES)
    return identify(robot, first.loaded, first.unloaded, validation=(second.loaded, second.unloaded))


def test_the_payload_is_the_same_as_over_canopen(robots, tmp_path):
    robot, twin = robots
    truth = twin.simulation.payload(twin.simulation.payload_name)
    over_ethercat = commissioned(robot, tmp_path / "ethercat", lambda load: ethercat_arm(robot, load, twin))
    over_canopen = commissioned(twin, tmp_path / "canopen", lambda load: simulated_arm(twin, load))
    found, other = over_ethercat.payload.model, over_canopen.payload.model
    assert found.mass_kg == pytest.approx(truth.mass_kg, rel=MASS_TOLERANCE)
    assert other.mass_kg == pytest.approx(truth.mass_kg, rel=MASS_TOLERANCE)
