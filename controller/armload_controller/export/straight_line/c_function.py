"""Expressions as the body of a C function: one constant per line, no loop, no branch, no allocation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from armload_controller.export.straight_line.expressions import Expression, Graph, Kind
from armload_controller.export.wording import exact


def c_statements(graph: Graph, inputs: Sequence[str], outputs: Mapping[str, Sequence[Expression]]) -> str:
    """Statements that compute outputs from the graph's inputs.

    Every output is written after every input was read, so that an output array may be one of the inputs.

    Args:
        graph: Where the outputs are.
        inputs: Arrays that the function is given; one that no output depends on is marked as unused.
        outputs: Elements by name of the array.
    """
    every = [element for elements in outputs.values() for element in elements]
    texts: dict[int, str] = {}
    lines: list[str] = []
    for number in graph.needed(every):
        node = graph.nodes[number]
        operands = [texts[operand] for operand in node.operands]
        match node.kind:
            case Kind.CONSTANT:
                texts[number] = exact(node.value)
                continue
            case Kind.INPUT:
                text = node.name
            case Kind.COSINE:
                text = f"cos({operands[0]})"
            case Kind.SINE:
                text = f"sin({operands[0]})"
            case Kind.SUM:
                text = f"{operands[0]} + {operands[1]}"
            case Kind.DIFFERENCE:
                text = f"{operands[0]} - {operands[1]}"
            case Kind.PRODUCT:
                text = f"{operands[0]} * {operands[1]}"
        texts[number] = f"t{len(lines)}"
        lines.append(f"    const double t{len(lines)} = {text};")
    unused = [f"    (void){name};" for name in inputs if not any(f" = {name}[" in line for line in lines)]
    lines = [*unused, *lines, ""]
    for name, elements in outputs.items():
        for i, element in enumerate(elements):
            value = exact(0.0) if element.is_zero else texts[element.number]
            lines.append(f"    {name}[{i}] = {'-' if not element.is_zero and element.sign < 0 else ''}{value};")
    return "\n".join(lines)
