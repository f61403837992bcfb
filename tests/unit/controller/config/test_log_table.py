"""`[log]`: meaning of the columns of other programs' logs."""

from __future__ import annotations

import pytest

from armload_controller.config.robot import load_robot
from armload_controller.control_errors import ConfigurationError

OLD = """time_column = 0
position_columns = [1, 2, 3, 4, 5, 6]
velocity_columns = [7, 8, 9, 10, 11, 12]
current_columns = [13, 14, 15, 16, 17, 18]
"""
NAMES = '["q1", "q2", "q3", "q4", "q5", "q6"]'


def test_columns_have_numbers_or_names_and_torque_is_one_of_them(edited):
    new = f'time_column = "t"\nposition_columns = {NAMES}\ntorque_columns = [7, 8, 9, 10, 11, 12]\n'
    columns = load_robot(str(edited(OLD, new, robot="ur10e"))).csv_columns
    assert columns.groups == {
        "time_s": ["t"],
        "position_rad": ["q1", "q2", "q3", "q4", "q5", "q6"],
        "torque_nm": [7, 8, 9, 10, 11, 12],
    }


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (
            "current_columns = [13, 14, 15, 16, 17, 18]\n",
            "",
            "current_columns.*either current_columns or torque_columns",
        ),
        ("current_columns =", "torque_columns = [1, 2, 3, 4, 5, 6]\ncurrent_columns =", "either current_columns or"),
        ("current_columns = [13, ", "current_columns = [", "current_columns.*expected 6 columns, as position_columns"),
        ("time_column = 0", "time_column = -1", "log.time_column"),
        ("time_column = 0", 'time_column = ""', "log.time_column"),
        ("position_columns = [1, 2, 3, 4, 5, 6]", "position_columns = []", "log.position_columns"),
    ],
)
def test_maps_that_make_no_sense_are_refused(edited, old, new, said):
    with pytest.raises(ConfigurationError, match=said):
        load_robot(str(edited(old, new, robot="ur10e")))
