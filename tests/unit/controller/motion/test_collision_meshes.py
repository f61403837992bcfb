"""Collision geometry from a URDF that the test writes: boxes, a cylinder, and a tool as an STL mesh."""

import re
import struct
import sys
from importlib import resources

import numpy as np
import pytest

from armload_controller.config.robot import load_robot
from armload_controller.control_errors import ConfigurationError
from armload_controller.motion.collision_meshes import SURPLUS_M, Meshes
from armload_controller.motion.obstacles import Obstacles
from armload_controller.session.commissioning import checked_excitations
from armload_identification.excitation.design import optimal_excitation
from armload_identification.excitation.design_envelope import Envelope
from armload_identification.excitation.design_search import Attempt, PeriodRange, Search, SearchSettings
from armload_identification.excitation.fourier import FourierTrajectory
from armload_identification.excitation.information import named_criterion
from armload_identification.identification_errors import ExcitationError, ModelError

PRBT = load_robot("prbt")
KEEP_M = 0.02
NOTHING = ""
TABLE = """<link name="table"><collision><origin xyz="0.5 0 0"/><geometry><box size="0.2 2 {height}"/></geometry>
</collision></link><joint name="floor" type="fixed"><parent link="base"/><child link="table"/></joint>"""


def write_stl(path, size_m, offset_m=0.05):
    """A tetrahedron as a binary STL file."""
    corners = [(1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1)]
    points = [np.array(corner) * size_m + [0.0, 0.0, offset_m] for corner in corners]
    faces = [(0, 1, 2), (0, 3, 1), (0, 2, 3), (1, 3, 2)]
    body = b"".join(struct.pack("<12fH", 0, 0, 0, *points[a], *points[b], *points[c], 0) for a, b, c in faces)
    path.write_bytes(bytes(80) + struct.pack("<I", len(faces)) + body)
    return np.array(points)


def write_urdf(folder, more=NOTHING, tool_m=0.03, names=PRBT.joint_names, lift_m=0.0):
    """prbt with a cylinder as its base, a box in every joint frame and a tool from a mesh."""
    points = write_stl(folder / "tool.stl", tool_m)
    text = """<robot name="prbt"><link name="base"><collision><origin xyz="0 0 0.08"/><geometry>
<cylinder radius="0.08" length="0.16"/></geometry></collision></link>"""
    origins = PRBT.tables.kinematics.origins
    for i, (origin, name) in enumerate(zip(origins, names, strict=True)):
        parent = f"link_{i}" if i else "base"
        xyz = np.add(origin.xyz_m, [0.0, 0.0, 0.0 if i else lift_m])
        text += f"""<link name="link_{i + 1}"><collision><geometry><box size="0.08 0.08 0.08"/></geometry></collision>
</link><joint name="{name}" type="revolute"><parent link="{parent}"/><child link="link_{i + 1}"/>
<origin xyz="{" ".join(map(repr, map(float, xyz)))}" rpy="{" ".join(map(repr, origin.rpy_rad))}"/>
<axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="1" velocity="1"/></joint>"""
    text += """<link name="tool"><collision><geometry><mesh filename="package://tool.stl"/></geometry></collision></link>
<joint name="mount" type="fixed"><parent link="link_6"/><child link="tool"/></joint>"""
    (folder / "arm.urdf").write_text(text + more + "</robot>")
    return points


@pytest.fixture
def meshes(tmp_path):
    def meshes(more=NOTHING, touching=(), **changes):
        write_urdf(tmp_path, more, **changes)
        return Meshes(tmp_path / "arm.urdf", PRBT.chain, PRBT.joint_names, KEEP_M, touching)

    return meshes


@pytest.fixture
def in_a_cell(tmp_path):
    """prbt's file with the URDF in its workspace."""

    def in_a_cell(more=NOTHING, keys='urdf = "arm.urdf"', **changes):
        write_urdf(tmp_path, more, **changes)
        configs = resources.files("armload_configs")
        for role in ("identification", "validation"):
            (tmp_path / f"prbt_{role}.toml").write_text((configs / f"prbt_{role}.toml").read_text("utf-8"))
        text = (configs / "prbt.toml").read_text("utf-8")
        (tmp_path / "mine.toml").write_text(re.sub(r"^keep_m = .*$", rf"\g<0>\n{keys}", text, flags=re.MULTILINE))
        return load_robot(str(tmp_path / "mine.toml"))

    return in_a_cell


