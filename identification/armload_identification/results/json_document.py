"""Documents of results: plain numbers, texts, lists and dictionaries, each described in `json_schemas.json`.

Keys contain their units. A number that is not determined, not measured or not finite is None.
"""

from __future__ import annotations

import json
from importlib.metadata import version
from importlib.resources import files
from typing import Any


def json_document(kind: str, fields: dict[str, Any]) -> dict[str, Any]:
    """A document of the schema `armload/KIND/1`.

    Args:
        kind: Its key in `json_schemas.json`.
        fields: Its content.
    """
    return {"schema": f"armload/{kind}/1", "armload_version": version("armload"), **fields}


def event_schema() -> dict[str, Any]:
    """JSON Schema of an event of a watched arm, as in `events` of a watch."""
    items: dict[str, Any] = json_schemas()["watch"]["properties"]["events"]["items"]
    return items


def json_schemas() -> dict[str, dict[str, Any]]:
    """JSON Schema of every document, by kind."""
    text = files("armload_identification.results").joinpath("json_schemas.json").read_text("utf-8")
    schemas: dict[str, dict[str, Any]] = json.loads(text)
    return {
        kind: {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema} for kind, schema in schemas.items()
    }
