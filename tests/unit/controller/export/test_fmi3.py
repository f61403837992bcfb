"""The exported FMUs, FMI 3.0 and 2.0: valid, and equal to Python when simulated by fmpy."""

import ctypes
import io
import re
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Model, FMU2Slave
from fmpy.fmi3 import FMU3Model, FMU3Slave
from fmpy.model_description import read_build_description, read_model_description
from fmpy.validation import validate_fmu

from armload_controller.control_errors import ExportError
from armload_controller.export.body_parameters import PARAMETERS
from armload_controller.export.fmi.fmi2 import export_fmu2, fmu2_texts
from armload_controller.export.fmi.fmi3 import export_fmu, fmu_texts
from armload_controller.feedforward.body_torque import LoadFriction
from armload_controller.feedforward.payload_feedforward import PayloadFeedforward
from armload_identification.model.chain import Chain
from armload_identification.model.payload import PARAMETER_NAMES, InertialParameters

STEP_S = 0.002
HEADERS = Path(fmpy.__file__).parent / "c-code"


@pytest.fixture(scope="module", autouse=True)
def quickly_compiled():
    """Compile without optimisation, which is not tested here."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setenv("CFLAGS", "-O0")
        yield


@dataclass(frozen=True)
class Version:
    """Differences between the versions of the standard."""

    number: int
    export: Callable
    texts: Callable
    token: str
    begin: Callable
    calls: str
    functions: int


def begin_3(slave):
    slave.enterInitializationMode(startTime=0.0)


def begin_2(slave):
    slave.setupExperiment(startTime=0.0)
    slave.enterInitializationMode()


CALLS = ("set", "get", "save", "restore", "pack", "unpack", "release", "integer")
CALLS_3 = "setFloat64 getFloat64 getFMUState setFMUState serializeFMUState deserializeFMUState freeFMUState getInt32"
CALLS_2 = "setReal getReal getFMUstate setFMUstate serializeFMUstate deSerializeFMUstate freeFMUstate getInteger"
VERSIONS = [
    Version(3, export_fmu, fmu_texts, "instantiation token", begin_3, CALLS_3, 70),
    Version(2, export_fmu2, fmu2_texts, "GUID", begin_2, CALLS_2, 30),
]


@pytest.fixture(scope="module", params=VERSIONS, ids=lambda version: f"FMI {version.number}")
def version(request):
    return request.param


@pytest.fixture(scope="module")
def made(version, make_subject, tmp_path_factory):
    """A subject, its FMU, and the unpacked FMU."""
    subject = make_subject("er50")
    ((name, content),) = version.export(subject).items()
    folder = tmp_path_factory.mktemp("fmu")
    (folder / name).write_bytes(content)
    zipfile.ZipFile(io.BytesIO(content)).extractall(folder / "unpacked")
    return subject, folder / name, folder / "unpacked"


class Unit:
    """An instance, accessed by the names of its variables."""

    def __init__(self, version, folder, token=None):
        description = read_model_description(str(folder))
        self.reference = {variable.name: variable.valueReference for variable in description.modelVariables}
        self.version = version
        self.slave = (FMU3Slave if version.number == 3 else FMU2Slave)(
            instanceName="unit",
            guid=token or description.guid or description.instantiationToken,
            unzipDirectory=str(folder),
            modelIdentifier=description.modelName,
        )
        self.slave.instantiate()

    def call(self, what, *arguments):
        return getattr(self.slave, self.version.calls.split()[CALLS.index(what)])(*arguments)

    def begin(self, **values):
        self.set(**values)
        self.version.begin(self.slave)
        self.slave.exitInitializationMode()
        self.now_s = 0.0

    def set(self, **values):
        for name, value in values.items():
            self.call("set", [self.reference[name]], [value])

    def set_joints(self, q, dq, ddq):
        for symbol, values in (("q", q), ("dq", dq), ("ddq", ddq)):
            self.call("set", [self.reference[f"{symbol}[{i + 1}]"] for i in range(len(values))], list(values))

    def torque(self):
        return np.array(self.call("get", [self.reference[f"tau[{i}]"] for i in range(1, 7)]))

    def step(self, step_s=STEP_S):
        self.slave.doStep(self.now_s, step_s)
        self.now_s += step_s
        return self.torque()


@pytest.fixture
def unit(version, made):
    units = []

    def unit(**values):
        units.append(Unit(version, made[2]))
        units[-1].begin(**values)
        return units[-1]

    yield unit
    for one in units:
        one.slave.freeInstance()


def states(count, seed=1):
    return np.random.default_rng(seed).uniform(-3, 3, (count, 3, 6))


def test_the_fmu_is_valid(version, made):
    assert validate_fmu(str(made[1])) == []
    listed = [f"fmi{version.number}.c", "armload_er50.c"]
    if version.number == 3:
        (build,) = read_build_description(str(made[1]))
        assert [list(files.sourceFiles) for files in build.sourceFileSets] == [listed]
    else:
        description = (made[2] / "modelDescription.xml").read_text()
        assert re.findall(r'<File name="(.*?)"', description) == 2 * listed


def test_every_variable_has_a_unit_and_a_description_and_the_payload_is_tunable(made):
    subject, path, _ = made
    variables = {variable.name: variable for variable in read_model_description(str(path)).modelVariables}
    assert all((variable.unit and variable.description) for variable in variables.values())
    tunable = [name for name, variable in variables.items() if variable.variability == "tunable"]
    assert tunable == [*(name for name, _, _ in PARAMETERS), "transition"]
    body = subject.payload.model
    assert float(variables["mass"].start) == body.mass_kg
    center = [float(variables[f"com_{axis}"].start) for axis in "xyz"]
    np.testing.assert_array_equal(center, body.center_of_mass_m)
    assert float(variables["ixy"].start) == body.inertia_about_com[0, 1]
    assert variables["q[2]"].description == f"position of {subject.joint_names[1]}"
    assert {variables[f"{symbol}[6]"].unit for symbol in ("q", "dq", "ddq", "tau")} == {
        "rad",
        "rad/s",
        "rad/s2",
        "N.m",
    }


def test_simulated_it_gives_pythons_torque(made):
    """With fmpy's own simulation: inputs by name, outputs at the communication points."""
    subject, path, _ = made
    feedforward = PayloadFeedforward(subject.chain, subject.payload.model)
    times = STEP_S * np.arange(200)
    angle = 2 * times[:, None] + np.arange(6)
    motion = np.stack([np.sin(angle), 2 * np.cos(angle), -4 * np.sin(angle)], axis=1)
    names = [f"{symbol}[{i}]" for symbol in ("q", "dq", "ddq") for i in range(1, 7)]
    inputs = np.zeros(len(times), dtype=[("time", float), *((name, float) for name in names)])
    inputs["time"] = times
    for column, name in enumerate(names):
        inputs[name] = motion[:, column // 6, column % 6]
    result = fmpy.simulate_fmu(
        str(path), stop_time=times[-1], output_interval=STEP_S, input=inputs, output=[f"tau[{i}]" for i in range(1, 7)]
    )
    found = np.array([[row[f"tau[{i}]"] for i in range(1, 7)] for row in result])
    # the torque at the end of a step belongs to the inputs at its beginning
    expected = np.array([feedforward.torque_nm(*state).copy() for state in motion])
    assert len(found) == len(times)
    np.testing.assert_allclose(found[1:], expected[:-1], rtol=0, atol=1e-12)


def test_in_model_exchange_the_torque_is_that_of_the_present_inputs(made):
    """With fmpy's solver: no delay of a step."""
    subject, path, _ = made
    feedforward = PayloadFeedforward(subject.chain, subject.payload.model)
    times = STEP_S * np.arange(100)
    inputs = np.zeros(len(times), dtype=[("time", float), ("q[2]", float)])
    inputs["time"], inputs["q[2]"] = times, 3.0 * times
    result = fmpy.simulate_fmu(
        str(path),
        fmi_type="ModelExchange",
        stop_time=times[-1],
        output_interval=STEP_S,
        input=inputs,
        output=["tau[2]"],
    )
    still = np.zeros((3, 6))
    for row in result:
        still[0, 1] = 3.0 * row["time"]
        assert row["tau[2]"] == pytest.approx(feedforward.torque_nm(*still)[1], abs=1e-9)
    assert len(result) >= len(times)


def exchange(version, folder):
    """An instance for model exchange in continuous time, and the references of its variables."""
    description = read_model_description(str(folder))
    model = (FMU3Model if version.number == 3 else FMU2Model)(
        instanceName="exchange",
        guid=description.guid or description.instantiationToken,
        unzipDirectory=str(folder),
        modelIdentifier=description.modelName,
    )
    model.instantiate()
    version.begin(model)
    model.exitInitializationMode()
    return model, {variable.name: variable.valueReference for variable in description.modelVariables}


def test_in_model_exchange_a_payload_changes_at_an_event(version, made, capsys):
    subject, (state,) = made[0], states(1)
    model, reference = exchange(version, made[2])
    setter, getter = (getattr(model, version.calls.split()[CALLS.index(what)]) for what in ("set", "get"))
    torque = [reference[f"tau[{i}]"] for i in range(1, 7)]
    model.enterContinuousTimeMode()
    for symbol, values in zip(("q", "dq", "ddq"), state, strict=True):
        setter([reference[f"{symbol}[{i + 1}]"] for i in range(6)], list(values))
    before = PayloadFeedforward(subject.chain, subject.payload.model).torque_nm(*state)
    np.testing.assert_allclose(getter(torque), before, rtol=0, atol=1e-12)
    with pytest.raises(FMICallException):
        setter([reference["mass"]], [4.0])
    assert "is a parameter: change it in event mode" in capsys.readouterr().out
    model.enterEventMode()
    for name, value in BODY.items():
        setter([reference[name]], [value])
    model.enterContinuousTimeMode()
    np.testing.assert_allclose(getter(torque), torque_of(subject, BODY, state), rtol=0, atol=1e-12)
    model.enterEventMode()
    setter([reference["mass"]], [-1.0])
    with pytest.raises(FMICallException):
        model.enterContinuousTimeMode()
    assert "no body has these parameters: mass -1 kg" in capsys.readouterr().out
    model.freeInstance()


def test_any_state_gives_pythons_torque(made, unit):
    subject, running = made[0], unit()
    feedforward = PayloadFeedforward(subject.chain, subject.payload.model)
    for state in states(50):
        running.set_joints(*state)
        np.testing.assert_allclose(running.step(), feedforward.torque_nm(*state), rtol=0, atol=1e-12)


BODY = {"mass": 4.0, "com_x": 0.05, "com_y": -0.1, "com_z": 0.2, "ixx": 0.03, "iyy": 0.04, "izz": 0.02}
BODY |= {"ixy": 0.002, "ixz": -0.003, "iyz": 0.001}


def torque_of(subject, values, state):
    i = {name: values[f"i{name}"] for name in ("xx", "yy", "zz", "xy", "xz", "yz")}
    inertia = [[i["xx"], i["xy"], i["xz"]], [i["xy"], i["yy"], i["yz"]], [i["xz"], i["yz"], i["zz"]]]
    center = [values[f"com_{axis}"] for axis in "xyz"]
    body = InertialParameters.from_center_of_mass(values["mass"], center, np.array(inertia))
    return PayloadFeedforward(subject.chain, body).torque_nm(*state)


def test_a_payload_that_is_set_before_holds_from_the_beginning(made, unit):
    subject, (state,) = made[0], states(1)
    running = unit(**BODY)
    running.set_joints(*state)
    np.testing.assert_allclose(running.step(), torque_of(subject, BODY, state), rtol=0, atol=1e-12)


def test_outputs_of_the_initialization_follow_its_inputs(version, made):
    running, (state,) = Unit(version, made[2]), states(1)
    version.begin(running.slave)
    running.set(**BODY)
    running.set_joints(*state)
    np.testing.assert_allclose(running.torque(), torque_of(made[0], BODY, state), rtol=0, atol=1e-12)
    running.set(mass=BODY["mass"] / 2)
    found = running.torque()
    np.testing.assert_allclose(found, torque_of(made[0], BODY | {"mass": 2.0}, state), rtol=0, atol=1e-12)
    running.slave.freeInstance()


def test_a_payload_that_is_changed_comes_without_a_step(made, unit):
    subject, (state,) = made[0], states(1)
    state[1:] = 0.0
    running = unit(transition=0.1)
    running.set_joints(*state)
    before = running.step()
    running.set(**BODY)
    torques = np.array([before, *(running.step() for _ in range(2000))])
    np.testing.assert_allclose(torques[-1], torque_of(subject, BODY, state), rtol=0, atol=1e-12)
    fastest = np.abs(np.diff(torques, axis=0)).max(axis=0) / STEP_S
    assert (fastest <= subject.torque_rate_nm_s).all()
    assert (np.abs(torques[25] - before) < np.abs(torques[-1] - before)).any()


def test_a_saved_state_goes_on_as_it_would_have(unit):
    running = unit(transition=0.2)
    running.set_joints(*states(1)[0])
    running.set(**BODY)
    for _ in range(10):
        running.step()
    kept = running.call("save")
    stored = running.call("pack", kept)
    first = [running.step() for _ in range(20)]
    running.set(mass=0.0, **{name: 0.0 for name in BODY if name != "mass"})
    running.step()
    running.call("restore", kept)
    np.testing.assert_array_equal([running.step() for _ in range(20)], first)
    again = running.call("unpack", stored)
    running.call("restore", again)
    np.testing.assert_array_equal([running.step() for _ in range(20)], first)
    for state in (kept, again):
        running.call("release", state)


def test_reset_begins_anew(made, unit):
    subject, (state,) = made[0], states(1)
    running = unit(**BODY)
    running.set_joints(*state)
    running.step()
    running.slave.reset()
    running.begin()
    running.set_joints(*state)
    expected = PayloadFeedforward(subject.chain, subject.payload.model).torque_nm(*state)
    np.testing.assert_allclose(running.step(), expected, rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        (lambda unit: (unit.set(mass=-1.0), unit.step()), "no body has these parameters: mass -1 kg"),
        (lambda unit: unit.set(mass=float("nan")), "the value for reference 19 is not a finite number"),
        (lambda unit: unit.set(**{"q[1]": float("inf")}), "the value for reference 1 is not a finite number"),
        (lambda unit: unit.set(transition=-1.0), "transition is -1 s, expected 0 or more"),
        (lambda unit: unit.set(**{"tau[1]": 1.0}), "no input or parameter has the value reference 30"),
        (lambda unit: unit.set(time=1.0), "no input or parameter has the value reference 0"),
        (lambda unit: unit.call("get", [36]), "no variable has the value reference 36"),
        (lambda unit: unit.step(0.0), "a step of 0 s: expected more than 0"),
        (lambda unit: unit.call("integer", [1]), "this FMU has nothing of that kind"),
        (
            lambda unit: (unit.slave.terminate(), unit.step()),
            "DoStep: the instance is terminated, expected one that is in step mode",
        ),
    ],
)
def test_what_is_wrong_is_an_error_that_says_so(unit, capsys, wrong, said):
    running = unit()
    with pytest.raises(FMICallException):
        wrong(running)
    assert said in capsys.readouterr().out


