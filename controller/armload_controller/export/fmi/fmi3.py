"""FMI 3.0, model exchange and co-simulation: an FMU with its sources and a Linux library; see `fmu`.

References:
    Modelica Association, Functional Mock-up Interface 3.0.2, sections 2.2 to 2.5 and 4: the C interface is written from
        it.
"""

from __future__ import annotations

import platform

from armload_controller.export.exported_payload import ExportSubject
from armload_controller.export.fmi.fmu import (
    documentation,
    element,
    model_description,
    model_name,
    packed,
    sources,
    variables,
)
from armload_controller.export.template import filled


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
        "sources/buildDescription.xml": filled("fmi/fmi3_build.xml", {"name": model_name(subject)}),
        **{f"sources/{file}": text for file, text in code.items()},
    }


def _model_description(subject: ExportSubject, token: str) -> str:
    """Variables, units and dependencies."""
    every = list(enumerate(variables(subject)))
    listed = [element("Float64", v.start_attribute | v.attributes(number) | {"unit": v.unit}) for number, v in every]
    outputs = [{"valueReference": str(number)} for number, variable in every if variable.causality == "output"]
    fields = {
        "variables": "\n".join(f"    {line}" for line in listed),
        "outputs": "\n".join(f"    {element('Output', output)}" for output in outputs),
        "unknowns": "\n".join(f"    {element('InitialUnknown', output)}" for output in outputs),
    }
    return model_description(subject, 3, token, fields)
