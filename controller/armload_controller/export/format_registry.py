"""All formats by name; what a format needs is loaded when a payload is exported."""

from __future__ import annotations

from collections.abc import Callable
from enum import StrEnum
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from armload_controller.export.subject import ExportSubject


class ExportFormat(StrEnum):
    """What a payload can be written as."""

    C = "c"
    URDF = "urdf"
    ROS2 = "ros2"
    KUKA = "kuka"
    ABB = "abb"
    UR = "ur"
    FANUC = "fanuc"
    YASKAWA = "yaskawa"


def exporter(export_format: ExportFormat) -> Callable[[ExportSubject], dict[str, str]]:
    """The function that writes a format: texts by file name; it touches no file."""
    match export_format:
        case ExportFormat.C:
            from armload_controller.export.c99 import export_c

            return export_c
        case ExportFormat.URDF:
            from armload_controller.export.urdf import export_urdf

            return export_urdf
        case ExportFormat.ROS2:
            from armload_controller.export.ros2 import export_ros2

            return export_ros2
        case ExportFormat.KUKA:
            from armload_controller.export.kuka import export_kuka

            return export_kuka
        case ExportFormat.ABB:
            from armload_controller.export.abb import export_abb

            return export_abb
        case ExportFormat.UR:
            from armload_controller.export.ur import export_ur

            return export_ur
        case ExportFormat.FANUC:
            from armload_controller.export.fanuc import export_fanuc

            return export_fanuc
        case ExportFormat.YASKAWA:
            from armload_controller.export.yaskawa import export_yaskawa

            return export_yaskawa