def test_another_fmus_description_is_refused(version, made, capsys):
    with pytest.raises(Exception, match="Failed to instantiate"):
        Unit(version, made[2], token="{0}")
    assert f"the {version.token} is not this binary's" in capsys.readouterr().out


@pytest.fixture(scope="module")
def small(make_subject):
    """An arm of two joints, which compiles fast."""
    xyz, axis = np.array([[0.0, 0.0, 0.2], [0.5, 0.0, 0.0]]), np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0]])
    return make_subject(chain=Chain.from_origins(xyz, np.zeros((2, 3)), axis, np.eye(4), np.array([0.0, 0.0, -9.81])))


def test_of_a_calibrated_arm_the_payloads_friction_is_added(calibrated, tmp_path):
    ((name, content),) = export_fmu(calibrated).items()
    (tmp_path / name).write_bytes(content)
    assert validate_fmu(str(tmp_path / name)) == []
    zipfile.ZipFile(tmp_path / name).extractall(tmp_path)
    running = Unit(VERSIONS[0], tmp_path)
    running.begin()
    feedforward = PayloadFeedforward(calibrated.chain, calibrated.payload.model)
    friction = LoadFriction(calibrated.chain, calibrated.calibration.body)
    for share, state in zip((1.0, 1.0, 0.5, 0.0), states(4), strict=True):
        running.set(friction=share)
        running.set_joints(*state)
        payload_nm = feedforward.torque_nm(*state).copy()
        friction_nm = friction.torque_nm(*state, payload_nm)
        assert np.abs(friction_nm).max() > 0.1
        np.testing.assert_allclose(running.step(), payload_nm + share * friction_nm, rtol=0, atol=1e-11)
    running.slave.freeInstance()


