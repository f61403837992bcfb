"""All limits of a motion as one list of excesses: their meaning, their gradient, their bound at all times."""

from __future__ import annotations

import numpy as np
import pytest

from armload_identification.excitation.design_envelope import CLEARANCE_SCALE_M, Envelope, ExcitationLimits
from armload_identification.excitation.fourier import FourierBounds, FourierTrajectory
from armload_identification.excitation.geometry.cartesian_speed import ArmPoints, SpeedLimit
from armload_identification.excitation.geometry.workspace import HalfSpace, Sphere, Workspace
from armload_identification.excitation.torque_limits import TorqueLimits
from armload_identification.identification_errors import ExcitationError
from armload_identification.model.dynamics import ArmBody

pytestmark = pytest.mark.pure

N = 3
JOINTS = ExcitationLimits(
    np.array([-2.9, -1.0, -1.2]),
    np.array([2.9, 1.6, 2.5]),
    np.array([2.0, 2.0, 2.4]),
    np.array([6.0, 6.0, 8.0]),
    np.array([60.0, 60.0, 80.0]),
)


@pytest.fixture(scope="module")
def envelope(any_arm, any_body) -> Envelope:
    rng = np.random.default_rng(1)
    chain, links = any_arm(rng, N)
    body = ArmBody(np.array([link.theta for link in links]), np.ones(N), np.ones(N), np.ones(N), np.eye(N))
    spheres = tuple(Sphere(link, rng.normal(size=3) * 0.1, 0.1) for link in range(5))
    floor = HalfSpace("floor", np.array([0.0, 0.0, 1.0]), -0.3, (1, 2, 3, 4))
    return Envelope(
        JOINTS,
        TorqueLimits(chain, body, any_body(rng), np.array([200.0, 150.0, 80.0]) - body.coulomb_nm),
        Workspace(chain, spheres, (floor,), (), ((0, 4), (1, 3))),
        SpeedLimit(ArmPoints(chain, np.array([0.1, 0.0, 0.2])), 0.8),
    )


def trajectory(seed: int, size: float = 0.4) -> FourierTrajectory:
    rng = np.random.default_rng(seed)
    return FourierTrajectory(0.3, rng.uniform(-0.5, 0.5, N), *(rng.normal(size=(2, N, 2)) * size))


def states(path: FourierTrajectory, times_s: np.ndarray) -> np.ndarray:
    state = path.evaluate(times_s)
    return np.stack([state.position_rad, state.velocity_rad_s, state.acceleration_rad_s2, state.jerk_rad_s3])


@pytest.mark.parametrize("seed", range(6))
def test_the_worst_excess_holds_at_every_time_and_gives_little_away(envelope, seed):
    path = trajectory(seed)
    dense = envelope.excess(states(path, np.linspace(0.0, path.period_s, 20_000))).max(axis=0)
    worst = envelope.worst(path)
    assert worst.shape == (envelope.rows,)
    assert np.all(worst >= dense)
    assert np.all(worst <= dense + np.maximum(0.003 * (1.0 + np.abs(dense)), 0.0125 / CLEARANCE_SCALE_M))


def test_margins_are_the_room_in_si_units(envelope):
    path = trajectory(3, 0.1)
    dense = states(path, np.linspace(0.0, path.period_s, 20_000))
    room = envelope.margins(path)
    below, above = dense[0].min(axis=0) - JOINTS.position_min_rad, JOINTS.position_max_rad - dense[0].max(axis=0)
    np.testing.assert_allclose(room.position_rad, np.minimum(below, above), atol=1e-4)
    np.testing.assert_allclose(room.velocity_rad_s, JOINTS.velocity_max_rad_s - np.abs(dense[1]).max(axis=0), atol=1e-4)
    np.testing.assert_allclose(
        room.acceleration_rad_s2, JOINTS.acceleration_max_rad_s2 - np.abs(dense[2]).max(axis=0), atol=1e-3
    )
    np.testing.assert_allclose(room.jerk_rad_s3, JOINTS.jerk_max_rad_s3 - np.abs(dense[3]).max(axis=0), atol=1e-3)
    demand = envelope.torque.demand(*dense[:3]).max(axis=0).reshape(-1, N).max(axis=0)
    np.testing.assert_allclose(room.torque_nm, envelope.torque.available_nm - demand, atol=0.5)
    clearances = envelope.workspace.clearances(dense[0]).min(axis=0)
    assert set(room.clearance_m) == {"floor", "base to tool", "link 1 to link 3"}
    for name, value in room.clearance_m.items():
        of_name = [c for c, other in zip(clearances, envelope.workspace.names, strict=True) if other == name]
        assert min(of_name) - 0.0125 <= value <= min(of_name)