def test_distances_are_those_of_the_bodies(meshes):
    found = meshes()
    straight = dict(zip(found.names, found.distances(np.zeros(6)), strict=True))
    assert straight["base to link_2"] == pytest.approx(0.2604 - 0.16 - 0.04, abs=1e-6)
    assert straight["link_1 to link_3"] == pytest.approx(0.35 - 0.08, abs=1e-6)
    lowest = 0.2604 + 0.35 + 0.307 + 0.084 + 0.05 - 0.03
    assert straight["base to tool"] == pytest.approx(lowest - 0.16, abs=1e-6)
    assert "link_1 to link_2" not in straight
    assert "link_6 to tool" not in straight


def test_a_mesh_turns_with_its_link(meshes, tmp_path):
    found = meshes(TABLE.format(height=1.0))
    points = write_stl(tmp_path / "tool.stl", 0.03)
    pair = found.names.index("table to tool")
    for q in np.add(np.random.default_rng(2).uniform(-0.3, 0.3, (5, 6)), [0.0, 0.4, -0.4, 0.0, 0.3, 0.0]):
        pose = PRBT.chain.forward(q)[-1]
        at = points @ pose[:3, :3].T + pose[:3, 3]
        beyond = np.abs(at - [0.5, 0.0, 0.0]) - [0.1, 1.0, 0.5]
        nearest_corner = np.linalg.norm(np.maximum(beyond, 0.0), axis=1).min()
        assert 0.0 < found.distances(q)[pair] <= nearest_corner + 1e-6


@pytest.mark.parametrize("role", ["identification", "validation"])
def test_what_is_reported_of_a_motion_holds_between_the_samples(meshes, role):
    found, path = meshes(), PRBT.excitations[role].trajectory
    least, between = found.nearest(path)
    dense = [found.distances(q) for q in path.evaluate(np.arange(0.0, path.period_s, 0.002)).position_rad]
    smallest = np.min(dense, axis=0)
    assert smallest.min() - SURPLUS_M < least <= smallest.min()
    assert between == found.names[int(smallest.argmin())]


def test_a_way_through_the_table_is_seen_however_short_the_touch(meshes):
    found = meshes(TABLE.format(height=1.5))
    start = np.array([1.4, 1.1, 0.0, 0.0, 0.0, 0.0])
    goal = start * [-1.0, 1.0, 1.0, 1.0, 1.0, 1.0]
    distance, between = found.nearest_on_line(start, goal)
    assert distance < found.least_m
    assert "table" in between
    assert found.nearest_on_line(start, start)[0] > found.least_m


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"names": tuple(f"axis_{i}" for i in range(6))}, "moving joints none; expected prbt_joint_1"),
        ({"lift_m": 0.05}, r"prbt_joint_2 turns about an axis that differs from the one in \[kinematics\], 0.050 m"),
        ({"more": "<nonsense>"}, "Expected a URDF"),
        ({"touching": (("tool", "hand"),)}, "no link 'hand' with a collision geometry; those that have one: base"),
    ],
)
def test_a_urdf_of_something_else_is_refused(meshes, changes, text):
    with pytest.raises(ModelError, match=text):
        meshes(**changes)


def test_joints_that_are_not_the_arms_stand_at_zero(meshes):
    finger = """<link name="finger"><collision><origin xyz="0 0 {z}"/><geometry><box size="0.01 0.01 0.01"/></geometry>
</collision></link><joint name="squeeze" type="prismatic"><parent link="tool"/><child link="finger"/>
<axis xyz="0 0 1"/><limit lower="0" upper="1" effort="1" velocity="1"/></joint>"""
    names = meshes(finger.format(z=0.1)).names
    assert "base to finger" in names
    assert meshes(finger.format(z=0.1)).distances(np.zeros(6)).shape == (len(names),)


