"""Exported texts, read back by separate parsers: the payload is unchanged."""

from __future__ import annotations

import ast
import json
import re
import shutil
import subprocess
from dataclasses import replace
from xml.etree import ElementTree

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from scipy.spatial.transform import Rotation

from armload_controller.control_errors import ExportError
from armload_controller.export.format_registry import ExportFormat, exporter
from armload_controller.export.inertia import principal_inertia
from armload_controller.export.load_data.abb import export_abb
from armload_controller.export.load_data.fanuc import export_fanuc
from armload_controller.export.load_data.franka import export_franka
from armload_controller.export.load_data.kuka import export_kuka
from armload_controller.export.load_data.ur import export_ur
from armload_controller.export.load_data.yaskawa import export_yaskawa
from armload_controller.export.mjcf import export_mjcf
from armload_controller.export.ros2 import export_ros2
from armload_controller.export.text_format import comment, exact, positional
from armload_controller.export.urdf import export_urdf
from armload_identification.model.payload import InertialParameters

pytestmark = pytest.mark.pure

ALL_INERTIA = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
ROUNDED = 1e-8  # nine significant digits of numbers below 1; millimetres are read back as metres
KGF_CM_S2 = 9.80665 * 0.01  # kg m2


def only_text(texts):
    assert len(texts) == 1
    return next(iter(texts.values()))


def unwrapped(text):
    """The words of a text without comment marks."""
    return " ".join(re.sub(r"^\W+", "", line) for line in text.splitlines())


def body_of(mass, center, tensor):
    return InertialParameters.from_center_of_mass(mass, center, np.array(tensor))


def read_kuka(text):
    number = r"(-?\d+\.\d*)"
    frame = ",".join(f"{axis} {number}" for axis in "XYZABC")
    moments = ",".join(f"{axis} {number}" for axis in "XYZ")
    pattern = rf"^LOAD_DATA\[1\]=\{{M {number},CM \{{{frame}\}},J \{{{moments}\}}\}}$"
    found = re.search(pattern, text, re.MULTILINE)
    mass, x, y, z, a, b, c, *j = (float(v) for v in found.groups())
    rotation = Rotation.from_euler("ZYX", [a, b, c], degrees=True).as_matrix()
    return mass, np.array([x, y, z]) * 1e-3, rotation @ np.diag(j) @ rotation.T


def read_abb(text):
    mass, cog, (q1, q2, q3, q4), *moments = ast.literal_eval(
        re.search(r"^  PERS loaddata \w{1,32} := (.*);$", text, re.MULTILINE)[1]
    )
    assert q1**2 + q2**2 + q3**2 + q4**2 == pytest.approx(1.0, abs=ROUNDED)
    rotation = Rotation.from_quat([q2, q3, q4, q1]).as_matrix()
    return mass, np.array(cog) * 1e-3, rotation @ np.diag(moments) @ rotation.T


def read_ur(text):
    """URScript's call and comments have Python's syntax."""
    call = ast.parse(text).body[0].value
    assert call.func.id == "set_target_payload"
    mass, center, *inertia = (ast.literal_eval(argument) for argument in call.args)
    assert inertia[1] == 0.5
    xx, yy, zz, xy, xz, yz = inertia[0]
    return mass, np.array(center), np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def read_franka(text):
    """The header's constants."""
    (mass,) = re.search(r"load_mass = (\S+);", text).groups()
    center, inertia = (
        ast.literal_eval(f"[{re.search(name + chr(123) * 2 + '(.*?)' + chr(125), text)[1]}]")
        for name in ("F_x_Cload", "load_inertia")
    )
    return float(mass), np.array(center), np.array(inertia).reshape(3, 3).T


def read_mjcf(text):
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><worldbody><body name="flange"><joint axis="0 0 1"/><geom size="0.1" mass="0.001"/>{text}'
        "</body></worldbody></mujoco>"
    )
    at = model.body("er50_payload").id
    turn = Rotation.from_quat(model.body_iquat[at], scalar_first=True).as_matrix()
    return model.body_mass[at], model.body_ipos[at], turn @ np.diag(model.body_inertia[at]) @ turn.T


