"""`armload watch` on the controller of a UR arm and on a ROS 2 topic: recorded rows, refusals, what is published."""

from __future__ import annotations

import json
import sys
from types import SimpleNamespace

import numpy as np
import pytest
from mcap.reader import make_reader

from armload_controller.control_errors import CommissioningError
from armload_controller.session.joint_feeds import rtde_feed
from armload_drivers.driver_errors import BusError
from armload_identification.recording.file_reading import read_recording_file
from armload_identification.recording.run_format import TOPIC
from tests.rtde_controller import Controller, row

JOINTS = ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3")


def test_what_the_controller_sends_is_recorded_and_what_it_was_told_is_shown(armload, tmp_path):
    rows = [
        row(7.0 + 0.002 * k, (0.001 * k,) * 6, (0.5 + k,) * 6, payload_kg=2.25, moment=(2.0 + k,) * 6)
        for k in range(600)
    ]
    path = tmp_path / "shift.mcap"
    with Controller(rows).listening() as address:
        run = armload("watch", "ur10e", "--rtde", address, "--record", path, "--load", "loaded", "--json")
    assert isinstance(run.exception, BusError), "the controller has closed the connection"
    recording = read_recording_file(path.with_suffix(".partial.mcap"))
    assert recording.joint_names == JOINTS
    assert recording.source.run()["load"] == "loaded"
    assert recording.size == len(rows)
    assert np.array_equal(recording.position_rad[:, 2], [each["actual_q"][2] for each in rows])
    assert np.array_equal(recording.current_a[:, 5], [each["actual_current"][5] for each in rows])
    assert recording.torque_nm is None, "what the controller calculated is not measured"
    with path.with_suffix(".partial.mcap").open("rb") as file:
        messages = [json.loads(message.data) for _, _, message in make_reader(file).iter_messages(TOPIC)]
    assert [each["target_torque_nm"][1] for each in messages] == [2.0 + k for k in range(600)]
    documents = [json.loads(line) for line in run.stdout.splitlines() if line.startswith("{")]
    assert documents[0]["bus"]["told"] == {"mass_kg": 2.25, "center_of_mass_m": [0.0, 0.1, 0.2]}
    assert documents[0]["bus"]["lost"] == 0


def test_an_arm_of_other_joints_has_no_rtde():
    arm = SimpleNamespace(n=7, file="seven.toml")
    with pytest.raises(CommissioningError, match=r"seven.toml: 7 joints.*which have 6"), rtde_feed(arm, "127.0.0.1:1"):
        pass


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (["--rtde", "h", "--ros2", "/j"], "the joints come from one place"),
        (["--rtde", "h", "--bus", "socketcan:can0"], "the joints come from one place"),
        (["--rtde", "h", "--effort", "current"], "requires --ros2"),
        (["--ros2", "/j", "--effort", "power", "--record", "x.mcap"], "'power': expected one of 'torque', 'current'"),
        (["a.mcap", "--ros2", "/j"], "cannot be combined with a RECORDING"),
    ],
)
def test_options_that_make_no_sense(armload, words, text):
    run = armload("watch", "ur10e", *words)
    assert run.exit_code == 2
    assert text in " ".join(run.output.split())


def test_the_name_of_a_topic_is_checked(armload, tmp_path, monkeypatch):
    pytest.importorskip("cyclonedds", reason="needs the extra ros2")
    monkeypatch.setenv("ROS_LOCALHOST_ONLY", "1")
    run = armload("watch", "ur10e", "--ros2", "joint_states", "--record", tmp_path / "x.mcap")
    assert isinstance(run.exception, BusError)
    assert "ros2 topic list" in str(run.exception)


def test_without_the_extra_it_is_named(armload, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "cyclonedds.core", None)
    for name in [name for name in sys.modules if name.startswith("armload_drivers.feeds.ros2")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.delitem(sys.modules, "armload_controller.session.ros2_publisher", raising=False)
    run = armload("watch", "ur10e", "--ros2", "/joint_states", "--record", tmp_path / "x.mcap")
    assert isinstance(run.exception, CommissioningError)
    assert 'pip install "armload[ros2]"' in str(run.exception)
