"""Straight-line dynamics: the graph's rules, and chains with parallel, opposite, coincident or intersecting axes."""

import math

import numpy as np
import pytest

from armload_controller.export.straight_line.arm_functions import STATE, link_torque_of
from armload_controller.export.straight_line.expressions import Graph, NodeKind
from armload_controller.export.straight_line.planar_groups import planar_groups
from armload_controller.export.straight_line.specialised_dynamics import (
    SpecialisedArm,
    specialised_regressor,
    specialised_torque,
)
from armload_identification.model import regressor
from armload_identification.model.chain import Chain, pose_from_xyz_rpy
from armload_identification.model.dynamics import ArmDynamics
from armload_identification.model.links_and_drives import LinksAndDrives

UP = (0.0, 0.0, -9.81)
QUARTER = math.pi / 2.0


def evaluated(graph, outputs, variables):
    """Values of expressions."""
    values = {}
    for number in graph.needed(outputs):
        node = graph.nodes[number]
        operands = [values[operand] for operand in node.operands]
        values[number] = {
            NodeKind.CONSTANT: lambda node, _: node.value,
            NodeKind.INPUT: lambda node, _: variables[node.name],
            NodeKind.COSINE: lambda _, a: math.cos(a[0]),
            NodeKind.SINE: lambda _, a: math.sin(a[0]),
            NodeKind.SUM: lambda _, a: a[0] + a[1],
            NodeKind.DIFFERENCE: lambda _, a: a[0] - a[1],
            NodeKind.PRODUCT: lambda _, a: a[0] * a[1],
        }[node.kind](node, operands)
    return np.array([0.0 if o.is_zero else o.sign * values[o.number] for o in outputs])


def test_what_vanishes_is_never_a_node():
    graph = Graph()
    x, zero, one = graph.input("x"), graph.constant(0.0), graph.constant(1.0)
    assert (x * zero).is_zero
    assert (x - x).is_zero
    assert x * one == x
    assert x + zero == x
    assert 3.0 * (2.0 * x) == 6.0 * x
    assert 2.0 * x + 3.0 * x == 5.0 * x
    assert graph.operations([x, x * one, x + zero]).total == 0


def test_equal_expressions_are_one_node_whatever_their_signs():
    graph = Graph()
    x, y = graph.inputs("v", 2)
    assert x * y == y * x
    assert (-x) * y == -(x * y)
    assert x - y == -(y - x)
    assert -(x + y) == (-x) - y
    assert graph.sine(-x) == -graph.sine(x)
    assert graph.cosine(-x) == graph.cosine(x)
    assert graph.operations([x * y, -(y * x), x - y, y - x]).total == 2


def test_only_what_an_output_needs_is_counted():
    graph = Graph()
    a, b = tuple(graph.inputs("a", 3)), tuple(graph.inputs("b", 3))
    outputs = list(np.cross(a, b))
    assert graph.operations(outputs).multiplications == 6
    assert graph.operations(outputs[:1]).multiplications == 2


CHAINS = {
    "one upright joint": ([(0, 0, 0.3)], [(0, 0, 0)], [(0, 0, 1)]),
    "one level joint": ([(0, 0, 0.3)], [(0, 0, 0)], [(1, 0, 0)]),
    "three parallel joints": ([(0, 0, 0.1), (0.4, 0, 0), (0.3, 0, 0.05)], [(0, 0, 0)] * 3, [(0, 1, 0)] * 3),
    "opposite axes": ([(0, 0, 0.1), (0.4, 0, 0), (0.3, 0, 0.05)], [(0, 0, 0)] * 3, [(0, 1, 0), (0, -1, 0), (0, 1, 0)]),
    "a group that ends upside down": (
        [(0, 0, 0.1), (0.4, 0, 0), (0.3, 0, 0.05), (0.1, 0.2, 0)],
        [(0, 0, 0)] * 4,
        [(0, 0, 1), (0, 1, 0), (0, -1, 0), (1, 0, 0)],
    ),
    "coincident axes": ([(0, 0, 0.1), (0, 0, 0.2), (0.3, 0, 0)], [(0, 0, 0)] * 3, [(0, 0, 1), (0, 0, 1), (0, 1, 0)]),
    "scara": ([(0, 0, 0.4), (0.3, 0, 0), (0.2, 0, 0)], [(0, 0, 0), (0, 0, 0.3), (0, 0, 0)], [(0, 0, 1)] * 3),
    "axes that meet": ([(0, 0, 0.4), (0, 0, 0), (0, 0, 0)], [(0, 0, 0)] * 3, [(0, 0, 1), (0, 1, 0), (0, 0, 1)]),
    "nearly parallel": ([(0, 0, 0.1), (0.4, 0, 0)], [(0, 0, 0), (1e-5, 0, 0)], [(0, 1, 0), (0, 1, 0)]),
    "a rounded right angle": ([(0, 0, 0.1), (0.4, 0, 0)], [(0, 0, 0), (1.5708, 0, 0)], [(0, 0, 1), (0, 0, 1)]),
}


