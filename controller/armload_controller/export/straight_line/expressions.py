"""Arithmetic as a graph: constants folded, equal expressions shared, signs without cost.

Every expression is a node and a sign. Nodes are interned, so an expression that occurs twice is computed once, and
a - b and b - a are one node. Only nodes that an output needs are counted or written.

Simplification rules:

    0 x = 0,  1 x = x,  c (d x) = (c d) x,  x + 0 = x,  c x + d x = (c + d) x,  (-x) (-y) = x y,  x + (-y) = x - y
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from armload_identification.float_array import FloatArray


class NodeKind(Enum):
    """Kind of a node; that of an operation is its function or operator in C."""

    CONSTANT = "constant"
    INPUT = "input"
    COSINE = "cos"
    SINE = "sin"
    SUM = "+"
    DIFFERENCE = "-"
    PRODUCT = "*"


@dataclass(frozen=True)
class Node:
    """One value.

    Attributes:
        operands: Numbers of its operand nodes.
        value: Value of a constant, greater than zero.
        name: Name of an input in C.
    """

    kind: NodeKind
    operands: tuple[int, ...] = ()
    value: float = 0.0
    name: str = ""


@dataclass(frozen=True)
class Operations:
    """Operation count of some outputs.

    Attributes:
        multiplications: Products.
        additions: Sums and differences.
        trigonometric: Sines and cosines.
    """

    multiplications: int
    additions: int
    trigonometric: int

    @property
    def total(self) -> int:
        """Multiplications and additions."""
        return self.multiplications + self.additions


class Graph:
    """All nodes of one function."""

    def __init__(self) -> None:
        self.nodes: list[Node] = []
        self._numbers: dict[Node, int] = {}

    def constant(self, value: float) -> Expression:
        """A number."""
        if value == 0.0:
            return Expression(self, -1, 1)
        return Expression(self, self._number(Node(NodeKind.CONSTANT, value=abs(value))), 1 if value > 0.0 else -1)

    def constants(self, values: FloatArray) -> Vector:
        """Numbers as an array of the same shape."""
        return np.asarray(np.vectorize(self.constant, otypes=[object])(values))

    def input(self, name: str) -> Expression:
        """An input variable, by its text in C."""
        return Expression(self, self._number(Node(NodeKind.INPUT, name=name)), 1)

    def inputs(self, name: str, count: int) -> list[Expression]:
        """The elements of an input array."""
        return [self.input(f"{name}[{i}]") for i in range(count)]

    def cosine(self, angle: Expression) -> Expression:
        """The cosine of an angle."""
        return Expression(self, self._number(Node(NodeKind.COSINE, (angle.number,))), 1)

    def sine(self, angle: Expression) -> Expression:
        """The sine of an angle."""
        return Expression(self, self._number(Node(NodeKind.SINE, (angle.number,))), angle.sign)

    def product(self, a: Expression, b: Expression) -> Expression:
        """The product a b."""
        if a.is_zero or b.is_zero:
            return self.constant(0.0)
        factor, left = self._split(a)
        other, right = self._split(b)
        factor *= other
        if left is None or right is None:
            return self._scaled(factor, left if right is None else right)
        number = self._number(Node(NodeKind.PRODUCT, (min(left, right), max(left, right))))
        return self._scaled(factor, number)

    def sum(self, a: Expression, b: Expression) -> Expression:
        """The sum a + b."""
        if a.is_zero or b.is_zero:
            return b if a.is_zero else a
        factor, left = self._split(a)
        other, right = self._split(b)
        if left == right:
            return self._scaled(factor + other, left)
        low, high = (a, b) if a.number < b.number else (b, a)
        kind = NodeKind.SUM if a.sign == b.sign else NodeKind.DIFFERENCE
        return Expression(self, self._number(Node(kind, (low.number, high.number))), low.sign)

    def needed(self, outputs: Iterable[Expression]) -> list[int]:
        """Numbers of all nodes that outputs depend on, operands first."""
        order: list[int] = []
        seen: set[int] = set()
        for output in outputs:
            stack = [] if output.is_zero else [(output.number, False)]
            while stack:
                number, ready = stack.pop()
                if ready:
                    order.append(number)
                elif number not in seen:
                    seen.add(number)
                    stack.append((number, True))
                    stack.extend((operand, False) for operand in reversed(self.nodes[number].operands))
        return order

    def operations(self, outputs: Iterable[Expression]) -> Operations:
        """Operation count of outputs."""
        kinds = [self.nodes[number].kind for number in self.needed(outputs)]
        return Operations(
            kinds.count(NodeKind.PRODUCT),
            kinds.count(NodeKind.SUM) + kinds.count(NodeKind.DIFFERENCE),
            kinds.count(NodeKind.COSINE) + kinds.count(NodeKind.SINE),
        )

    def _split(self, a: Expression) -> tuple[float, int | None]:
        """An expression as a number times a node; None means a pure number."""
        node = self.nodes[a.number]
        if node.kind is NodeKind.CONSTANT:
            return a.sign * node.value, None
        if node.kind is NodeKind.PRODUCT and self.nodes[node.operands[0]].kind is NodeKind.CONSTANT:
            return a.sign * self.nodes[node.operands[0]].value, node.operands[1]
        if node.kind is NodeKind.PRODUCT and self.nodes[node.operands[1]].kind is NodeKind.CONSTANT:
            return a.sign * self.nodes[node.operands[1]].value, node.operands[0]
        return float(a.sign), a.number

    def _scaled(self, factor: float, number: int | None) -> Expression:
        """A number times a node."""
        if number is None or factor == 0.0:
            return self.constant(factor)
        sign = 1 if factor > 0.0 else -1
        if abs(factor) == 1.0:
            return Expression(self, number, sign)
        constant = self.constant(abs(factor)).number
        node = Node(NodeKind.PRODUCT, (min(constant, number), max(constant, number)))
        return Expression(self, self._number(node), sign)

    def _number(self, node: Node) -> int:
        """The number of a node, which is added if there is no equal one."""
        if node not in self._numbers:
            self._numbers[node] = len(self.nodes)
            self.nodes.append(node)
        return self._numbers[node]


@dataclass(frozen=True)
class Expression:
    """A node with a sign; zero is the node -1.

    Attributes:
        graph: The node's graph.
        number: The node's number.
        sign: 1 or -1.
    """

    graph: Graph
    number: int
    sign: int

    @property
    def is_zero(self) -> bool:
        """Whether it is the constant zero."""
        return self.number < 0

    def __neg__(self) -> Expression:
        return Expression(self.graph, self.number, -self.sign)

    def __add__(self, other: Expression) -> Expression:
        return self.graph.sum(self, other)

    def __sub__(self, other: Expression) -> Expression:
        return self.graph.sum(self, -other)

    def __mul__(self, other: Expression | float) -> Expression:
        if not isinstance(other, Expression):
            other = self.graph.constant(other)
        return self.graph.product(self, other)

    __rmul__ = __mul__


Vector = NDArray[np.object_]
"""(3,) expressions, or a matrix of them; numpy adds and multiplies them like numbers."""
