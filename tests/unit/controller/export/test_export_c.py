"""The exported C: compiled as strictly as gcc can, and equal to Python."""

import ctypes
import re
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from armload_controller.export.c99 import export_c
from armload_controller.feedforward.payload_feedforward import NOTHING, PayloadFeedforward
from armload_identification.model.payload import InertialParameters
from armload_identification.model.regressor import payload_regressor, payload_torque
from tests.unit.controller.export.compiled_c import FLAGS, GCC, needs_gcc, run

FUNCTIONS = ("torque", "gravity", "regressor", "init", "set_payload", "compute", "compute_gravity")


@pytest.fixture
def compiled(library):
    """A function of an export for numpy arrays."""

    def compiled(subject, *options, function="torque"):
        found, name = library(subject, *options)
        call = getattr(found, f"{name}_{function}")
        arrays = 2 if function == "gravity" else 4
        call.argtypes = [np.ctypeslib.ndpointer(np.float64, 1, flags="C_CONTIGUOUS")] * arrays
        call.restype = None
        return call

    return compiled


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
@pytest.mark.parametrize(("seed", "n", "options"), [(1, 1, ()), (2, 2, ()), (3, 7, ("-O2",))])
def test_any_chain_gives_pythons_and_pinocchios_torque(compiled, make_subject, any_arm, in_pinocchio, seed, n, options):
    rng = np.random.default_rng(seed)
    chain, links = any_arm(rng, n)
    subject = make_subject(chain=chain)
    moving, resting = compiled(subject, *options), compiled(subject, *options, function="gravity")
    states = rng.uniform(-3, 3, (3, 100, n))
    largest_nm = np.abs(payload_torque(chain, subject.payload.model.theta, *states)).max()
    require_equal(moving, subject, 1e-12 * max(1.0, largest_nm))

    models = [in_pinocchio(chain, links, payload) for payload in (subject.payload.model, None)]
    data, still = [model.createData() for model in models], np.zeros(n)

    def payloads(*state):
        loaded, empty = (pin.rnea(model, own, *state) for model, own in zip(models, data, strict=True))
        return loaded - empty

    for state in rng.uniform(-3, 3, (30, 3, n)):
        torque = np.full(n, np.nan)
        moving(*state, torque)
        np.testing.assert_allclose(torque, payloads(*state), rtol=1e-9, atol=1e-9)
        resting(state[0], torque)
        np.testing.assert_allclose(torque, payloads(state[0], still, still), rtol=1e-9, atol=1e-9)


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
def test_names_from_files_cannot_break_the_source(compiled, make_subject):
    subject = make_subject("er50")
    limits = replace(subject.limits, joint_names=("*/",) * 6)
    subject = replace(subject, robot='7 Axis*/ "Ä"\\', payload_file="a*/b\\\n#error.toml", limits=limits)
    require_equal(compiled(subject), subject, 1e-12)


@needs_gcc
def test_the_object_needs_sine_cosine_and_floor_and_nothing_else(make_subject, tmp_path):
    texts = export_c(make_subject("prbt"))
    assert sorted(texts) == ["CMakeLists.txt", "armload_prbt.c", "armload_prbt.h", "armload_prbt.hpp"]
    for name, text in texts.items():
        (tmp_path / name).write_text(text)
    run(GCC, *FLAGS, "-c", "armload_prbt.c", cwd=tmp_path)
    symbols = {(*line.split()[-2:],) for line in run("nm", "-g", "armload_prbt.o", cwd=tmp_path).splitlines()}
    functions = {("T", f"armload_prbt_{name}") for name in FUNCTIONS}
    assert symbols == {("U", "cos"), ("U", "sin"), ("U", "floor"), ("R", "armload_prbt_payload")} | functions


