"""The files that a fleet's result depends on, by their contents."""

import hashlib

import pytest

from armload_controller.fleet.robot_dependencies import RobotFiles


def sha256(text):
    return hashlib.sha256(text.encode()).hexdigest()


@pytest.mark.parametrize(
    ("text", "calibration"),
    [
        ('[robot]\ncalibration = "arm.toml"\n', sha256("calibration")),
        ('[robot]\ncalibration = "none.toml"\n', "cannot be read"),
        ("[robot]\ncalibration = 5\n", ""),
        ('robot = "arm.toml"\n', ""),
        ("not TOML", ""),
        ("a = " + "[" * 3000, ""),
    ],
)
def test_a_robot_is_its_file_and_the_calibration_that_it_names(tmp_path, text, calibration):
    path = tmp_path / "robot.toml"
    path.write_text(text)
    (tmp_path / "arm.toml").write_text("calibration")
    assert RobotFiles.of(str(path)) == RobotFiles((sha256(text),), calibration)


def test_the_profiles_beside_it_are_part_of_a_robot(tmp_path):
    text = "".join(f'[[joints]]\ndrive.profile = "{name}.toml"\n' for name in ("mine", "none", "mine"))
    path = tmp_path / "robot.toml"
    path.write_text(text)
    (tmp_path / "mine.toml").write_text("profile")
    assert RobotFiles.of(str(path)) == RobotFiles((sha256(text), sha256("profile"), "cannot be read"), "")


def test_a_shipped_robot_is_its_name():
    assert RobotFiles.of("er50") == RobotFiles(("er50",), "")


def test_a_robot_that_cannot_be_read_is_an_error(tmp_path):
    with pytest.raises(OSError, match="none"):
        RobotFiles.of(str(tmp_path / "none.toml"))