@pytest.mark.parametrize("gravity", [UP, (9.81, 0.0, 0.0), (1.0, -2.0, 9.0)], ids=["upright", "on a wall", "tilted"])
@pytest.mark.parametrize("name", CHAINS)
def test_any_arrangement_of_axes_gives_the_cores_torque_and_regressor(name, gravity):
    xyz, rpy, axis = CHAINS[name]
    flange = pose_from_xyz_rpy((0.05, -0.02, 0.1), (0.3, QUARTER, -1.0))
    chain = Chain.from_origins(xyz, rpy, axis, flange, gravity)
    body = np.array([2.0, 0.1, -0.3, 0.2, 0.3, 0.4, 0.35, 0.02, -0.01, 0.03])
    graph, n = Graph(), chain.n
    groups = planar_groups(chain)
    arm = SpecialisedArm(graph, groups, *(graph.inputs(v, n) for v in ("q", "dq", "ddq")))
    columns = [element for row in specialised_regressor(arm) for element in row]
    matrix = placed(groups.flange)
    torque = specialised_torque(arm, [graph.constant(float(value)) for value in matrix @ body])
    for state in np.random.default_rng(4).uniform(-3, 3, (5, 3, n)):
        names = {f"{v}[{i}]": state[k, i] for k, v in enumerate(("q", "dq", "ddq")) for i in range(n)}
        expected = regressor.payload_regressor(chain, *state)
        found = evaluated(graph, columns, names).reshape(n, 10)
        np.testing.assert_allclose(found, expected, rtol=0.0, atol=3e-13)
        np.testing.assert_allclose(evaluated(graph, torque, names), expected @ body, rtol=0.0, atol=3e-13)


def placed(pose):
    """(10, 10) transform of a body's parameters from a frame at `pose` to the frame in which the pose is given."""
    elements = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)]

    def moved(theta):
        m, s, r, p = theta[0], theta[1:4], pose[:3, :3], pose[:3, 3]
        tensor = np.zeros((3, 3))
        for value, (i, k) in zip(theta[4:], elements, strict=True):
            tensor[i, k] = tensor[k, i] = value
        s = r @ s
        cross_terms = 2.0 * (s @ p) * np.eye(3) - np.outer(s, p) - np.outer(p, s)
        tensor = r @ tensor @ r.T + cross_terms + m * ((p @ p) * np.eye(3) - np.outer(p, p))
        return np.array([m, *(s + m * p), *(tensor[i, k] for i, k in elements)])

    return np.column_stack([moved(unit) for unit in np.eye(10)])


def test_an_upright_arms_first_angle_costs_nothing():
    xyz, rpy, axis = CHAINS["axes that meet"]
    chain = Chain.from_origins(xyz, rpy, axis, np.eye(4), UP)
    graph = Graph()
    arm = SpecialisedArm(graph, planar_groups(chain), *(graph.inputs(v, 3) for v in ("q", "dq", "ddq")))
    outputs = specialised_torque(arm, graph.inputs("theta", 10))
    used = {graph.nodes[number].name for number in graph.needed(outputs)}
    assert "q[0]" not in used
    assert {"q[1]", "q[2]", "dq[0]", "ddq[0]"} <= used


