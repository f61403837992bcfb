"""The exported C: compiled as strictly as gcc can, and equal to Python."""

import ctypes
import re
import shutil
import subprocess
from dataclasses import replace

import numpy as np
import pytest

from armload_controller.export.c99 import export_c
from armload_controller.feedforward.payload_feedforward import NOTHING, PayloadFeedforward
from armload_identification.model.chain import Chain, pose_from_xyz_rpy
from armload_identification.model.payload import InertialParameters
from armload_identification.model.regressor import payload_regressor, payload_torque

GCC = shutil.which("gcc")
FLAGS = ["-std=c99", "-Wall", "-Wextra", "-Wconversion", "-Werror", "-pedantic"]

needs_gcc = pytest.mark.skipif(GCC is None, reason="no gcc on this machine")


@pytest.fixture
def compiled(tmp_path):
    """Compile an export into a library and give its function for numpy arrays."""

    def compiled(subject, *optimisation, function="torque"):
        texts = export_c(subject)
        for name, text in texts.items():
            (tmp_path / name).write_text(text)
        source = next(name for name in texts if name.endswith(".c"))
        library = tmp_path / "payload.so"
        command = [GCC, *FLAGS, *optimisation, "-shared", "-fPIC", source, "-o", library, "-lm"]
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        call = getattr(ctypes.CDLL(str(library)), f"{source.removesuffix('.c')}_{function}")
        arrays = 2 if function == "gravity" else 4
        call.argtypes = [np.ctypeslib.ndpointer(np.float64, 1, flags="C_CONTIGUOUS")] * arrays
        call.restype = None
        return call

    return compiled


def random_chain(seed: int, n: int) -> Chain:
    rng = np.random.default_rng(seed)
    xyz, rpy, axis = rng.uniform(-1, 1, (3, n, 3))
    flange = pose_from_xyz_rpy(*rng.uniform(-1, 1, (2, 3)))
    return Chain.from_origins(xyz, 3 * rpy, axis, flange, 9.81 * rng.uniform(-1, 1, 3))


def require_equal(function, subject, tolerance_nm):
    n = subject.chain.n
    feedforward = PayloadFeedforward(subject.chain, subject.payload.model)
    for state in np.random.default_rng(1).uniform(-3, 3, (300, 3, n)):
        torque = np.full(n, np.nan)
        function(*state, torque)
        assert np.abs(torque - feedforward.torque_nm(*state)).max() <= tolerance_nm


@needs_gcc
@pytest.mark.parametrize("robot", ["er50", "prbt", "ur10e"])
def test_shipped_arms_give_pythons_torque(compiled, make_subject, robot):
    subject = make_subject(robot)
    require_equal(compiled(subject), subject, 1e-12)


@needs_gcc
@pytest.mark.parametrize(("seed", "n"), [(1, 1), (2, 2), (3, 6), (4, 7)])
def test_any_chain_gives_pythons_torque(compiled, make_subject, seed, n):
    chain = random_chain(seed, n)
    names = tuple(f"joint {i}" for i in range(n))
    subject = make_subject(chain=chain, joint_names=names)
    states = np.random.default_rng(seed).uniform(-3, 3, (3, 100, n))
    largest_nm = np.abs(payload_torque(chain, subject.payload.model.theta, *states)).max()
    require_equal(compiled(subject, "-O3", "-march=native"), subject, 1e-12 * max(1.0, largest_nm))


@needs_gcc
def test_the_torque_may_be_written_over_an_input(compiled, make_subject):
    subject = make_subject("er50")
    function = compiled(subject)
    state = np.random.default_rng(5).uniform(-2, 2, (3, 6))
    torque = np.zeros(6)
    function(*state, torque)
    for i in range(3):
        arrays = state.copy()
        function(*arrays, arrays[i])
        np.testing.assert_array_equal(arrays[i], torque)


@needs_gcc
def test_the_header_is_cplusplus_as_well(make_subject, tmp_path):
    texts = export_c(make_subject("er50"))
    for name, text in texts.items():
        (tmp_path / name).write_text(text)
    (tmp_path / "main.cpp").write_text('#include "er50_payload.h"\nint main() { return ER50_PAYLOAD_JOINTS - 6; }\n')
    command = ["g++", "-Wall", "-Wextra", "-Werror", "-pedantic", "-fsyntax-only", "main.cpp"]
    if shutil.which("g++") is None:
        pytest.skip("no g++ on this machine")
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


