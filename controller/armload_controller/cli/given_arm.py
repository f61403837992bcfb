"""The arm given to a command: by name, file or URDF."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from armload_controller.cli.attendance import attended
from armload_controller.cli.options import (
    BitrateOption,
    BusOption,
    CycleOption,
    RobotArgument,
    SimulatedDrivesOption,
    bus_address,
)

if TYPE_CHECKING:
    from armload_controller.cli.screen import Screen
    from armload_controller.config.robot import Robot
    from armload_controller.config.robot_recordings import MeasuredArm
    from armload_controller.session.run_session import ServosFactory


def given_arm(robot: str, base: str | None, flange: str | None) -> MeasuredArm:
    """The arm of a ROBOT argument that may be a URDF.

    Args:
        robot: Name of a shipped robot, or path of a robot's file or of a URDF.
        base: First link of the arm in the URDF.
        flange: Its last link.

    Raises:
        BadParameter: links without a URDF.
        ConfigurationError: the file cannot be used.
    """
    from armload_controller.config.chain_from_urdf import read_urdf_arm
    from armload_controller.config.urdf_tree import is_urdf

    if is_urdf(Path(robot)):
        return read_urdf_arm(robot, base, flange)
    from armload_controller.config.robot import load_robot

    arm = load_robot(robot)
    if base is not None or flange is not None:
        raise typer.BadParameter(f"select the arm in a URDF; ROBOT {robot!r} is none", param_hint="--base, --flange")
    return arm


@dataclass(frozen=True)
class ArmOnBus:
    """An arm, and the bus that it is on."""

    robot: RobotArgument
    bus: BusOption = None
    bitrate: BitrateOption = None

    def arm(self, cycle_hz: float | None = None) -> Robot:
        """The arm on that bus.

        Args:
            cycle_hz: SYNC rate, instead of the configured one.

        Raises:
            BadParameter: the bus has another form.
            ConfigurationError: the file cannot be used, or has no bus.
        """
        from armload_controller.config.robot import load_robot

        interface, channel = (None, None) if self.bus is None else bus_address(self.bus, "--bus")
        return load_robot(self.robot).with_bus(interface, channel, self.bitrate, cycle_hz)


@dataclass(frozen=True)
class DrivenArm(ArmOnBus):
    """An arm whose drives are brought up, and perhaps enabled."""

    cycle_hz: CycleOption = None
    simulated_drives: SimulatedDrivesOption = False

    def require_rules(self, arm: Robot) -> None:
        """Refuse a real arm without all that it requires.

        Raises:
            ConfigurationError: the file does not state the drives' identities, or the constraints on motions.
            UnsafeBus: there is no operator to ask.
        """
        from armload_controller.session.arm_access import require_rules

        require_rules(arm, simulated_drives=self.simulated_drives, attended=attended())

    def opened(self, arm: Robot, screen: Screen, *, brakes_closed: bool = False) -> ServosFactory:
        """Opens the arm with a load on the flange; `brakes_closed` as in `open_arm`."""
        from armload_controller.session.arm_access import open_arm

        simulated, say = self.simulated_drives, screen.step
        return lambda load: open_arm(
            arm, load, say, simulated_drives=simulated, attended=attended(), brakes_closed=brakes_closed
        )