def test_meshes_of_a_package_are_found_in_a_folder_above(meshes, tmp_path):
    write_urdf(tmp_path)
    text = (tmp_path / "arm.urdf").read_text()
    for name in ("package://my_arm/meshes/tool.stl", f"package://{tmp_path.name}/meshes/tool.stl"):
        for folder in ("meshes", "urdf"):
            (tmp_path / folder).mkdir(exist_ok=True)
        (tmp_path / "meshes" / "tool.stl").write_bytes((tmp_path / "tool.stl").read_bytes())
        file = tmp_path / "urdf" / "arm.urdf"
        file.write_text(text.replace("package://tool.stl", name))
        assert "base to tool" in Meshes(file, PRBT.chain, PRBT.joint_names, KEEP_M).names
    file.write_text(text.replace("package://tool.stl", "package://my_arm/other.stl"))
    with pytest.raises(ModelError, match=r"the mesh package://my_arm/other.stl was not found"):
        Meshes(file, PRBT.chain, PRBT.joint_names, KEEP_M)


@pytest.mark.parametrize("cone", [False, True])
def test_a_round_mesh_is_no_traceback(tmp_path, cone):
    """Facets of a disc meet in one corner, of which the library's hulls have at most 255 edges."""
    write_urdf(tmp_path)
    turn = np.linspace(0.0, 2.0 * np.pi, 400, endpoint=False)
    rim = 0.03 * np.column_stack([np.cos(turn), np.sin(turn), np.zeros(400)])
    top = np.array([[0.0, 0.0, 0.02]]) if cone else rim + np.array([0.0, 0.0, 0.02])
    corners = np.vstack([rim, top])
    ahead = np.arange(1, 401) % 400
    faces = [(k, ahead[k], 400 if cone else 400 + k) for k in range(400)]
    body = b"".join(struct.pack("<12fH", 0, 0, 0, *corners[list(face)].ravel(), 0) for face in faces)
    (tmp_path / "tool.stl").write_bytes(bytes(80) + struct.pack("<I", len(faces)) + body)
    if cone:
        with pytest.raises(ModelError, match=r"tool\.stl: expected a body with a volume, and fewer than 256 edges"):
            Meshes(tmp_path / "arm.urdf", PRBT.chain, PRBT.joint_names, KEEP_M)
    else:
        assert "base to tool" in Meshes(tmp_path / "arm.urdf", PRBT.chain, PRBT.joint_names, KEEP_M).names


def test_links_that_may_touch_are_left_out(meshes):
    assert "base to link_2" not in meshes(touching=(("link_2", "base"),)).names


def test_a_configuration_is_checked_against_its_urdf_before_anything_moves(in_a_cell):
    checked_excitations(in_a_cell(), ["validation"])
    fat = in_a_cell(tool_m=0.3)
    with pytest.raises(
        ConfigurationError, match=r"excitation.validation is 'a path that brings .* to tool \(meshes\) within"
    ):
        checked_excitations(fat, ["validation"])
    with pytest.raises(ConfigurationError, match=r"workspace.urdf is 'other.urdf'"):
        _ = in_a_cell(keys='urdf = "other.urdf"').obstacles


def test_an_approach_through_something_is_refused(in_a_cell):
    obstacles = in_a_cell(TABLE.format(height=1.5)).obstacles
    start = np.array([1.4, 1.1, 0.0, 0.0, 0.0, 0.0])
    goal = start * [-1.0, 1.0, 1.0, 1.0, 1.0, 1.0]
    assert Obstacles(PRBT.workspace, obstacles.meshes).objection_on_line(start, goal).startswith("brings ")
    assert obstacles.objection_on_line(np.zeros(6), np.full(6, 0.1)) is None


def designed(objection):
    payload = PRBT.payloads.expected
    criterion = named_criterion("condition-number", PRBT.chain, PRBT.limits.torque_noise_nm, payload)
    envelope: Envelope = PRBT.envelope(0.1, 0.7, 0.8)
    return optimal_excitation(
        criterion, envelope, SearchSettings(1, PeriodRange(10.0, 10.0, 10.0), 1, 2), objection=objection
    ).trajectory


@pytest.mark.long
def test_a_design_takes_the_best_start_that_nothing_is_said_against(monkeypatch):
    attempts: dict[tuple[int, ...], Attempt] = {}
    run = Search.run

    def once(search, source):
        """A start is the same in every design, so it is optimised once."""
        if source.spawn_key not in attempts:
            attempts[source.spawn_key] = run(search, source)
        return attempts[source.spawn_key]

    monkeypatch.setattr(Search, "run", once)
    asked: list[FourierTrajectory] = []

    def first_refused(path):
        asked.append(path)
        return "brings tool to link_2 too close" if len(asked) == 1 else None

    assert designed(first_refused) is asked[1]
    with pytest.raises(ExcitationError, match=r"none of 2 starts.*the best one within the limits brings tool"):
        designed(lambda path: "brings tool to link_2 too close")


