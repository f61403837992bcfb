"""`import armload`: its names, what they import, their examples, and the result of an identification."""

import contextlib
import doctest
import inspect
import json
import pydoc
import shutil
import subprocess
import sys
from importlib import resources
from importlib.metadata import version
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

import armload
from armload_controller.control_errors import ConfigurationError
from armload_identification.identification_errors import (
    EstimationError,
    ExcitationError,
    PayloadFileError,
)
from armload_identification.model.payload import PARAMETER_NAMES, InertialParameters
from armload_identification.verdict.agreement import Outcome


def answer(program):
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_every_public_name_is_there_and_listed():
    assert set(armload.__all__) <= set(dir(armload))
    assert armload.__all__ == sorted(armload.__all__)
    for name in armload.__all__:
        assert getattr(armload, name) is getattr(armload, name)
    with pytest.raises(AttributeError, match="no attribute 'identity'"):
        armload.identity  # noqa: B018 - tests the attribute access


def test_every_argument_of_a_public_function_is_described():
    """Inside, an argument that would only repeat its name has no entry; here all have, and every shape and unit."""
    functions = [getattr(armload, name) for name in armload.__all__]
    methods = [method for thing in functions if inspect.isclass(thing) for method in vars(thing).values()]
    for function in (getattr(one, "__func__", one) for one in (*functions, *methods)):
        text = inspect.getdoc(function) or ""
        if inspect.isfunction(function) and ("Args:" in text or function in functions):
            arguments = set(inspect.signature(function).parameters) - {"self", "cls"}
            assert [name for name in arguments if f"\n    {name}: " not in text] == [], function


def test_each_name_is_that_of_its_module():
    assert {public: there for public, (_, there) in armload._HOMES.items() if public != there} == {}
    assert armload.__version__ == version("armload")


def test_help_begins_with_what_people_use():
    shown = pydoc.plain(pydoc.render_doc(armload))
    places = [shown.index(f"    {name}(") for name in ("commission", "identify", "validate", "calibrate", "watch")]
    assert places == sorted(places)
    assert places[-1] < shown.index("\nCLASSES") < shown.index("\nFUNCTIONS")


def test_names_are_loaded_when_they_are_used():
    loaded = answer(
        "import json, sys\n"
        "import armload\n"
        "heavy = ('numpy', 'scipy', 'can', 'canopen', 'typer', 'rich', 'matplotlib', 'msgspec', 'ruckig', 'mcap')\n"
        "listed = lambda: [name for name in heavy if name in sys.modules]\n"
        "first = listed()\n"
        "armload.PayloadFeedforward\n"
        "print(json.dumps([first, listed()]))"
    )
    assert loaded == [[], ["numpy"]]


def test_an_identification_loads_neither_a_bus_nor_a_drawing_nor_the_command_line():
    loaded = answer(
        "import json, sys\n"
        "import armload\n"
        "armload.identify\n"
        "heavy = ('canopen', 'typer', 'rich', 'matplotlib', 'jinja2', 'mujoco')\n"
        "print(json.dumps([name for name in heavy if name in sys.modules]))"
    )
    assert loaded == []


EXAMPLES = [
    test
    for name in ("", *armload.__all__)
    for test in doctest.DocTestFinder(recurse=name in {"Recording", "Findings"}).find(
        getattr(armload, name) if name else armload, f"armload.{name}", module=False, globs={}
    )
    if test.examples
]
SLOW = ("armload.identify", "armload.design", "armload.commission", "armload.fleet")


def test_every_public_name_is_in_an_example():
    text = "".join(example.source for test in EXAMPLES for example in test.examples)
    assert [name for name in armload.__all__ if f"armload.{name}" not in text] == []
    assert len(EXAMPLES) >= 9


@pytest.mark.parametrize(
    "test",
    [pytest.param(test, marks=[pytest.mark.long] * (test.name in SLOW), id=test.name) for test in EXAMPLES],
)
def test_examples_run_as_they_stand(test, recorded_er50, tmp_path):
    if test.name != "armload.commission":  # makes these recordings
        (tmp_path / "runs").symlink_to(recorded_er50 / "runs")
    if test.name == "armload.fleet":  # Dask's threads last as long as their process
        program = "import armload, doctest; doctest.run_docstring_examples(armload.fleet, {})"
        run = subprocess.run([sys.executable, "-c", program], cwd=tmp_path, capture_output=True, text=True, check=True)
        assert run.stdout == ""
        return
    runner = doctest.DocTestRunner()
    with contextlib.chdir(tmp_path):
        runner.run(test)
    assert runner.summarize(verbose=False) == (0, len(test.examples))


