"""The parts shared by FMUs of every version of FMI: variables, units, sources, documentation, and a library.

    inputs q[i], dq[i], ddq[i] -> outputs tau[i]        i = 1 .. n; the joints from the base to the flange
    tunable parameters mass, com_x .. com_z, ixx .. iyz, transition; friction, for a calibrated arm

Co-simulation: the torque at the end of a step is that of the inputs at its beginning, one call of the exported C's
`compute`. Model exchange: the torque is that of the present inputs; there are no states and no event indicators. The
parameters are mass in kg, centre of mass in m in the flange frame, and inertia in kg m2 about the centre of mass as
tensor elements (ixy = -int xy dm) in the flange's axes. Values set before the simulation starts apply at once; values
changed while it runs are reached without a step after `transition`, or later if the torque would change too fast; in
model exchange they apply at once, at the event at which they are set.
Physically impossible values end the simulation with an error.

What is not determined: as in `c99`.
"""

from __future__ import annotations

import hashlib
import io
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass, replace
from html import escape
from xml.etree import ElementTree

from armload_controller.export.body_parameters import FRICTION, PARAMETERS, TRANSITION_S, body_values
from armload_controller.export.c99 import export_c
from armload_controller.export.c_code.c_template import filled
from armload_controller.export.compiled_library import compiled_library
from armload_controller.export.exported_payload import ExportSubject
from armload_controller.export.inertia import TENSOR, complete_inertia
from armload_controller.export.text_format import comment, exact, printable, provenance, spdx

UNITS = {
    "s": {"s": 1},
    "rad": {"rad": 1},
    "rad/s": {"rad": 1, "s": -1},
    "rad/s2": {"rad": 1, "s": -2},
    "N.m": {"kg": 1, "m": 2, "s": -2},
    "kg": {"kg": 1},
    "m": {"m": 1},
    "kg.m2": {"kg": 1, "m": 2},
    "1": {},
}
"""Exponents of the base units, by unit."""
_EPOCH = (1980, 1, 1, 0, 0, 0)
"""Date of every file inside, fixed so that the same payload gives the same bytes."""


@dataclass(frozen=True)
class FmuVariable:
    """A variable; its value reference is its index in the list of all variables.

    Attributes:
        name: Structured name.
        causality: As in the standard: independent, input, parameter or output.
        variability: continuous or tunable.
        unit: Name of its unit.
        description: Its meaning.
        start: Start value; None if it has none.
    """

    name: str
    causality: str
    variability: str
    unit: str
    description: str
    start: float | None = None

    @property
    def start_attribute(self) -> dict[str, str]:
        """Its start value as an XML attribute; empty if it has none."""
        return {} if self.start is None else {"start": exact(self.start)}

    def attributes(self, reference: int) -> dict[str, str]:
        """Its XML attributes in both versions of the standard, with its value reference."""
        names = ("description", "causality", "variability")
        return {"name": self.name, "valueReference": str(reference)} | {name: getattr(self, name) for name in names}


def model_name(subject: ExportSubject) -> str:
    """The model's name and identifier."""
    return f"armload_{subject.identifier}"


def roots(
    subject: ExportSubject, fmi_version: str, token: Mapping[str, str], state: str, no_step_needed: Mapping[str, str]
) -> tuple[ElementTree.Element, tuple[ElementTree.Element, ElementTree.Element]]:
    """The model description's root and its elements ModelExchange and CoSimulation.

    Args:
        subject: The payload and the arm.
        fmi_version: Version of the standard.
        token: The token of the sources, by the attribute's name in that version.
        state: The FMU's state as that version spells it in attributes' names.
        no_step_needed: That version's attribute for "completed integrator steps need not be reported".
    """
    name = model_name(subject)
    about = {
        "fmiVersion": fmi_version,
        "modelName": name,
        **token,
        "description": printable(f"Torque that the payload requires of the joints. {provenance(subject)}"),
        "generationTool": printable(f"armload {subject.armload_version}"),
        "variableNamingConvention": "structured",
    }
    root = ElementTree.Element("fmiModelDescription", about)
    able = {"modelIdentifier": name} | dict.fromkeys((f"canGetAndSet{state}", f"canSerialize{state}"), "true")
    exchange = ElementTree.SubElement(root, "ModelExchange", able | dict(no_step_needed))
    variable_step = {"canHandleVariableCommunicationStepSize": "true"}
    return root, (exchange, ElementTree.SubElement(root, "CoSimulation", able | variable_step))


def variables(subject: ExportSubject) -> list[FmuVariable]:
    """All variables in the order of `value` in the C code."""
    found = [FmuVariable("time", "independent", "continuous", "s", "simulated time")]
    motion = (("q", "rad", "position"), ("dq", "rad/s", "velocity"), ("ddq", "rad/s2", "acceleration"))
    for symbol, unit, what in motion:
        for i, joint in enumerate(subject.joint_names, 1):
            found.append(FmuVariable(f"{symbol}[{i}]", "input", "continuous", unit, f"{what} of {joint}", 0.0))
    body = zip(PARAMETERS, body_values(subject), strict=True)
    parameters = [(name, unit, f"payload: {text}", value) for (name, unit, text), value in body]
    text = "transition time of a change of the payload; longer if torque would change too fast"
    parameters.append(("transition", "s", text, TRANSITION_S))
    if subject.calibration is not None:
        parameters.append(("friction", "1", f"share of {FRICTION}", 1.0))
    found += [FmuVariable(name, "parameter", "tunable", unit, text, value) for name, unit, text, value in parameters]
    for i, joint in enumerate(subject.joint_names, 1):
        text = f"torque that the payload requires of {joint}"
        found.append(FmuVariable(f"tau[{i}]", "output", "continuous", "N.m", text))
    return [replace(variable, description=printable(variable.description)) for variable in found]


