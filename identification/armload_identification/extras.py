"""Libraries that a plain installation does not include, and the extras that provide them.

A plain installation suffices for using a payload: robot and payload files, the bus, feed-forward, exports. The
libraries for identification and figures take two thirds of the space and are therefore extras; they are imported where
they are used, and checked for before any work is done.
"""

from __future__ import annotations

from enum import StrEnum
from importlib.util import find_spec
from typing import Final

from armload_identification.identification_errors import ExtraMissing


class Extra(StrEnum):
    """A set of libraries, by its name for pip."""

    IDENTIFY = "identify"
    REPORT = "report"
    FLEET = "fleet"
    ROS = "ros"
    PARQUET = "parquet"


_LIBRARIES: Final = {
    Extra.IDENTIFY: {"scipy": "SciPy"},
    Extra.REPORT: {"matplotlib": "Matplotlib", "jinja2": "Jinja"},
    Extra.FLEET: {"distributed": "Dask", "pyarrow": "PyArrow", "fsspec": "fsspec", "cryptography": "cryptography"},
    Extra.ROS: {"rosbags": "rosbags"},
    Extra.PARQUET: {"pyarrow": "PyArrow"},
}


def require_extra(extra: Extra, purpose: str) -> None:
    """Raise if an extra is not installed.

    Args:
        extra: The required extra.
        purpose: What requires it; the beginning of the message.

    Raises:
        ExtraMissing: one of its libraries is not installed.
    """
    missing = [name for module, name in _LIBRARIES[extra].items() if find_spec(module) is None]
    if missing:
        raise ExtraMissing(_sentence(purpose, " and ".join(missing), extra))


def missing_extra(error: ModuleNotFoundError) -> ExtraMissing | None:
    """The extra that would have prevented a failed import; None if there is none."""
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
