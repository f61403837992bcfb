"""A trial bring-up of an arm's drives, and a fault reset: the two inspections of drives that write to them.

`check` performs bring-up short of enabling, continues after an error, and keeps the result of every step. It resets
nodes and writes their configuration, as bring-up does; so it reads all of them first, writes to none while a drive of
the arm carries torque, even one whose master has ended, and never to a real drive whose identity the configuration does
not state. `reset` acts on one drive, under the same conditions and with consent. Nothing is energised.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from functools import partial

from armload_drivers.bring_up.arm_bring_up import ArmBringUp
from armload_drivers.bring_up.description_check import description_gaps
from armload_drivers.bring_up.drive_bring_up import DriveSetup, Step, configured_units, is_simulation, stated
from armload_drivers.cia402.arm_settings import ArmSettings, Identity
from armload_drivers.cia402.state_machine import State
from armload_drivers.driver_errors import ServoError, WrongDevice


class Verdict(Enum):
    """Result of a step of the check."""

    OK = "ok"
    MISSING = "missing"
    WRONG = "wrong"
    NOT_DONE = "not done"


@dataclass(frozen=True, slots=True)
class Check:
    """One step on one drive.

    Attributes:
        joint: Name of the joint.
        step: What was checked.
        verdict: Its result.
        detail: What was found, or what is missing or wrong and how to correct it.
    """

    joint: str
    node_id: int
    step: str
    verdict: Verdict
    detail: str


@dataclass(frozen=True, slots=True)
class ArmCheck:
    """Result of a trial bring-up.

    Attributes:
        steps: Every step on every drive, joint by joint.
        secured: The drives whose safety properties were examined: all or none.
    """

    steps: tuple[Check, ...]
    secured: tuple[DriveSetup, ...] = ()


def check(bring_up: ArmBringUp) -> ArmCheck:
    """Perform bring-up short of enabling, every step of every drive.

    Args:
        bring_up: The arm on its bus.

    Raises:
        BusError: the bus failed.
    """
    arm, setups = bring_up.arm, bring_up.setups
    rows: list[Check] = []
    for setup in setups:
        rows += [_row(setup, "description", Verdict.MISSING, gap) for gap in description_gaps(setup.settings)]
    of_the_arm = [setup for setup in setups if _identify(setup, rows)]
    named = [setup for setup in of_the_arm if _is_named(setup, rows)]
    strangers = _strangers(bring_up)
    if _carries_torque(bring_up, of_the_arm, rows):
        what = "not while a drive of the arm carries torque, or does not report whether it does"
        rows += [_row(setup, "reset", Verdict.NOT_DONE, what) for setup in setups]
        return ArmCheck((*_by_joint(rows, arm), *strangers))
    silent = bring_up.restart(named)
    sound = [_check_alone(setup, rows, booted=setup not in silent) for setup in named]
    if not all(sound) or len(named) < len(setups):
        what = "requires the scale of every drive, and not all drives have passed"
        rows += [_row(setup, "safety", Verdict.NOT_DONE, what) for setup in setups]
        return ArmCheck((*_by_joint(rows, arm), *strangers))
    units = configured_units(arm, setups)
    for setup in setups:
        _passed(setup, (("safety", partial(setup.secure, units)),), rows)
        if setup.objects.missing:
            rows.append(_row(setup, "objects", Verdict.MISSING, "; ".join(map(str, setup.objects.missing))))
    return ArmCheck((*_by_joint(rows, arm), *strangers), tuple(setups))


def _strangers(bring_up: ArmBringUp) -> list[Check]:
    """A row if the bus has a drive that the configuration does not name. Only reads."""
    try:
        bring_up.require_no_strangers()
    except WrongDevice as error:
        return [Check(error.joint, error.node_id, "other drives", Verdict.WRONG, str(error))]
    return []


def _by_joint(rows: list[Check], arm: ArmSettings) -> list[Check]:
    """All rows of a joint together."""
    order = [drive.node_id for drive in arm.drives]
    return sorted(rows, key=lambda row: order.index(row.node_id))


def _identify(setup: DriveSetup, rows: list[Check]) -> bool:
    """Whether a node answers and is not another device than the configured drive. Only reads."""
    if not setup.is_up():
        rows.append(_row(setup, "answers", Verdict.WRONG, "no answer: is it powered and connected, with this node id?"))
        return False
    rows.append(_row(setup, "answers", Verdict.OK, ""))
    try:
        setup.check_identity()
    except ServoError as error:
        rows.append(_row(setup, "identity", Verdict.WRONG, str(error)))
        return False
    return True


def _carries_torque(bring_up: ArmBringUp, setups: list[DriveSetup], rows: list[Check]) -> bool:
    """Whether a drive carries torque, or does not report its state. Only reads."""
    try:
        powered = bring_up.powered_drives(setups)
    except ServoError as error:
        rows.append(Check(error.joint, error.node_id, "torque", Verdict.WRONG, str(error)))
        return True
    rows += [_row(drive.setup, "torque", Verdict.WRONG, f"{drive.what}. {drive.remedy}") for drive in powered]
    return bool(powered)


def _is_named(setup: DriveSetup, rows: list[Check]) -> bool:
    """Whether a drive may be written to: the configuration states its identity, or it is a simulated one."""
    if _is_anonymous(setup):
        rows.append(_row(setup, "identity", Verdict.NOT_DONE, _name_it(setup.identity)))
        _passed(setup, setup.reading_steps(), rows)
        return False
    rows.append(_row(setup, "identity", Verdict.OK, f"device type 0x{setup.device_type:08X}"))
    return True


def _is_anonymous(setup: DriveSetup) -> bool:
    """Whether an identified drive is a real one, and the configuration does not state its identity."""
    return not setup.settings.is_named and not is_simulation(setup.identity)


def require_named(setup: DriveSetup, what: str) -> Identity:
    """Identity of a drive that may be written to.

    Args:
        what: What is to be done with it, for the error.

    Raises:
        WrongDevice: it is not the configured drive, or a real one whose identity the configuration does not state.
        ServoError: an SDO failed.
    """
    found = setup.check_identity()
    if _is_anonymous(setup):
        settings, remedy = setup.settings, f"Then repeat {what}"
        raise WrongDevice(settings.node_id, settings.joint, "identifying", _name_it(found), remedy)
    return found


def _name_it(found: Identity) -> str:
    """How to state the identity of an anonymous drive."""
    return (
        "a real drive that the configuration does not name is not written to. If it belongs to this arm, name it: "
        f"{stated(found)}"
    )


def _check_alone(setup: DriveSetup, rows: list[Check], *, booted: bool) -> bool:
    """All steps that concern only one drive, which has been reset; True if nothing is wrong."""
    if not booted and not _passed(setup, (("boot", setup.require_alive),), rows):
        return False
    return _passed(setup, setup.reading_steps(), rows) and _passed(setup, setup.writing_steps(), rows)


def _passed(setup: DriveSetup, steps: tuple[Step, ...], rows: list[Check]) -> bool:
    """All of some steps on one drive; True if nothing is wrong."""
    sound = True
    for name, step in steps:
        try:
            found = step()
        except ServoError as error:
            sound = False
            rows.append(_row(setup, name, Verdict.WRONG, str(error)))
        else:
            rows.append(_row(setup, name, Verdict.OK, found or ""))
    return sound


def _row(setup: DriveSetup, step: str, verdict: Verdict, detail: str) -> Check:
    """One row of the table."""
    return Check(setup.settings.joint, setup.settings.node_id, step, verdict, detail)


def reset(bring_up: ArmBringUp, joint: str, consent: Callable[[str], bool]) -> State | None:
    """Reset the fault of one drive, by a bounded number of rising edges. No other is written to, and none is enabled.

    Args:
        bring_up: The arm on its bus.
        joint: Name of the joint.
        consent: Asked before a real drive is written to, with a description of the action.

    Returns:
        The drive's state afterwards; None if consent was refused and nothing was done.

    Raises:
        WrongDevice: it is not the configured drive, or a real one whose identity the configuration does not state.
        ServoError: the drive is not in FAULT, or stays there; or a drive of the arm carries torque.
        BusError: the bus failed.
    """
    setups = bring_up.setups
    setup = next(setup for setup in setups if setup.settings.joint == joint)
    found = require_named(setup, "resetting")
    for drive in bring_up.powered_drives([other for other in setups if other.is_up()]):
        raise drive.refusal()
    cause = setup.read_fault()
    node = f"{joint} (node {setup.settings.node_id})"
    if not is_simulation(found) and not consent(
        f"{node} is in FAULT: {cause}. Has the cause been removed, and should the fault be reset?"
    ):
        return None
    return bring_up.reset_fault(setup)