def read_yaskawa(text):
    bare = re.sub(r"//.*", "", text)
    preset = json.loads(re.sub(r"(\w+):", r'"\1":', bare))
    assert preset["filetype"] == "presets"
    (tool,) = preset["presets"]
    assert tool["preset"] == "tool"
    return tool["weight"], np.array(tool["com"]) * 1e-3, np.diag(tool["moi"])


def read_fanuc(text):
    lines = [line for line in text.splitlines() if not line.startswith("#")]
    fields = dict(re.fullmatch(r"(PAYLOAD.*) = (.*)", line).groups() for line in lines)
    center = [float(fields[f"PAYLOAD CENTER {axis} [cm]"]) * 0.01 for axis in "XYZ"]
    moments = [float(fields[f"PAYLOAD INERTIA {axis} [kgf cm s2]"]) * KGF_CM_S2 for axis in "XYZ"]
    return float(fields["PAYLOAD [kg]"]), np.array(center), np.diag(moments)


def read_inertia(urdf):
    """Mass, centre of mass and inertia of the only moving body, by Pinocchio."""
    body = pin.buildModelFromXML(urdf).inertias[1]
    return body.mass, body.lever, body.inertia


def read_urdf(text):
    return read_inertia(
        '<robot name="r"><link name="base"/><joint name="j" type="continuous"><parent link="base"/>'
        f'<child link="flange"/><axis xyz="0 0 1"/></joint><link name="flange">{text}</link></robot>'
    )


def read_xacro(text):
    """The macro, called with a parent and a prefix, attached to a joint without a body."""
    xacro = "{http://www.ros.org/wiki/xacro}"
    (macro,) = ElementTree.fromstring(text).findall(f"{xacro}macro")
    assert macro.get("name") == "er50_payload"
    assert macro.get("params") == "parent prefix:=''"
    called = "".join(ElementTree.tostring(element, encoding="unicode") for element in macro)
    called = called.replace("${parent}", "tool0").replace("${prefix}", "left_")
    assert "$" not in called
    return read_inertia(
        '<robot name="r"><link name="base"/><joint name="j" type="continuous"><parent link="base"/>'
        f'<child link="tool0"/><axis xyz="0 0 1"/></joint><link name="tool0"/>{called}</robot>'
    )


def read_yaml(text):
    """Nested mappings by indentation, values in Python's syntax."""
    root: dict = {}
    levels = [(-1, root)]
    for line in text.splitlines():
        if line.startswith("#"):
            continue
        indent = len(line) - len(line.lstrip())
        key, _, value = line.strip().partition(":")
        while levels[-1][0] >= indent:
            levels.pop()
        parent = levels[-1][1]
        if value:
            parent[key] = value.strip() if value.strip().isidentifier() else ast.literal_eval(value.strip())
        else:
            parent[key] = {}
            levels.append((indent, parent[key]))
    return root


READERS = {
    "kuka": (export_kuka, read_kuka),
    "abb": (export_abb, read_abb),
    "ur": (export_ur, read_ur),
    "franka": (lambda subject: {"x": export_franka(subject)["er50_franka_load.hpp"]}, read_franka),
    "yaskawa": (export_yaskawa, read_yaskawa),
    "fanuc": (export_fanuc, read_fanuc),
    "urdf": (export_urdf, read_urdf),
    "mjcf": (export_mjcf, read_mjcf),
    "ros2": (lambda subject: {"x": export_ros2(subject)["er50_payload.urdf.xacro"]}, read_xacro),
}
WHOLE_TENSOR = ("kuka", "abb", "ur", "franka", "urdf", "mjcf", "ros2")
POINT_MASS = ("abb", "ur", "yaskawa", "fanuc")


def read_back(name, subject):
    export, read = READERS[name]
    return read(only_text(export(subject)))


def same_body(found, body, moments_only):
    mass, center, tensor = found
    expected = body.inertia_about_com
    expected = np.diag(np.diag(expected)) if moments_only else expected
    assert mass == pytest.approx(body.mass_kg, abs=1e-7)
    np.testing.assert_allclose(center, body.center_of_mass_m, atol=ROUNDED)
    np.testing.assert_allclose(tensor, expected, atol=ROUNDED)


@pytest.mark.parametrize("name", READERS)
def test_the_payload_reads_back(make_subject, name):
    subject = make_subject()
    same_body(read_back(name, subject), subject.payload.model, name not in WHOLE_TENSOR)


