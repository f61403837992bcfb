"""`--json`: one document on a line of its own, alone on the standard output; everything else goes to standard error.

`controller/JSON.md` describes the documents.
"""

from __future__ import annotations

import json
from typing import Annotated, Any

import typer

from armload_controller.cli.printable_text import printable

JsonOption = Annotated[
    bool,
    typer.Option("--json", help="Print the result as JSON (controller/JSON.md), everything else to standard error."),
]


def print_document(document: dict[str, Any]) -> None:
    """Print a document that has nothing but JSON's own types, and no number that JSON cannot write."""
    typer.echo(printable(json.dumps(document, allow_nan=False, ensure_ascii=False)))
