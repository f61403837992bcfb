"""A robot's file: what it lacks is said with its name."""

import pytest

from armload_controller.config.robot import load_robot
from armload_controller.control_errors import ConfigurationError

PRBT = load_robot("prbt")


def test_joints_chain_and_tables_are_those_of_the_file():
    assert PRBT.n == len(PRBT.joint_names) == 6
    assert PRBT.joint_names[0] == "prbt_joint_1"
    assert PRBT.chain is PRBT.chain
    assert PRBT.chain.gravity_m_s2.tolist() == [0.0, 0.0, -9.81]
    assert PRBT.bus is PRBT.tables.bus
    assert PRBT.simulation_table is PRBT.tables.simulation


@pytest.mark.parametrize(
    ("key", "read", "words"),
    [
        ("bus", lambda robot: robot.bus, "known from logs only, for `armload identify`. To move it, add [bus] and a"),
        ("simulation", lambda robot: robot.simulation_table, "this robot has no simulated twin"),
    ],
)
def test_a_table_that_is_missing_is_named(key, read, words):
    without = PRBT.with_tables(**{key: None})
    assert getattr(PRBT.tables, key) is not None
    with pytest.raises(ConfigurationError) as caught:
        read(without)
    assert str(caught.value).startswith(f"{PRBT.file}: {key}")
    assert words in str(caught.value)
