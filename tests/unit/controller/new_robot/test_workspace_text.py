"""`[workspace]` of a first robot file: what it contains, what is assumed, and what is left unchecked."""

import tomllib
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from armload_controller.new_robot.drafted_file import DraftedFile
from armload_controller.new_robot.workspace_draft import WorkspaceDraft
from armload_controller.new_robot.workspace_text import add_workspace
from armload_identification.excitation.geometry.workspace import Sphere

pytestmark = pytest.mark.pure

ARM = SimpleNamespace(n=2, chain=SimpleNamespace(gravity_m_s2=np.array([0.0, -9.81, 0.0])))
PLAIN = WorkspaceDraft(
    spheres=(
        Sphere(0, np.array([0.0, 0.0, 0.12345]), 0.1),
        Sphere(1, np.array([-0.0, 0.25, 0.0]), 0.08006),
        Sphere(2, np.zeros(3), 0.15),
        Sphere(3, np.array([0.0, 0.0, 0.1]), 0.2),
    ),
    bare=(2,),
    floor_m=-0.70004,
    above_floor=(2, 3),
    apart=((0, 3), (1, 3)),
    overlapping=((0, 1), (2, 3)),
    meshes=False,
    touching=(),
    why_no_meshes="",
)


def written(draft):
    file = DraftedFile()
    add_workspace(file, ARM, draft)
    return tomllib.loads(file.text)["workspace"], file


def test_spheres_pairs_and_floor_are_the_drafts():
    table, file = written(PLAIN)
    assert table["keep_m"] > 0.0
    assert table["spheres"] == [
        {"link": 0, "center_m": [0.0, 0.0, 0.1234], "radius_m": 0.1},
        {"link": 1, "center_m": [0.0, 0.25, 0.0], "radius_m": 0.0801},
        {"link": 2, "center_m": [0.0, 0.0, 0.0], "radius_m": 0.15},
        {"link": "tool", "center_m": [0.0, 0.0, 0.1], "radius_m": 0.2},
    ]
    assert table["apart"] == [[0, "tool"], [1, "tool"]]
    (floor,) = table["half_spaces"]
    assert floor == {"name": "floor", "normal": [0.0, 1.0, 0.0], "offset_m": -0.7, "links": [2, "tool"]}
    assert "-0.0" not in file.text.replace("-0.7", "")
    assert "urdf" not in table


def test_only_what_is_not_from_the_geometry_is_marked_as_assumed():
    _, file = written(PLAIN)
    rows = [line for line in file.text.splitlines() if "radius_m" in line]
    assert ["assumed" in row for row in rows] == [False, False, True, True]
    assert ["no geometry" in row for row in rows] == [False, False, True, False]


def test_what_there_is_not_is_not_written():
    table, _ = written(replace(PLAIN, apart=(), above_floor=()))
    assert set(table) == {"keep_m", "spheres"}


def test_meshes_are_named_only_if_they_are_checked():
    meshes = replace(PLAIN, meshes=True, urdf="arm.urdf", touching=(("l1", "l2"),))
    table, _ = written(meshes)
    assert (table["urdf"], table["urdf_touching"]) == ("arm.urdf", [["l1", "l2"]])
    assert "urdf_touching" not in written(replace(meshes, touching=()))[0]
    assert "urdf" not in written(replace(meshes, meshes=False))[0]
    assert "urdf" not in written(replace(meshes, urdf=None))[0]


def listed(draft):
    return written(draft)[1].unchecked[1:]


def test_what_is_left_unchecked_is_listed():
    assert listed(PLAIN) == [
        "link 1: not kept above that floor, which its spheres reach in most poses",
        "shape of link 2: a sphere of 0.05 m around its origin",
        'pairs of links not checked for collision, because their spheres overlap in most poses: 0 and 1, 2 and "tool"',
    ]
    assert listed(replace(PLAIN, above_floor=(1, 2, 3), bare=(), overlapping=())) == []
    assert listed(replace(PLAIN, above_floor=(), bare=(), overlapping=()))[0].startswith("link 1, 2: not kept")


def test_meshes_check_the_pairs_whose_spheres_overlap_but_not_those_that_touch():
    checked = replace(PLAIN, above_floor=(1, 2, 3), bare=(), meshes=True)
    assert listed(checked) == []
    (text,) = listed(replace(checked, touching=(("l1", "l2"), ("l2", "l3"))))
    assert text == "pairs of meshes that may touch, because their convex hulls do in most poses: l1 and l2, l2 and l3"
    (text,) = listed(replace(checked, meshes=False, overlapping=(), touching=(("l1", "l2"),), why_no_meshes="no file"))
    assert text == "meshes are not checked: no file"
