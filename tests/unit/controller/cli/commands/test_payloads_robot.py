"""A payload belongs to the robot on which it was identified; its file is not overwritten by another robot's."""

import re
import shutil
from pathlib import Path

import numpy as np
import pytest

from armload_controller.config.robot import load_robot
from armload_controller.control_errors import CommissioningError
from armload_identification.files.payload_file import read_payload
from armload_identification.model.chain import Chain

CONFIGS = Path(__file__).parents[5] / "configs" / "armload_configs"


@pytest.fixture
def today(recorded_er50):
    return recorded_er50 / "runs" / "today"


@pytest.fixture
def sister(tmp_path):
    """er50 under another name, and er50 with a flange 10 mm farther out; without excitations."""
    text = (CONFIGS / "er50.toml").read_text("utf-8")
    text = text[: text.index("[excitation]")] + text[text.index("[bus]") :]
    renamed = tmp_path / "sister.toml"
    renamed.write_text(text.replace('name = "er50"', 'name = "er51"', 1))
    moved = tmp_path / "moved.toml"
    moved.write_text(text.replace("flange = { xyz_m = [0.0, 0.0, 0.0]", "flange = { xyz_m = [0.0, 0.0, 0.01]", 1))
    return renamed, moved


def test_a_payload_names_its_robot_and_its_kinematics(today):
    known = read_payload(today / "payload.toml").provenance
    assert known.robot == "er50"
    assert known.kinematics_sha256 == load_robot("er50").chain.kinematics_sha256


def test_the_hash_is_of_the_kinematics_and_not_of_how_the_base_stands():
    chain = load_robot("er50").chain
    tilted = Chain(chain.placement, chain.axis, chain.flange, np.array([0.0, 9.81, 0.0]))
    assert tilted.kinematics_sha256 == chain.kinematics_sha256
    farther = chain.flange.copy()
    farther[2, 3] += 1e-4
    assert Chain(chain.placement, chain.axis, farther, chain.gravity_m_s2).kinematics_sha256 != chain.kinematics_sha256


@pytest.mark.parametrize("command", ["export", "validate", "feedforward"])
def test_another_robots_payload_is_refused_by_name(armload, today, sister, tmp_path, command):
    pair = ["--loaded", today / "loaded_validation.mcap", "--unloaded", today / "unloaded_validation.mcap"]
    more = {
        "export": ["--format", "kuka", "--output", tmp_path / "out"],
        "validate": pair,
        "feedforward": ["--excitation", CONFIGS / "er50_validation.toml"],
    }[command]
    renamed, moved = sister

    def words(robot):
        if command == "export":
            return ["export", robot, today / "payload.toml", *more]
        named = [command, "trial"] if command == "feedforward" else [command]
        return [*named, robot, today / "payload.toml", *more]

    refused = armload(*words(renamed))
    assert refused.exit_code == 1, refused.output
    assert "identified on the robot 'er50', not on 'er51'" in str(refused.exception)
    refused = armload(*words(moved))
    assert "identified on er50 with [kinematics] that differ" in str(refused.exception)


def test_a_payload_whose_file_does_not_name_a_robot_is_taken(armload, today, sister, tmp_path):
    """Files of earlier versions do not name it."""
    text = (today / "payload.toml").read_text("utf-8")
    old = tmp_path / "old.toml"
    old.write_text(re.sub(r"^(robot|kinematics_sha256) = .*\n", "", text, flags=re.MULTILINE))
    result = armload("export", sister[0], old, "--format", "kuka", "--output", tmp_path / "out")
    assert result.exit_code == 0, result.output


def test_identify_asks_before_it_replaces_another_payload(armload, today, tmp_path):
    def identify(role, *more):
        pair = ["--loaded", today / f"loaded_{role}.mcap", "--unloaded", today / f"unloaded_{role}.mcap"]
        return armload("identify", "er50", *pair, "--output", file, *more)

    file = tmp_path / "payload.toml"
    shutil.copy(today / "payload.toml", file)
    before = file.read_bytes()
    assert identify("identification").exit_code == 0, "the same recordings are the same payload"
    file.write_bytes(before)
    refused = identify("validation")
    assert isinstance(refused.exception, CommissioningError)
    assert re.search(r"holds another payload \(9\.\d+ kg, from .*--force", str(refused.exception))
    assert file.read_bytes() == before
    assert identify("validation", "--force").exit_code == 0
    assert file.read_bytes() != before
    file.write_text("notes of mine\n")
    assert "is not a payload file" in str(identify("validation").exception)
    assert file.read_text() == "notes of mine\n"
