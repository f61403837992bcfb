"""Drives whose mappings cannot be written: run with `python -m tests.ethercat_drives fixed`."""

from contextlib import closing
from dataclasses import replace

import numpy as np
import pytest

from armload_drivers.cia402 import object_dictionary as od
from armload_drivers.cia402.arm_settings import EffortFeedback, Fieldbus
from armload_drivers.ethercat.ethercat_servos import EthercatServos
from armload_drivers.servos import JointCommand
from tests.ethercat_drives import PROFILE_VELOCITY
from tests.ideal_plant import IdealPlant
from tests.lockstep_line import UNDER_IT, WHY, LockstepLine, PlantBehindDrives, VirtualFrames

pytestmark = [pytest.mark.ethercat, pytest.mark.skipif(not UNDER_IT, reason=WHY)]

N, CYCLE_S = 3, 0.01
ZERO = np.zeros(N)
TORQUE_NM, TORQUE_PERMILLE = 10.0, 50


def test_a_fixed_mapping_is_used_as_it_is(arm_settings):
    """In the drives' order; the profile velocity, which is in the frame too, keeps its value."""
    small = arm_settings(cycle_s=CYCLE_S, feedback=EffortFeedback.TORQUE, rated_current_a=None)
    drives = tuple(replace(drive, node_id=place) for place, drive in enumerate(small.drives, start=1))
    settings = replace(small, drives=drives, coupling=np.eye(N), fieldbus=Fieldbus.ETHERCAT, watchdog_s=2.0)
    plant = IdealPlant(np.zeros(N), np.full(N, 5.0))
    with (
        closing(LockstepLine(PlantBehindDrives(plant, settings, CYCLE_S))) as line,
        closing(EthercatServos(settings, line, VirtualFrames())) as servos,
    ):
        servos.connect()
        target = servos.enable().position_rad
        for _ in range(100):
            target = target + 0.002
            feedback = servos.exchange(JointCommand(target, ZERO, np.full(N, TORQUE_NM)))
            assert not feedback.missing.any()
        for _ in range(3):
            feedback = servos.exchange(JointCommand(target, ZERO, np.full(N, TORQUE_NM)))
        assert feedback.position_rad == pytest.approx(target, abs=1e-5)
        offsets = [int.from_bytes(line.upload(place, 0x60B2, 0, 0.5), "little") for place in range(N)]
        assert offsets == [TORQUE_PERMILLE] * N
        others = [int.from_bytes(line.upload(place, 0x6081, 0, 0.5), "little") for place in range(N)]
        assert others == [PROFILE_VELOCITY] * N
        fields = [setup.outputs for setup in servos._bring_up.line_setups]
        assert all(part.offsets[od.CONTROLWORD] == 8 for part in fields), "the drives' own mapping was not used"
        assert servos.take_remarks() == ()
