"""Identify what a robot arm is carrying from its motor currents.

    >>> import armload
    >>> loaded = armload.read_recording("runs/today/loaded_identification.mcap")
    >>> unloaded = armload.read_recording("runs/today/unloaded_identification.mcap")
    >>> isinstance(loaded, armload.Recording)
    True
    >>> result = armload.identify("er50", loaded, unloaded)
    >>> result.save("payload.toml")

Errors are an `IdentificationError` (recordings, estimates, payload and calibration files) or a `ControlError` (robot
files and names, a recording of another arm, an excitation that the bus cannot stream); docstrings name the class below
these that is raised.

Each name is loaded on first use, so that a control process that imports `PayloadFeedforward` loads neither the command
line nor a bus. All units are SI and are part of the names.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from armload_controller.analysis.robot_excitation import design
    from armload_controller.analysis.robot_identification import identify, validate
    from armload_controller.analysis.robot_identification import read_run as read_recording
    from armload_controller.config.chain_from_urdf import UrdfArm, read_urdf_arm
    from armload_controller.config.robot import Robot, load_robot
    from armload_controller.control_errors import ControlError
    from armload_controller.cycle.plugins import CycleStep
    from armload_controller.feedforward.payload_feedforward import NOTHING, PayloadFeedforward
    from armload_controller.session.installed_plugins import PluginTable
    from armload_identification.estimation.prior_knowledge import KnownPayload
    from armload_identification.files.calibration_file import read_calibration
    from armload_identification.files.payload_file import read_payload
    from armload_identification.identification_errors import IdentificationError
    from armload_identification.model.payload import InertialParameters
    from armload_identification.pipeline.payload_estimator import PayloadEstimator
    from armload_identification.recording.recording import Recording
    from armload_identification.results.findings import Findings
    from armload_identification.storage.strict_toml import BadValue
    from armload_identification.verdict.tolerance import Tolerance

__all__ = [
    "BadValue",
    "ControlError",
    "CycleStep",
    "Findings",
    "IdentificationError",
    "InertialParameters",
    "KnownPayload",
    "NOTHING",
    "PayloadEstimator",
    "PayloadFeedforward",
    "PluginTable",
    "Recording",
    "Robot",
    "Tolerance",
    "UrdfArm",
    "design",
    "identify",
    "load_robot",
    "read_calibration",
    "read_payload",
    "read_recording",
    "read_urdf_arm",
    "validate",
]

_HOMES: Final = {
    "BadValue": ("armload_identification.storage.strict_toml", "BadValue"),
    "ControlError": ("armload_controller.control_errors", "ControlError"),
    "CycleStep": ("armload_controller.cycle.plugins", "CycleStep"),
    "Findings": ("armload_identification.results.findings", "Findings"),
    "IdentificationError": ("armload_identification.identification_errors", "IdentificationError"),
    "InertialParameters": ("armload_identification.model.payload", "InertialParameters"),
    "KnownPayload": ("armload_identification.estimation.prior_knowledge", "KnownPayload"),
    "NOTHING": ("armload_controller.feedforward.payload_feedforward", "NOTHING"),
    "PayloadEstimator": ("armload_identification.pipeline.payload_estimator", "PayloadEstimator"),
    "PayloadFeedforward": ("armload_controller.feedforward.payload_feedforward", "PayloadFeedforward"),
    "PluginTable": ("armload_controller.session.installed_plugins", "PluginTable"),
    "Recording": ("armload_identification.recording.recording", "Recording"),
    "Robot": ("armload_controller.config.robot", "Robot"),
    "Tolerance": ("armload_identification.verdict.tolerance", "Tolerance"),
    "UrdfArm": ("armload_controller.config.chain_from_urdf", "UrdfArm"),
    "design": ("armload_controller.analysis.robot_excitation", "design"),
    "identify": ("armload_controller.analysis.robot_identification", "identify"),
    "load_robot": ("armload_controller.config.robot", "load_robot"),
    "read_calibration": ("armload_identification.files.calibration_file", "read_calibration"),
    "read_payload": ("armload_identification.files.payload_file", "read_payload"),
    "read_recording": ("armload_controller.analysis.robot_identification", "read_run"),
    "read_urdf_arm": ("armload_controller.config.chain_from_urdf", "read_urdf_arm"),
    "validate": ("armload_controller.analysis.robot_identification", "validate"),
}
"""Module of each public name, and its name in that module; the imports above state the same for type checkers."""


if not TYPE_CHECKING:  # a type checker would accept any name

    def __getattr__(name: str) -> object:
        """Load a name on its first use."""
        if name not in _HOMES:
            raise AttributeError(f"module 'armload' has no attribute {name!r}")
        module, there = _HOMES[name]
        value = getattr(import_module(module), there)
        globals()[name] = value
        return value


def __dir__() -> list[str]:
    """The public names, loaded or not."""
    return sorted({*globals(), *__all__})
