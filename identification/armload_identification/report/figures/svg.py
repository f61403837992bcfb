"""A Matplotlib figure as SVG inside a page: without addresses, dates and style rules."""

from __future__ import annotations

import io
import re
from typing import Final
from xml.etree import ElementTree

import matplotlib.style
from matplotlib.figure import Figure

from armload_identification.storage.control_characters import printable

_NAMESPACE: Final = re.compile(r"^\{[^}]*\}")
_NEEDLESS_DIGITS: Final = re.compile(r"(?<=\.\d\d)\d+")
"""Digits below a hundredth of a point: invisible, but a third of the page."""
_TEXT_STAYS_TEXT: Final = {"svg.fonttype": "none", "svg.hashsalt": "armload"}
"""Read by Matplotlib while it writes; outlines of letters would also lose their size to `_NEEDLESS_DIGITS`."""
_LEFT_OUT: Final = frozenset({"metadata", "style"})
_REFERRING: Final = frozenset({"href", "clip-path"})


def inline_svg(figure: Figure, name: str, title: str) -> str:
    """A figure as the text of an `svg` element that fills the available width.

    Args:
        name: Prefix of every id, unique on the page.
        title: Description of the figure, for readers who cannot see it.
    """
    written = io.BytesIO()
    with matplotlib.style.context(_TEXT_STAYS_TEXT):
        figure.savefig(written, format="svg", metadata={"Date": None})
    root = ElementTree.fromstring(printable(written.getvalue().decode()))
    _clean(root, name)
    for attribute in ("width", "height", "version"):
        root.attrib.pop(attribute, None)
    root.set("role", "img")
    root.set("aria-labelledby", f"{name}-title")
    label = ElementTree.Element("title", {"id": f"{name}-title"})
    label.text = printable(title)
    root.insert(0, label)
    return ElementTree.tostring(root, encoding="unicode")


def _clean(element: ElementTree.Element, name: str) -> None:
    """Make ids unique and remove name spaces, metadata, style rules and needless digits, recursively."""
    element.tag = _NAMESPACE.sub("", element.tag)
    attributes = {_NAMESPACE.sub("", key): value for key, value in element.items()}
    for key, value in attributes.items():
        if key == "id":
            attributes[key] = f"{name}-{value}"
        elif key in _REFERRING:
            attributes[key] = value.replace("#", f"#{name}-")
        elif key != "style":
            attributes[key] = _NEEDLESS_DIGITS.sub("", value)
    element.attrib.clear()
    element.attrib.update(attributes)
    for child in list(element):
        if _NAMESPACE.sub("", child.tag) in _LEFT_OUT:
            element.remove(child)
        else:
            _clean(child, name)
