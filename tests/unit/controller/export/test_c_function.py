"""Expressions as C statements, line by line."""

from armload_controller.export.straight_line.arm_functions import Function
from armload_controller.export.straight_line.c_function import c_statements
from armload_controller.export.straight_line.expressions import Graph
from armload_controller.export.straight_line.precision import Precision


def test_every_number_is_a_constant_and_inputs_without_use_are_marked():
    graph = Graph()
    q, _unused = graph.inputs("q", 1), graph.inputs("other", 1)
    turned = graph.sine(q[0]) * graph.constant(2.5)
    function = Function(graph, ("q", "other"), {"out": [turned, -turned, graph.constant(0.0)]})
    assert c_statements(function).splitlines() == [
        "    (void)other;",
        "    const double t0 = q[0];",
        "    const double t1 = sin(t0);",
        "    const double t2 = t1 * 2.5;",
        "",
        "    out[0] = t2;",
        "    out[1] = -t2;",
        "    out[2] = 0.0;",
    ]
    single = c_statements(function, Precision.SINGLE).splitlines()
    assert single[2:4] == ["    const float t1 = sinf(t0);", "    const float t2 = t1 * 2.5f;"]
    assert single[-1] == "    out[2] = 0.0f;"
