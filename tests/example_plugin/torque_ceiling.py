"""A plug-in of armload's cycle: requests a stop if a joint's measured torque stays above a limit.

[plugins.torque_ceiling]
joint = "joint_2"
torque_nm = 150.0
cycles = 10
"""

from __future__ import annotations

from typing import Annotated

from msgspec import Meta

import armload


class TorqueCeilingTable(armload.PluginTable):
    """The keys of `[plugins.torque_ceiling]`.

    armload refuses missing and unknown keys and values of wrong type or range, naming file, key and value.

    Attributes:
        joint: Name of the joint.
        torque_nm: Limit of the torque's magnitude.
        cycles: Number of consecutive cycles above the limit that is not noise.
    """

    joint: str
    torque_nm: Annotated[float, Meta(gt=0)]
    cycles: Annotated[int, Meta(ge=1)]

    def plugin(self, robot: armload.Robot) -> TorqueCeiling:
        """Make the plug-in for an arm; refuses settings that do not fit the arm."""
        if self.joint not in robot.joint_names:
            raise armload.BadValue("joint", self.joint, f"expected one of {', '.join(robot.joint_names)}")
        return TorqueCeiling(robot, self)


class TorqueCeiling:
    """The plug-in.

    Args:
        robot: The arm.
        settings: Its table in the robot's file.
    """

    def __init__(self, robot: armload.Robot, settings: TorqueCeilingTable) -> None:
        self._settings = settings
        self._joint = robot.joint_names.index(settings.joint)
        self._transmission = robot.transmission
        self._above = 0

    def on_cycle(self, step: armload.CycleStep) -> None:
        """Check one cycle; called in the control loop, so it must not block."""
        torque_nm = self._transmission.measured(step.feedback.torque_nm, step.feedback.current_a)
        if torque_nm is None:
            return
        found_nm = abs(float(torque_nm[self._joint]))
        self._above = self._above + 1 if found_nm > self._settings.torque_nm else 0
        if self._above == self._settings.cycles:
            step.ask_to_stop(
                f"{self._settings.joint} has {found_nm:.1f} N m, its ceiling is {self._settings.torque_nm:g} N m"
            )
