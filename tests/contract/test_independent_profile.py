"""The simulated drives of the shipped arms under canopen's own CiA 402 profile, in one process in real time."""

import numpy as np
import pytest

from armload_controller.config.robot import load_robot
from tests.ideal_plant import IdealPlant
from tests.independent_master import Master, description, network_with_drives


@pytest.mark.parametrize(
    ("robot", "mode", "split"),
    [
        ("er50", "CYCLIC SYNCHRONOUS POSITION", True),
        ("prbt", "INTERPOLATED POSITION", False),
        pytest.param("er50", "CYCLIC SYNCHRONOUS POSITION", False, marks=pytest.mark.long),
        pytest.param("prbt", "INTERPOLATED POSITION", True, marks=pytest.mark.long),
    ],
)
def test_a_node_is_booted_enabled_moved_by_a_degree_and_disabled(tmp_path, robot, mode, split):
    arm = load_robot(robot).drives.settings
    start = np.array([0.1, -0.2, 0.3, 0.0, 0.5, -0.1])
    plant = IdealPlant(start)
    with network_with_drives(arm, plant) as network:
        master = Master(network, arm.drives[2].node_id, description(tmp_path / "drive.eds"))
        master.boot()
        turn = master.counts_per_turn()
        degree = round(turn / 360.0)
        master.configure(mode, split)
        begin = master.enable()
        assert plant.powered == [axis == 2 for axis in range(6)]
        np.testing.assert_allclose(plant.position_rad, start, atol=2.0 * np.pi / turn)
        assert master.move(degree) == begin + degree
        np.testing.assert_allclose(plant.position_rad[2] - start[2], np.deg2rad(1.0), rtol=1e-3)
        master.disable()
        assert not any(plant.powered)
        master.leave()