@needs_gcc
def test_names_from_files_cannot_break_the_source(compiled, make_subject):
    subject = replace(
        make_subject("er50"), robot='7 Axis*/ "Ä"\\', payload_file="a*/b\\\n#error.toml", joint_names=("*/",) * 6
    )
    require_equal(compiled(subject), subject, 1e-12)


@needs_gcc
def test_the_object_needs_sine_cosine_and_floor_and_nothing_else(make_subject, tmp_path):
    texts = export_c(make_subject("prbt"))
    assert sorted(texts) == ["prbt_payload.c", "prbt_payload.h"]
    for name, text in texts.items():
        (tmp_path / name).write_text(text)
    subprocess.run([GCC, *FLAGS, "-c", "prbt_payload.c"], cwd=tmp_path, check=True)
    done = subprocess.run(["nm", "-g", "prbt_payload.o"], cwd=tmp_path, capture_output=True, text=True, check=True)
    symbols = {(*line.split()[-2:],) for line in done.stdout.splitlines()}
    functions = {("T", f"prbt_payload_{name}") for name in ("torque", "gravity", "regressor")}
    functions |= {("T", f"prbt_payload_{name}") for name in ("init", "set", "compute")}
    assert symbols == {("U", "cos"), ("U", "sin"), ("U", "floor")} | functions


def test_the_header_says_what_is_no_measurement(make_subject):
    header = export_c(make_subject("er50", undetermined=("ixy", "iyz")))["er50_payload.h"]
    assert "NOT DETERMINED by the measurement: ixy, iyz." in header
    assert "NOT DETERMINED" not in export_c(make_subject("er50"))["er50_payload.h"]


def test_the_payload_keeps_every_digit(make_subject):
    subject = make_subject("er50")
    header = export_c(subject)["er50_payload.h"]
    text = header.replace("*", " ").split("about the flange's origin: ")[1].split("Inertia:")[0].strip(" .\n")
    np.testing.assert_array_equal([float(v) for v in text.split(",")], subject.payload.model.theta)


@needs_gcc
@pytest.mark.parametrize("robot", ["er50", "prbt", "ur10e"])
def test_the_torque_at_rest_is_that_of_the_weight(compiled, make_subject, robot):
    subject = make_subject(robot)
    function = compiled(subject, function="gravity")
    still = np.zeros(subject.chain.n)
    for q in np.random.default_rng(2).uniform(-3, 3, (100, subject.chain.n)):
        torque = np.full(subject.chain.n, np.nan)
        function(q, torque)
        expected = payload_torque(subject.chain, subject.payload.model.theta, q, still, still)
        np.testing.assert_allclose(torque, expected, rtol=0.0, atol=1e-12)


@needs_gcc
@pytest.mark.parametrize("robot", ["er50", "prbt", "ur10e"])
def test_the_regressor_is_pythons(compiled, make_subject, robot):
    subject = make_subject(robot)
    function = compiled(subject, function="regressor")
    for state in np.random.default_rng(3).uniform(-3, 3, (100, 3, subject.chain.n)):
        found = np.full(subject.chain.n * 10, np.nan)
        function(*state, found)
        expected = payload_regressor(subject.chain, *state)
        np.testing.assert_allclose(found.reshape(-1, 10), expected, rtol=0.0, atol=1e-11)


def test_no_loop_no_branch_and_the_operations_that_the_header_counts(make_subject):
    texts = export_c(make_subject("er50"))
    source, header = texts["er50_payload.c"], texts["er50_payload.h"]
    bodies = re.findall(r"\n{\n(.*?)\n}\n", source, re.DOTALL)[:3]
    counted = re.findall(r"Operations: (\d+) multiplications, (\d+) additions, (\d+) sines and cosines", header)
    assert len(bodies) == 3
    for body, (products, sums, angles) in zip(bodies, counted[:3], strict=True):
        assert not re.search(r"\b(for|while|if|switch|goto|malloc|static)\b|\?", body)
        found = (body.count(" * "), body.count(" + ") + body.count(" - "), body.count("sin(") + body.count("cos("))
        assert found == (int(products), int(sums), int(angles))


def test_er50_takes_fewer_operations_than_casadis_code(make_subject):
    """180 multiplications, 127 additions, 10 sines and cosines were counted there; 860 in a prototype's regressor."""
    header = export_c(make_subject("er50"))["er50_payload.h"]
    torque, _, regressor, compute = re.findall(r"(\d+) multiplications, (\d+) additions, (\d+) sines", header)
    assert int(torque[0]) <= 180
    assert int(torque[1]) <= 127
    assert int(torque[2]) <= 10
    assert int(regressor[0]) + int(regressor[1]) <= 860
    assert int(compute[0]) + int(compute[1]) <= 180 + 127


