"""Rooms whose numbers stand in one table: what the table states of each, and that no other module has numbers."""

import ast
import inspect
import re
from pathlib import Path

import pytest

from armload_identification.signals import signal_constants
from armload_identification.verdict import decision_levels

pytestmark = pytest.mark.pure

ENTRY = re.compile(
    r"\[(?P<unit>[^]]+)\] (?P<meaning>.+)\n\nOrigin: (?P<origin>.+)\nFactor of two: (?P<cost>.+)", re.DOTALL
)


def classes(module):
    return [node for node in module.body if isinstance(node, ast.ClassDef)]


def entries(table):
    """Name, value and docstring of every attribute of every class of a table."""
    for concern in classes(ast.parse(inspect.getsource(table))):
        following = [*concern.body[1:], None]
        for node, after in zip(concern.body, following, strict=True):
            if isinstance(node, ast.Assign | ast.AnnAssign):
                text = (
                    after.value.value if isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant) else ""
                )
                yield pytest.param(node, inspect.cleandoc(text), id=f"{concern.name}.{node.target.id}")


@pytest.mark.parametrize(("node", "text"), [*entries(signal_constants), *entries(decision_levels)])
def test_an_entry_states_unit_meaning_origin_and_cost(node, text):
    assert isinstance(node, ast.AnnAssign)
    assert ast.unparse(node.annotation) == "Final"
    found = ENTRY.fullmatch(text)
    assert found, text
    assert all(re.search(r"[.)]$", found[part].strip()) for part in ("meaning", "origin", "cost")), text


@pytest.mark.parametrize("table", [signal_constants, decision_levels], ids=["signals", "verdict"])
def test_no_other_module_of_the_room_assigns_a_number(table):
    tables = {node.name for node in classes(ast.parse(inspect.getsource(table)))}
    path = Path(table.__file__)
    found = []
    for file in sorted(path.parent.rglob("*.py")):
        for node in ast.parse(file.read_text(encoding="utf-8")).body if file != path else []:
            value = node.value if isinstance(node, ast.Assign | ast.AnnAssign) else None
            parts = list(ast.walk(value)) if value is not None else []
            number = any(isinstance(part, ast.Constant) and type(part.value) in (int, float) for part in parts)
            if number and not any(isinstance(part, ast.Name) and part.id in tables for part in parts):
                found.append(f"{file.name}:{node.lineno}")
    assert found == []


@pytest.mark.parametrize("table", [signal_constants, decision_levels], ids=["signals", "verdict"])
def test_a_table_imports_nothing_that_takes_time(table):
    imports = [
        node for node in ast.parse(inspect.getsource(table)).body if isinstance(node, ast.Import | ast.ImportFrom)
    ]
    assert {node.module for node in imports} == {"__future__", "typing"}