@pytest.mark.parametrize("gravity", [UP, (1.0, -2.0, 9.0)], ids=["upright", "tilted"])
@pytest.mark.parametrize("name", CHAINS)
def test_the_links_of_any_arrangement_take_the_cores_torque(name, gravity):
    xyz, rpy, axis = CHAINS[name]
    chain = Chain.from_origins(xyz, rpy, axis, np.eye(4), gravity)
    rng, n = np.random.default_rng(5), chain.n
    links = rng.uniform(-1, 1, (n, 10))
    function = link_torque_of(chain, links)
    states = rng.uniform(-3, 3, (3, 5, n))
    body = LinksAndDrives(links, *np.zeros((3, n)), np.eye(n))
    expected = ArmDynamics(chain, body).link_torque(*states)
    for t in range(5):
        names = {f"{v}[{i}]": states[k, t, i] for k, v in enumerate(STATE) for i in range(n)}
        found = evaluated(function.graph, function.elements, names)
        np.testing.assert_allclose(found, expected[t], rtol=0.0, atol=1e-12)


@pytest.mark.parametrize(("name", "signs"), [("three parallel joints", [1, 1, 1]), ("opposite axes", [1, -1, 1])])
def test_parallel_joints_are_one_group_with_shifts_along_their_normals(name, signs):
    """Axes along y: 0.4 m to the second, and 0.3 and 0.05 m, so 0.30414 m at -9.46 degrees about y, to the third."""
    xyz, rpy, axis = CHAINS[name]
    groups = planar_groups(Chain.from_origins(xyz, rpy, axis, pose_from_xyz_rpy((0, 0, 0.2), (0, 0, 0)), UP))
    np.testing.assert_allclose(groups.gravity_m_s2, [9.81, 0.0, 0.0])
    (group,) = groups.groups
    assert (group.alpha_rad, group.shift_m) == (0.0, (0.0, 0.0))
    assert [joint.index for joint in group.joints] == [0, 1, 2]
    assert [joint.sign for joint in group.joints] == signs
    np.testing.assert_allclose(
        [joint.shift_m for joint in group.joints], [[0.4, 0.0], [np.hypot(0.3, 0.05), 0.0], [0, 0]]
    )
    slope = math.atan2(0.05, 0.3)
    # From gravity, along x of the base frame, to the first normal; then to the second one, about the joint's own axis.
    turns = [joint.sign * joint.zero_rad for joint in group.joints]
    np.testing.assert_allclose(turns, [-QUARTER, -slope, 0.0], atol=1e-12)
    # The flange is 0.2 m above the last axis: with x along the last normal, that is before and above it.
    place = groups.flange[:3, 3]
    assert place[0] == pytest.approx(0.2 * math.sin(slope))
    assert np.hypot(*place[:2]) == pytest.approx(0.2)
    assert place[2] == 0.0


def test_axes_that_meet_are_three_groups_at_right_angles_in_one_point():
    """Up, along y, and up again through one point, and the flange 0.1 m above it."""
    xyz, rpy, axis = CHAINS["axes that meet"]
    groups = planar_groups(Chain.from_origins(xyz, rpy, axis, pose_from_xyz_rpy((0, 0, 0.1), (0, 0, 0)), UP))
    np.testing.assert_allclose(groups.gravity_m_s2, [0.0, 0.0, -9.81])
    assert [len(group.joints) for group in groups.groups] == [1, 1, 1]
    assert [group.shift_m for group in groups.groups] == [(0.0, 0.0)] * 3
    assert [abs(group.alpha_rad) for group in groups.groups] == pytest.approx([0.0, QUARTER, QUARTER])
    np.testing.assert_allclose(groups.flange[:3, 3], [0.0, 0.0, 0.1], atol=1e-15)


def test_skew_axes_are_apart_by_their_common_normal():
    """The second axis, along y, passes 0.3 m before the first, along z, at a height of 0.25 m."""
    chain = Chain.from_origins([(0, 0, 0.1), (0.3, 0.7, 0.15)], [(0, 0, 0)] * 2, [(0, 0, 1), (0, 1, 0)], np.eye(4), UP)
    first, second = planar_groups(chain).groups
    assert first.shift_m == (0.0, 0.0)
    assert second.shift_m == pytest.approx((0.3, 0.0))
    assert abs(second.alpha_rad) == pytest.approx(QUARTER)
    # The second frame's origin is at the foot of the normal, 0.7 m before the joint's own along its axis.
    np.testing.assert_allclose(np.abs(second.joints[0].link[:3, 3]), [0.0, 0.0, 0.7], atol=1e-15)