@pytest.mark.parametrize("name", READERS)
@pytest.mark.parametrize("seed", range(12))
def test_any_payload_reads_back(make_subject, name, seed):
    rng = np.random.default_rng(seed)
    rotation = Rotation.random(rng=rng).as_matrix()
    spread = rng.uniform(0.0005, 0.05, 3)
    tensor = rotation @ np.diag([spread[1] + spread[2], spread[0] + spread[2], spread[0] + spread[1]]) @ rotation.T
    body = body_of(rng.uniform(0.5, 9), rng.uniform(-0.3, 0.3, 3), (tensor + tensor.T) / 2)
    base = make_subject()
    subject = replace(base, payload=replace(base.payload, model=body))
    same_body(read_back(name, subject), body, name not in WHOLE_TENSOR)


@pytest.mark.parametrize("name", ["urdf", "ros2"])
def test_urdf_keeps_every_digit(make_subject, name):
    subject = make_subject()
    mass, center, tensor = read_back(name, subject)
    body = subject.payload.model
    assert mass == body.mass_kg
    np.testing.assert_allclose(center, body.center_of_mass_m, rtol=1e-15)
    np.testing.assert_allclose(tensor, body.inertia_about_com, rtol=1e-13)


def test_ros2_parameters_are_those_of_the_admittance_controller(make_subject):
    subject = make_subject()
    parameters = read_yaml(export_ros2(subject)["er50_payload.yaml"])
    compensation = parameters["admittance_controller"]["ros__parameters"]["gravity_compensation"]
    assert compensation["frame"] == {"id": "flange"}
    assert set(compensation) == {"frame", "CoG"}
    np.testing.assert_allclose(compensation["CoG"]["pos"], subject.payload.model.center_of_mass_m, atol=ROUNDED)
    assert compensation["CoG"]["force"] == pytest.approx(2.7 * 9.81)


@pytest.mark.parametrize("name", POINT_MASS)
def test_a_point_mass_is_written_where_the_controller_knows_one(make_subject, name):
    subject = make_subject(undetermined=ALL_INERTIA)
    mass, center, tensor = read_back(name, subject)
    assert mass == pytest.approx(2.7)
    np.testing.assert_allclose(center, subject.payload.model.center_of_mass_m, atol=ROUNDED)
    np.testing.assert_array_equal(tensor, np.zeros((3, 3)))
    text = unwrapped(only_text(READERS[name][0](subject)))
    assert "NOT DETERMINED by the measurement: ixx, iyy, izz" in text
    assert "point mass" in text


def test_a_point_mass_has_the_flanges_axes(make_subject):
    assert "[1.0, 0.0, 0.0, 0.0],0.0,0.0,0.0]" in only_text(export_abb(make_subject(undetermined=ALL_INERTIA)))


def test_ur_changes_gradually_and_says_what_happens_to_the_force_sensor(make_subject):
    text = only_text(export_ur(make_subject(undetermined=ALL_INERTIA)))
    inertia = "[0.0, 0.0, 0.0, 0.0, 0.0, 0.0]"
    assert text.splitlines()[-1] == f"set_target_payload(2.7, [0.031, -0.012, 0.094], {inertia}, 0.5)"
    assert "ZEROES THE READINGS OF THE FORCE/TORQUE SENSOR" in unwrapped(text)


def test_urs_driver_gets_the_same_numbers(make_subject):
    text = only_text(export_ur(make_subject()))
    request = re.search(r"'(\{mass.*?\})'", text.replace("\\\n#", ""), re.DOTALL)[1]
    found = ast.literal_eval(re.sub(r"(\w+):", r"'\1':", request))
    body = make_subject().payload.model
    assert found["mass"] == pytest.approx(body.mass_kg)
    np.testing.assert_allclose(list(found["center_of_gravity"].values()), body.center_of_mass_m, atol=ROUNDED)
    np.testing.assert_allclose([found[name] for name in ALL_INERTIA], body.values[4:], atol=ROUNDED)
    assert found["transition_time"] == {"sec": 0, "nanosec": 500000000}


