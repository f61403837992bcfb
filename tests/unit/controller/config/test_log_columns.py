"""Which columns of a table are read: those of its header, or those of the robot's [log]."""

import numpy as np
import pytest

from armload_controller.config.robot import load_robot
from armload_controller.config.robot_recordings import RecordingChoice, read_of
from armload_identification.identification_errors import RecordingError

UR10E = load_robot("ur10e")
BY_NUMBER = ["t", *(f"a{n}" for n in range(18))]
RTDE = [
    "timestamp",
    *(f"{name}_{n}" for name in ("target_qdd", "actual_q", "actual_qd", "actual_current") for n in range(6)),
]


def table(path, header, columns):
    rng = np.random.default_rng(4)
    values = np.column_stack([np.arange(200) / 125.0, rng.uniform(-1, 1, (200, columns - 1))])
    lines = [",".join(map(repr, row)) for row in values.tolist()]
    path.write_text("\n".join(([",".join(header)] if header else []) + lines) + "\n")
    return values


@pytest.mark.parametrize("header", [None, BY_NUMBER], ids=["no header", "a header without known names"])
def test_the_numbers_of_the_robot_are_those_of_a_table_without_names(tmp_path, header):
    values = table(tmp_path / "run.csv", header, 19)
    run = read_of(UR10E, tmp_path / "run.csv")
    np.testing.assert_allclose(run.current_a, values[:, 13:19])


def test_a_header_that_names_the_columns_comes_before_the_robots_numbers(tmp_path):
    """Column 13 of UR's recorder is no current: a loaded run was then said to carry nothing."""
    values = table(tmp_path / "run.csv", RTDE, 25)
    run = read_of(UR10E, tmp_path / "run.csv")
    np.testing.assert_allclose(run.position_rad, values[:, 7:13])
    np.testing.assert_allclose(run.current_a, values[:, 19:25])


def test_a_header_that_leaves_something_open_is_asked_about(tmp_path):
    open_question = [name.replace("actual_current", "current [xx]") for name in RTDE]
    table(tmp_path / "run.csv", open_question, 25)
    with pytest.raises(RecordingError, match="--columns"):
        read_of(UR10E, tmp_path / "run.csv")


def test_a_joint_beyond_the_recordings_is_named_as_it_was_given(tmp_path):
    table(tmp_path / "run.csv", None, 19)
    with pytest.raises(RecordingError, match=r"no joint 7, the recording has 6.*Correct `joints=`"):
        read_of(UR10E, tmp_path / "run.csv", RecordingChoice(joints=(0, 6)))
    run = read_of(UR10E, tmp_path / "run.csv", RecordingChoice(joints=(5, 4, 3, 2, 1, 0)))
    assert run.n == 6