def test_without_pinocchio_the_error_names_the_remedy(meshes, monkeypatch):
    monkeypatch.setitem(sys.modules, "coal", None)
    with pytest.raises(ModelError, match=re.escape('pip install "armload[urdf]"')):
        meshes()


class Nearing(Meshes):
    """Two pairs whose distances are functions of the position of one joint, with levers of 2 m and 0.5 m."""

    def __init__(self, *distances):
        self.keep_m, self.names, self._reach = 0.02, ("a to b", "a to c"), [np.array([2.0]), np.array([0.5])]
        self.given, self.seen = distances, []

    def distances(self, q):
        self.seen.append(float(q[0]))
        return np.array([distance(q[0]) for distance in self.given])


def test_the_next_sample_is_as_far_away_as_the_distances_allow():
    """(0.1 - 0.02 + 0.003) m at 2 m/s; the other pair, at 0.5 m/s, allows more unless it is near."""
    found = Nearing(lambda q: 0.1, lambda q: 0.1)
    assert found.nearest_on_line(np.zeros(1), np.ones(1)) == (pytest.approx(0.1 - 0.0015), "a to b")
    assert found.seen == pytest.approx([*(0.083 / 2.0 * np.arange(25)), 1.0])
    other = Nearing(lambda q: 0.9, lambda q: 0.03)
    assert other.nearest_on_line(np.zeros(1), -np.ones(1)) == (pytest.approx(0.0285), "a to c")
    assert other.seen == pytest.approx([*(-0.013 / 0.5 * np.arange(39)), -1.0])


def test_a_way_is_followed_to_the_first_place_that_is_too_near_or_to_its_end():
    found = Nearing(lambda q: 0.1, lambda q: 0.06 - 0.1 * q)
    distance_m, between = found.nearest_on_line(np.zeros(1), np.ones(1))
    assert between == "a to c"
    assert 0.02 - 0.1 * 0.1 < distance_m + 0.0015 < 0.02
    assert found.seen[-1] < 0.6
    still = Nearing(lambda q: 0.1, lambda q: 0.05)
    assert still.nearest_on_line(np.ones(1), np.ones(1)) == (pytest.approx(0.0485), "a to c")
    assert still.seen == [1.0, 1.0]
    found.names = ()
    assert found.nearest_on_line(np.zeros(1), np.ones(1)) == (np.inf, "nothing")


def test_levers_are_the_ways_from_each_joint_between_two_links(meshes):
    """From a joint along the offsets of those behind it, and half the diagonal of a box of 80 mm."""
    found = meshes()
    away = [float(np.linalg.norm(origin.xyz_m)) for origin in PRBT.tables.kinematics.origins]
    for pair, joints in (
        ("base to link_4", (1, 2, 3, 4)),
        ("link_1 to link_3", (2, 3)),
        ("link_3 to link_6", (4, 5, 6)),
    ):
        place = found.names.index(pair)
        last = joints[-1]
        expected = np.zeros(6)
        for joint in joints:
            expected[joint - 1] = sum(away[joint:last]) + 0.04 * np.sqrt(3.0)
        np.testing.assert_allclose(found._reach[place], expected, atol=1e-9)
        assert found.joints_between[place] == len(joints)


def test_at_least_three_millimetres_are_kept_and_half_of_them_at_all_times(tmp_path):
    write_urdf(tmp_path)
    for keep_m, kept_m in ((0.02, 0.02), (0.001, 0.003)):
        found = Meshes(tmp_path / "arm.urdf", PRBT.chain, PRBT.joint_names, keep_m)
        assert (found.keep_m, found.least_m) == (kept_m, pytest.approx(kept_m - 0.0015))


@pytest.mark.parametrize(("lift_m", "refused"), [(0.0009, False), (0.0012, True)])
def test_an_axis_is_the_same_to_a_millimetre(meshes, lift_m, refused):
    if refused:
        with pytest.raises(ModelError, match="prbt_joint_2 turns about an axis"):
            meshes(lift_m=lift_m)
    else:
        meshes(lift_m=lift_m)
