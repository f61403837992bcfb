"""`[kinematics]` and `[transmission]` of a robot file, each convention against transforms written down here."""

from pathlib import Path

import numpy as np
import pytest

from armload_controller.config.robot import load_robot
from armload_controller.control_errors import ConfigurationError


def turn(axis, angle):
    """(4, 4) rotation about an axis of the frame."""
    c, s = np.cos(angle), np.sin(angle)
    pose = np.eye(4)
    a, b = [(1, 2), (2, 0), (0, 1)][axis]
    pose[[a, b], [a, b]] = c
    pose[a, b], pose[b, a] = -s, s
    return pose


def move(x, y, z):
    pose = np.eye(4)
    pose[:3, 3] = x, y, z
    return pose


Q = np.array([0.3, -0.2, 0.5, 0.7, -0.4, 0.2])
ROWS = [
    (np.pi, 0.0, 0.0, 0.0),
    (np.pi / 2, 0.16, 0.0, -np.pi / 2),
    (0.0, 0.68, 0.0, 0.0),
    (-np.pi / 2, 0.13, 0.74, 0.0),
    (np.pi / 2, 0.0, 0.0, 0.0),
    (-np.pi / 2, 0.0, 0.10, 0.0),
]


def test_modified_rows_turn_and_move_along_x_before_z():
    pose = np.eye(4)
    for (alpha, a, d, theta), q in zip(ROWS, Q, strict=True):
        pose = pose @ turn(0, alpha) @ move(a, 0, 0) @ turn(2, theta + q) @ move(0, 0, d)
    np.testing.assert_allclose(load_robot("er50").chain.forward(Q)[-1], pose, atol=1e-12)


def test_standard_rows_turn_and_move_along_z_before_x(edited):
    arm = load_robot(edited('convention = "modified-dh"', 'convention = "standard-dh"'))
    pose = np.eye(4)
    for (alpha, a, d, theta), q in zip(ROWS, Q, strict=True):
        pose = pose @ turn(2, theta + q) @ move(0, 0, d) @ move(a, 0, 0) @ turn(0, alpha)
    np.testing.assert_allclose(arm.chain.forward(Q)[-1], pose, atol=1e-12)


def test_a_flange_is_a_pose_in_the_last_frame(edited):
    new = "xyz_m = [0.1, 0.2, 0.3], rpy_rad = [0.0, 0.0, 1.0] }  # the"
    arm = load_robot(edited("xyz_m = [0.0, 0.0, 0.0], rpy_rad = [0.0, 0.0, 0.0] }  # the", new))
    plain = load_robot("er50").chain.forward(Q)[-1]
    np.testing.assert_allclose(arm.chain.forward(Q)[-1], plain @ move(0.1, 0.2, 0.3) @ turn(2, 1.0), atol=1e-12)


ORIGIN = "    { xyz_m = [0.0, 0.0, 0.1], rpy_rad = [0.0, 0.5, 0.0], axis = [0.0, 1.0, 0.0] },\n"


def origins(edited, more=""):
    begin, end = "rows = [\n", "]\nflange"
    path = edited("[robot]", "[robot]")
    text = Path(path).read_text()
    first = text.index(begin)
    last = text.index(end, first)
    text = text[:first] + "origins = [\n" + 6 * ORIGIN + text[last:]
    Path(path).write_text(text.replace('convention = "modified-dh"', f'convention = "joint-origins"{more}'))
    return path


def test_origins_are_poses_and_axes(edited):
    pose = np.eye(4)
    for q in Q:
        pose = pose @ move(0, 0, 0.1) @ turn(1, 0.5) @ turn(1, q)
    np.testing.assert_allclose(load_robot(origins(edited)).chain.forward(Q)[-1], pose, atol=1e-12)


def test_rows_and_origins_exclude_each_other(edited):
    rows = "\nrows = [{ alpha_rad = 0.0, a_m = 0.0, d_m = 0.0, theta_rad = 0.0 }]"
    with pytest.raises(ConfigurationError, match="give origins and not rows"):
        load_robot(origins(edited, rows))
    with pytest.raises(ConfigurationError, match="give origins and not rows"):
        load_robot(edited('convention = "modified-dh"', 'convention = "joint-origins"'))


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("[0.0, 0.0, 0.0, 0.0167, 1.0, 0.0]", "[0.0, 0.0, 0.0, 0.0167, 1.0]", "6 rows of 6"),
        ("[0.0, 0.0, 0.0, 0.0167, 1.0, 0.0]", "[0.0, 0.0, 0.0, 0.0, 0.0, 0.0]", "invertible"),
        ("    [1.0, 0.0, 0.0, 0.0, 0.0, 0.0],\n", "", "6 rows of 6"),
    ],
)
def test_a_coupling_that_is_none_is_refused(edited, old, new, words):
    with pytest.raises(ConfigurationError, match=words) as caught:
        load_robot(edited(old, new))
    assert caught.value.key == "transmission.coupling"


@pytest.mark.parametrize(("value", "accepted"), [(0.0, True), (0.5, True), (0.51, False), (-0.01, False)])
@pytest.mark.parametrize("key", ["gain_deviation", "scale_deviation"])
def test_deviations_are_shares_up_to_a_half(edited, key, value, accepted):
    path = edited("[transmission]", f"[transmission]\n{key} = {value}")
    if accepted:
        load_robot(path)
    else:
        with pytest.raises(ConfigurationError):
            load_robot(path)
