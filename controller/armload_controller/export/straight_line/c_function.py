"""A function's expressions as the body of a C function: one constant per line, no loop, no branch, no allocation."""

from __future__ import annotations

from armload_controller.export.straight_line.arm_functions import Function
from armload_controller.export.straight_line.expressions import NodeKind
from armload_controller.export.straight_line.precision import Precision


def c_statements(function: Function, precision: Precision = Precision.DOUBLE) -> str:
    """Statements that compute a function's outputs from its inputs.

    All inputs are read before the first output is written, so an output array may be one of the inputs. An input that
    no output depends on is marked as unused.

    Args:
        precision: Type of every number.
    """
    graph = function.graph
    texts: dict[int, str] = {}
    lines: list[str] = []
    for number in graph.needed(function.elements):
        node = graph.nodes[number]
        operands = [texts[operand] for operand in node.operands]
        match node.kind:
            case NodeKind.CONSTANT:
                texts[number] = precision.literal(node.value)
                continue
            case NodeKind.INPUT:
                text = node.name
            case NodeKind.COSINE | NodeKind.SINE:
                text = f"{node.kind.value}{precision.suffix}({operands[0]})"
            case _:
                text = f"{operands[0]} {node.kind.value} {operands[1]}"
        texts[number] = f"t{len(lines)}"
        lines.append(f"    const {precision} t{len(lines)} = {text};")
    unused = [f"    (void){name};" for name in function.inputs if not any(f" = {name}[" in line for line in lines)]
    lines = [*unused, *lines, ""]
    for name, elements in function.outputs.items():
        for i, element in enumerate(elements):
            value = precision.literal(0.0) if element.is_zero else texts[element.number]
            lines.append(f"    {name}[{i}] = {'-' if not element.is_zero and element.sign < 0 else ''}{value};")
    return "\n".join(lines)