def sources(subject: ExportSubject, wrapper: str) -> tuple[dict[str, str], str]:
    """The C code, and the token that links it to its model description.

    Args:
        subject: The payload and the arm.
        wrapper: Name of the file with the functions of the standard.

    Returns:
        Texts by file name, and the token.
    """
    name = model_name(subject)
    code = {file: text for file, text in export_c(subject).items() if file in {f"{name}.c", f"{name}.h"}}
    start = [variable.start for variable in variables(subject) if variable.causality == "parameter"]
    values = ",\n".join(f"    {exact(value)}" for value in start if value is not None)
    token = hashlib.sha256("".join((*code.values(), values)).encode()).hexdigest()
    about = [spdx(subject, " *")]
    about += comment(
        [provenance(subject), "An FMU for model exchange and co-simulation; see modelDescription.xml."], " *"
    )
    fields = {
        "name": name,
        "GUARD": name.upper(),
        "about": "\n".join(about).replace("*/", "* /"),
        "token": token,
        "start": values,
        "theta_of": filled("theta_of.c", {}),
    }
    return {wrapper: filled(wrapper, {**fields, "core": filled("fmu_core.c", fields)}), **code}, token


def units(parent: ElementTree.Element) -> None:
    """The definitions of all units."""
    definitions = ElementTree.SubElement(parent, "UnitDefinitions")
    for unit, exponents in UNITS.items():
        ElementTree.SubElement(
            ElementTree.SubElement(definitions, "Unit", name=unit),
            "BaseUnit",
            {base: str(exponent) for base, exponent in exponents.items()},
        )


def log_and_experiment(parent: ElementTree.Element) -> None:
    """The category of messages, and the default simulation settings of the FMU."""
    categories = ElementTree.SubElement(parent, "LogCategories")
    ElementTree.SubElement(categories, "Category", name="logStatusError", description="reason why a call was refused")
    ElementTree.SubElement(parent, "DefaultExperiment", startTime="0", stopTime="1", stepSize="0.001")


def documentation(subject: ExportSubject) -> str:
    """A page with information beyond the variables' descriptions."""
    paragraphs = (
        provenance(subject),
        f"The robot's file: sha256 {subject.robot_sha256}.",
        complete_inertia(subject.payload, TENSOR).statement,
        "Torque that the payload requires of the joints, gravity included: the joint torque needed in addition to that "
        "of the empty arm. Positions, velocities, accelerations and torques are the joints', with the zeros "
        "and directions of the robot's configuration; gear ratios and motor coupling are not included.",
        f"Gravity in the base frame: {', '.join(exact(g) for g in subject.chain.gravity_m_s2)} m/s2.",
        "Payload parameters set before the simulation starts apply at once. In co-simulation tau at the end of a step "
        "corresponds to the inputs at its beginning; parameters that are changed while it runs are reached smoothly "
        "after the time transition. The step size may vary; during a change, all steps are assumed to be as long as "
        "the first. In model exchange tau corresponds to the present inputs, and changed parameters apply at the event "
        "at which they are set.",
    )
    head = f'<head><meta charset="utf-8"><title>{model_name(subject)}</title></head>'
    lines = [f"<p>{escape(printable(paragraph))}</p>" for paragraph in paragraphs]
    page = ("<!DOCTYPE html>", '<html lang="en">', head, "<body>", *lines, "</body>", "</html>")
    return "\n".join(page) + "\n"


def xml_text(root: ElementTree.Element) -> str:
    """A document."""
    ElementTree.indent(root)
    text = ElementTree.tostring(root, encoding="us-ascii").decode("ascii")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{text}\n'


def packed(subject: ExportSubject, texts: Mapping[str, str], platform: str) -> dict[str, bytes]:
    """The FMU with its library, by its file name.

    Args:
        subject: The payload and the arm.
        texts: Texts by path inside the FMU.
        platform: The library's folder under `binaries`.

    Raises:
        ExportError: there is no C compiler.
    """
    name = model_name(subject)
    code = {file.removeprefix("sources/"): text for file, text in texts.items() if file.endswith((".c", ".h"))}
    contents = {file: text.encode("ascii") for file, text in texts.items()}
    contents[f"binaries/{platform}/{name}.so"] = compiled_library(code, f"{name}.fmu")
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        for path, content in contents.items():
            archive.writestr(zipfile.ZipInfo(path, _EPOCH), content, zipfile.ZIP_DEFLATED)
    return {f"{name}.fmu": file.getvalue()}