def test_printed_it_is_a_table_with_the_verdict(found):
    lines = str(found).splitlines()
    assert lines[1].split() == ["parameter", "estimate", "95", "%", "interval", "unit"]
    assert [line.split()[0] for line in lines[2:12]] == list(PARAMETER_NAMES)
    for line, known in zip(lines[2:12], found.payload.determined, strict=True):
        assert ("not determined" in line) == (not known)
    assert found.verdict.title in lines[12]


def test_a_prompt_shows_the_table_and_a_notebook_too(found):
    assert repr(found) == str(found)
    page = ElementTree.fromstring(f"<div>{found._repr_html_()}</div>")
    assert [row.findtext("td") for row in page.iter("tr")][1:] == list(PARAMETER_NAMES)
    assert found.verdict.title in page.findtext("p")


@pytest.fixture(scope="module")
def folder(recorded_er50):
    return recorded_er50 / "runs" / "today"


def test_objects_are_taken_in_the_place_of_paths(folder, tmp_path, found):
    robot, payload = armload.load_robot("er50"), armload.read_payload(folder / "payload.toml")
    runs = [folder / f"{load}_identification.mcap" for load in ("unloaded", "loaded")]
    arm = armload.calibrate(robot, [armload.read_recording(run, robot) for run in runs])
    arm.save(tmp_path / "arm.toml")
    read = armload.read_calibration(tmp_path / "arm.toml")
    by_kind = [armload.identify(robot, runs[1], calibration=each) for each in (arm, read, tmp_path / "arm.toml")]
    assert len({each.payload.model.mass_kg for each in by_kind[1:]}) == 1
    assert by_kind[0].payload.model.mass_kg == pytest.approx(by_kind[1].payload.model.mass_kg, rel=1e-6)
    hashes = [each.payload.provenance.calibration_sha256 for each in by_kind]
    assert {*hashes[0].values()} == {*hashes[1].values()} == {*hashes[2].values()}
    assert [*hashes[0], *hashes[2]] == ["calibration of er50", "arm.toml"]
    assert armload.compare(payload, folder / "payload.toml", calibration=arm).outcome is not Outcome.WRONG
    one = armload.export(robot, payload, "urdf", tmp_path / "a.urdf")
    assert list(one.files.values()) == [True]
    joints = np.array([0.0, 1.0, 0.2, 0.0, 1.0, 0.0])
    torques = [
        armload.PayloadFeedforward(*given).torque_nm(joints, 0 * joints, 0 * joints).copy()
        for given in (("er50", folder / "payload.toml"), (robot, payload), (robot.chain, payload.model))
    ]
    assert np.ptp(torques, axis=0).max() == 0.0
    feedforward = armload.PayloadFeedforward(robot, armload.NOTHING)
    feedforward.set_payload(found, 0.0, 0.001)
    expected = armload.PayloadFeedforward(robot, found).torque_nm(joints, 0 * joints, 0 * joints)
    np.testing.assert_array_equal(feedforward.torque_nm(joints, 0 * joints, 0 * joints), expected)
    assert armload.export(robot, found, "urdf", tmp_path / "b.urdf").files
    assert armload.compare(found, found.payload).outcome is Outcome.RIGHT


