"""Clearances against an independent geometry, their gradient, and the bound between samples."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from armload_identification.excitation.fourier import FourierTrajectory
from armload_identification.excitation.geometry.workspace import Box, HalfSpace, Sphere, Workspace
from armload_identification.identification_errors import ModelError
from armload_identification.model.chain import Chain, pose_from_xyz_rpy

pytestmark = pytest.mark.pure

N = 4
ALL = (1, 2, 3, 4, 5)
BOX_POSE = pose_from_xyz_rpy([0.5, -0.2, 0.3], [0.4, -0.7, 1.2])
BOX_SIZE = np.array([0.5, 0.3, 0.8])
NORMAL = np.array([0.6, 0.0, 0.8])


@pytest.fixture(scope="module")
def workspace(any_arm) -> Workspace:
    rng = np.random.default_rng(8)
    chain, _ = any_arm(rng, N)
    spheres = tuple(Sphere(link, rng.normal(size=3) * 0.2, rng.uniform(0.05, 0.15)) for link in (0, *ALL, 2, 5))
    return Workspace(
        chain,
        spheres,
        (HalfSpace("floor", NORMAL, -0.7, ALL), HalfSpace("wall", np.array([0.0, 1.0, 0.0]), -0.9, (3, 5))),
        (Box("table", BOX_POSE, BOX_SIZE, ALL),),
        ((0, 3), (2, 5)),
    )


def centres(workspace: Workspace, q: np.ndarray) -> np.ndarray:
    """(S, 3) centres of all spheres, by `Chain.forward`."""
    poses = np.concatenate([[np.eye(4)], workspace.chain.forward(q)])  # base, links, flange
    return np.array([poses[s.link][:3, :3] @ s.center_m + poses[s.link][:3, 3] for s in workspace.spheres])


def box_distance(point: np.ndarray) -> float:
    """Signed distance by brute force over faces, edges and corners of the box."""
    local = BOX_POSE[:3, :3].T @ (point - BOX_POSE[:3, 3])
    half = 0.5 * BOX_SIZE
    if np.all(np.abs(local) < half):
        return -float((half - np.abs(local)).min())
    return float(np.linalg.norm(local - np.clip(local, -half, half)))


def by_hand(workspace: Workspace, q: np.ndarray) -> list[float]:
    at, spheres = centres(workspace, q), workspace.spheres
    found = []
    for plane in workspace.half_spaces:
        found += [
            plane.normal @ c - plane.offset_m - s.radius_m
            for c, s in zip(at, spheres, strict=True)
            if s.link in plane.links
        ]
    found += [box_distance(c) - s.radius_m for c, s in zip(at, spheres, strict=True) if s.link in ALL]
    for pair in workspace.apart:
        found += [
            np.linalg.norm(at[a] - at[b]) - spheres[a].radius_m - spheres[b].radius_m
            for a, b in itertools.product(range(len(spheres)), repeat=2)
            if (spheres[a].link, spheres[b].link) == pair
        ]
    return found


def test_a_straight_way_is_bounded_between_samples_too(workspace):
    rng = np.random.default_rng(5)
    for _ in range(5):
        start, goal = rng.uniform(-np.pi, np.pi, (2, N))
        found = workspace.least_on_line(start, goal)
        dense = workspace.clearances(start + (goal - start) * np.linspace(0.0, 1.0, 20001)[:, None]).min(axis=0)
        assert np.all(found <= dense)
        assert np.all(found > dense - 0.01)


def test_clearances_are_the_distances(workspace):
    q = np.random.default_rng(0).uniform(-np.pi, np.pi, (300, N))
    found = workspace.clearances(q)
    expected = np.array([by_hand(workspace, row) for row in q])
    assert found.shape == (300, len(workspace.names))
    np.testing.assert_allclose(np.sort(found, axis=1), np.sort(expected, axis=1), atol=1e-12)
    for name in ("floor", "table", "base to link 3", "link 2 to tool"):
        assert name in workspace.names
    assert (found < 0.0).any(axis=0).any()
    assert (found > 0.0).any(axis=0).all()


def test_the_slope_is_the_finite_difference_of_the_clearances(workspace):
    rng = np.random.default_rng(1)
    q = rng.uniform(-np.pi, np.pi, (200, N))
    weight = rng.normal(size=(200, len(workspace.names)))
    weight[::2] = 0.0
    slope = workspace.slope(weight, q)
    assert not slope[::2].any()
    direction = rng.normal(size=q.shape)
    ahead, behind = (np.sum(weight * workspace.clearances(q + s * 1e-7 * direction)) for s in (1, -1))
    assert np.sum(slope * direction) == pytest.approx((ahead - behind) / 2e-7, rel=1e-5)


@pytest.mark.parametrize("seed", range(8))
def test_the_bound_holds_at_every_time_and_gives_little_away(workspace, seed):
    rng = np.random.default_rng(seed)
    path = FourierTrajectory(0.2, rng.uniform(-1, 1, N), rng.normal(size=(N, 3)) * 0.5, rng.normal(size=(N, 3)) * 0.5)
    least = workspace.least(path)
    dense = workspace.clearances(path.evaluate(np.linspace(0.0, 5.0, 100_001)).position_rad).min(axis=0)
    assert np.all(least <= dense)
    assert np.all(least >= dense - 0.0121)  # for two spheres: twice 3 mm and the motion in half a step


def test_an_empty_workspace_is_in_nobodys_way(workspace):
    free = Workspace(workspace.chain)
    q = np.zeros((3, N))
    assert free.clearances(q).shape == (3, 0)
    assert not free.slope(np.zeros((3, 0)), q).any()
    assert free.least(FourierTrajectory(1.0, np.zeros(N), np.ones((N, 1)), np.ones((N, 1)))).shape == (0,)


def test_a_sphere_on_the_axis_of_a_lone_joint_stays_where_it_is():
    chain = Chain.from_modified_dh([[0.0, 0.0, 0.5, 0.0]], np.eye(4), [0.0, 0.0, -9.81])
    up = np.array([0.0, 0.0, 1.0])
    floor = Workspace(chain, (Sphere(1, 0.2 * up, 0.1),), (HalfSpace("floor", up, 0.0, (1,)),))
    np.testing.assert_allclose(floor.clearances(np.array([[0.0], [1.0]])), [[0.6], [0.6]])


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"spheres": (Sphere(N + 2, np.zeros(3), 0.1),)}, f"link {N + 2} of an arm of {N}"),
        ({"spheres": (Sphere(1, np.zeros(3), 0.0),)}, "radius of 0.0 m"),
        ({"boxes": (Box("table", BOX_POSE, np.array([1.0, 0.0, 1.0]), ALL),)}, "'table' has the size"),
        ({"half_spaces": (HalfSpace("floor", np.array([0.0, 0.0, 2.0]), 0.0, ALL),)}, "'floor' is not a unit vector"),
        ({"half_spaces": (HalfSpace("floor", NORMAL, 0.0, (2,)),)}, "'floor' has no effect"),
        ({"apart": ((1, 3),)}, "'link 1 to link 3' has no effect"),
        ({"apart": ((1, 9),)}, "link 9"),
        ({"keep_m": -0.01}, "-0.01 m to keep"),
    ],
)
def test_what_makes_no_sense_is_refused(workspace, arguments, words):
    given = {"spheres": (Sphere(1, np.zeros(3), 0.1),), **arguments}
    with pytest.raises(ModelError, match=words):
        Workspace(workspace.chain, **given)


def test_spheres_are_where_their_links_are(workspace):
    q = np.random.default_rng(5).uniform(-2.0, 2.0, N)
    np.testing.assert_allclose(workspace.centres(q), centres(workspace, q), atol=1e-12)
