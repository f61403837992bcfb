"""The recursive estimator for one calibrated arm: straight-line regressor and link torques, with the core's update.

The update is the core's own source (`armload_core/source/estimator/`) in one file, with the arm's prefix in its names:
one source for Python and for controllers, and the tests compare both on the same samples.
"""

from __future__ import annotations

import re
from collections.abc import Collection
from importlib import resources
from importlib.resources.abc import Traversable
from typing import Final

from armload_controller.export.straight_line.arm_functions import link_torque_of, regressor_of
from armload_controller.export.straight_line.c_function import c_statements
from armload_controller.export.straight_line.precision import Precision
from armload_controller.export.template import filled
from armload_controller.export.text_format import exact
from armload_identification.model.body_model import BodyModel
from armload_identification.model.chain import Chain
from armload_identification.pipeline.estimator_constants import EstimatorConstants

_CONSTANTS: Final = r"\b(ESTIMATOR_\w*|FRICTION_STATES|SMOOTHED|WAITING|REMEMBERED_ROWS)"
_TYPES_AND_FUNCTIONS: Final = r"^\} (\w+);|\b(estimator_\w+)\("
"""Types and functions that the core's header declares."""
_REPLACED_HEADERS: Final = ("payload_estimator.h", "chain.h")
"""Headers that the export replaces with a header and constants of its own."""
_UNIT: Final = r"^#include .*\n|^#(?:ifndef|define) ARMLOAD_\w+_H\n|^#endif\n\Z"
"""Lines that make a file a unit of its own: its includes, and a header's guard."""
_SHARED: Final = r"^(?=\w+ \w+\()"
"""Where a function that is declared in a header of the core begins."""
_TITLE: Final = r"\A/\*.*?\*/\n+"


def estimator_texts(
    name: str, about: str, chain: Chain, body: BodyModel, constants: EstimatorConstants, effort: str
) -> dict[str, str]:
    """Header and source of `<name>_estimator`.

    Args:
        name: Prefix of every public name.
        about: Text of both files' first comment.
        chain: Kinematics, and gravity in the arm's base frame.
        body: Its links.
        constants: The estimator's other constants of the arm.
        effort: The effort that the drives report, with its unit.

    Returns:
        Texts by file name.
    """
    regressor, links = regressor_of(chain), link_torque_of(chain, body.links)
    header = _own_part("payload_estimator.h")
    names = {a or b for a, b in re.findall(_TYPES_AND_FUNCTIONS, header, re.MULTILINE)} - {"payload_estimator"}
    fields = {
        "name": name,
        "GUARD": name.upper(),
        "about": about,
        "effort": effort,
        "regressor": c_statements(regressor),
        "regressor_count": str(regressor.operations.total),
        "links": c_statements(links),
        "links_count": str(links.operations.total),
        "from_effort": Precision.DOUBLE.rows(constants.from_effort),
        "rotors": Precision.DOUBLE.rows(constants.rotors),
        "parameter": ",\n    ".join(f"{{{Precision.DOUBLE.listed(row)}}}" for row in constants.parameter),
        "scale": Precision.DOUBLE.rows(constants.scale.reshape(2, 5)),
        "memory_s": exact(constants.memory_s),
        "delay_s": exact(constants.delay_s),
        "declarations": _renamed(header, names, name),
        "update": _renamed(_update(), names, name),
    }
    return {
        f"{name}_estimator.h": filled("c_code/estimator.h", fields),
        f"{name}_estimator.c": filled("c_code/estimator.c", fields),
    }


def _core_file(name: str) -> Traversable:
    """A file of the core's estimator."""
    return resources.files("armload_core") / "source" / "estimator" / name


def _fragment(file: str) -> str:
    """A file of the core as a part of a longer one."""
    text = re.sub(_UNIT, "", _core_file(file).read_text(encoding="ascii"), flags=re.MULTILINE).strip()
    return re.sub(r"\n{3,}", "\n\n", text)


def _own_part(file: str) -> str:
    """A part without its first comment, which the export replaces."""
    return re.sub(_TITLE, "", _fragment(file), flags=re.DOTALL)


def _update() -> str:
    """The core's update in one file: headers, then functions, static where only the core's files share them."""
    headers = _headers_of("payload_estimator.c")
    sources = [source for header in headers if _core_file(source := header.replace(".h", ".c")).is_file()]
    shared = [re.sub(_SHARED, "static ", _fragment(file), flags=re.MULTILINE) for file in (*headers, *sources)]
    return "\n\n".join([*shared, _own_part("payload_estimator.c")])


def _headers_of(file: str) -> list[str]:
    """The headers that a file of the core includes, each once and after those that it includes itself."""
    found: list[str] = []
    for header in re.findall(r'^#include "(\w+\.h)"$', _core_file(file).read_text(encoding="ascii"), re.MULTILINE):
        if header not in _REPLACED_HEADERS:
            found += [*_headers_of(header), header]
    return list(dict.fromkeys(found))


def _renamed(text: str, names: Collection[str], name: str) -> str:
    """A text of the core with names of this arm."""
    text = re.sub(_CONSTANTS, rf"{name.upper()}_\1", text)
    text = re.sub(rf"\b({'|'.join(sorted(names))})\b", rf"{name}_\1", text)
    text = re.sub(r"\bpayload_estimator\b", f"{name}_estimator", text)
    return text.replace("MOST_JOINTS", f"{name.upper()}_JOINTS").replace(
        "BODY_PARAMETERS", f"{name.upper()}_PARAMETERS"
    )
