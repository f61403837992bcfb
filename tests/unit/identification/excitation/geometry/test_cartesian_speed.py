"""Speeds of an arm's points against Pinocchio's frame velocities, their derivative, and the bound between samples."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from armload_identification.excitation.fourier import FourierTrajectory
from armload_identification.excitation.geometry.cartesian_speed import ArmPoints, CarriedSphere
from armload_identification.model.chain import Chain

pytestmark = pytest.mark.pure

SEEDS = range(6)
TOOL_M = np.array([0.05, -0.02, 0.2])
CARRIED = (
    CarriedSphere("gripper", np.array([0.0, 0.0, 0.1]), 0.08),
    CarriedSphere("payload", np.array([-0.1, 0.2, 0.15]), 0.25),
)


def states(rng, count, n):
    return rng.uniform(-3.0, 3.0, (count, n)), rng.normal(size=(count, n))


def pinocchio_speeds(chain, links, in_pinocchio, q, dq):
    """Pinocchio's speeds of the joints from the second on, of the flange and of the tool."""
    model = in_pinocchio(chain, links)
    last = model.njoints - 1
    flange = pin.SE3(chain.flange[:3, :3], chain.flange[:3, 3])
    for name, pose in (("flange", flange), ("tcp", flange * pin.SE3(np.eye(3), TOOL_M))):
        model.addFrame(pin.Frame(name, last, 0, pose, pin.FrameType.OP_FRAME))
    data = model.createData()
    found = []
    for position, velocity in zip(q, dq, strict=True):
        pin.forwardKinematics(model, data, position, velocity)
        pin.updateFramePlacements(model, data)
        row = [pin.getVelocity(model, data, joint).linear for joint in range(2, last + 1)]
        row += [pin.getFrameVelocity(model, data, model.getFrameId(name)).linear for name in ("flange", "tcp")]
        found.append([np.linalg.norm(vector) for vector in row])
    return np.array(found)


@pytest.mark.parametrize("seed", SEEDS)
def test_speeds_are_pinocchios(seed, any_arm, in_pinocchio):
    rng = np.random.default_rng(seed)
    chain, links = any_arm(rng, 2 + seed)
    q, dq = states(rng, 5, chain.n)
    points = ArmPoints(chain, TOOL_M)
    assert points.names == (*(f"joint {k}" for k in range(2, chain.n + 1)), "flange", "tool centre point")
    np.testing.assert_allclose(points.speeds(q, dq), pinocchio_speeds(chain, links, in_pinocchio, q, dq), atol=1e-12)


def test_without_a_tool_the_flange_is_the_tool_centre_point(any_arm):
    chain, _ = any_arm(np.random.default_rng(1), 3)
    assert ArmPoints(chain, np.zeros(3)).names == ("joint 2", "joint 3", "tool centre point")


@pytest.mark.parametrize("seed", SEEDS)
def test_no_point_of_a_carried_sphere_is_faster_than_the_sphere(seed, any_arm, in_pinocchio):
    rng = np.random.default_rng(seed)
    chain, links = any_arm(rng, 2 + seed)
    q, dq = states(rng, 5, chain.n)
    points = ArmPoints(chain, TOOL_M, CARRIED)
    assert points.names == (*ArmPoints(chain, TOOL_M).names, "gripper", "payload")
    speed = points.speeds(q, dq)
    np.testing.assert_array_equal(speed[:, :-2], ArmPoints(chain, TOOL_M).speeds(q, dq))
    model = in_pinocchio(chain, links)
    data = model.createData()
    flange = pin.SE3(chain.flange[:3, :3], chain.flange[:3, 3])
    surface = rng.normal(size=(200, 3))
    surface /= np.linalg.norm(surface, axis=1)[:, None]
    for row, position, velocity in zip(speed, q, dq, strict=True):
        pin.forwardKinematics(model, data, position, velocity)
        moving = flange.actInv(pin.getVelocity(model, data, model.njoints - 1))
        for found, sphere in zip(row[-2:], CARRIED, strict=True):
            centre = moving.linear + np.cross(moving.angular, sphere.center_m)
            most = np.linalg.norm(centre) + sphere.radius_m * np.linalg.norm(moving.angular)
            assert found == pytest.approx(most, abs=1e-12)
            around = centre + np.cross(moving.angular, sphere.radius_m * surface)
            assert np.linalg.norm(around, axis=1).max() <= found + 1e-12


@pytest.mark.parametrize("seed", SEEDS)
def test_the_slope_is_that_of_finite_differences(seed, any_arm):
    rng = np.random.default_rng(seed)
    chain, _ = any_arm(rng, 2 + seed)
    points = ArmPoints(chain, TOOL_M, CARRIED)
    q, dq = states(rng, 3, chain.n)
    weight = rng.normal(size=(3, len(points.names)))
    slope = points.moving(q, dq).slope(weight)
    step = 1e-6
    for joint in range(chain.n):
        by = step * (np.arange(chain.n) == joint)
        for order, moved in enumerate((lambda side: (q + side * by, dq), lambda side: (q, dq + side * by))):  # noqa: B023
            ahead, behind = (np.sum(weight * points.speeds(*moved(side)), axis=1) for side in (1.0, -1.0))
            np.testing.assert_allclose(slope[order, :, joint], (ahead - behind) / (2.0 * step), atol=1e-7)


@pytest.mark.parametrize("seed", SEEDS)
def test_no_point_is_faster_between_samples_than_the_bound(seed, any_arm):
    rng = np.random.default_rng(seed)
    chain, _ = any_arm(rng, 4)
    size = 0.8 / np.arange(1, 4)
    path = FourierTrajectory(0.5, rng.uniform(-1, 1, 4), rng.normal(size=(4, 3)) * size, rng.normal(size=(4, 3)) * size)
    points = ArmPoints(chain, TOOL_M, CARRIED)
    bound = points.greatest_in_period(path, 64)
    state = path.evaluate(np.linspace(0.0, path.period_s, 64 * 16 + 1))
    speed = points.speeds(state.position_rad, state.velocity_rad_s)
    between = np.array([speed[16 * k : 16 * k + 17].max(axis=0) for k in range(64)])
    assert np.all(bound >= between - 1e-12)
    fine = points.greatest_on(path)
    assert np.all(fine >= speed.max(axis=0) - 1e-12)
    assert np.all(fine <= speed.max(axis=0) * 1.01 + 1e-3)


def test_the_bound_between_samples_counts_the_turning_of_a_sphere_whose_centre_stands_still():
    chain = Chain.from_origins([np.zeros(3)], [np.zeros(3)], [(0.0, 0.0, 1.0)], np.eye(4), (0.0, 0.0, -9.81))
    points = ArmPoints(chain, np.zeros(3), (CarriedSphere("payload", np.zeros(3), 0.5),))
    path = FourierTrajectory(1.0, np.zeros(1), np.zeros((1, 2)), np.array([[0.0, 0.3]]))
    bound = points.greatest_in_period(path, 4)
    speed = points.speeds(np.zeros((1001, 1)), path.evaluate(np.linspace(0.0, 1.0, 1001)).velocity_rad_s)
    assert np.all(bound[:, -1] >= speed[:, -1].max())
