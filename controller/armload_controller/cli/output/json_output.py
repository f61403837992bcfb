"""`--json`: one document on one line, as the only text on standard output; everything else goes to standard error.

`controller/JSON.md` describes the documents.
"""

from __future__ import annotations

import json
from importlib.metadata import version
from typing import Annotated, Any

import typer

from armload_controller.cli.printable_text import as_options, printable

JsonOption = Annotated[
    bool,
    typer.Option("--json", help="Print the result as JSON (controller/JSON.md), everything else to standard error."),
]


def json_document(kind: str, fields: dict[str, Any]) -> dict[str, Any]:
    """A document of the schema `armload/KIND/1`."""
    return {"schema": f"armload/{kind}/1", "armload_version": version("armload"), **fields}


def print_document(document: dict[str, Any]) -> None:
    """Print a document that contains only JSON's own types and finite numbers."""
    typer.echo(printable(as_options(json.dumps(document, allow_nan=False, ensure_ascii=False))))
