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

from armload_controller.export.body_parameters import FRICTION, PARAMETERS, TRANSITION_S
from armload_controller.export.c99 import export_c
from armload_controller.export.compiled_library import compiled_library
from armload_controller.export.exported_payload import ExportSubject
from armload_controller.export.inertia import TENSOR, complete_inertia
from armload_controller.export.template import filled
from armload_controller.export.text_format import ascii_line, c_heading, exact, provenance

_EPOCH = (1980, 1, 1, 0, 0, 0)
"""Date of every file inside, fixed so that the same payload gives the same bytes."""


@dataclass(frozen=True)
class FmuVariable:
    """A variable; its value reference is its index in the list of all variables.

    Attributes:
        name: Structured name.
        causality: As in the standard: independent, input, parameter or output.
        unit: Name of its unit.
        description: Its meaning.
        start: Start value; None if it has none.
    """

    name: str
    causality: str
    unit: str
    description: str
    start: float | None = None

    @property
    def start_attribute(self) -> dict[str, str]:
        """Its start value as an XML attribute; empty if it has none."""
        return {} if self.start is None else {"start": exact(self.start)}

    def attributes(self, reference: int) -> dict[str, str]:
        """Its XML attributes in both versions of the standard, with its value reference."""
        about = {"description": self.description, "causality": self.causality}
        variability = "tunable" if self.causality == "parameter" else "continuous"
        return {"name": self.name, "valueReference": str(reference)} | about | {"variability": variability}


def model_name(subject: ExportSubject) -> str:
    """The model's name and identifier."""
    return f"armload_{subject.identifier}"


def model_description(subject: ExportSubject, version: int, token: str, fields: Mapping[str, str]) -> str:
    """The model description, from the template of a version of the standard.

    Args:
        subject: The payload and the arm.
        version: 2 or 3.
        token: The token of the sources.
        fields: XML of the variables and of what depends on them, by name.
    """
    about = {
        "name": model_name(subject),
        "token": token,
        "description": _attribute(f"Torque that the payload requires of the joints. {provenance(subject)}"),
        "tool": _attribute(f"armload {subject.armload_version}"),
        "units_and_log": filled("fmi/units_and_log.xml", {}).rstrip("\n"),
    }
    return filled(f"fmi/fmi{version}_model.xml", about | dict(fields))


def element(tag: str, attributes: Mapping[str, str]) -> str:
    """An XML element without content."""
    given = "".join(f' {name}="{_attribute(text)}"' for name, text in attributes.items())
    return f"<{tag}{given} />"


def _attribute(text: str) -> str:
    """A text for the value of an XML attribute."""
    return escape(ascii_line(text), quote=False).replace('"', "&quot;")


def variables(subject: ExportSubject) -> list[FmuVariable]:
    """All variables in the order of `value` in the C code."""
    found = [FmuVariable("time", "independent", "s", "simulated time")]
    motion = (("q", "rad", "position"), ("dq", "rad/s", "velocity"), ("ddq", "rad/s2", "acceleration"))
    for symbol, unit, what in motion:
        for i, joint in enumerate(subject.joint_names, 1):
            found.append(FmuVariable(f"{symbol}[{i}]", "input", unit, f"{what} of {joint}", 0.0))
    body = zip(PARAMETERS, subject.payload.values, strict=True)
    parameters = [(name, unit, f"payload: {text}", value) for (name, unit, text), value in body]
    text = "transition time of a change of the payload; longer if torque would change too fast"
    parameters.append(("transition", "s", text, TRANSITION_S))
    if subject.calibration is not None:
        parameters.append(("friction", "1", f"share of {FRICTION}", 1.0))
    found += [FmuVariable(name, "parameter", unit, text, value) for name, unit, text, value in parameters]
    for i, joint in enumerate(subject.joint_names, 1):
        text = f"torque that the payload requires of {joint}"
        found.append(FmuVariable(f"tau[{i}]", "output", "N.m", text))
    return [replace(variable, description=ascii_line(variable.description)) for variable in found]


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
    about = [provenance(subject), "An FMU for model exchange and co-simulation; see modelDescription.xml."]
    fields = {
        "name": name,
        "GUARD": name.upper(),
        "about": c_heading(subject, about),
        "token": token,
        "start": values,
        "theta_of": filled("c_code/theta_of.c", {}),
    }
    return {
        wrapper: filled(f"c_code/{wrapper}", {**fields, "core": filled("c_code/fmu_core.c", fields)}),
        **code,
    }, token


def documentation(subject: ExportSubject) -> str:
    """A page with information beyond the variables' descriptions."""
    fields = {
        "name": model_name(subject),
        "provenance": escape(ascii_line(provenance(subject))),
        "robot_sha256": subject.robot_sha256,
        "inertia": escape(complete_inertia(subject.payload, TENSOR).statement),
        "gravity": ", ".join(exact(g) for g in subject.chain.gravity_m_s2),
    }
    return filled("fmi/documentation.html", fields)


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
