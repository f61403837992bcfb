"""What a plain installation leaves out, and the extra that brings it.

A plain installation has what puts a payload into a loop: robot and payload files, the bus, feed-forward, exports. What
identifies and draws takes two thirds of the space, so it comes with an extra; it is imported where it is used,
and asked for before any work is done.
"""

from __future__ import annotations

from enum import StrEnum
from importlib.util import find_spec
from typing import Final

from armload_identification.identification_errors import ExtraMissing


class Extra(StrEnum):
    """A set of libraries by the name that pip knows it by."""

    IDENTIFY = "identify"
    REPORT = "report"
    FLEET = "fleet"


_LIBRARIES: Final = {
    Extra.IDENTIFY: {"scipy": "SciPy"},
    Extra.REPORT: {"matplotlib": "Matplotlib", "jinja2": "Jinja"},
    Extra.FLEET: {"distributed": "Dask", "pyarrow": "PyArrow", "fsspec": "fsspec"},
}


def require_extra(extra: Extra, purpose: str) -> None:
    """Refuse to begin what an extra is missing for.

    Args:
        extra: What is needed.
        purpose: What needs it; the beginning of the message.

    Raises:
        ExtraMissing: one of its libraries is not installed.
    """
    missing = [name for module, name in _LIBRARIES[extra].items() if find_spec(module) is None]
    if missing:
        raise ExtraMissing(_sentence(purpose, " and ".join(missing), extra))


def missing_extra(error: ModuleNotFoundError) -> ExtraMissing | None:
    """What a failed import says of an extra; None where no extra would help."""
    root = (error.name or "").partition(".")[0]
    for extra, libraries in _LIBRARIES.items():
        if root in libraries:
            return ExtraMissing(_sentence("this", libraries[root], extra))
    return None


def _sentence(purpose: str, names: str, extra: Extra) -> str:
    return (
        f"{purpose} needs {names}, which a plain installation does not include. Install it: pip install "
        f"'armload[{extra}]'."
    )
