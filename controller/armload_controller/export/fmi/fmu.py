"""FMI 3.0, model exchange and co-simulation: an FMU with its sources and a Linux library; see `fmu_parts`.

References:
    Modelica Association, Functional Mock-up Interface 3.0.2, sections 2.2 to 2.5 and 4: the C interface is written from
        it.
"""

from __future__ import annotations

import platform
from xml.etree import ElementTree

from armload_controller.export.exported_payload import ExportSubject
from armload_controller.export.fmi.fmu_parts import (
    documentation,
    log_and_experiment,
    model_name,
    packed,
    roots,
    sources,
    units,
    variables,
    xml_text,
)


def export_fmu(subject: ExportSubject) -> dict[str, bytes]:
    """The FMU `armload_<robot>.fmu`.

    Returns:
        The file by its name.

    Raises:
        ExportError: there is no C compiler.
    """
    return packed(subject, fmu_texts(subject), f"{platform.machine()}-linux")


def fmu_texts(subject: ExportSubject) -> dict[str, str]:
    """Everything inside the FMU except the library.

    Returns:
        Texts by path inside the FMU.
    """
    code, token = sources(subject, "fmi3.c")
    return {
        "modelDescription.xml": _model_description(subject, token),
        "documentation/index.html": documentation(subject),
        "sources/buildDescription.xml": _build_description(model_name(subject)),
        **{f"sources/{file}": text for file, text in code.items()},
    }


def _model_description(subject: ExportSubject, token: str) -> str:
    """Variables, units and dependencies."""
    root, _ = roots(
        subject, "3.0", {"instantiationToken": token}, "FMUState", {"needsCompletedIntegratorStep": "false"}
    )
    units(root)
    log_and_experiment(root)
    listed = ElementTree.SubElement(root, "ModelVariables")
    structure = ElementTree.SubElement(root, "ModelStructure")
    every = variables(subject)
    for reference, variable in enumerate(every):
        attributes = variable.start_attribute | variable.attributes(reference)
        ElementTree.SubElement(listed, "Float64", attributes, unit=variable.unit)
    for kind in ("Output", "InitialUnknown"):
        for reference, variable in enumerate(every):
            if variable.causality == "output":
                ElementTree.SubElement(structure, kind, valueReference=str(reference))
    return xml_text(root)


def _build_description(name: str) -> str:
    """How an importer compiles the sources if there is no library for its platform."""
    root = ElementTree.Element("fmiBuildDescription", fmiVersion="3.0")
    build = ElementTree.SubElement(root, "BuildConfiguration", modelIdentifier=name)
    files = ElementTree.SubElement(build, "SourceFileSet", language="C99", compilerOptions="-fvisibility=hidden")
    for file in ("fmi3.c", f"{name}.c"):
        ElementTree.SubElement(files, "SourceFile", name=file)
    ElementTree.SubElement(build, "Library", name="m", external="true")
    return xml_text(root)