class State(ctypes.Structure):
    _fields_ = [
        *((name, ctypes.c_double * 10) for name in ("theta", "from_", "to")),
        ("done", ctypes.c_double),
        ("step", ctypes.c_double),
    ]


class Changing:
    """The payload that changes, as a C program uses it."""

    def __init__(self, library, name):
        vector = np.ctypeslib.ndpointer(np.float64, 1, flags="C_CONTIGUOUS")
        self._init, self._set, self._compute = (getattr(library, f"{name}_{f}") for f in ("init", "set", "compute"))
        self._set.argtypes = [ctypes.c_void_p, vector, ctypes.c_double, ctypes.c_double]
        self._compute.argtypes = [ctypes.c_void_p, *[vector] * 4]
        self._compute.restype = self._init.restype = None
        self._state = State()
        self._init(ctypes.byref(self._state))

    def set(self, theta, transition_s, cycle_s=0.001):
        return self._set(ctypes.byref(self._state), np.array(theta, float), transition_s, cycle_s)

    def compute(self, q, dq, ddq):
        torque = np.full(len(q), np.nan)
        self._compute(ctypes.byref(self._state), q, dq, ddq, torque)
        return torque


@pytest.fixture
def changing(compiled, make_subject, tmp_path):
    subject = make_subject("er50")
    compiled(subject)
    return subject, Changing(ctypes.CDLL(str(tmp_path / "payload.so")), "er50_payload")


@needs_gcc
def test_a_payload_that_changes_follows_pythons_feedforward(changing):
    subject, state = changing
    python = PayloadFeedforward(subject.chain, subject.payload.model)
    other = InertialParameters.from_center_of_mass(9.0, [0.1, 0.0, 0.2], np.diag([0.3, 0.25, 0.2]))
    rng = np.random.default_rng(6)
    for call in range(300):
        if call == 20:
            assert state.set(other.theta, 0.1) == 0
            python.set_payload(other, 0.1, 0.001)
        if call == 70:  # half way: taken up where it is
            assert state.set(np.zeros(10), 0.05) == 0
            python.set_payload(NOTHING, 0.05, 0.001)
        if call == 200:
            assert state.set(other.theta, 0.0) == 0
            python.set_payload(other, 0.0, 0.001)
        joints = rng.uniform(-2, 2, (3, 6))
        np.testing.assert_allclose(state.compute(*joints), python.torque_nm(*joints), rtol=0.0, atol=1e-11)


@needs_gcc
@pytest.mark.parametrize(
    "change",
    [
        {0: -1.0},
        {0: np.nan},
        {3: np.inf},
        {0: 0.0, 1: 0.5},
        {4: -0.5},
        {4: 5.0},
        {7: 3.0},
    ],
    ids=["negative mass", "nan", "infinite", "moment without mass", "negative inertia", "no triangle", "products"],
)
def test_an_impossible_payload_is_refused_and_changes_nothing(changing, change):
    subject, state = changing
    theta = subject.payload.model.theta.copy()
    for index, value in change.items():
        theta[index] = value
    joints = np.random.default_rng(7).uniform(-2, 2, (3, 6))
    before = state.compute(*joints)
    assert state.set(theta, 0.1) == -1
    np.testing.assert_array_equal(state.compute(*joints), before)


@needs_gcc
def test_possible_payloads_are_taken_and_times_below_zero_are_not(changing):
    _, state = changing
    rng = np.random.default_rng(8)
    for count in np.tile([1, 2, 3, 8], 50):  # points of mass: a needle and a plate are bodies too
        points = np.column_stack([0.2 * rng.normal(size=(count, 3)), np.ones(count)])
        points *= np.sqrt(rng.uniform(0.1, 2.0, (count, 1)))
        assert state.set(InertialParameters.from_pseudo_inertia(points.T @ points).theta, 0.1) == 0
    theta = np.zeros(10)
    assert state.set(theta, 0.1) == 0
    assert state.set(theta, -0.1) == -1
    assert state.set(theta, 0.1, 0.0) == -1
    assert state.set(theta, np.nan) == -1


def test_the_robots_name_becomes_an_identifier(make_subject):
    names = {name: replace(make_subject("er50"), robot=name).identifier for name in ("ER-50 ", "7bot", "Ä", "kr_6")}
    assert names == {"ER-50 ": "er_50", "7bot": "robot_7bot", "Ä": "robot", "kr_6": "kr_6"}
