"""The frames that Foxglove shows: chained, they are the chain's own poses."""

import json

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from armload_controller.cycle.arm_frames import ArmFrames
from armload_identification.model.chain import Chain

pytestmark = pytest.mark.pure

NAMES = ("shoulder", "elbow", "wrist")


def chained(message):
    """The pose of every frame in the first, and the frames' names."""
    pose, names, poses = np.eye(4), [], []
    for edge in json.loads(message)["transforms"]:
        step = np.eye(4)
        step[:3, :3] = Rotation.from_quat([edge["rotation"][key] for key in "xyzw"]).as_matrix()
        step[:3, 3] = [edge["translation"][key] for key in "xyz"]
        pose = pose @ step
        names.append((edge["parent_frame_id"], edge["child_frame_id"]))
        poses.append(pose)
    return names, poses


def test_chained_they_are_the_poses_of_joints_and_flange(any_arm):
    rng = np.random.default_rng(7)
    for _ in range(5):
        chain, _ = any_arm(rng, 3)
        q = rng.uniform(-3.0, 3.0, 3)
        names, poses = chained(ArmFrames(chain, NAMES).message(q, 0))
        assert names == [("base", "shoulder"), ("shoulder", "elbow"), ("elbow", "wrist"), ("wrist", "flange")]
        np.testing.assert_allclose(poses, chain.forward(q), atol=1e-9)


@pytest.mark.parametrize("axis", [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (0.6, 0.0, -0.8)])
def test_half_turns_between_frames_are_exact(axis):
    half = np.eye(4)
    half[:3, :3] = Rotation.from_rotvec(np.pi * np.array(axis)).as_matrix()
    chain = Chain(np.stack([half] * 3), np.tile([0.0, 0.0, 1.0], (3, 1)), half, np.array([0.0, 0.0, -9.81]))
    _, poses = chained(ArmFrames(chain, NAMES).message(np.zeros(3), 0))
    np.testing.assert_allclose(poses, chain.forward(np.zeros(3)), atol=1e-12)


def test_a_stamp_is_seconds_and_the_rest_in_nanoseconds(any_arm):
    chain, _ = any_arm(np.random.default_rng(1), 3)
    message = json.loads(ArmFrames(chain, NAMES).message(np.zeros(3), 1_700_000_000_000_000_123))
    assert {(edge["timestamp"]["sec"], edge["timestamp"]["nsec"]) for edge in message["transforms"]} == {
        (1_700_000_000, 123)
    }