def test_the_slope_is_the_finite_difference_of_the_excess(envelope):
    rng = np.random.default_rng(5)
    at = states(trajectory(1), np.linspace(0.0, 3.0, 40))
    weight = rng.uniform(size=(40, envelope.rows))
    slope = envelope.slope(weight, at)
    for order in range(4):
        direction = np.zeros_like(at)
        direction[order] = rng.normal(size=at[0].shape)
        ahead, behind = (np.sum(weight * envelope.excess(at + s * 1e-7 * direction)) for s in (1, -1))
        assert np.sum(slope * direction) == pytest.approx((ahead - behind) / 2e-7, rel=1e-5)


def test_a_distance_to_keep_is_part_of_the_limit_and_of_the_clearance(envelope):
    path, free = trajectory(3, 0.1), envelope.workspace
    kept = Workspace(free.chain, free.spheres, free.half_spaces, free.boxes, free.apart, keep_m=0.05)
    wider = Envelope(envelope.joints, envelope.torque, kept)
    begin = envelope.rows - len(free.names) - len(envelope.speed.points.names)
    rows = slice(begin, begin + len(free.names))
    np.testing.assert_allclose(wider.worst(path)[rows], envelope.worst(path)[rows] + 0.05 / CLEARANCE_SCALE_M)
    at = states(path, np.linspace(0.0, 3.0, 5))
    np.testing.assert_allclose(wider.excess(at)[:, rows], envelope.excess(at)[:, rows] + 0.05 / CLEARANCE_SCALE_M)
    assert wider.margins(path).clearance_m == pytest.approx(envelope.margins(path).clearance_m)


@pytest.mark.parametrize(
    ("row", "text"),
    [
        (1, "exceeds the range of joint 2 by 25.0 %"),
        (N + 2, "exceeds the speed of joint 3 by 25.0 %"),
        (4 * N - 1, "exceeds the jerk of joint 3 by 25.0 %"),
        (4 * N + N + 1, "requires 25.0 % more torque than joint 2 may use"),
        (4 * N + 4 * N, "brings link 1 0.050 m too close to 'floor'"),
        (-1, "is 25.0 % too fast at tool centre point"),
    ],
)
def test_the_limit_that_is_exceeded_most_is_named(envelope, row, text):
    worst = np.full(envelope.rows, -0.1)
    worst[row] = 0.25
    assert envelope.most_exceeded(worst) == text


def test_reduced_limits_leave_the_room_asked_for():
    reduced = JOINTS.reduced(0.1, 0.7)
    np.testing.assert_allclose(reduced.position_min_rad, [-2.8, -0.9, -1.1])
    np.testing.assert_allclose(reduced.position_max_rad, [2.8, 1.5, 2.4])
    np.testing.assert_allclose(reduced.velocity_max_rad_s, [1.4, 1.4, 1.68])
    np.testing.assert_allclose(reduced.acceleration_max_rad_s2, [4.2, 4.2, 5.6])
    np.testing.assert_allclose(reduced.jerk_max_rad_s3, [42.0, 42.0, 56.0])
    with pytest.raises(ExcitationError, match="share 0"):
        JOINTS.reduced(0.1, 0.0)
    with pytest.raises(ExcitationError, match=r"joint 2: positions from .* min < max"):
        JOINTS.reduced(1.5, 1.0)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (([1.0], [-1.0], [1.0], [1.0], [1.0]), "joint 1: positions from 1.0 to -1.0 rad"),
        (([-1.0], [1.0], [0.0], [1.0], [1.0]), r"velocity_max_rad_s is \[0.0\]; expected numbers above 0"),
        (([-1.0], [1.0], [1.0], [-1.0], [1.0]), r"acceleration_max_rad_s2 is \[-1.0\]; expected numbers above 0"),
        (([-1.0], [1.0], [1.0], [1.0], [0.0]), r"jerk_max_rad_s3 is \[0.0\]; expected numbers above 0"),
        (([-1.0], [1.0, 2.0], [1.0], [1.0], [1.0]), "position_max_rad"),
        (([-np.inf], [1.0], [1.0], [1.0], [1.0]), "position_min_rad contains a number that is not finite"),
    ],
)
def test_limits_that_make_no_sense_are_refused(arguments, words):
    with pytest.raises(ExcitationError, match=words):
        ExcitationLimits(*(np.array(a) for a in arguments))


def test_parts_of_different_arms_are_refused(envelope):
    head = ExcitationLimits(*(getattr(JOINTS, name)[:2] for name in FourierBounds.__slots__))
    with pytest.raises(ExcitationError, match="limits of 2 joints, torque of 3"):
        Envelope(head, envelope.torque, envelope.workspace)
