"""FMI 2.0, model exchange and co-simulation, for tools without FMI 3.0: the same FMU; see `fmu`.

References:
    Modelica Association, Functional Mock-up Interface for Model Exchange and Co-Simulation 2.0.4, sections 2 and 4: the
        C interface is written from it.
"""

from __future__ import annotations

import platform

from armload_controller.export.exported_payload import ExportSubject
from armload_controller.export.fmi.fmu import (
    documentation,
    element,
    model_description,
    packed,
    sources,
    variables,
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
    lines, outputs = [], []
    for reference, variable in enumerate(variables(subject)):
        real = element("Real", variable.start_attribute | {"unit": variable.unit})
        scalar = element("ScalarVariable", variable.attributes(reference)).removesuffix(" />")
        lines += [f"    {scalar}>", f"      {real}", "    </ScalarVariable>"]
        if variable.causality == "output":
            outputs.append(f"      {element('Unknown', {'index': str(reference + 1)})}")
    return model_description(subject, 2, token, {"variables": "\n".join(lines), "outputs": "\n".join(outputs)})
