"""Settings are stored on request only, in drives that may be written to, and in all or none."""

import pytest

from armload_drivers.bring_up.drive_store import store
from armload_drivers.canopen.canopen_bring_up import CanopenBringUp
from armload_drivers.cia402 import object_dictionary as od
from armload_drivers.cia402.arm_settings import Identity
from armload_drivers.driver_errors import ServoError, WrongDevice
from armload_drivers.simulation.drives.drive_dictionary import DriveTraits
from armload_drivers.simulation.lockstep_bus import LockstepBus

REAL = Identity(0x02DC, 0x1234_5678)


def stored(arm):
    return [drive.dictionary.values[od.STORE_ALL.key] == od.STORE_SIGNATURE for drive in arm.drives._drives.values()]


def refused(question):
    raise AssertionError(question)


def test_simulated_drives_store_without_a_question(virtual_arm):
    arm = virtual_arm()
    assert store(CanopenBringUp(arm.arm, arm.bus), refused)
    assert stored(arm) == [True] * 3


@pytest.mark.parametrize("answer", [True, False])
def test_real_ones_ask_first(virtual_arm, arm_settings, answer):
    arm = virtual_arm(arm_settings(identity=REAL), traits=dict.fromkeys((2, 3, 5), DriveTraits(identity=REAL)))
    asked = []
    bring_up = CanopenBringUp(arm.arm, arm.bus)
    assert store(bring_up, lambda question: asked.append(question) or answer) is answer
    assert "joint_2, joint_3, joint_5" in asked[0]
    assert stored(arm) == [answer] * 3


def test_an_unnamed_real_drive_is_not_written_to(virtual_arm, arm_settings):
    traits = {5: DriveTraits(identity=REAL)}
    arm = virtual_arm(arm_settings(identity=Identity(None, None)), traits=traits)
    with pytest.raises(WrongDevice, match=r"identity = \{ vendor_id = 0x000002DC"):
        store(CanopenBringUp(arm.arm, arm.bus), refused)
    assert stored(arm) == [False] * 3


def test_nothing_is_stored_while_a_drive_carries_torque(virtual_arm):
    arm = virtual_arm()
    arm.servos.connect()
    arm.servos.enable()
    with LockstepBus(arm.wires[0]) as bus, pytest.raises(ServoError, match="OPERATION ENABLED"):
        store(CanopenBringUp(arm.arm, bus), refused)
    assert stored(arm) == [False] * 3


def test_a_drive_that_cannot_is_named_before_any_is_written_to(virtual_arm):
    arm = virtual_arm(traits={5: DriveTraits(absent=frozenset({0x1010}))})
    with pytest.raises(ServoError, match=r"joint_5 .*no 1010:1.*manufacturer's tool"):
        store(CanopenBringUp(arm.arm, arm.bus), refused)
    assert stored(arm) == [False] * 3
    arm.drives._drives[3].dictionary.values[od.STORE_ALL.key] = 2
    with pytest.raises(ServoError, match=r"joint_3 .*1010:1 .*is 0x2, without bit 0"):
        store(CanopenBringUp(arm.arm, arm.bus), refused)
