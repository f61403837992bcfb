"""`[workspace]` of a robot file: spheres and obstacles, and refusal of wrong ones."""

from __future__ import annotations

import numpy as np
import pytest

from armload_controller.config.robot import load_robot
from armload_controller.control_errors import ConfigurationError


def test_er50_stands_a_metre_above_the_floor_on_a_pedestal():
    workspace = load_robot("er50").workspace
    assert {"floor", "pedestal", "link 1 to tool"} <= set(workspace.names)
    stretched = np.array([[0.0, 1.5707963, -1.5707963 + 0.176, 0.0, 0.0, 0.0]])
    floor = workspace.clearances(stretched)[0, [name == "floor" for name in workspace.names]]
    centre = workspace.centres(stretched[0])[:, 2]
    assert floor.min() == pytest.approx(
        min(c + 1.0 - s.radius_m for c, s in zip(centre, workspace.spheres, strict=True))
    )


def test_a_robot_without_a_workspace_has_nothing_in_its_way():
    arm = load_robot("ur10e")
    assert not arm.has_workspace
    assert arm.workspace.names == ()


def test_planes_boxes_and_cells_become_obstacles(edited):
    more = """[workspace]
inside = { min_m = [-1.0, -1.1, -0.1], max_m = [1.0, 1.1, 1.5] }
half_spaces = [{ name = "wall", normal = [0.0, -3.0, 0.0], offset_m = -0.8, links = [5, "tool"] }]
boxes = [{ name = "table", xyz_m = [0.9, 0.0, 0.0], rpy_rad = [0.0, 0.0, 0.3], size_m = [0.4, 0.4, 0.4] }]
"""
    workspace = load_robot(edited("[workspace]\n", more, "prbt")).workspace
    assert {"inside, -x", "inside, +z", "wall", "table", "floor"} <= set(workspace.names)
    q = np.zeros((1, 6))
    height = workspace.centres(q[0])[:, 2]
    found = workspace.clearances(q)[0, [name == "inside, +z" for name in workspace.names]]
    moving = [(z, s.radius_m) for z, s in zip(height, workspace.spheres, strict=True) if s.link > 0]
    assert found.min() == pytest.approx(min(1.5 - z - radius for z, radius in moving))
    assert workspace.names.count("wall") == 2
    assert workspace.half_spaces[-1].normal.tolist() == [0.0, -1.0, 0.0]


@pytest.mark.parametrize(
    ("robot", "old", "new", "key", "words"),
    [
        ("prbt", 'link = "tool"', 'link = "gripper"', "workspace.spheres[12].link", "tool"),
        ("prbt", 'link = "tool"', "link = 5", "workspace.spheres", "link = tool"),
        ("prbt", "link = 3,", "link = 2,", "workspace.spheres", "link = 3"),
        ("prbt", "link = 6,", "link = 7,", "workspace.spheres[11].link", '0 (the base) to 6, or "tool"'),
        ("prbt", "[0, 4]", "[0, 9]", "workspace.apart[1]", '"tool"'),
        ("prbt", "[0, 4]", "[0, 4, 5]", "workspace.apart[1]", "2 items"),
        ("prbt", "radius_m = 0.12", "radius_m = 0.0", "workspace.spheres[1].radius_m", "greater than 0"),
        ("prbt", "keep_m = 0.02", "", "workspace.keep_m", "required"),
        ("prbt", "keep_m = 0.02", "keep_m = -1.0", "workspace.keep_m", "0"),
        ("prbt", "floor_height_m", "floor_m", "workspace.floor_m", "did you mean floor_height_m"),
        ("er50", "size_m = [0.6, 0.6, 0.6]", "size_m = [0.6, 0.0, 0.6]", "workspace.boxes[1].size_m[2]", "greater"),
        ("er50", 'links = [2, 3, 4, 5, 6, "tool"]', "links = [8]", "workspace.boxes[1].links", '"tool"'),
        ("er50", 'links = [2, 3, 4, 5, 6, "tool"]', "links = [0]", "workspace", "'pedestal' has no effect"),
        ("prbt", "[[body.links]]\nmass_kg = 0.02", "[[skip]]\nmass_kg = 0.02", "skip", "unknown"),
        ("prbt", "coulomb_nm = 7.0\nviscous", "coulomb_nm = 21.0\nviscous", "body.links[6].coulomb_nm", "20.1"),
        ("prbt", "coulomb_nm = 7.0\nviscous", "viscous", "body.links[6].coulomb_nm", "required"),
        (
            "prbt",
            "torque_max_nm = 370.0",
            "torque_max_nm = 370.0\narm_torque_share = 0.5",
            "joints[1].arm_torque_share",
            "not both",
        ),
        ("er50", "arm_torque_share = 0.35", "arm_torque_share = 1.0", "joints[1].arm_torque_share", "less than 1"),
        ("er50", "mass_kg = 16.0", "mass_kg = 17.0", "heaviest_payload.mass_kg", "rated_payload_kg = 16"),
        ("er50", "mass_kg = 3.0 ", "mass_kg = 30.0 ", "payload_set.gripper.mass_kg", "rated_payload_kg = 16"),
        (
            "er50",
            "gravity_m_s2 = [0.0, 0.0, -9.81]",
            "gravity_m_s2 = [0.0, 0.0, 0.0]",
            "workspace.floor_height_m",
            "vertical",
        ),
    ],
)
def test_what_is_wrong_is_named(edited, robot, old, new, key, words):
    with pytest.raises(ConfigurationError) as caught:
        load_robot(edited(old, new, robot))
    assert caught.value.key == key
    assert words in str(caught.value)
