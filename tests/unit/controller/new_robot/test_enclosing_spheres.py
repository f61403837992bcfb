"""Spheres around shapes: every point of the surface is inside, and they are not much larger than needed."""

from __future__ import annotations

from types import SimpleNamespace

import coal
import numpy as np
import pytest

from armload_controller.new_robot.enclosing_spheres import MARGIN_M, MOST_SLICES, enclosing_spheres

TURN = np.array([[0.0, -1.0, 0.0], [0.8, 0.0, -0.6], [0.6, 0.0, 0.8]])
AT = np.array([0.3, -0.2, 0.5])


def body(shape, joint=1, frame=7, scale=(1.0, 1.0, 1.0), at=AT):
    placement = SimpleNamespace(rotation=TURN, translation=at)
    return SimpleNamespace(geometry=shape, meshScale=scale, placement=placement, parentJoint=joint, parentFrame=frame)


def spheres(*bodies):
    return enclosing_spheres(SimpleNamespace(coal=coal, geometry=SimpleNamespace(geometryObjects=bodies)))


def mesh(vertices, triangles):
    model = coal.BVHModelOBBRSS()
    model.beginModel(len(triangles), len(vertices))
    for triangle in triangles:
        model.addTriangle(*(np.asarray(vertices[corner], dtype=float) for corner in triangle))
    model.endModel()
    return model


def beyond(found, points, scale=1.0):
    """Distance of the worst point in the shape's frame from the surface of the best sphere; negative if inside."""
    placed = scale * points @ TURN.T + AT
    return max(min(np.linalg.norm(p - s.center_m) - s.radius_m for s in found) for p in placed)


def surface(kind):
    """Dense points on each shape, by a formula of its own."""
    rng = np.random.default_rng(3)
    direction = rng.normal(size=(4000, 3))
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    if kind == "box":
        return direction / np.abs(direction / [0.25, 0.05, 0.04]).max(axis=1)[:, None]
    if kind == "sphere":
        return 0.12 * direction
    angle, height = rng.uniform(0.0, 2.0 * np.pi, 4000), rng.uniform(-0.2, 0.2, 4000)
    wall = np.column_stack([0.06 * np.cos(angle), 0.06 * np.sin(angle), height])
    if kind == "cylinder":
        return wall
    return np.concatenate([wall, 0.06 * direction + np.sign(direction[:, 2:]) * [0.0, 0.0, 0.2]])


SHAPES = {
    "box": coal.Box(0.5, 0.1, 0.08),
    "sphere": coal.Sphere(0.12),
    "cylinder": coal.Cylinder(0.06, 0.4),
    "capsule": coal.Capsule(0.06, 0.4),
}


@pytest.mark.parametrize(
    ("kind", "largest_m"), [("box", 0.15), ("sphere", 0.22), ("cylinder", 0.13), ("capsule", 0.15)]
)
def test_the_surface_is_inside_and_not_by_far(kind, largest_m):
    found = spheres(body(SHAPES[kind]))
    assert {sphere.link for sphere in found} == {1}
    points = surface(kind)
    worst = beyond(found, points)
    assert worst <= 0.0
    assert max(sphere.radius_m for sphere in found) < largest_m
    assert len(found) == (1 if kind == "sphere" else MOST_SLICES)


@pytest.mark.parametrize("shape", [coal.Cylinder(0.2, 0.02), coal.Sphere(0.12), coal.Box(0.3, 0.3, 0.02)])
def test_rounding_does_not_choose_among_equally_long_directions(shape):
    found = spheres(body(shape))
    for shift in np.random.default_rng(2).normal(scale=1e-13, size=(8, 3)):
        moved = spheres(body(shape, at=AT + shift))
        np.testing.assert_allclose([s.center_m for s in moved], [s.center_m for s in found], rtol=0.0, atol=1e-6)


def test_a_large_triangle_is_covered_between_its_corners_too():
    corners = np.array([[0.0, 0.0, 0.0], [0.9, 0.0, 0.0], [0.0, 0.3, 0.0]])
    found = spheres(body(mesh(corners, [(0, 1, 2)])))
    weights = np.random.default_rng(2).dirichlet(np.ones(3), 3000)
    assert beyond(found, weights @ corners) <= 0.0
    assert len(found) > 1
    assert max(sphere.radius_m for sphere in found) < 0.35


@pytest.mark.parametrize("size_m", [0.01, 0.03, 0.07, 0.15, 0.5])
def test_triangles_of_every_size_are_covered(size_m):
    corners = size_m * np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 0.3]])
    faces = [(0, 1, 2), (0, 1, 3), (1, 2, 3), (0, 2, 3)]
    found = spheres(body(mesh(corners, faces)))
    weights = np.random.default_rng(2).dirichlet(np.ones(3), 500)
    assert max(beyond(found, weights @ corners[list(face)]) for face in faces) <= 0.0


def test_a_mesh_is_scaled():
    corners = np.array([[0.0, 0.0, 0.0], [9.0, 0.0, 0.0], [0.0, 3.0, 0.0]])
    found = spheres(body(mesh(corners, [(0, 1, 2)]), scale=(0.01, 0.01, 0.01)))
    assert beyond(found, corners, 0.01) <= 0.0
    assert max(sphere.radius_m for sphere in found) < 0.1


def test_a_single_point_gets_the_margin():
    (point,) = spheres(body(mesh(np.zeros((3, 3)), [(0, 1, 2)])))
    np.testing.assert_allclose(point.center_m, AT, atol=1e-12)
    assert point.radius_m == pytest.approx(MARGIN_M)


def test_parts_of_one_link_share_its_spheres_but_fixed_parts_keep_their_own():
    ball, far = coal.Sphere(0.05), AT + np.array([0.0, 0.0, 0.2])
    joined = spheres(body(ball, frame=1), body(ball, frame=2, at=far))
    assert {sphere.link for sphere in joined} == {1}
    assert len(joined) > 1
    fixed = body(ball, joint=0, frame=1), body(ball, joint=0, frame=2, at=far)
    own = [sphere.center_m for one in fixed for sphere in spheres(one)]
    np.testing.assert_array_equal([sphere.center_m for sphere in spheres(*fixed)], own)
    order = [s.link for s in spheres(body(ball, joint=2), body(ball, joint=0), body(ball, joint=1))]
    assert order == sorted(order)
    assert set(order) == {0, 1, 2}


def test_two_parts_of_a_link_that_are_far_apart_have_nothing_between_them():
    ball, apart = coal.Sphere(0.05), np.array([0.0, 0.0, 2.0])
    found = spheres(body(ball), body(ball, at=AT + apart))
    ways = np.array([np.dot(sphere.center_m - AT, apart) / 4.0 for sphere in found])
    assert len(found) >= 2
    assert ((np.abs(ways) < 0.1) | (np.abs(ways - 1.0) < 0.1)).all()
    assert max(sphere.radius_m for sphere in found) < 0.2
