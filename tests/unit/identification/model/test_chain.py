"""The chain: conventions, poses, and refusals."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from armload_identification.identification_errors import ModelError
from armload_identification.model.chain import Chain, pose_from_xyz_rpy, rpy_rad
from armload_identification.model.regressor import payload_regressor

pytestmark = pytest.mark.pure

PI = np.pi
GRAVITY = [0.0, 0.0, -9.81]

# A Puma-like arm in three conventions. Standard rows: alpha_i, a_i, d_i, offset.
STANDARD = np.array(
    [
        [PI / 2, 0.0, 0.4, 0.0],
        [0.0, 0.43, 0.0, 0.3],
        [-PI / 2, 0.02, 0.15, -0.2],
        [PI / 2, 0.0, 0.43, 0.0],
        [-PI / 2, 0.0, 0.0, 0.1],
        [0.0, 0.0, 0.05, 0.0],
    ]
)
# Modified rows have alpha and a of the previous link; the last link's are in the flange.
MODIFIED = np.column_stack([np.r_[0.0, STANDARD[:-1, 0]], np.r_[0.0, STANDARD[:-1, 1]], STANDARD[:, 2], STANDARD[:, 3]])
FLANGE = pose_from_xyz_rpy([0.01, -0.02, 0.03], [0.1, 0.2, 0.3])


def random_chain(rng: np.random.Generator, n: int = 6) -> Chain:
    return Chain.from_origins(
        rng.uniform(-0.5, 0.5, (n, 3)),
        rng.uniform(-PI, PI, (n, 3)),
        rng.normal(size=(n, 3)),
        pose_from_xyz_rpy(rng.uniform(-0.2, 0.2, 3), rng.uniform(-PI, PI, 3)),
        rng.uniform(-10.0, 10.0, 3),
    )


def test_standard_modified_and_origins_describe_the_same_arm():
    standard = Chain.from_standard_dh(STANDARD, FLANGE, GRAVITY)
    modified = Chain.from_modified_dh(MODIFIED, FLANGE, GRAVITY)
    # the same placements by hand: Rx(alpha) and the position in the previous frame, then the offset about z
    xyz = [[a, -d * np.sin(al), d * np.cos(al)] for al, a, d, _ in MODIFIED]
    rpy = []
    for al, _, _, off in MODIFIED:
        r = pose_from_xyz_rpy([0, 0, 0], [al, 0, 0]) @ pose_from_xyz_rpy([0, 0, 0], [0, 0, off])
        rpy.append([np.arctan2(r[2, 1], r[2, 2]), -np.arcsin(r[2, 0]), np.arctan2(r[1, 0], r[0, 0])])
    origins = Chain.from_origins(xyz, rpy, np.tile([0, 0, 2.0], (6, 1)), FLANGE, GRAVITY)
    rng = np.random.default_rng(1)
    for _ in range(5):
        q, dq, ddq = rng.normal(size=(3, 6))
        expected = modified.forward(q)[-1]
        regressor = payload_regressor(modified, q, dq, ddq)
        for other in (standard, origins):
            np.testing.assert_allclose(other.forward(q)[-1], expected, rtol=0, atol=1e-13)
            np.testing.assert_allclose(payload_regressor(other, q, dq, ddq), regressor, rtol=0, atol=1e-11)


def test_modified_rows_of_the_paper_put_the_flange_where_the_assumed_wrist_says():
    # joints 1 to 3 of Chen 2016, then er50's assumed wrist
    rows = [
        [PI, 0.0, 0.0, 0.0],
        [PI / 2, 0.16, 0.0, -PI / 2],
        [0.0, 0.68, 0.0, 0.0],
        [-PI / 2, 0.13, 0.74, 0.0],
        [PI / 2, 0.0, 0.0, 0.0],
        [-PI / 2, 0.0, 0.10, 0.0],
    ]
    chain = Chain.from_modified_dh(rows, np.eye(4), GRAVITY)
    q = np.array([0.3, -0.4, 0.7, 0.0, 0.0, 0.0])
    poses = chain.forward(q)
    in_frame_3 = np.linalg.inv(poses[2]) @ poses[6]
    np.testing.assert_allclose(in_frame_3[:3, 3], [0.13, 0.84, 0.0], atol=1e-12)
    np.testing.assert_allclose(poses[0][:3, 2], [0, 0, -1], atol=1e-12)  # axis 1 points down
    upright = chain.forward(np.zeros(6))
    np.testing.assert_allclose(upright[2][:3, 3], [0.16, 0.0, 0.68], atol=1e-12)  # upper arm up, world z up


def test_roll_pitch_yaw_turn_about_fixed_axes():
    pose = pose_from_xyz_rpy([1.0, 2.0, 3.0], [PI / 2, 0.0, PI / 2])
    # y: roll turns it to z, yaw leaves it there; x: roll leaves it, yaw turns it to y
    np.testing.assert_allclose(pose[:3, 1], [0, 0, 1], atol=1e-15)
    np.testing.assert_allclose(pose[:3, 0], [0, 1, 0], atol=1e-15)
    np.testing.assert_allclose(pose[:3, 3], [1, 2, 3])


def test_a_turned_frame_has_its_z_along_the_axis():
    chain = random_chain(np.random.default_rng(3))
    for joint in range(chain.n):
        turned = chain.turned_back(joint)
        np.testing.assert_allclose(turned @ turned.T, np.eye(3), atol=1e-12)
        np.testing.assert_allclose(turned @ chain.axis[joint], [0.0, 0.0, 1.0], atol=1e-12)


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 10_000))
def test_a_joint_turns_everything_behind_it_about_its_axis(seed):
    rng = np.random.default_rng(seed)
    chain = random_chain(rng)
    q = rng.normal(size=6)
    joint = int(rng.integers(6))
    before, after = chain.forward(q), chain.forward(q + np.eye(6)[joint] * 0.4)
    np.testing.assert_allclose(after[:joint], before[:joint])
    axis = before[joint][:3, :3] @ chain.axis[joint]
    np.testing.assert_allclose(after[joint][:3, :3] @ chain.axis[joint], axis, atol=1e-12)
    turn = after[6][:3, :3] @ before[6][:3, :3].T
    np.testing.assert_allclose(turn @ axis, axis, atol=1e-12)
    assert np.trace(turn) == pytest.approx(1 + 2 * np.cos(0.4), abs=1e-12)
    origin = before[joint][:3, 3]
    np.testing.assert_allclose(after[6][:3, 3] - origin, turn @ (before[6][:3, 3] - origin), rtol=0, atol=1e-12)


def test_the_head_is_the_same_arm_cut_short():
    chain = random_chain(np.random.default_rng(4))
    q = np.random.default_rng(5).normal(size=6)
    head = chain.head(3)
    assert head.n == 3
    np.testing.assert_allclose(head.forward(q[:3])[:3], chain.forward(q)[:3], atol=1e-14)
    np.testing.assert_array_equal(head.forward(q[:3])[3], head.forward(q[:3])[2])
    with pytest.raises(ModelError, match="expected 1 to 6"):
        chain.head(7)


def test_a_chain_does_not_change_with_the_arrays_it_was_made_from():
    rows, flange = STANDARD.copy(), FLANGE.copy()
    chain = Chain.from_standard_dh(rows, flange, GRAVITY)
    before = chain.forward(np.ones(6))
    rows[:] = 0.0
    flange[:] = 0.0
    np.testing.assert_array_equal(chain.forward(np.ones(6)), before)
    with pytest.raises(ValueError, match="read-only"):
        chain.flange[0, 3] = 1.0


NOT_A_ROTATION = np.diag([1.0, 1.0, 2.0, 1.0])
MIRRORED = np.diag([1.0, 1.0, -1.0, 1.0])


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"flange": NOT_A_ROTATION}, "flange is not a pose"),
        ({"flange": MIRRORED}, "flange is not a pose"),
        ({"placement": np.stack([np.eye(4), np.ones((4, 4))])}, "placement of joint 2 is not a pose"),
        ({"placement": np.zeros((0, 4, 4)), "axis": np.zeros((0, 3))}, "at least one joint"),
        ({"axis": np.array([[0, 0, 1.0], [0, 0, 0]])}, "axis of joint 2"),
        ({"axis": np.array([[0, 0, 1.0]])}, r"axis has shape \(1, 3\); expected \(2, 3\)"),
        ({"gravity_m_s2": np.array([0.0, np.nan, 0.0])}, "gravity_m_s2 contains a number that is not finite"),
        ({"gravity_m_s2": "down"}, "gravity_m_s2 is not an array of numbers"),
    ],
)
def test_a_chain_that_makes_no_sense_is_refused(change, words):
    good = {
        "placement": np.stack([np.eye(4), np.eye(4)]),
        "axis": np.array([[0, 0, 1.0], [0, 0, 1.0]]),
        "flange": np.eye(4),
        "gravity_m_s2": np.array(GRAVITY),
    }
    Chain(**good)
    with pytest.raises(ModelError, match=words):
        Chain(**{**good, **change})


def test_positions_of_the_wrong_number_are_refused():
    chain = Chain.from_standard_dh(STANDARD, FLANGE, GRAVITY)
    with pytest.raises(ModelError, match=r"q has shape \(5,\); expected \(6,\)"):
        chain.forward(np.zeros(5))


@pytest.mark.parametrize(
    "angles",
    [
        (0.1, -0.2, 0.3),
        (3.0, 1.5, -3.0),
        (-2.0, -1.5, 2.0),
        (0.0, 0.0, 0.0),
        (0.4, np.pi / 2, 0.0),
        (0.4, -np.pi / 2, 0.0),
    ],
)
def test_a_rotation_has_its_roll_pitch_and_yaw(angles):
    rotation = pose_from_xyz_rpy(np.zeros(3), angles)[:3, :3]
    np.testing.assert_allclose(rpy_rad(rotation), angles, atol=1e-7)


def test_in_gimbal_lock_the_yaw_is_part_of_the_roll():
    """Only their difference, or sum, is a rotation: Rz(y) Ry(90 deg) Rx(r) depends on r - y."""
    for pitch, sign in ((np.pi / 2, -1.0), (-np.pi / 2, 1.0)):
        rotation = pose_from_xyz_rpy(np.zeros(3), (0.5, pitch, 0.2))[:3, :3]
        np.testing.assert_allclose(rpy_rad(rotation), [0.5 + sign * 0.2, pitch, 0.0], atol=1e-7)


BASE = np.eye(4)


def test_the_hash_of_the_kinematics_tells_arms_apart_to_a_nanometre_and_ignores_gravity():
    def arm(x_m=0.3, gravity_m_s2=(0.0, 0.0, -9.81), flange=BASE):
        return Chain.from_origins([(x_m, 0.0, 0.0)], [(0.0, 0.0, 0.0)], [(0.0, 0.0, 1.0)], flange, gravity_m_s2)

    own = arm().kinematics_sha256
    assert arm(0.3 + 1e-11).kinematics_sha256 == own
    assert arm(gravity_m_s2=(9.81, 0.0, 0.0)).kinematics_sha256 == own
    assert arm(0.3 + 2e-9).kinematics_sha256 != own
    assert arm(flange=pose_from_xyz_rpy((0.0, 0.0, 2e-9), (0.0, 0.0, 0.0))).kinematics_sha256 != own
    assert arm(-0.0).kinematics_sha256 == arm(0.0).kinematics_sha256