@needs_gcc
@pytest.mark.parametrize("robot", ["er50", "prbt", "ur10e"])
def test_the_self_test_passes_and_notices_another_result(library, make_subject, robot, tmp_path):
    found, name = library(make_subject(robot))
    assert getattr(found, f"{name}_selftest")() == 0
    if robot == "prbt":
        texts = export_c(make_subject(robot))
        (tmp_path / f"{name}.h").write_text(texts[f"{name}.h"])
        for k, body in enumerate(("cos(", "EXPECTED[v]")):  # a wrong function, a wrong number
            wrong = {"cos(": "sin(", "EXPECTED[v]": "EXPECTED[7 - v]"}[body]
            (tmp_path / f"{name}.c").write_text(texts[f"{name}.c"].replace(body, wrong, 1))
            run(GCC, "-DARMLOAD_SELFTEST", "-shared", "-fPIC", f"{name}.c", "-o", f"{k}.so", "-lm", cwd=tmp_path)
            assert getattr(ctypes.CDLL(str(tmp_path / f"{k}.so")), f"{name}_selftest")() == 1


def test_the_header_says_what_is_no_measurement(make_subject):
    header = export_c(make_subject("er50", undetermined=("ixy", "iyz")))["armload_er50.h"]
    assert "NOT DETERMINED by the measurement: ixy, iyz." in header
    assert "NOT DETERMINED" not in export_c(make_subject("er50"))["armload_er50.h"]


def test_the_payload_keeps_every_digit(make_subject):
    subject = make_subject("er50")
    header = export_c(subject)["armload_er50.h"]
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
    source, header = texts["armload_er50.c"], texts["armload_er50.h"]
    bodies = re.findall(r"\n{\n(.*?)\n}\n", source, re.DOTALL)[:5]
    compute, compute_gravity, torque, gravity, regressor = counted_operations(header)
    assert len(bodies) == 5
    for body, counted in zip(bodies, (torque, gravity, regressor, compute, compute_gravity), strict=True):
        assert not re.search(r"\b(for|while|if|switch|goto|malloc|static)\b|\?", body)
        assert counted == (body.count(" * "), body.count(" + ") + body.count(" - "), len(re.findall("sin|cos", body)))


def counted_operations(header):
    """Multiplications, additions, sines and cosines of compute, compute_gravity, torque, gravity and regressor."""
    found = re.findall(r"Operations: (\d+) multiplications, (\d+) additions, (\d+) sines and cosines", header)
    return [tuple(int(count) for count in counts) for counts in found]


@pytest.mark.parametrize(("robot", "products", "sums"), [("er50", 180, 127), ("prbt", 177, 120)])
def test_arms_take_fewer_operations_than_casadis_code(make_subject, robot, products, sums):
    """CasADi's counts of products and sums, with 10 sines and cosines; a prototype's regressor took 860 operations."""
    compute, _, torque, _, regressor = counted_operations(export_c(make_subject(robot))[f"armload_{robot}.h"])
    assert torque[0] <= products
    assert torque[1] <= sums
    assert torque[2] <= 10
    assert sum(compute[:2]) <= products + sums
    assert sum(regressor[:2]) <= 860


class State(ctypes.Structure):
    _fields_ = [
        *((name, ctypes.c_double * 10) for name in ("theta", "from_", "to")),
        *((name, ctypes.c_uint32) for name in ("done", "calls")),
    ]


class Changing:
    """The payload with changes, as used by a C program."""

    def __init__(self, library, name):
        vector = np.ctypeslib.ndpointer(np.float64, 1, flags="C_CONTIGUOUS")
        names = ("init", "set_payload", "compute", "compute_gravity")
        self._init, self._set, self._compute, self._gravity = (getattr(library, f"{name}_{f}") for f in names)
        self._set.argtypes = [ctypes.c_void_p, vector, ctypes.c_double, ctypes.c_double]
        self._compute.argtypes = [ctypes.c_void_p, *[vector] * 4]
        self._gravity.argtypes = [ctypes.c_void_p, *[vector] * 2]
        self.state = State()
        self._init(ctypes.byref(self.state))

    def set(self, theta, transition_s, cycle_s=0.001):
        return self._set(ctypes.byref(self.state), np.array(theta, float), transition_s, cycle_s)

    def compute(self, q, dq, ddq):
        torque = np.full(len(q), np.nan)
        self._compute(ctypes.byref(self.state), q, dq, ddq, torque)
        return torque

    def gravity(self, q):
        torque = np.full(len(q), np.nan)
        self._gravity(ctypes.byref(self.state), q, torque)
        return torque


