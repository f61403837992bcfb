"""An HTML page: rendered from its template, and written to its file."""

from __future__ import annotations

import json
import re
from functools import cache
from importlib.metadata import version
from pathlib import Path

import jinja2
from markupsafe import Markup, escape

from armload_identification.numerals import MINUS, NO_BREAK, counted, numeral, scientific
from armload_identification.report.figures.figure_file import write_drawn
from armload_identification.storage.control_characters import printable

_IN_BACKTICKS = re.compile(r"`([^`\n]+)`")
_NEGATIVE = re.compile(r"(?<![\w.+/-])-(?=\d)")
_PERCENT = re.compile(r"(?<=\d) %")


def rendered(template: str, package: str = __package__, **values: object) -> str:
    """A page from its template; undefined values are errors, text is escaped and typeset, with `words` as code.

    Args:
        template: The template's file.
        package: The package that it is in; what it includes may also be in this one.
        values: Values of the template's variables; it may call functions for numbers, and `json.loads`, too.
    """
    return _environment(package).get_template(template).render(values)


@cache
def _environment(package: str) -> jinja2.Environment:
    """What all templates of a package have in common."""
    environment = jinja2.Environment(
        loader=jinja2.ChoiceLoader([jinja2.PackageLoader(each, ".") for each in (package, __package__)]),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        finalize=_typeset,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.globals |= {"counted": counted, "loads": json.loads, "numeral": numeral, "scientific": scientific}
    environment.globals["armload_version"] = version("armload")
    return environment


def _typeset(value: object) -> object:
    """Text with the signs of a printed page, and `words` in backticks as code; anything else unchanged."""
    if not isinstance(value, str) or isinstance(value, Markup):
        return value
    parts = _IN_BACKTICKS.split(printable(value))  # every second one is code
    parts[::2] = (_PERCENT.sub(f"{NO_BREAK}%", _NEGATIVE.sub(MINUS, part.replace("+-", "±"))) for part in parts[::2])
    return Markup("").join(
        escape(part) if k % 2 == 0 else Markup("<code>{}</code>").format(part) for k, part in enumerate(parts)
    )


def write_page(path: Path, page: str) -> None:
    """Write a page.

    Args:
        path: The file; an earlier report is replaced, no other file.
        page: Its text.

    Raises:
        ReportError: the file cannot be written, or is another one.
    """
    write_drawn(path, page, "report")
