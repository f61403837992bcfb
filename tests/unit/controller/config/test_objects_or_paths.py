"""Arguments that are objects, or the names and paths that they are read from."""

from types import SimpleNamespace

import numpy as np
import pytest

from armload_controller.config.chain_from_urdf import UrdfArm
from armload_controller.config.objects_or_paths import arm_of, payload_from, recording_of, robot_of, several_runs
from armload_controller.config.robot import load_robot
from armload_identification.files.payload_file import write_payload
from armload_identification.recording.recording import Recording
from tests.five_joints import URDF

TIME_S = np.linspace(0.0, 2.0, 41)
RUN = Recording.from_arrays(TIME_S, np.outer(np.sin(TIME_S), np.ones(6)), torque_nm=np.ones((41, 6)))


def test_one_run_or_a_table_is_a_list_of_one(tmp_path):
    assert several_runs(RUN) == [RUN]
    assert several_runs("runs.csv") == ["runs.csv"]
    assert several_runs(tmp_path) == [tmp_path]
    both = ("a.mcap", RUN)
    assert several_runs(both) is both
    for wrong in (3, [RUN, 3], None, {"a.mcap"}):
        with pytest.raises(TypeError, match=r"runs.*recordings, their paths, or the path of a table"):
            several_runs(wrong)


def test_a_robot_is_an_object_a_name_or_a_path(edited):
    robot = load_robot("er50")
    assert robot_of(robot) is arm_of(robot) is robot
    assert robot_of("er50").sha256 == robot.sha256
    assert arm_of(edited("[robot]", "[robot]")).name == "er50"
    for wrong in (3, None, RUN):
        with pytest.raises(TypeError, match="a Robot, the name of a shipped robot"):
            arm_of(wrong)


def test_a_urdf_is_told_from_a_robots_file_by_its_content(tmp_path, edited):
    path = tmp_path / "arm.toml"
    path.write_text(URDF.replace('"hand"', '"tool0"'))
    arm = arm_of(path)
    assert isinstance(arm, UrdfArm)
    assert arm_of(arm) is arm
    with pytest.raises(TypeError):
        robot_of(arm)


def test_a_recording_gets_the_arms_joints(tmp_path):
    arm = SimpleNamespace(own=lambda run: ("own", run))
    assert recording_of(arm, RUN, "loaded") == ("own", RUN)
    with pytest.raises(TypeError, match=r"loaded.*a Recording \(read_recording, Recording\.from_arrays\)"):
        recording_of(arm, 3, "loaded")


def test_a_payload_is_itself_a_result_or_a_file(tmp_path, make_subject):
    payload = make_subject().payload
    assert payload_from(payload, "payload") is payload
    assert payload_from(SimpleNamespace(payload=payload), "payload") is payload
    write_payload(tmp_path / "payload.toml", payload)
    for path in (tmp_path / "payload.toml", str(tmp_path / "payload.toml")):
        np.testing.assert_allclose(payload_from(path, "payload").model.theta, payload.model.theta)
    for wrong in (3, SimpleNamespace(payload=3), None):
        with pytest.raises(TypeError, match=r"minus.*a payload \(read_payload\)"):
            payload_from(wrong, "minus")
