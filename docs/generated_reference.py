"""Pages of the reference that are made from the code: commands, JSON documents, exit statuses, Python, modules."""

from __future__ import annotations

import ast
import inspect
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import typer

import armload
from armload_controller.cli.command_tree import app
from armload_identification.results.json_document import json_schemas


def write(folder: Path) -> None:
    """Write all pages into a folder; a page that has not changed is left alone."""
    folder.mkdir(exist_ok=True)
    for name, text in (("commands", _commands()), ("json", _json()), ("python", _python()), ("modules", _modules())):
        file = folder / f"{name}.md"
        if not file.exists() or file.read_text("utf-8") != text:
            file.write_text(text, "utf-8")


def _commands() -> str:
    """Every command with its arguments and options."""
    parts = ["# Commands\n\nWhat `armload COMMAND --help` says. [Exit statuses](../../controller/JSON.md).\n"]
    for words, command in _leaves(typer.main.get_command(app), ["armload"]):
        given = [each for each in command.params if each.param_type_name == "argument"]
        usage = " ".join([*words, "[OPTIONS]", *map(_metavar, given)])
        rows = [(_names(each), getattr(each, "help", "") or "") for each in command.params if each.name != "help"]
        parts += [
            f"## {' '.join(words)}\n",
            f"```console\n$ {usage}\n```\n",
            inspect.cleandoc(command.help or "") + "\n",
        ]
        parts.append(_table(("", ""), rows))
    return "\n".join(parts)


def _modules() -> str:
    """Every module with the first line of its docstring, room by room."""
    parts = ["# Modules\n\nWhat the first line of each file says, room by room.\n"]
    for package in ("controller", "drivers", "identification", "configs"):
        root = Path(__file__).parents[1] / package
        for folder in sorted({file.parent for file in root.rglob("*.py")}):
            said = [
                (f"`{file.name}`", (ast.get_docstring(ast.parse(file.read_text("utf-8"))) or "").split("\n")[0])
                for file in sorted(folder.glob("*.py"))
            ]
            parts += [f"## {folder.relative_to(root)}\n", _table(("module", ""), said)]
    return "\n".join(parts)


def _table(headings: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table of texts."""
    lines = [" | ".join(_cell(cell) for cell in row) for row in (headings, ["---"] * len(headings), *rows)]
    return "".join(f"| {line} |\n" for line in lines)


def _leaves(command: Any, words: list[str]) -> Iterator[tuple[list[str], Any]]:
    """The commands below a group."""
    inner = getattr(command, "commands", None)
    if inner is None:
        yield words, command
    for name, each in (inner or {}).items():
        yield from _leaves(each, [*words, name])


def _metavar(parameter: Any) -> str:
    """Placeholder of a value."""
    return str(parameter.metavar or parameter.name.upper().replace("_", "-"))


def _names(parameter: Any) -> str:
    """An option's names and placeholder, or an argument."""
    if parameter.param_type_name == "argument":
        return f"`{_metavar(parameter)}`"
    names = ", ".join(f"`{name}`" for name in (*parameter.opts, *parameter.secondary_opts))
    return names if parameter.is_flag else f"{names} `{_metavar(parameter)}`"


def _json() -> str:
    """Every document of `--json`, key by key."""
    parts = ["# JSON documents\n\nWhat `armload schema` says; common rules are in [JSON](../../controller/JSON.md).\n"]
    for schema in json_schemas().values():
        rows = [(f"`{key}`", kind, text) for key, kind, text in _keys(schema, "")]
        parts += [f"## {schema['title']}\n", schema["description"] + "\n", _table(("key", "type", ""), rows)]
    return "\n".join(parts)


def _keys(schema: dict[str, Any], at: str) -> Iterator[tuple[str, str, str]]:
    """Path, type and meaning of every described key."""
    kind = schema.get("type", "string")
    if at and ("description" in schema or not ("properties" in schema or "items" in schema)):
        yield at, kind if isinstance(kind, str) else " or ".join(kind), schema.get("description", "")
    for key, inner in schema.get("properties", {}).items():
        yield from _keys(inner, f"{at}.{key}" if at else key)
    if "items" in schema:
        yield from (row for row in _keys(schema["items"], f"{at}[]") if row[2] or "." in row[0][len(at) + 2 :])


def _cell(text: str) -> str:
    """Text within a cell of a table."""
    return " ".join(text.split()).replace("|", "\\|")


def _python() -> str:
    """Every public name, in the order of the front door's own list, then the others."""
    text = armload.__doc__ or ""
    order = sorted(armload.__all__, key=lambda name: (text.find(f"    {name}(") % (1 << 30), name))
    parts = ["# Python\n", "```{eval-rst}", ".. py:module:: armload\n"]
    for name in order:
        there = getattr(armload, name)
        kind = "autoclass" if inspect.isclass(there) else "autofunction" if callable(there) else "autodata"
        members = inspect.isclass(there) and not issubclass(there, Exception)
        parts += [f".. {kind}:: armload.{name}", "   :members:\n" if members else ""]
    return "\n".join([*parts, "```\n"])
