"""The servos on CANopen: what they connect to, what they remark, and which drives they watch."""

import math

import pytest

from armload_drivers.canopen.canopen_servos import CanopenServos
from armload_drivers.cyclic.cyclic_servos import Phase
from armload_drivers.driver_errors import StateError
from armload_drivers.simulation.drives.drive_dictionary import DriveTraits


def test_a_drive_that_sends_no_heartbeat_is_not_watched_for_one(virtual_arm, arm_settings):
    arm = arm_settings(accept_missing=frozenset({"drive_lost"}))
    made = virtual_arm(arm, traits={3: DriveTraits(absent=frozenset({0x1017}))})
    assert isinstance(made.servos, CanopenServos)
    made.servos.connect()
    limits = {node.settings.node_id: node.heartbeat_limit_s for node in made.servos._can_nodes}
    assert [math.isinf(limits[node]) for node in (2, 3, 5)] == [False, True, False]


def test_an_arm_is_connected_once_and_reports_nothing_of_a_quiet_start(virtual_arm):
    made = virtual_arm()
    made.servos.connect()
    assert made.servos._phase is Phase.CONNECTED
    assert not any(node.booted for node in made.servos._can_nodes)
    assert made.servos.take_remarks() == ()
    with pytest.raises(StateError):
        made.servos.connect()


def test_torque_that_the_reset_removed_is_told_once(virtual_arm):
    made = virtual_arm()
    made.servos._taken_over = "joint_2, joint_5"
    assert made.servos.take_remarks() == (
        "joint_2, joint_5: held with torque after the last master ended; the reset removed the torque",
    )
    assert made.servos.take_remarks() == ()
