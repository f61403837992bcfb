"""A URDF as it is given to Pinocchio: joints that move, limits, mimics, and where meshes are found."""

import sys

import pytest

from armload_controller.motion.urdf_geometry import load_urdf_geometry
from armload_identification.identification_errors import ModelError

FACET = b"facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n"
STL = b"solid a\n" + FACET + b"endsolid a\n"
LINKS = ("base", "upper", "lower", "finger", "tool")
JOINTS = """
<joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 0 1"/>
  <limit lower="-1" upper="2" effort="50" velocity="3"/></joint>
<joint name="elbow" type="continuous"><parent link="upper"/><child link="lower"/><axis xyz="0 0 1"/></joint>
<joint name="gripper" type="prismatic"><parent link="lower"/><child link="finger"/>
  <limit lower="0" upper="1" effort="1" velocity="1"/><mimic joint="shoulder"/></joint>
<joint name="other" type="revolute"><parent link="lower"/><child link="tool"/>
  <limit lower="0" upper="1" effort="1" velocity="1"/></joint>
"""


@pytest.fixture
def arm(tmp_path):
    """Write an arm of two joints with a mesh in a package; returns its path."""

    def arm(mesh="package://my_arm/meshes/a.stl", place="my_arm/meshes/a.stl", text=None):
        folder = tmp_path / "my_arm" / "urdf"
        folder.mkdir(parents=True)
        (tmp_path / place).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / place).write_bytes(STL)
        links = "".join(f'<link name="{name}"/>' for name in LINKS[:-1])
        shape = f'<collision><geometry><mesh filename="{mesh}"/></geometry></collision>'
        path = folder / "arm.urdf"
        path.write_text(text or f'<robot name="a">{links}<link name="tool">{shape}</link>{JOINTS}</robot>')
        return path

    return arm


def test_only_the_arms_joints_move_and_a_continuous_one_gets_limits(arm):
    found = load_urdf_geometry(arm(), ("shoulder", "elbow", "gripper"))
    assert list(found.model.names) == ["universe", "shoulder", "elbow"]
    assert found.model.nq == 2, "a continuous joint would have two numbers"
    assert found.model.lowerPositionLimit.tolist() == [-1.0, -10.0]
    assert found.model.upperPositionLimit.tolist() == [2.0, 10.0]
    assert found.connected == {
        frozenset(pair) for pair in (LINKS[:2], LINKS[1:3], ("lower", "finger"), ("lower", "tool"))
    }
    assert found.geometry.ngeoms == 1


@pytest.mark.parametrize(
    ("mesh", "place"),
    [
        ("package://my_arm/meshes/a.stl", "my_arm/meshes/a.stl"),
        ("package://my_arm/a.stl", "a.stl"),
        ("package://a.stl", "a.stl"),
        ("a.stl", "my_arm/urdf/a.stl"),
        ("file://a.stl", "my_arm/urdf/a.stl"),
        ("../meshes/a.stl", "my_arm/meshes/a.stl"),
    ],
)
def test_a_mesh_is_found_in_the_file_s_folder_or_in_one_above(arm, tmp_path, mesh, place):
    found = load_urdf_geometry(arm(mesh, place), ("shoulder",))
    assert found.geometry.geometryObjects[0].meshPath == str((tmp_path / place).resolve())


@pytest.mark.parametrize("mesh", ["package://my_arm/b.stl", "package://", "b.stl", "meshes/a.stl"])
def test_a_mesh_that_is_nowhere_is_named(arm, mesh):
    path = arm(mesh)
    with pytest.raises(ModelError) as caught:
        load_urdf_geometry(path, ("shoulder",))
    assert str(caught.value) == (
        f"{path}: the mesh {mesh} was not found in its folder or in a parent folder. Put the package's folder there"
    )


@pytest.mark.parametrize(
    ("text", "words"),
    [("<robot", "Expected a URDF"), ("<robot name='a'/>", "Expected a URDF with its meshes in the same folder")],
)
def test_a_file_that_is_no_arm_is_named(arm, text, words):
    path = arm(text=text)
    with pytest.raises(ModelError) as caught:
        load_urdf_geometry(path, ("shoulder",))
    assert str(caught.value).startswith(f"{path}: ")
    assert str(caught.value).endswith(words)


def test_a_missing_library_is_named_with_its_remedy(arm, monkeypatch):
    path = arm()
    monkeypatch.setitem(sys.modules, "coal", None)
    with pytest.raises(ModelError, match=r'arm\.urdf: a URDF needs Pinocchio with coal: pip install "armload\[urdf\]"'):
        load_urdf_geometry(path, ())