@pytest.fixture
def changing(library, make_subject):
    subject = make_subject("er50")
    return subject, Changing(*library(subject))


OTHER = InertialParameters.from_center_of_mass(9.0, [0.1, 0.0, 0.2], np.diag([0.3, 0.25, 0.2]))


@needs_gcc
def test_a_payload_that_changes_follows_pythons_feedforward(changing):
    subject, state = changing
    python = PayloadFeedforward(subject.chain, subject.payload.model)
    rng = np.random.default_rng(6)
    changes = {20: (OTHER, 0.5), 270: (NOTHING, 0.3), 800: (OTHER, 0.4)}  # the second begins half-way through the first
    for call in range(1300):
        if call in changes:
            payload, transition_s = changes[call]
            assert state.set(payload.theta, transition_s) == 0
            python.set_payload(payload, transition_s, 0.001)
        joints = rng.uniform(-2, 2, (3, 6))
        if call % 3 == 0:
            still = np.zeros(6)
            np.testing.assert_allclose(state.gravity(joints[0]), python.torque_nm(joints[0], still, still), atol=1e-11)
        else:
            np.testing.assert_allclose(state.compute(*joints), python.torque_nm(*joints), rtol=0.0, atol=1e-11)


@needs_gcc
@pytest.mark.parametrize("robot", ["er50", "prbt"])
def test_a_change_at_once_is_spread_until_no_joint_exceeds_its_rate(library, make_subject, robot):
    subject, cycle_s = make_subject(robot), 0.01
    state = Changing(*library(subject))
    fastest = 0.0
    for q in np.random.default_rng(9).uniform(-3, 3, (20, subject.chain.n)):
        for payload in (OTHER, NOTHING):
            before = state.gravity(q)
            assert state.set(payload.theta, 0.0, cycle_s) == 0
            while state.state.done < state.state.calls:
                torque = state.gravity(q)
                fastest = max(fastest, float(np.max(np.abs(torque - before) / subject.torque_rate_nm_s)) / cycle_s)
                before = torque
    assert 0.15 < fastest <= 1.0  # a common bound for all joints in all postures


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
    for count in np.tile([1, 2, 3, 8], 50):  # point masses: a needle and a plate are bodies too
        points = np.column_stack([0.2 * rng.normal(size=(count, 3)), np.ones(count)])
        points *= np.sqrt(rng.uniform(0.1, 2.0, (count, 1)))
        assert state.set(InertialParameters.from_pseudo_inertia(points.T @ points).theta, 0.1) == 0
    theta = np.zeros(10)
    assert state.set(theta, 0.1) == 0
    assert state.set(theta, -0.1) == -1
    assert state.set(theta, 0.1, 0.0) == -1
    assert state.set(theta, 0.1, -0.001) == -1
    assert state.set(theta, 1e4, 1e-6) == -1  # more cycles than the counter holds
    assert state.set(np.array([2e9, *np.zeros(9)]), 0.1, 100.0) == -1
    assert state.set(theta, np.nan) == -1


def test_the_robots_name_becomes_an_identifier(make_subject):
    names = {name: replace(make_subject("er50"), robot=name).identifier for name in ("ER-50 ", "7bot", "Ä", "kr_6")}
    assert names == {"ER-50 ": "er_50", "7bot": "robot_7bot", "Ä": "robot", "kr_6": "kr_6"}
