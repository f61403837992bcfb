"""FMI 3.0 co-simulation: the payload's torque as an FMU, sources and a Linux library inside.

    inputs q[i], dq[i], ddq[i] -> outputs tau[i]        i = 1 .. n; the joints from the base to the flange
    tunable parameters mass, com_x .. com_z, ixx .. iyz, transition; friction, of a calibrated arm

The torque at the end of a step is that of the inputs at its beginning, one call of the exported C's `compute`. The
parameters are mass in kg, centre of mass in m in the flange frame, and inertia in kg m2 about the centre of mass as
tensor elements (ixy = -int xy dm) in the flange's axes. Set before the simulation begins they hold at once; changed
while it runs they are reached after `transition`, or later where the change of torque would be too fast, without a
step. Numbers that no body can have end the simulation with an error.

What is not determined: as in `c99`.

References:
    Modelica Association, Functional Mock-up Interface 3.0.2, sections 2.2 to 2.5 and 4: the C interface is written from
        it.
"""

from __future__ import annotations

import hashlib
import io
import platform
import zipfile
from html import escape
from itertools import count
from xml.etree import ElementTree

from armload_controller.export.body_parameters import FRICTION, PARAMETERS, TRANSITION_S, body_values
from armload_controller.export.c99 import export_c
from armload_controller.export.c_code.c_template import filled
from armload_controller.export.compiled_library import compiled_library
from armload_controller.export.inertia import TENSOR, complete_inertia
from armload_controller.export.subject import ExportSubject
from armload_controller.export.wording import comment, exact, printable, provenance

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
"""Exponents of the base units."""
_EPOCH = (1980, 1, 1, 0, 0, 0)
"""Date of every file inside: the same payload gives the same bytes."""


def export_fmu(subject: ExportSubject) -> dict[str, bytes]:
    """The FMU `armload_<robot>.fmu`.

    Args:
        subject: The payload and the arm.

    Returns:
        The file by its name.

    Raises:
        ExportError: there is no C compiler.
    """
    name = _name(subject)
    texts = fmu_texts(subject)
    sources = {file.removeprefix("sources/"): text for file, text in texts.items() if file.endswith((".c", ".h"))}
    library = compiled_library(sources, f"{name}.fmu")
    contents = {file: text.encode("ascii") for file, text in texts.items()}
    contents[f"binaries/{platform.machine()}-linux/{name}.so"] = library
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        for file, content in contents.items():
            archive.writestr(zipfile.ZipInfo(file, _EPOCH), content, zipfile.ZIP_DEFLATED)
    return {f"{name}.fmu": packed.getvalue()}


def fmu_texts(subject: ExportSubject) -> dict[str, str]:
    """What is inside, but for the library.

    Args:
        subject: The payload and the arm.

    Returns:
        Texts by path inside the FMU.
    """
    name = _name(subject)
    code = {file: text for file, text in export_c(subject).items() if file in {f"{name}.c", f"{name}.h"}}
    body = body_values(subject)
    friction = () if subject.calibration is None else (1.0,)
    token = hashlib.sha256("".join((*code.values(), *map(exact, body))).encode()).hexdigest()
    about = comment([provenance(subject), "FMI 3.0 co-simulation; see modelDescription.xml."], " *")
    wrapper = filled(
        "fmi3.c",
        {
            "name": name,
            "GUARD": name.upper(),
            "about": "\n".join(about).replace("*/", "* /"),
            "token": token,
            "start": ",\n".join(f"    {exact(value)}" for value in (*body, TRANSITION_S, *friction)),
            "theta_of": filled("theta_of.c", {}),
        },
    )
    return {
        "modelDescription.xml": _model_description(subject, token, body),
        "documentation/index.html": _documentation(subject),
        "sources/buildDescription.xml": _build_description(name),
        "sources/fmi3.c": wrapper,
        **{f"sources/{file}": text for file, text in code.items()},
    }


def _name(subject: ExportSubject) -> str:
    """The model's name and identifier."""
    return f"armload_{subject.identifier}"


