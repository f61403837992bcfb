"""Identify what a robot arm is carrying from its motor currents.

What people use, in the order of a commissioning:

    commission(robot, output)                 run a simulated arm empty and loaded, identify and validate the payload
    identify(robot, loaded, unloaded)         the payload, from a recording with it and one without
    validate(robot, payload, loaded, unloaded)   is it right? from recordings of another motion
    calibrate(robot, runs)                    the arm's gains, body and friction: narrower intervals, any motion
    compare(payload, cad)                     a payload against CAD
    export(robot, payload, "c", folder)       for other controllers: C, FMU, LinuxCNC, URDF, ROS 2, load data
    PayloadFeedforward(robot, payload)        the payload's torque in a control loop
    watch(robot, recording)                   the payload along a recording: grasped, released
    drift(robot, runs)                        what has changed on an arm since its calibration
    design(robot)                             the most informative motion within the arm's limits
    fleet(jobs, folder), fleet_report(folder) many recordings of many arms

    >>> import armload
    >>> loaded = armload.read_recording("runs/today/loaded_identification.mcap")
    >>> unloaded = armload.read_recording("runs/today/unloaded_identification.mcap")
    >>> isinstance(loaded, armload.Recording)
    True
    >>> result = armload.identify("er50", loaded, unloaded)
    >>> result.save("payload.toml")

Everywhere an object, a name or a path may be given: a robot as "er50", the path of its file or what `load_robot`
returned; a recording, payload or calibration as its path or what was read from it. Results print as tables, have
`to_dict()`, and write their files and reports.

Errors are an `IdentificationError` (recordings, estimates, payload and calibration files) or a `ControlError` (robot
files and names, a recording of another arm, an excitation that the bus cannot stream); docstrings name the class below
these that is raised. An argument of another type raises TypeError.

Each name is loaded on first use, so that a control process that imports `PayloadFeedforward` loads neither the command
line nor a bus. All units are SI and are part of the names.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:  # read by `_homes` too: the only list of the public names
    from armload_controller.analysis.payload_watch import watch as watch
    from armload_controller.analysis.robot_calibration import calibrate as calibrate
    from armload_controller.analysis.robot_comparison import compare as compare
    from armload_controller.analysis.robot_drift import drift as drift
    from armload_controller.analysis.robot_excitation import DesignSearch as DesignSearch
    from armload_controller.analysis.robot_excitation import design as design
    from armload_controller.analysis.robot_export import ExportOptions as ExportOptions
    from armload_controller.analysis.robot_export import export as export
    from armload_controller.analysis.robot_identification import identify as identify
    from armload_controller.analysis.robot_identification import identify_over_time as identify_over_time
    from armload_controller.analysis.robot_identification import read_recording as read_recording
    from armload_controller.analysis.robot_identification import validate as validate
    from armload_controller.analysis.stated_drift import StatedDrift as StatedDrift
    from armload_controller.config.chain_from_urdf import UrdfArm as UrdfArm
    from armload_controller.config.chain_from_urdf import read_urdf_arm as read_urdf_arm
    from armload_controller.config.robot import Robot as Robot
    from armload_controller.config.robot import load_robot as load_robot
    from armload_controller.control_errors import ControlError as ControlError
    from armload_controller.cycle.plugins import CycleStep as CycleStep
    from armload_controller.export.exported_payload import ExportSubject as ExportSubject
    from armload_controller.feedforward.payload_feedforward import NOTHING as NOTHING
    from armload_controller.feedforward.payload_feedforward import PayloadFeedforward as PayloadFeedforward
    from armload_controller.fleet.many_recordings import fleet as fleet
    from armload_controller.fleet.many_recordings import fleet_report as fleet_report
    from armload_controller.session.commissioning_results import commission as commission
    from armload_controller.session.installed_plugins import PluginTable as PluginTable
    from armload_identification.estimation.prior_knowledge import KnownPayload as KnownPayload
    from armload_identification.files.calibration_file import read_calibration as read_calibration
    from armload_identification.files.payload_file import read_payload as read_payload
    from armload_identification.identification_errors import IdentificationError as IdentificationError
    from armload_identification.identification_errors import NothingMounted as NothingMounted
    from armload_identification.model.payload import InertialParameters as InertialParameters
    from armload_identification.pipeline.recursive_estimator import PayloadEstimator as PayloadEstimator
    from armload_identification.recording.recording import Recording as Recording
    from armload_identification.results.calibrated_arm import CalibratedArm as CalibratedArm
    from armload_identification.results.findings import Findings as Findings
    from armload_identification.storage.strict_toml import BadValue as BadValue
    from armload_identification.verdict.tolerance import Tolerance as Tolerance

    __version__: str
else:  # a type checker would accept any name

    def _homes():
        """Module of each public name, and its name in that module, from the imports above."""
        import ast

        imports = (
            node for node in ast.walk(ast.parse(__loader__.get_source(__name__))) if type(node) is ast.ImportFrom
        )
        return {
            name.asname: (node.module, name.name)
            for node in imports
            if node.module.startswith("armload_")
            for name in node.names
        }

    def __getattr__(name):
        """Load a name on its first use."""
        from importlib import import_module
        from importlib.metadata import version

        if name == "__version__":
            value = version("armload")
        elif name == "__all__":
            value = sorted(_HOMES)
        elif name in _HOMES:
            module, there = _HOMES[name]
            value = getattr(import_module(module), there)
        else:
            raise AttributeError(f"module 'armload' has no attribute {name!r}")
        globals()[name] = value
        return value

    def __dir__():
        """The public names, loaded or not."""
        return sorted({*globals(), *_HOMES, "__all__", "__version__"})

    _HOMES = _homes()
