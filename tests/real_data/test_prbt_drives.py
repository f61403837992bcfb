"""`prbt.toml` against drives simulated from the manufacturer's description."""

from dataclasses import replace

import numpy as np
import pytest

from armload_controller.config.robot import load_robot
from armload_controller.motion.motion_control import MotionControl
from armload_controller.session.arm_access import simulated_arm
from armload_controller.session.commissioning import CommissioningPlan, record_half
from armload_controller.session.run_session import Consent, NoDisplay, Operator
from armload_controller.session.session_load import SessionLoad
from armload_drivers.bring_up.description_file import read_description
from armload_drivers.cia402.drive_safety import Safety
from armload_identification.excitation.fourier import Excitation, FourierTrajectory
from armload_identification.recording.file_reading import read_recording_file

SWING = np.full((6, 1), 0.05)


@pytest.fixture
def robot():
    """prbt with excitations of one period of 1 s."""
    path = FourierTrajectory(1.0, np.array([0.0, 0.6, 1.2, 0.0, 0.5, 0.0]), SWING, 0.5 * SWING)
    return replace(load_robot("prbt"), excitations=dict.fromkeys(("identification", "validation"), Excitation(path, 1)))


@pytest.mark.long
def test_a_half_is_recorded_on_the_makers_drives(robot, shared_data, tmp_path):
    described = read_description(shared_data / "eds" / "pilz_prbt_0_1.dcf")
    opened = []

    def open_servos(load):
        servos = simulated_arm(robot, load, [described])
        opened.append(servos)
        return servos

    operator = Operator(NoDisplay(), MotionControl(), Consent(lambda question: False, given=False))
    record_half(robot, SessionLoad.LOADED, open_servos, operator, CommissioningPlan(tmp_path))
    recording = read_recording_file(tmp_path / "loaded_identification.mcap")
    assert np.isfinite(recording.phase_s).sum() == 100
    assert np.abs(recording.torque_nm).max() > 1.0


def test_its_ways_and_consents_are_those_of_the_file(robot, shared_data):
    described = read_description(shared_data / "eds" / "pilz_prbt_0_1.dcf")
    with simulated_arm(robot, SessionLoad.UNLOADED, [described]) as servos:
        servos.connect()
        assert servos.simulated, "the description leaves the identity open, so it is the simulation's"
        for setup in servos.setups:
            missing = {finding.of for finding in setup.safety if finding.way is None}
            accepted = {finding.of for finding in setup.safety if finding.accepted}
            assert missing == accepted
            assert missing == {Safety.MASTER_LOST, Safety.SETPOINTS_LOST, Safety.QUICK_STOP, Safety.FAULT_REACTION}
