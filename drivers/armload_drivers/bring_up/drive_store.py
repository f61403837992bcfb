"""Storing the present settings of an arm's drives in their memory (1010), only on request."""

from __future__ import annotations

from collections.abc import Callable

from armload_drivers.bring_up.arm_bring_up import ArmBringUp
from armload_drivers.bring_up.drive_bring_up import is_simulation
from armload_drivers.bring_up.drive_check import require_named


def store(bring_up: ArmBringUp, consent: Callable[[str], bool]) -> bool:
    """Store the present settings of every drive. All are examined before the first is written to.

    Args:
        bring_up: The arm on its bus.
        consent: Asked before a real drive is written to, with a description of the action.

    Returns:
        Whether they were stored; False if consent was refused.

    Raises:
        WrongDevice: a node is not the configured drive, or a real one whose identity the configuration does not state.
        ServoError: a drive carries torque, cannot store its settings on request, or does not confirm it.
        BusError: the bus failed.
    """
    found = [require_named(setup, "storing") for setup in bring_up.setups]
    for drive in bring_up.powered_drives(bring_up.setups):
        raise drive.refusal()
    for setup in bring_up.setups:
        setup.require_storage()
    joints = ", ".join(setup.settings.joint for setup in bring_up.setups)
    if not all(map(is_simulation, found)) and not consent(
        f"The present settings of {joints} replace those in the drives' memory, also those that a manufacturer's tool "
        "has stored. Go on?"
    ):
        return False
    for setup in bring_up.setups:
        setup.store_settings()
    return True
