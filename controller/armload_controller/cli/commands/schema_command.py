"""`armload schema`: what the documents of `--json` contain."""

from __future__ import annotations

from typing import Annotated

import typer


def schema(
    kind: Annotated[
        str | None,
        typer.Argument(metavar="[KIND]", help="Kind of document, such as payload (armload/payload/1); all by default."),
    ] = None,
) -> None:
    """Print the JSON Schema of the documents that commands print with --json."""
    import json

    from armload_identification.results.json_document import json_schemas

    schemas = json_schemas()
    if kind is not None and kind not in schemas:
        raise typer.BadParameter(f"{kind!r}: expected one of {', '.join(schemas)}", param_hint="KIND")
    typer.echo(json.dumps(schemas if kind is None else schemas[kind], indent=2, ensure_ascii=False))
