"""All formats by name; a format's module is loaded when a payload is exported."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from enum import StrEnum
from importlib import import_module
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from armload_controller.export.exported_payload import ExportSubject


class ExportFormat(StrEnum):
    """Formats of a payload."""

    C = "c"
    FMU = "fmu"
    FMU2 = "fmu2"
    HAL = "hal"
    URDF = "urdf"
    MJCF = "mjcf"
    ROS2 = "ros2"
    KUKA = "kuka"
    ABB = "abb"
    UR = "ur"
    FRANKA = "franka"
    FANUC = "fanuc"
    YASKAWA = "yaskawa"


LOAD_DATA: Final = frozenset(
    {
        ExportFormat.KUKA,
        ExportFormat.ABB,
        ExportFormat.UR,
        ExportFormat.FRANKA,
        ExportFormat.FANUC,
        ExportFormat.YASKAWA,
    }
)
"""Formats of robot controllers, in the flange frame of the robot's maker."""
OF_AN_ARM: Final = frozenset({ExportFormat.URDF, ExportFormat.MJCF})
"""Formats of a calibrated arm."""
DEFAULT_LICENCE: Final = "Apache-2.0"
"""SPDX identifier of generated source code, armload's own licence."""

Exporter = Callable[["ExportSubject"], Mapping[str, str | bytes]]
"""Returns contents by file name, texts in ASCII, without writing files."""

_HOMES: Final = {
    ExportFormat.C: ("c99", "export_c"),
    ExportFormat.FMU: ("fmi.fmu", "export_fmu"),
    ExportFormat.FMU2: ("fmi.fmu2", "export_fmu2"),
    ExportFormat.HAL: ("hal", "export_hal"),
    ExportFormat.URDF: ("urdf", "export_urdf"),
    ExportFormat.MJCF: ("mjcf", "export_mjcf"),
    ExportFormat.ROS2: ("ros2", "export_ros2"),
    ExportFormat.KUKA: ("load_data.kuka", "export_kuka"),
    ExportFormat.ABB: ("load_data.abb", "export_abb"),
    ExportFormat.UR: ("load_data.ur", "export_ur"),
    ExportFormat.FRANKA: ("load_data.franka", "export_franka"),
    ExportFormat.FANUC: ("load_data.fanuc", "export_fanuc"),
    ExportFormat.YASKAWA: ("load_data.yaskawa", "export_yaskawa"),
}
"""Module in this room, and its function, for each format."""


def exporter(export_format: ExportFormat) -> Exporter:
    """The function that writes a format."""
    module, function = _HOMES[export_format]
    found: Exporter = getattr(import_module(f"armload_controller.export.{module}"), function)
    return found