def test_ur_refuses_an_inertia_beyond_its_field(make_subject):
    base = make_subject()
    huge = replace(base, payload=replace(base.payload, model=body_of(900.0, [0, 0, 0], np.diag([140.0, 90.0, 90.0]))))
    with pytest.raises(
        ExportError, match=r"an element of the inertia is 140 kg m2; set_target_payload accepts at most"
    ):
        export_ur(huge)


def test_desk_and_set_load_get_the_same_numbers(make_subject):
    texts = export_franka(make_subject())
    desk = json.loads(texts["endeffector-config.json"])
    assert set(desk) == {"id", "name", "color", "mass", "centerOfMass", "transformation", "inertia"}
    assert not desk["id"].startswith("ee-")
    np.testing.assert_array_equal(np.reshape(desk["transformation"], (4, 4)), np.eye(4))
    mass, center, tensor = read_franka(texts["er50_franka_load.hpp"])
    assert (desk["mass"], desk["centerOfMass"]) == (mass, center.tolist())
    np.testing.assert_array_equal(np.reshape(desk["inertia"], (3, 3)), tensor)


@pytest.mark.skipif(shutil.which("g++") is None, reason="no g++ on this machine")
def test_frankas_header_compiles(make_subject, tmp_path):
    (tmp_path / "load.hpp").write_text(export_franka(make_subject())["er50_franka_load.hpp"])
    (tmp_path / "main.cpp").write_text('#include "load.hpp"\nstatic_assert(armload_er50::load_mass == 2.7);\n')
    command = ["g++", "-std=c++17", "-fsyntax-only", "-Wall", "-Wextra", "-Werror", "main.cpp"]
    assert subprocess.run(command, cwd=tmp_path, check=False).returncode == 0


@pytest.mark.parametrize("name", [n for n in READERS if n not in POINT_MASS])
def test_the_model_is_written_and_marked_where_a_format_needs_an_inertia(make_subject, name):
    subject = make_subject(undetermined=ALL_INERTIA)
    same_body(read_back(name, subject), subject.payload.model, moments_only=False)
    text = unwrapped(only_text(READERS[name][0](subject)))
    assert "NOT DETERMINED by the measurement: ixx, iyy, izz, ixy, ixz, iyz" in text
    assert "They are not measurements." in text


@pytest.mark.parametrize("name", READERS)
def test_a_partly_determined_inertia_is_the_models_and_marked(make_subject, name):
    subject = make_subject(undetermined=("izz", "ixz"))
    same_body(read_back(name, subject), subject.payload.model, name not in WHOLE_TENSOR)
    named = "izz, ixz" if name in WHOLE_TENSOR else "izz"
    text = unwrapped(only_text(READERS[name][0](subject)))
    assert f"NOT DETERMINED by the measurement: {named}. For these, the values of the model" in text


@pytest.mark.parametrize("name", ["yaskawa", "fanuc"])
def test_products_do_not_matter_where_there_is_no_place_for_them(make_subject, name):
    text = unwrapped(only_text(READERS[name][0](make_subject(undetermined=("ixy", "ixz", "iyz")))))
    assert "all elements written here are determined" in text
    assert "no fields for products of inertia, so they are omitted" in text


def test_sign_of_the_products(make_subject):
    """Masses near the diagonal x = y: int xy dm is positive, so the tensor element is negative."""
    body = InertialParameters(np.array([2.0, 0, 0, 0, 0.021, 0.021, 0.04, -0.0199, 0, 0]))
    base = make_subject()
    subject = replace(base, payload=replace(base.payload, model=body))
    assert "0.04, -0.0199, 0.0, 0.0], 0.5)" in only_text(export_ur(subject))
    assert 'ixy="-0.0199"' in only_text(export_urdf(subject))
    # the smallest moment is about the diagonal that the masses lie on
    for name in ("kuka", "abb"):
        values, axes = np.linalg.eigh(read_back(name, subject)[2])
        assert values[0] == pytest.approx(0.0011, abs=ROUNDED)
        assert abs(axes[:, 0] @ [1, 1, 0]) == pytest.approx(np.sqrt(2))


@pytest.mark.parametrize("moments", [(3.0, 1.0, 2.0), (1.0, 1.0, 2.0), (2.0, 2.0, 2.0), (1.0, 2.0, 2.5)])
def test_axes_of_a_diagonal_tensor_are_the_flanges(moments):
    found_kg_m2, rotation = principal_inertia(np.diag(moments))
    np.testing.assert_array_equal(rotation, np.eye(3))
    np.testing.assert_array_equal(found_kg_m2, moments)


