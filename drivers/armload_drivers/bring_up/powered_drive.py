"""A drive that carries torque before bring-up, and whether its torque may be removed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from armload_drivers.bring_up.drive_bring_up import DriveSetup
from armload_drivers.cia402.axis_brakes import STANDSTILL_RAD_S
from armload_drivers.cia402.state_machine import State
from armload_drivers.driver_errors import ServoError


@dataclass(frozen=True, slots=True)
class PoweredDrive:
    """A drive that carries torque before bring-up.

    Attributes:
        setup: The drive.
        what: What was found, as text.
        remedy: What the operator can do about it.
        abandoned: Whether its master has ended, and a reset may remove the torque.
    """

    setup: DriveSetup
    what: str
    remedy: str
    abandoned: bool = False

    def refusal(self) -> ServoError:
        """The error that refuses to continue with this drive."""
        settings = self.setup.settings
        return ServoError(settings.node_id, settings.joint, "looking for torque", self.what, self.remedy)


def powered_drives(
    setups: Sequence[DriveSetup], watch_s: float, wait: Callable[[float], object], commands: Callable[[], str]
) -> list[PoweredDrive]:
    """Drives that carry torque; if there are any, their axes are watched for a while. Only reads.

    Args:
        setups: Drives of the arm that answer.
        watch_s: How long the axes are watched.
        wait: Waits for a time in s.
        commands: What another master was heard to command until now, as text; empty if nothing.

    Raises:
        ServoError: a drive does not report its state, position or scale.
        BusError: the bus failed.
    """
    powered = {setup: state for setup in setups if (state := setup.read_powered_state()) is not None}
    if not powered:
        return []
    before = {setup: setup.read_position() for setup in powered}
    wait(watch_s)
    speed = {setup: abs(setup.read_position() - before[setup]) / watch_s for setup in powered}
    return [judged(setup, state, commands(), speed[setup]) for setup, state in powered.items()]


def judged(setup: DriveSetup, state: State, commands: str, speed_counts_s: float) -> PoweredDrive:
    """Whether the reset of a drive that carries torque would be safe, and why not.

    Args:
        commands: What another master was heard to command, as text; empty if nothing.
        speed_counts_s: Speed of its axis.
    """
    carries = f"the drive carries torque in {state.title}"
    if commands:
        return PoweredDrive(setup, f"{carries}, and {commands}", "Then repeat this command")
    if state is State.OPERATION_ENABLED:
        return PoweredDrive(
            setup,
            f"{carries}: another program, the manufacturer's tool or the drive itself may be moving it",
            "Stop it, or press the emergency stop, then repeat this command",
        )
    speed_rad_s = speed_counts_s / abs(setup.read_units().counts_per_rad)
    if speed_rad_s > STANDSTILL_RAD_S:
        return PoweredDrive(
            setup, f"{carries} and moves at {speed_rad_s:.3f} rad/s", "Repeat this command when the arm stands still"
        )
    holds = f"the drive holds its position with torque, in {state.title}; its master has ended"
    if not setup.settings.has_brake:
        return PoweredDrive(
            setup,
            f"{holds}. Its axis has no brake and falls without torque",
            "Support the arm, press the emergency stop, then repeat this command",
        )
    return PoweredDrive(
        setup,
        holds,
        "Press the emergency stop, or run `armload commission`: it resets the drive, and the brake holds the axis",
        abandoned=True,
    )
