"""Drives that are enabled with their brakes closed (60FE), to test them."""

from dataclasses import replace

import numpy as np
import pytest

from armload_drivers.cia402 import object_dictionary as od
from armload_drivers.driver_errors import ServoError
from armload_drivers.servos import JointCommand
from armload_drivers.simulation.drives.drive_dictionary import DriveTraits

ZERO = np.zeros(3)


@pytest.fixture
def testing(virtual_arm, arm_settings):
    """Makes a connected arm that keeps its brakes closed; the first axis has none."""

    def make(traits=None, *, brakes_closed=True):
        arm = replace(arm_settings(), brakes_closed=brakes_closed)
        first, *others = arm.drives
        arm = virtual_arm(replace(arm, drives=(replace(first, has_brake=False), *others)), traits=traits)
        arm.servos.connect()
        return arm

    return make


def outputs(arm):
    keys = (od.PHYSICAL_OUTPUTS.key, od.OUTPUT_MASK.key)
    return [[drive.dictionary.values[key] for key in keys] for drive in arm.drives._drives.values()]


def test_they_are_closed_while_torque_is_on_and_the_drives_own_afterwards(testing):
    arm = testing()
    arm.drives._drives[3].dictionary.values[od.OUTPUT_MASK.key] = 0x30000
    assert arm.plant.kept_braked == [False] * 3
    here = arm.servos.enable().position_rad
    arm.servos.exchange(JointCommand(here, ZERO, ZERO))
    assert (arm.plant.kept_braked, arm.plant.powered) == ([False, True, True], [True] * 3)
    arm.servos.stop()
    arm.servos.disable()
    assert (arm.plant.kept_braked, arm.plant.powered) == ([False] * 3, [False] * 3)
    assert outputs(arm) == [[0, 0], [0, 0x30000], [0, 0]], "what else the drive drives is left alone"


def test_otherwise_the_drives_open_them(testing):
    arm = testing(brakes_closed=False)
    arm.servos.enable()
    assert arm.plant.kept_braked == [False] * 3


@pytest.mark.parametrize("traits", [DriveTraits(absent=frozenset({0x60FE})), DriveTraits(forgets=frozenset({0x60FE}))])
def test_a_drive_that_cannot_is_refused_and_none_is_left_so(testing, traits):
    arm = testing({5: traits})
    with pytest.raises(ServoError, match=r"joint_5 .*keeping the brake closed.*60FE.*manufacturer's tool"):
        arm.servos.enable()
    assert (arm.plant.kept_braked, arm.plant.powered) == ([False] * 3, [False] * 3)
    assert outputs(arm)[1] == [0, 0]
