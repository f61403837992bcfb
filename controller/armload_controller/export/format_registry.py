"""All formats by name."""

from __future__ import annotations

from collections.abc import Callable
from enum import StrEnum

from armload_controller.export.abb import export_abb
from armload_controller.export.c99 import export_c
from armload_controller.export.fanuc import export_fanuc
from armload_controller.export.kuka import export_kuka
from armload_controller.export.ros2 import export_ros2
from armload_controller.export.subject import ExportSubject
from armload_controller.export.ur import export_ur
from armload_controller.export.urdf import export_urdf
from armload_controller.export.yaskawa import export_yaskawa


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


EXPORTERS: dict[ExportFormat, Callable[[ExportSubject], dict[str, str]]] = {
    ExportFormat.C: export_c,
    ExportFormat.URDF: export_urdf,
    ExportFormat.ROS2: export_ros2,
    ExportFormat.KUKA: export_kuka,
    ExportFormat.ABB: export_abb,
    ExportFormat.UR: export_ur,
    ExportFormat.FANUC: export_fanuc,
    ExportFormat.YASKAWA: export_yaskawa,
}
"""Each gives texts by file name and touches no file."""