def test_the_same_payload_gives_the_same_bytes(small):
    assert export_fmu(small) == export_fmu(small)


def test_the_code_starts_with_the_parameters_of_its_description(version, made):
    subject, _, folder = made
    code = "".join(text for file, text in version.texts(subject).items() if file.endswith(".c"))
    ((values),) = re.findall(r"START\[[^]]+\] = \{([^}]*)\}", code)
    stated = [
        float(variable.start)
        for variable in read_model_description(str(folder)).modelVariables
        if variable.causality == "parameter"
    ]
    assert [float(value) for value in values.split(",")] == stated
    assert len(stated) > 10


@pytest.mark.skipif(shutil.which("gcc") is None, reason="no gcc on this machine")
def test_names_from_files_break_neither_xml_nor_c(version, small, tmp_path):
    limits = replace(small.limits, joint_names=('*/<&>"\n', "\u00e4-->\\"))
    subject = replace(small, robot='7 Axis*/ "\u00c4"\\', payload_file='a*/b"\\\n#error.toml', limits=limits)
    for file, text in version.texts(subject).items():
        assert text.isascii()
        (tmp_path / file).parent.mkdir(exist_ok=True)
        (tmp_path / file).write_text(text)
        if not file.endswith("buildDescription.xml"):
            assert "written by armload 1.2.3" in text
            assert "sha256 0123abcd" in re.sub(r"\s+\*? ?", " ", text)
    assert validate_fmu(str(tmp_path)) == []
    assert read_model_description(str(tmp_path)).modelName == "armload_robot_7_axis"
    words = [
        "gcc",
        "-std=gnu99",
        "-fsyntax-only",
        "-Wall",
        "-Werror",
        f"fmi{version.number}.c",
        "armload_robot_7_axis.c",
    ]
    done = subprocess.run(words, cwd=tmp_path / "sources", capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_an_inertia_that_is_not_determined_is_marked(small):
    determined = np.array([name not in {"ixx", "iyz"} for name in PARAMETER_NAMES])
    subject = replace(small, payload=replace(small.payload, determined=determined))
    text = fmu_texts(subject)["documentation/index.html"]
    assert "NOT DETERMINED by the measurement: ixx, iyz" in text


@pytest.mark.skipif(shutil.which("gcc") is None, reason="no gcc on this machine")
def test_the_interface_is_the_standards(version, made):
    """The sources compile strictly against the standard's own headers: all types and arguments agree."""
    sources = made[2] / "sources"
    command = ["gcc", "-std=gnu99", "-fsyntax-only", "-Wall", "-Wextra", "-Wconversion", "-Werror"]
    for more in ([], ["-DARMLOAD_FMI_HEADERS", f"-isystem{HEADERS}"]):
        done = subprocess.run(
            [*command, *more, f"fmi{version.number}.c"], cwd=sources, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stderr


def test_all_functions_of_the_standard_are_there_and_nothing_else(version, made):
    library = next(made[2].glob("binaries/*/*.so"))
    found = ctypes.CDLL(str(library))
    header = (HEADERS / f"fmi{version.number}Functions.h").read_text()
    named = re.findall(rf"^\s*FMI{version.number}_Export \w+ +(\w+);", header, re.MULTILINE)
    assert len(named) > version.functions
    assert [name for name in named if not hasattr(found, name)] == []
    assert not hasattr(found, "armload_er50_compute")


def test_without_a_compiler_the_message_says_what_to_install(small, monkeypatch, tmp_path):
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setitem(sys.modules, "ziglang", None)
    with pytest.raises(ExportError, match=r"armload_er50\.fmu: holds a compiled library, but no C compiler was found"):
        export_fmu(small)
    monkeypatch.setenv("CC", str(tmp_path / "nocc"))
    with pytest.raises(ExportError, match=r"the C compiler .*nocc cannot be run: No such file"):
        export_fmu(small)
    monkeypatch.setenv("CC", shutil.which("false", path="/bin:/usr/bin"))
    with pytest.raises(ExportError, match=r"the C compiler .*false ended with 1"):
        export_fmu(small)
