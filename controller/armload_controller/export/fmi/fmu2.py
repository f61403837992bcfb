"""FMI 2.0, model exchange and co-simulation, for tools without FMI 3.0: the same FMU; see `fmu_parts`.

References:
    Modelica Association, Functional Mock-up Interface for Model Exchange and Co-Simulation 2.0.4, sections 2 and 4: the
        C interface is written from it.
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


def export_fmu2(subject: ExportSubject) -> dict[str, bytes]:
    """The FMU `armload_<robot>.fmu`.

    Returns:
        The file by its name.

    Raises:
        ExportError: there is no C compiler.
    """
    machine = platform.machine()
    return packed(subject, fmu2_texts(subject), "linux64" if machine == "x86_64" else f"{machine}-linux")


def fmu2_texts(subject: ExportSubject) -> dict[str, str]:
    """Everything inside the FMU except the library.

    Returns:
        Texts by path inside the FMU.
    """
    code, token = sources(subject, "fmi2.c")
    return {
        "modelDescription.xml": _model_description(subject, token),
        "documentation/index.html": documentation(subject),
        **{f"sources/{file}": text for file, text in code.items()},
    }


def _model_description(subject: ExportSubject, token: str) -> str:
    """Variables, units and dependencies."""
    not_needed = {"completedIntegratorStepNotNeeded": "true"}
    root, kinds = roots(subject, "2.0", {"guid": token}, "FMUstate", not_needed)
    for kind in kinds:
        files = ElementTree.SubElement(kind, "SourceFiles")
        for file in ("fmi2.c", f"{model_name(subject)}.c"):
            ElementTree.SubElement(files, "File", name=file)
    units(root)
    log_and_experiment(root)
    listed = ElementTree.SubElement(root, "ModelVariables")
    structure = ElementTree.SubElement(root, "ModelStructure")
    unknown = [ElementTree.SubElement(structure, kind) for kind in ("Outputs", "InitialUnknowns")]
    for reference, variable in enumerate(variables(subject)):
        scalar = ElementTree.SubElement(listed, "ScalarVariable", variable.attributes(reference))
        ElementTree.SubElement(scalar, "Real", variable.start_attribute, unit=variable.unit)
        if variable.causality == "output":
            for parent in unknown:
                ElementTree.SubElement(parent, "Unknown", index=str(reference + 1))
    return xml_text(root)
