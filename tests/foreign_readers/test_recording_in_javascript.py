"""A recording read with the MCAP library of the Foxglove application, which is independent of the writer's.

`.ci/run` installs that library in a copy of this folder (`npm ci`) and passes the copy's path.
"""

import json
import os
import subprocess
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from armload_controller.config.robot import load_robot
from armload_controller.cycle.arm_frames import ArmFrames
from armload_controller.cycle.run_recorder import Recorder
from armload_controller.motion.phase import Segment
from armload_drivers.servos import JointCommand, JointFeedback

FOLDER = Path(os.environ.get("ARMLOAD_FOREIGN_READERS", "not-given"))
START_NS = 1_700_000_000_000_000_000

pytestmark = pytest.mark.skipif(
    not (FOLDER / "node_modules").is_dir(), reason="ARMLOAD_FOREIGN_READERS names no folder with npm's @mcap/core"
)


def test_arm_in_3d_rows_and_attachments_are_read(tmp_path):
    robot = load_robot("er50")
    n, path = robot.n, tmp_path / "run.mcap"
    still, missing = np.zeros(n), np.zeros(n, dtype=bool)
    position = np.sin(0.02 * np.arange(200)[:, None] + np.arange(n))
    frames = ArmFrames(robot.chain, robot.joint_names)
    with Recorder(path, {"run.json": '{"robot": "er50"}'}, frames=frames, clock_ns=lambda: START_NS) as recorder:
        recorder.attach("way_round.json", '{"via_points_rad": []}')
        for cycle, q in enumerate(position):
            feedback = JointFeedback(
                cycle, 0.01 * cycle, q, still, q + cycle, None, np.full(n, 0x1637, np.uint16), missing
            )
            recorder.write(feedback, JointCommand(q, still, still), Segment.PERIODS, 0.01 * cycle)
    done = subprocess.run(["node", FOLDER / "read_recording.mjs", path], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)

    assert found["attachments"] == {"run.json": '{"robot": "er50"}', "way_round.json": '{"via_points_rad": []}'}
    kinds = {channel["topic"]: channel for channel in found["channels"]}
    assert {(kind["encoding"], kind["schemaEncoding"]) for kind in kinds.values()} == {("json", "jsonschema")}
    assert kinds["/frames"]["schema"] == "foxglove.FrameTransforms"
    assert kinds["/frames"]["properties"] == ["transforms"]
    rows = [message for message in found["messages"] if message["topic"] == "/joints"]
    assert len(rows) == 200
    assert set(rows[0]["body"]) <= set(kinds["/joints"]["properties"])
    np.testing.assert_array_equal([row["body"]["position_rad"] for row in rows], position)
    assert [int(row["logTime"]) - START_NS for row in rows] == [10_000_000 * cycle for cycle in range(200)]

    shown = [message for message in found["messages"] if message["topic"] == "/frames"]
    assert len(found["messages"]) == len(rows) + len(shown) == int(found["messageCount"])
    assert 37 <= len(shown) <= 40
    for message in shown:
        cycle = (int(message["logTime"]) - START_NS) // 10_000_000
        np.testing.assert_allclose(_flange(message), robot.chain.forward(position[cycle])[-1], atol=1e-9)


def _flange(message):
    """Pose of the flange in the base frame, composed from the links' transforms."""
    pose, frame = np.eye(4), "base"
    for link in message["body"]["transforms"]:
        assert link["parent_frame_id"] == frame
        assert str(link["timestamp"]["sec"] * 10**9 + link["timestamp"]["nsec"]) == message["logTime"]
        step = np.eye(4)
        step[:3, :3] = Rotation.from_quat([link["rotation"][key] for key in "xyzw"]).as_matrix()
        step[:3, 3] = [link["translation"][key] for key in "xyz"]
        pose, frame = pose @ step, link["child_frame_id"]
    assert frame == "flange"
    return pose
