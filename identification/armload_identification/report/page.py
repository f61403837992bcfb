"""An HTML page: rendered from its template, and written to its file."""

from __future__ import annotations

from pathlib import Path

import jinja2

from armload_identification.identification_errors import ReportError
from armload_identification.storage.replace_file import replace_file


def rendered(template: str, **values: object) -> str:
    """A page from its template; undefined values are errors, and text is escaped.

    Args:
        template: The template's file, in this package.
        values: Values of the template's variables.
    """
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("armload_identification.report", "."),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template(template).render(values)


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
