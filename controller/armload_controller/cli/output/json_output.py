"""`--json`: one document on one line, as the only text on standard output; everything else goes to standard error.

`armload schema` describes the documents.
"""

from __future__ import annotations

import json
from typing import Annotated, Any

import typer

from armload_controller.cli.argument_names import as_options
from armload_identification.storage.control_characters import printable

JsonOption = Annotated[
    bool,
    typer.Option("--json", help="Print the result as JSON (see `armload schema`), everything else to standard error."),
]


def print_document(document: dict[str, Any]) -> None:
    """Print a document that contains only JSON's own types and finite numbers."""
    typer.echo(printable(as_options(json.dumps(document, allow_nan=False, ensure_ascii=False))))
