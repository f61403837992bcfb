"""Joint ranges for the first excitations of an arm: no narrower than its meshes require."""

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
    """Replaces meshes: there is contact if the sine of the second joint is below a height."""

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
    for arm in (robot(None), robot(Wall(-2.0))):
        np.testing.assert_array_equal(range_of(arm)[0][0], whole)


@pytest.mark.parametrize("height_m", [-0.5, 0.0, 0.5])
def test_what_is_left_is_clear_of_meshes_in_nearly_every_pose(height_m):
    boxes, roomiest_rad = range_of(robot(Wall(height_m)))
    low, high = boxes[0]
    assert np.sin(roomiest_rad[1]) - height_m > Wall.keep_m
    assert (low >= LIMITS.position_min_rad).all()
    assert (high <= LIMITS.position_max_rad).all()
    assert (low < high).all()
    poses = np.random.default_rng(5).uniform(low, high, (300, 6))
    clear = np.sin(poses[:, 1]) - height_m >= Wall.keep_m
    assert clear.mean() > 0.85
    whole = LIMITS.position_max_rad - LIMITS.position_min_rad
    assert (high - low < whole).any()


def test_where_meshes_object_everywhere_the_narrowest_is_left_to_the_design():
    low, high = range_of(robot(Wall(2.0)))[0][-1]
    assert (high - low <= 0.26 * (LIMITS.position_max_rad - LIMITS.position_min_rad)).all()


def test_the_next_is_clear_of_everything_and_so_is_the_pose_that_an_arm_stands_in():
    arm = robot(Wall(-0.5))
    (boxes, roomiest_rad), envelope = range_of(arm), design_envelope(arm)
    low, high = boxes[-1]
    poses = np.vstack([roomiest_rad, np.random.default_rng(5).uniform(low, high, (300, 6))])
    still = np.zeros_like(poses)
    clear = (envelope.workspace.clearances(poses) >= envelope.workspace.keep_m).all(axis=1)
    strong = (envelope.torque.demand(poses, still, still) <= np.tile(envelope.torque.available_nm, 4)).all(axis=1)
    room = clear & strong & (np.sin(poses[:, 1]) + 0.5 >= Wall.keep_m)
    assert room[0]
    assert room.mean() > 0.85