@pytest.mark.parametrize(
    ("call", "argument"),
    [
        (lambda: armload.identify(5, "a.mcap"), "robot"),
        (lambda: armload.identify("er50", 5), "loaded"),
        (lambda: armload.identify("er50", "a.mcap", calibration=5), "calibration"),
        (lambda: armload.validate("er50", 5, "a.mcap", "b.mcap"), "payload"),
        (lambda: armload.compare(5, 5), "payload"),
        (lambda: armload.PayloadFeedforward("er50", 5), "payload"),
        (lambda: armload.PayloadFeedforward(5, 5), "robot"),
        (lambda: armload.drift([], "a.mcap"), "robot"),
        (lambda: armload.calibrate("er50", 5), "runs"),
        (lambda: armload.identify("er50", "a.mcap", known=5), "known"),
        (lambda: armload.identify("er50", "a.mcap", minus=5), "minus"),
        (lambda: armload.identify("er50", "a.mcap", tolerance=0.02), "tolerance"),
        (lambda: armload.identify("er50", "a.mcap", validation="b.mcap"), "validation"),
        (lambda: armload.compare("a.toml", "b.toml", tolerance=5), "tolerance"),
        (lambda: armload.commission(armload, "out"), "robot"),
        (lambda: armload.commission("er50", None), "output"),
        (lambda: armload.load_robot(None), "name_or_path"),
        (lambda: armload.load_robot(b"er50"), "name_or_path"),
        (lambda: armload.read_payload(None), "path"),
        (lambda: armload.read_calibration(None), "path"),
        (lambda: armload.read_urdf_arm(None), "path"),
        (lambda: armload.read_recording(None), "path"),
        (lambda: armload.read_recording("a.mcap", joints="1-3"), "joints"),
        (lambda: armload.read_recording("a.mcap", between_s=5.0), "between_s"),
        (lambda: armload.read_recording("a.mcap", between_s=(10,)), "between_s"),
        (lambda: armload.read_recording("a.mcap", between_s=("10", "20")), "between_s"),
        (lambda: armload.KnownPayload(mass_kg="2.1"), "mass_kg"),
        (lambda: armload.KnownPayload(mass_kg=(1, "3")), "mass_kg"),
        (lambda: armload.KnownPayload(mass_kg=(1, (2, 3))), "mass_kg"),
        (lambda: armload.KnownPayload(center_of_mass_m=("0", 0, 0)), "center_of_mass_m"),
        (lambda: armload.calibrate("er50", [None]), "runs"),
        (lambda: armload.identify("er50", "a.mcap", drift=0.03), "drift"),
        (lambda: armload.watch("er50", None), "recording"),
        (lambda: armload.export("er50", "a.toml", "c", options={"single": True}), "options"),
        (lambda: armload.export("er50", "a.toml", "c", None), "output"),
        (lambda: armload.design("er50", search=3), "search"),
        (lambda: armload.design("er50", period_s="fast"), "period_s"),
    ],
)
def test_an_argument_of_another_type_gets_a_sentence(call, argument):
    with pytest.raises(TypeError, match=rf"^`{argument}=` is .* \(\w+\): expected .+\.$"):
        call()


def test_an_effort_that_is_none_is_told_which_there_are():
    with pytest.raises(armload.IdentificationError, match="`effort=` is 'power': expected torque or current"):
        armload.read_recording("a.mcap", effort="power")


@pytest.mark.parametrize("read", [armload.read_payload, armload.read_calibration, armload.load_robot])
def test_a_table_where_a_file_in_toml_is_expected_is_told_where_it_goes(read, tmp_path):
    (tmp_path / "run.csv").write_text("time,position_1\n0,0\n")
    with pytest.raises((armload.IdentificationError, armload.ControlError), match=r"run\.csv: a recording .*--loaded"):
        read(tmp_path / "run.csv")


def test_a_loop_takes_no_payload_of_another_arm_and_none_that_no_body_has(found):
    with pytest.raises(PayloadFileError, match="identified on the robot 'er50', not on 'prbt'"):
        armload.PayloadFeedforward("prbt", found)
    impossible = InertialParameters.from_center_of_mass(-2.0, np.zeros(3), 0.01 * np.eye(3))
    with pytest.raises(armload.IdentificationError, match="no body has"):
        armload.PayloadFeedforward("er50", impossible)
    with pytest.raises(armload.IdentificationError, match="no body has"):
        armload.PayloadFeedforward("er50", armload.NOTHING).set_payload(impossible, 0.2, 0.001)