@pytest.mark.parametrize("moments", [(1.0, 1.0, 2.0), (2.0, 2.0, 2.0), (1.0, 2.0, 2.0)])
def test_rounding_does_not_choose_among_equal_moments(moments):
    noise = np.random.default_rng(4).normal(scale=1e-16, size=(8, 3, 3))
    for tensor in np.diag(moments) + noise + noise.transpose(0, 2, 1):
        np.testing.assert_allclose(principal_inertia(tensor)[1], np.eye(3), atol=1e-3)


@pytest.mark.parametrize("seed", range(20))
def test_principal_axes_are_right_handed_and_near_the_flanges(seed):
    turn = Rotation.random(rng=np.random.default_rng(seed)).as_matrix()
    tensor = turn @ np.diag([0.3, 0.4, 0.6]) @ turn.T
    moments_kg_m2, r = principal_inertia(tensor)
    np.testing.assert_allclose(r @ np.diag(moments_kg_m2) @ r.T, tensor, atol=1e-14)
    np.testing.assert_allclose(r.T @ r, np.eye(3), atol=1e-14)
    assert np.linalg.det(r) == pytest.approx(1.0)
    assert np.degrees(Rotation.from_matrix(r).magnitude()) < 63


@pytest.mark.parametrize(
    ("undetermined", "named"), [(("mass",), "mass"), (("cz",), "cz"), (("mass", "cx", "ixx"), "mass, cx")]
)
def test_nothing_is_exported_without_mass_and_centre_of_mass(make_subject, undetermined, named):
    with pytest.raises(ExportError, match=rf"^payload\.toml: not determined: {named};") as refusal:
        make_subject(undetermined=undetermined)
    assert refusal.value.file == "payload.toml"


def test_a_payload_of_another_frame_arm_or_world_is_refused(make_subject):
    subject = make_subject()
    with pytest.raises(ExportError, match="given in the frame 'link_3'; expected 'flange'"):
        replace(subject, payload=replace(subject.payload, frame="link_3"))
    with pytest.raises(ExportError, match="identified on 3 joints, but er50 has 6"):
        replace(subject, payload=replace(subject.payload, residual_rms_nm=np.ones(3)))
    impossible = body_of(1.0, [0, 0, 0], np.diag([0.01, 0.01, 0.03]))
    with pytest.raises(ExportError, match="no body has these parameters"):
        replace(subject, payload=replace(subject.payload, model=impossible))


@pytest.mark.parametrize("name", [name for name in ExportFormat if "fmu" not in name])
def test_every_text_says_where_it_comes_from_and_is_ascii(make_subject, calibrated, name):
    subject = calibrated if name == ExportFormat.THRESHOLDS else make_subject()
    subject = replace(subject, robot="Ünit--3", payload_file="last-->\n\u2603.toml")
    for file, text in exporter(name)(subject).items():
        assert text.isascii()
        if file.endswith(".json"):  # has no comments
            continue
        assert "written by armload 1.2.3" in text
        assert "sha256 0123abcd" in unwrapped(text)
        assert text.endswith("\n")


@pytest.mark.parametrize("name", ["urdf", "mjcf", "ros2"])
def test_names_from_files_cannot_end_an_xml_comment(make_subject, name):
    subject = replace(make_subject(), payload_file="a-->b--c-.toml")
    ElementTree.fromstring(next(iter(exporter(name)(subject).values())))


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.0, "0.0"),
        (-0.0, "0.0"),
        (12.0, "12.0"),
        (1.5e-7, "0.00000015"),
        (-0.123456789012, "-0.123456789"),
        (1e5, "100000.0"),
    ],
)
def test_controllers_get_no_exponents(value, text):
    assert positional(value) == text


@pytest.mark.parametrize("value", [0.1, 1e-300, -2.0 / 3.0, 5.0])
def test_exact_numbers_come_back(value):
    assert float(exact(value)) == value


def test_comments_keep_their_prefix():
    lines = comment(("word " * 60, "x\ny"), ";")
    assert all(line.startswith("; ") and len(line) <= 100 for line in lines)
    assert lines[-1] == "; x?y"
