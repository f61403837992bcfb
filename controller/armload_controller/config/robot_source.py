"""A robot's file as read: its tables, and its name for messages."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Self

import msgspec
import numpy as np

from armload_controller.config.tables.drive_tables import BusTable
from armload_controller.config.tables.robot_file import RobotFile
from armload_controller.config.tables.simulation_table import SimulationTable
from armload_controller.control_errors import ConfigurationError
from armload_identification.model.chain import Chain


@dataclass(frozen=True, eq=False)
class RobotSource:
    """The common source of all parts of a robot.

    Attributes:
        file: The file's name, for messages.
        text: The file's text, for the recordings.
        folder: The file's folder; other files are named relative to it.
        tables: Its content.
    """

    file: str
    text: str
    folder: Path
    tables: RobotFile

    @property
    def n(self) -> int:
        """Number of joints."""
        return self.tables.n

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints, from the base to the flange."""
        return tuple(joint.name for joint in self.tables.joints)

    @cached_property
    def chain(self) -> Chain:
        """Kinematics up to the flange, and gravity."""
        return self.tables.kinematics.chain(np.array(self.tables.robot.gravity_m_s2))

    @property
    def bus(self) -> BusTable:
        """`[bus]`.

        Raises:
            ConfigurationError: the file has none.
        """
        if self.tables.bus is None:
            raise self.refused(
                "bus",
                None,
                "this robot is known from logs only, for `armload identify`. To move it, add [bus] and a "
                "[joints.drive] for every joint: `armload init` with --scan, --description or --simulated writes them",
            )
        return self.tables.bus

    @property
    def simulation_table(self) -> SimulationTable:
        """`[simulation]`.

        Raises:
            ConfigurationError: the file has none.
        """
        if self.tables.simulation is None:
            raise self.refused("simulation", None, "this robot has no simulated twin")
        return self.tables.simulation

    def with_tables(self, **tables: object) -> Self:
        """A copy with some of the tables replaced.

        Args:
            tables: Table by its key; checked by the caller.
        """
        return replace(self, tables=msgspec.structs.replace(self.tables, **tables))

    def refused(self, key: str, found: object, expected: str) -> ConfigurationError:
        """An error that names this file.

        Args:
            key: Dotted path of the key.
            found: The value found; None if missing.
            expected: What was expected; ends the message.
        """
        return ConfigurationError(self.file, key, found, expected)