def _model_description(subject: ExportSubject, token: str, body: tuple[float, ...]) -> str:
    """Variables, units, and what depends on what; the order of the variables is that of `value` in the C code."""
    name = _name(subject)
    root = ElementTree.Element(
        "fmiModelDescription",
        fmiVersion="3.0",
        modelName=name,
        instantiationToken=token,
        description=printable(f"Torque that the payload requires of the joints. {provenance(subject)}"),
        generationTool=printable(f"armload {subject.armload_version}"),
        variableNamingConvention="structured",
    )
    ElementTree.SubElement(
        root,
        "CoSimulation",
        modelIdentifier=name,
        canGetAndSetFMUState="true",
        canSerializeFMUState="true",
        canHandleVariableCommunicationStepSize="true",
    )
    units = ElementTree.SubElement(root, "UnitDefinitions")
    for unit, exponents in UNITS.items():
        ElementTree.SubElement(
            ElementTree.SubElement(units, "Unit", name=unit),
            "BaseUnit",
            {base: str(exponent) for base, exponent in exponents.items()},
        )
    categories = ElementTree.SubElement(root, "LogCategories")
    ElementTree.SubElement(categories, "Category", name="logStatusError", description="why a call was refused")
    ElementTree.SubElement(root, "DefaultExperiment", startTime="0", stopTime="1", stepSize="0.001")
    variables = ElementTree.SubElement(root, "ModelVariables")
    references = count()

    def add(variable: str, causality: str, variability: str, unit: str, text: str, start: str | None) -> str:
        reference = str(next(references))
        attributes = {"name": variable, "valueReference": reference, "description": printable(text)}
        attributes |= {"causality": causality, "variability": variability, "unit": unit}
        ElementTree.SubElement(variables, "Float64", attributes | ({} if start is None else {"start": start}))
        return reference

    add("time", "independent", "continuous", "s", "simulated time", None)
    motion = (("q", "rad", "position"), ("dq", "rad/s", "velocity"), ("ddq", "rad/s2", "acceleration"))
    for symbol, unit, what in motion:
        for i, joint in enumerate(subject.joint_names, 1):
            add(f"{symbol}[{i}]", "input", "continuous", unit, f"{what} of {joint}", "0.0")
    for (parameter, unit, text), value in zip(PARAMETERS, body, strict=True):
        add(parameter, "parameter", "tunable", unit, f"payload: {text}", exact(value))
    text = "time that a change of the payload takes; longer where torque would change too fast"
    add("transition", "parameter", "tunable", "s", text, exact(TRANSITION_S))
    if subject.calibration is not None:
        add("friction", "parameter", "tunable", "1", f"share of {FRICTION}", "1.0")
    outputs = [
        add(f"tau[{i}]", "output", "continuous", "N.m", f"torque that {joint} must give for the payload", None)
        for i, joint in enumerate(subject.joint_names, 1)
    ]
    structure = ElementTree.SubElement(root, "ModelStructure")
    for kind in ("Output", "InitialUnknown"):
        for reference in outputs:
            ElementTree.SubElement(structure, kind, valueReference=reference)
    return _xml(root)


def _build_description(name: str) -> str:
    """What an importer compiles where it has no library for its platform."""
    root = ElementTree.Element("fmiBuildDescription", fmiVersion="3.0")
    build = ElementTree.SubElement(root, "BuildConfiguration", modelIdentifier=name)
    files = ElementTree.SubElement(build, "SourceFileSet", language="C99", compilerOptions="-fvisibility=hidden")
    for file in ("fmi3.c", f"{name}.c"):
        ElementTree.SubElement(files, "SourceFile", name=file)
    ElementTree.SubElement(build, "Library", name="m", external="true")
    return _xml(root)


def _documentation(subject: ExportSubject) -> str:
    """A page with what is not in the variables' descriptions."""
    paragraphs = (
        provenance(subject),
        f"The robot's file: sha256 {subject.robot_sha256}.",
        complete_inertia(subject.payload, TENSOR).statement,
        "Torque that the payload requires of the joints, gravity included: what the joints must give for it on top of "
        "what the empty arm needs. Positions, velocities, accelerations and torques are the joints', with the zeros "
        "and directions of the robot's configuration; gear ratios and coupled motors are not in it.",
        f"Gravity in the base frame: {', '.join(exact(g) for g in subject.chain.gravity_m_s2)} m/s2.",
        "tau at the end of a step is that of the inputs at its beginning. The payload's parameters hold at once where "
        "they are set before the simulation begins, and are reached without a step after the time transition where "
        "they are changed while it runs. Steps may vary; a change takes all of its steps to be as long as the first.",
    )
    head = f'<head><meta charset="utf-8"><title>{_name(subject)}</title></head>'
    lines = [f"<p>{escape(printable(paragraph))}</p>" for paragraph in paragraphs]
    page = ("<!DOCTYPE html>", '<html lang="en">', head, "<body>", *lines, "</body>", "</html>")
    return "\n".join(page) + "\n"


def _xml(root: ElementTree.Element) -> str:
    """A document."""
    ElementTree.indent(root)
    text = ElementTree.tostring(root, encoding="us-ascii").decode("ascii")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{text}\n'
