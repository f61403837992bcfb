"""Where the first excitations of an arm are looked for: no narrower than its meshes ask for."""

from dataclasses import replace

import numpy as np
import pytest

from armload_controller.analysis.robot_excitation import design_envelope
from armload_controller.config.robot import load_robot
from armload_controller.motion.obstacles import Obstacles
from armload_controller.new_robot.design_range import design_range

ROBOT = load_robot("prbt")
LIMITS = ROBOT.limits.motion


class Wall:
    """In place of meshes: they touch where the sine of the second joint is below a height."""

    keep_m = 0.02

    def __init__(self, height_m):
        self.height_m = height_m

    def distances(self, q):
        return np.array([np.sin(q[1]) - self.height_m])


def robot(meshes):
    made = replace(ROBOT)
    made.__dict__["obstacles"] = Obstacles(ROBOT.workspace, meshes)
    return made


def range_of(arm):
    return design_range(arm, design_envelope(arm))


def test_where_no_mesh_objects_the_whole_ranges_are_left():
    whole = np.array([LIMITS.position_min_rad, LIMITS.position_max_rad])
    np.testing.assert_array_equal(range_of(robot(None)), whole)
    np.testing.assert_array_equal(range_of(robot(Wall(-2.0))), whole)


@pytest.mark.parametrize("height_m", [-0.5, 0.0, 0.5])
def test_what_is_left_is_clear_of_meshes_in_nearly_every_pose(height_m):
    low, high = range_of(robot(Wall(height_m)))
    assert (low >= LIMITS.position_min_rad).all()
    assert (high <= LIMITS.position_max_rad).all()
    assert (low < high).all()
    poses = np.random.default_rng(5).uniform(low, high, (300, 6))
    clear = np.sin(poses[:, 1]) - height_m >= Wall.keep_m
    assert clear.mean() > 0.85
    whole = LIMITS.position_max_rad - LIMITS.position_min_rad
    assert (high - low < whole).any()


def test_where_meshes_object_everywhere_the_narrowest_is_left_to_the_design():
    low, high = range_of(robot(Wall(2.0)))
    assert (high - low <= 0.26 * (LIMITS.position_max_rad - LIMITS.position_min_rad)).all()
