"""All formats by name; a format's module is loaded when a payload is exported."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from enum import StrEnum
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from armload_controller.control_errors import ExportError
from armload_identification.extensions import ExtensionGroup, extension, extension_names

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
    THRESHOLDS = "thresholds"


LOAD_DATA: Final = frozenset(map(ExportFormat, ("kuka", "abb", "ur", "franka", "fanuc", "yaskawa")))
"""Formats of robot controllers, in the flange frame of the robot's maker."""
OF_AN_ARM: Final = frozenset({ExportFormat.URDF, ExportFormat.MJCF})
"""Formats of a calibrated arm."""

Exporter = Callable[["ExportSubject"], Mapping[str, str | bytes]]
"""Returns contents by file name, texts in ASCII, without writing files."""

_MODULES: Final = {
    ExportFormat.C: "c99",
    ExportFormat.FMU: "fmi.fmi3",
    ExportFormat.FMU2: "fmi.fmi2",
    **{maker: f"load_data.{maker}" for maker in LOAD_DATA},
}
"""Module in this room of each format whose module is not named like the format; its function is `export_FORMAT`."""


def format_names() -> tuple[str, ...]:
    """Names of all formats, with those of installed packages."""
    return (*ExportFormat, *extension_names(ExtensionGroup.EXPORTS, tuple(ExportFormat)))


def exporter(export_format: str) -> Exporter:
    """The function that writes a format: armload's, or that of an installed package (`armload.exports`).

    Raises:
        ExportError: no such format, or the package's function fails.
    """
    if export_format in set(ExportFormat):
        module = _MODULES.get(ExportFormat(export_format), export_format)
        own: Exporter = getattr(import_module(f"armload_controller.export.{module}"), f"export_{export_format}")
        return own
    found = extension(ExtensionGroup.EXPORTS, export_format, tuple(ExportFormat))
    if found is None or not callable(found[0]):
        raise ExportError(
            f"{export_format!r}",
            f"no such format: one of {', '.join(name for name in format_names() if name != export_format)}",
        )
    return partial(_by_extension, found[0], f"{export_format} of {found[1]}")


def _by_extension(function: Exporter, whose: str, subject: ExportSubject) -> Mapping[str, str | bytes]:
    """What a package's function writes, checked: texts in ASCII, names without folders."""
    try:
        contents: dict[Any, Any] = dict(function(subject))
    except Exception as problem:
        raise ExportError(subject.payload_file, f"{whose} failed: {type(problem).__name__}: {problem}") from problem
    for name, content in contents.items():
        if not isinstance(name, str) or Path(name).name != name or not isinstance(content, str | bytes):
            raise ExportError(
                subject.payload_file, f"{whose} gave {name!r}, expected names of files without folders, and texts"
            )
        if isinstance(content, str) and not content.isascii():
            raise ExportError(subject.payload_file, f"{whose} gave {name} with characters that are not ASCII")
    if not contents:
        raise ExportError(subject.payload_file, f"{whose} gave no file")
    return contents
