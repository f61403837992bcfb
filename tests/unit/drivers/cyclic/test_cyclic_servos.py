"""The order of an arm's operation: what is allowed in which phase, and what an enabling or exchange leaves behind."""

import numpy as np
import pytest

from armload_drivers.cia402 import object_dictionary as od
from armload_drivers.cia402.state_machine import State
from armload_drivers.cia402.timeouts import Timeouts
from armload_drivers.cyclic.cyclic_servos import CyclicServos, Phase
from armload_drivers.driver_errors import (
    CommandError,
    ServoError,
    ServoFault,
    ServoTimeout,
    StateError,
    TorqueRemains,
)
from armload_drivers.servos import JointCommand
from tests.even_motion import ZERO, enabled, move

QUICK = Timeouts(probe_s=0.05, scan_s=0.01, boot_s=0.3, sdo_s=0.1, mode_s=0.1, stop_s=1.0, enable_s=0.5, disable_s=0.5)


@pytest.fixture
def arm(virtual_arm):
    arm = virtual_arm(timeouts=QUICK)
    assert isinstance(arm.servos, CyclicServos)
    return arm


def object_of(arm, node_id, entry):
    """Value of an object in a simulated drive."""
    return arm.drives._drives[node_id].dictionary.values[entry.key]


def test_before_connecting_nothing_but_closing_is_allowed(arm):
    servos = arm.servos
    assert (servos.n, servos.cycle_s, servos.simulated) == (3, arm.arm.cycle_s, False)
    for step in (servos.standing_rad, servos.enable, servos.stop, servos.disable):
        with pytest.raises(StateError, match="are new"):
            step()
    with pytest.raises(StateError):
        servos.exchange(JointCommand(ZERO, ZERO, ZERO))
    servos.close()
    servos.close()
    with pytest.raises(StateError, match="are closed"):
        servos.stop()


def test_connecting_energises_nothing_and_says_what_it_found(arm):
    arm.servos.connect()
    assert not any(arm.plant.powered)
    assert arm.servos.simulated
    assert all(setup.safety for setup in arm.servos.setups)
    np.testing.assert_allclose(arm.servos.standing_rad(), arm.arm.coupling @ [0.1, -0.2, 0.3], atol=1e-5)
    arm.servos.stop()
    arm.servos.disable()
    with pytest.raises(StateError, match="are connected, but must be enabled"):
        arm.servos.exchange(JointCommand(ZERO, ZERO, ZERO))


def test_enabled_drives_hold_their_position(arm):
    here = enabled(arm)
    assert all(arm.plant.powered)
    np.testing.assert_allclose(here, arm.arm.coupling @ [0.1, -0.2, 0.3], atol=1e-5)
    for step in (arm.servos.enable, arm.servos.standing_rad):
        with pytest.raises(StateError, match="are enabled, but must be connected"):
            step()
    there = move(arm, here, 10)
    feedback = arm.servos.exchange(JointCommand(there, ZERO, ZERO))
    np.testing.assert_allclose(feedback.position_rad, there, atol=0.02)


def test_a_setpoint_that_no_axis_can_reach_in_a_cycle_is_not_sent(arm):
    here = enabled(arm)
    before = arm.servos._running.number
    far = here + np.array([0.0, 0.0, 2.1 * arm.arm.cycle_s])
    with pytest.raises(CommandError, match=r"joint_5: the setpoint is 0.021. rad from the last one"):
        arm.servos.exchange(JointCommand(far, ZERO, ZERO))
    assert arm.servos._running.number == before
    near = here + np.array([0.0, 0.0, 1.9 * arm.arm.cycle_s])
    arm.servos.exchange(JointCommand(near, ZERO, np.array([1.0, 0.0, 0.0])))
    assert [node.offset_permille for node in arm.servos._nodes] == [5, 0, 0], "1 of 200 N m"


