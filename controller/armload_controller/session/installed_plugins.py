"""Plug-ins of the cycle from other packages: installed, named in a robot's file, and found by entry point.

    [plugins.torque_ceiling]                        in the robot's file: the entry point's name
    joint = "joint_2"                               the package's own settings, read strictly
    torque_nm = 150.0

    [project.entry-points."armload.plugins"]        in the package's pyproject.toml
    torque_ceiling = "torque_ceiling:TorqueCeilingTable"

The entry point is a `PluginTable`. A session creates the plug-ins before it opens the arm, calls them in every cycle
after its own monitors, in the order of the file, and calls their `close`, if any, once the arm is off.

Such a plug-in can watch, record and request a stop. It cannot add torque: torque reaches the drives only after their
offset was tested at standstill (`offset_check`), which is not done for packages. Any exception from it counts as a
failure of the plug-in, and the arm is brought to rest along its path.
"""

from __future__ import annotations

import difflib
from abc import abstractmethod
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from importlib.metadata import EntryPoint, entry_points
from typing import Protocol

from armload_controller.config.robot import Robot
from armload_controller.control_errors import ConfigurationError, ControlError
from armload_controller.cycle.plugins import CycleStep, PluginFailed
from armload_identification.extensions import package_of
from armload_identification.storage.strict_toml import BadValue, Table, validated

GROUP = "armload.plugins"
"""Group of the entry points."""


class Watcher(Protocol):
    """A plug-in that adds no torque."""

    def on_cycle(self, step: CycleStep) -> None:
        """Process one cycle.

        Args:
            step: The cycle; its arrays are read-only.
        """


class PluginTable(Table):
    """Settings of a plug-in, `[plugins.NAME]` of a robot's file; a package derives its own class, a field per key.

    Examples:
        >>> import armload
        >>> class SlowestTable(armload.PluginTable):
        ...     velocity_rad_s: float
        ...
        ...     def plugin(self, robot: armload.Robot) -> "Slowest":
        ...         if self.velocity_rad_s <= 0.0:
        ...             raise armload.BadValue("velocity_rad_s", self.velocity_rad_s, "expected more than 0")
        ...         return Slowest(self.velocity_rad_s)
        >>> class Slowest:
        ...     def __init__(self, velocity_rad_s: float) -> None:
        ...         self.velocity_rad_s = velocity_rad_s
        ...
        ...     def on_cycle(self, step: armload.CycleStep) -> None:
        ...         if abs(step.command.velocity_rad_s).max() > self.velocity_rad_s:
        ...             step.ask_to_stop("too fast for the load")
        >>> isinstance(SlowestTable(velocity_rad_s=1.0).plugin(armload.load_robot("er50")), Slowest)
        True
    """

    @abstractmethod
    def plugin(self, robot: Robot) -> Watcher:
        """Create the plug-in, once per session and before the arm is opened.

        Args:
            robot: The arm.

        Raises:
            BadValue: a setting does not fit the arm.
        """
        raise NotImplementedError("the method `plugin` is abstract")  # reading a file does not call the class


class FilePlugin:
    """Adapts a plug-in from a robot's file to the cycle.

    Args:
        name: Name of its table.
        watcher: The plug-in that the package created.
        package: Name and version of the package.

    Attributes:
        name: Its name for messages: the key in the robot's file, which none of armload's own plug-ins has.
        package: Name and version of the package.
    """

    def __init__(self, name: str, watcher: Watcher, package: str) -> None:
        self.name = _table_key(name)
        self.package = package
        self._on_cycle: Callable[[CycleStep], object] = watcher.on_cycle

    def on_cycle(self, step: CycleStep) -> None:
        """Call the plug-in with one cycle.

        Raises:
            PluginFailed: it raised, or returned something. This includes armload's own error classes, whose stops are
                reserved for armload's monitors.
        """
        try:
            answer = self._on_cycle(step)
        except Exception as error:
            raise PluginFailed(self.name, f"of {self.package} raised {type(error).__name__}: {error}") from error
        if answer is not None:
            raise PluginFailed(
                self.name,
                f"of {self.package} returned {answer!r}, expected None: a plug-in named in a robot's file "
                "cannot add torque, because the drives' torque offset is not tested for it",
            )


@contextmanager
def plugins_of(robot: Robot) -> Iterator[tuple[FilePlugin, ...]]:
    """The plug-ins that a robot's file names, for one session; leaving the block closes them.

    Raises:
        ConfigurationError: a plug-in is not installed, cannot be loaded, or refuses its settings.
    """
    with ExitStack() as closing:
        plugins = []
        for name, settings in robot.plugins.items():
            entry = _entry_point(robot, name)
            watcher = _created(robot, name, entry, settings)
            close = getattr(watcher, "close", None)
            if close is not None:
                closing.callback(close)
            plugins.append(FilePlugin(name, watcher, package_of(entry)))
        yield tuple(plugins)


def _entry_point(robot: Robot, name: str) -> EntryPoint:
    """The entry point with a name."""
    entries = list(entry_points(group=GROUP))
    found = [entry for entry in entries if entry.name == name]
    if len(found) == 1:
        return found[0]
    if found:
        packages = " and ".join(sorted(package_of(entry) for entry in found))
        raise robot.refused(_table_key(name), {}, f"{packages} both provide a plug-in with this name: uninstall one")
    close = difflib.get_close_matches(name, {entry.name for entry in entries}, n=1)
    meant = f" Did you mean {close[0]}?" if close else ""
    names = ", ".join(sorted(f"{entry.name} ({package_of(entry)})" for entry in entries)) or "none"
    missing = f"no plug-in with this name is installed.{meant} Installed are: {names}"
    remedy = "Install its package in armload's environment, or remove the table"
    raise robot.refused(_table_key(name), {}, f"{missing}. {remedy}")


def _created(robot: Robot, name: str, entry: EntryPoint, settings: Mapping[str, object]) -> Watcher:
    """The plug-in of an entry point."""
    key, whose = _table_key(name), f"{entry.value} of {package_of(entry)}"
    try:
        table = entry.load()
    except Exception as problem:
        why = f"{type(problem).__name__}: {problem}"
        raise robot.refused(key, {}, f"{whose} cannot be loaded: {why}. Reinstall that package") from problem
    if not (isinstance(table, type) and issubclass(table, PluginTable)):
        raise robot.refused(key, {}, f"{whose} is {table!r}, expected a class derived from armload.PluginTable")
    try:
        watcher = validated(settings, robot.file, table, ConfigurationError, within=key).plugin(robot)
    except BadValue as problem:
        raise robot.refused(f"{key}.{problem.key}", problem.found, problem.expected) from problem
    except ControlError:
        raise
    except Exception as problem:
        why = f"{type(problem).__name__}: {problem}"
        raise robot.refused(key, {}, f"{whose} could not create its plug-in: {why}") from problem
    if not callable(getattr(watcher, "on_cycle", None)):
        raise robot.refused(key, {}, f"{whose} returned {watcher!r}, expected an object with on_cycle(step)")
    return watcher


def _table_key(name: str) -> str:
    """Key of a plug-in's table in the robot's file."""
    return f"plugins.{name}"