def test_a_real_arm_is_not_commissioned_from_python(tmp_path):
    robot = armload.load_robot("er50").with_bus("socketcan", "can0")
    with pytest.raises(armload.ControlError, match="not simulated in this process, but on socketcan"):
        armload.commission(robot, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_printed_recording_is_one_line():
    time_s = 0.01 * np.arange(300.0)
    position_rad = np.sin(np.outer(time_s, [1.0, 2.0]))
    run = armload.Recording.from_arrays(time_s, position_rad, torque_nm=position_rad, name="mine")
    assert repr(run) == str(run) == "mine: 2 joints, 2.99 s, 300 rows of time_s, position_rad, torque_nm"
    assert repr(armload.load_robot("er50")).startswith("Robot er50: 6 joints, ")
    gap = np.where(time_s == time_s[7], np.nan, time_s)
    part = armload.Recording.from_arrays(gap, position_rad, current_a=position_rad, velocity_rad_s=position_rad)
    assert str(part.joints([1])) == (
        "arrays: 1 joint, 2.99 s, 299 rows (1 of 300 left out) of time_s, position_rad, velocity_rad_s, current_a"
    )


def test_it_is_saved(found, tmp_path):
    found.save(tmp_path / "payload.toml")
    assert armload.read_payload(tmp_path / "payload.toml").model.mass_kg == found.payload.model.mass_kg


@pytest.mark.long
def test_it_is_reported(found, tmp_path):
    found.report(tmp_path / "report.html")
    page = (tmp_path / "report.html").read_text()
    assert found.verdict.title in page
    assert "Simulated" in page
    assert "validation, loaded" in page


def test_the_dictionary_is_plain_and_has_no_number_for_what_is_not_determined(found):
    document = found.to_dict()
    assert json.loads(json.dumps(document, allow_nan=False)) == document
    flat = [document["payload"]["mass_kg"], *document["payload"]["center_of_mass_m"].values()]
    flat += document["payload"]["inertia_kg_m2"].values()
    assert [value is not None for value in flat] == found.payload.determined.tolist()


@pytest.mark.parametrize(
    ("call", "base"),
    [
        (lambda: armload.load_robot("none.toml"), armload.ControlError),
        (lambda: armload.read_urdf_arm("none.urdf"), armload.ControlError),
        (lambda: armload.read_recording("none.mcap"), armload.IdentificationError),
        (lambda: armload.read_payload("none.toml"), armload.IdentificationError),
        (lambda: armload.read_calibration("none.toml"), armload.IdentificationError),
        (lambda: armload.identify("er50", "none.mcap", "none.mcap"), armload.IdentificationError),
        (lambda: armload.design("er50", search=armload.DesignSearch(criterion="none")), armload.IdentificationError),
        (lambda: armload.design("er50", period_s=-1.0), armload.ControlError),
        (lambda: armload.Tolerance(mass_share=0.0), armload.IdentificationError),
        (lambda: armload.KnownPayload(mass_kg=-1.0), armload.IdentificationError),
        (lambda: armload.Recording.from_arrays([0.0, 1.0], [0.0, 1.0]), armload.IdentificationError),
    ],
)
def test_what_is_wrong_is_one_of_two_errors(call, base):
    with pytest.raises(base):
        call()


def test_a_robot_is_given_by_its_name_or_by_a_path(recorded_er50, tmp_path):
    configs = Path(str(resources.files("armload_configs")))
    for file in configs.glob("er50*.toml"):
        shutil.copy(file, tmp_path)
    path = tmp_path / "er50.toml"
    assert armload.load_robot(path).file == armload.load_robot(str(path)).file == str(path)
    assert armload.load_robot(Path("er50")).sha256 == armload.load_robot("er50").sha256
    run = recorded_er50 / "runs/today/loaded_identification.mcap"
    assert armload.read_recording(run, path).n == 6
    with pytest.raises(EstimationError, match="no unloaded recording was given"):
        armload.identify(path, run)
    with pytest.raises(PayloadFileError, match=r"none\.toml"):
        armload.validate(path, tmp_path / "none.toml", run, run)
    with pytest.raises(ExcitationError, match="criterion is 'none'"):
        armload.design(path, search=armload.DesignSearch(criterion="none"))
    with pytest.raises(ConfigurationError, match=r"none\.toml: no such file, and no shipped robot: er50"):
        armload.identify(tmp_path / "none.toml", run)
