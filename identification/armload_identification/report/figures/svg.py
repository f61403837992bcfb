"""A Matplotlib figure as SVG inside a page: without addresses, dates and style rules."""

from __future__ import annotations

import io
import re
from typing import Final

import matplotlib.style
from markupsafe import escape
from matplotlib.figure import Figure

from armload_identification.storage.control_characters import printable

_TAG: Final = re.compile(r"<[^>]*>")
_ATTRIBUTE: Final = re.compile(r' (?:\w+:)?([\w-]+)="([^"]*)"')
_NEEDLESS_DIGITS: Final = re.compile(r"(?<=\.\d\d)\d+")
"""Digits below a hundredth of a point: invisible, but a third of the page."""
_TEXT_STAYS_TEXT: Final = {"svg.fonttype": "none", "svg.hashsalt": "armload"}
"""Read by Matplotlib while it writes; outlines of letters would also lose their size to `_NEEDLESS_DIGITS`."""
_LEFT_OUT: Final = re.compile(r"<metadata>.*?</metadata>|<style[^>]*>.*?</style>|<!--.*?-->", re.DOTALL)
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

    def attribute(found: re.Match[str]) -> str:
        """With a unique id, without name space and needless digits."""
        key, value = found.groups()
        if key == "id":
            value = f"{name}-{value}"
        elif key in _REFERRING:
            value = value.replace("#", f"#{name}-")
        elif key != "style":
            value = _NEEDLESS_DIGITS.sub("", value)
        return f' {key}="{value}"'

    root, _, content = printable(written.getvalue().decode()).partition("<svg ")[2].partition(">")
    content = _TAG.sub(lambda tag: _ATTRIBUTE.sub(attribute, tag[0]), _LEFT_OUT.sub("", content))
    view = dict(_ATTRIBUTE.findall(f" {root}"))["viewBox"]
    label = f'<title id="{name}-title">{escape(printable(title))}</title>'
    return f'<svg viewBox="{view}" role="img" aria-labelledby="{name}-title">{label}{content}'
