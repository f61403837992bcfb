"""An HTML page: rendered from its template, and written to its file."""

from __future__ import annotations

import re
from pathlib import Path

import jinja2
from markupsafe import Markup, escape

from armload_identification.identification_errors import ReportError
from armload_identification.storage.replace_file import replace_file

_IN_BACKTICKS = re.compile(r"`([^`\n]+)`")


def rendered(template: str, **values: object) -> str:
    """A page from its template; undefined values are errors, text is escaped, and `words` in backticks are set as code.

    Args:
        template: The template's file, in this package.
        values: Values of the template's variables.
    """
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("armload_identification.report", "."),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        finalize=_with_code,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template(template).render(values)


def _with_code(value: object) -> object:
    """Text with `words` in backticks as code; anything else unchanged."""
    if not isinstance(value, str) or isinstance(value, Markup) or "`" not in value:
        return value
    return Markup(_IN_BACKTICKS.sub(r"<code>\1</code>", str(escape(value))))


def write_page(path: Path, page: str) -> None:
    """Write a page.

    Args:
        path: The file; an existing one is replaced.
        page: Its text.

    Raises:
        ReportError: the file cannot be written.
    """
    try:
        replace_file(path, page)
    except OSError as problem:
        raise ReportError(
            f"{path}: the report cannot be written ({problem.strerror}). Choose a file in an existing, writable folder."
        ) from problem