def test_a_stop_keeps_torque_on_and_ends_the_exchange(arm):
    here = move(arm, enabled(arm), 20)
    arm.servos.stop()
    assert all(arm.plant.powered)
    assert all(node.state is State.QUICK_STOP_ACTIVE for node in arm.servos._nodes)
    assert all(node.still_for(3) for node in arm.servos._nodes)
    cycles = arm.servos._running.number
    arm.servos.stop()
    assert arm.servos._running.number == cycles, "a second one has no effect"
    with pytest.raises(StateError, match="are stopped, but must be enabled"):
        arm.servos.exchange(JointCommand(here, ZERO, ZERO))
    with pytest.raises(StateError, match="are stopped, but must be connected"):
        arm.servos.enable()
    arm.servos.disable()
    assert not any(arm.plant.powered)
    arm.servos.enable()
    assert all(arm.plant.powered)


def test_an_arm_at_rest_is_disabled_without_a_quick_stop_and_one_in_motion_with_one(arm):
    here = enabled(arm)
    for _ in range(5):
        arm.servos.exchange(JointCommand(here, ZERO, ZERO))
    stops = []
    stop, arm.servos.stop = arm.servos.stop, lambda: (stops.append(1), stop())
    arm.servos.disable()
    assert stops == []
    move(arm, arm.servos.enable().position_rad, 20)
    arm.servos.disable()
    assert stops == [1]
    assert not any(arm.plant.powered)


def test_the_drives_watch_their_master_only_while_they_are_enabled(arm):
    arm.servos.connect()
    assert object_of(arm, 3, od.HEARTBEAT_CONSUMER) == 0
    arm.servos.enable()
    assert object_of(arm, 3, od.HEARTBEAT_CONSUMER) != 0
    arm.servos.disable()
    assert object_of(arm, 3, od.HEARTBEAT_CONSUMER) == 0


def test_a_drive_in_fault_is_not_enabled_and_the_others_lose_their_torque(arm):
    arm.servos.connect()
    arm.drives.fail(3, 0x2310)
    with pytest.raises(ServoFault, match=r"joint_3.*0x2310"):
        arm.servos.enable()
    assert not any(arm.plant.powered)


def test_a_drive_that_does_not_enable_in_time_costs_the_others_their_torque(arm):
    arm.servos.connect()
    node = arm.servos._nodes[1]
    node.ask = lambda goal, step: None
    with pytest.raises(ServoTimeout, match=r"joint_3.*not reached within 0.5 s"):
        arm.servos.enable()
    assert not any(arm.plant.powered)
    del node.ask
    arm.servos.enable()
    assert all(arm.plant.powered)


def test_a_drive_that_has_restarted_is_neither_asked_nor_enabled(arm):
    arm.servos.connect()
    arm.drives.switch_off(3)
    arm.drives.switch_on(3)
    arm.servos._link.command(od.NmtCommand.PRE_OPERATIONAL, 2)  # any frame lets the drives act
    for step in (arm.servos.standing_rad, arm.servos.enable):
        with pytest.raises(ServoError, match=r"joint_3.*re(boot|start)ed"):
            step()
    assert not any(arm.plant.powered)


def test_closing_removes_the_torque_in_every_phase(arm):
    move(arm, enabled(arm), 20)
    arm.servos.close()
    assert not any(arm.plant.powered)
    assert arm.servos._phase is Phase.CLOSED


def test_an_interruption_while_closing_leaves_after_the_torque_is_off(arm):
    enabled(arm)
    arm.servos.stop = lambda: (_ for _ in ()).throw(KeyboardInterrupt)
    with pytest.raises(KeyboardInterrupt):
        arm.servos.close()
    assert not any(arm.plant.powered)


def test_torque_that_could_not_be_removed_is_what_closing_reports_first(arm):
    enabled(arm)

    def keeps(*_):
        raise ServoTimeout(3, "joint_3", "", "silent", "")

    for setup in arm.servos.setups:
        setup.remove_torque = keeps
    for node in arm.servos._nodes:
        node.machine.drop = node.restart = lambda: None
        node.ask = lambda goal, step: None
    arm.servos._running.await_restart = lambda nodes, limit_s: None
    with pytest.raises(TorqueRemains, match=r"joint_2.*joint_3 \(node 3\), joint_5"):
        arm.servos.close()
    assert all(arm.plant.powered)
