"""Plug-ins named in a robot file: the example package built, installed and run, and all errors."""

import contextlib
import itertools
import re
import sys
import zipfile
from importlib import resources
from pathlib import Path

import hatchling.build
import numpy as np
import pytest

from armload_controller.config.robot import load_robot
from armload_controller.control_errors import ConfigurationError, MotionError
from armload_controller.cycle.stop_decisions import Cause, cause_of
from armload_controller.motion.motion_control import MotionControl
from armload_controller.session.run_session import Consent, NoDisplay, Operator, run_session
from armload_controller.session.session_load import SessionLoad

EXAMPLE = Path(__file__).parents[3] / "example_plugin"
NUMBERS = itertools.count()


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """The content of the example package's wheel, as pip installs it."""
    folder = tmp_path_factory.mktemp("wheel")
    with contextlib.chdir(EXAMPLE):
        wheel = hatchling.build.build_wheel(str(folder))
    zipfile.ZipFile(folder / wheel).extractall(folder / "installed")
    return folder / "installed"


@pytest.fixture
def installed(built, monkeypatch):
    """The example package is installed."""
    monkeypatch.syspath_prepend(built)


@pytest.fixture
def bring(tmp_path, monkeypatch):
    """Install a package of one module with plug-ins; returns the name of its settings table there."""

    def bring(source, **names):
        number = next(NUMBERS)
        module, folder = f"brought_{number}", tmp_path / f"site-{number}"
        information = folder / f"package_{number}-2.dist-info"
        information.mkdir(parents=True)
        (folder / f"{module}.py").write_text("import armload\n" + source)
        (information / "METADATA").write_text(f"Metadata-Version: 2.1\nName: package-{number}\nVersion: 2\n")
        lines = "".join(f"{name} = {module}:{there}\n" for name, there in names.items())
        (information / "entry_points.txt").write_text(f"[armload.plugins]\n{lines}")
        monkeypatch.syspath_prepend(folder)
        return f"package-{number} 2"

    return bring


@pytest.fixture
def robot(tmp_path):
    """prbt with some plug-ins in its file."""

    def robot(tables):
        text = (resources.files("armload_configs") / "prbt.toml").read_text("utf-8")
        text = re.sub(r"^\[excitation\]\n(.+\n)*", "", text, flags=re.MULTILINE)
        path = tmp_path / "mine.toml"
        path.write_text(f"{text}\n{tables}")
        return load_robot(str(path))

    return robot


class Steps(NoDisplay):
    """A display that keeps the steps."""

    def __init__(self):
        self.steps = []

    def step(self, text):
        self.steps.append(text)


@pytest.fixture
def servos(ideal_servos):
    """A perfect arm."""
    return ideal_servos(6, 0.01)


@pytest.fixture
def held(servos):
    """Hold the perfect arm for some cycles under a robot's file."""

    def held(robot, cycles=30, display=None):
        @contextlib.contextmanager
        def open_servos(load):
            servos.log.append("open")
            yield servos
            servos.close()
            servos.log.append("closed")

        until = len(servos.sent) + cycles
        operator = Operator(display or NoDisplay(), MotionControl(), Consent(lambda question: False, given=False))
        with run_session(robot, SessionLoad.UNLOADED, open_servos, operator) as session:
            session.hold([], lambda hold: hold(lambda: len(servos.sent) >= until))

    return held


def ceiling(**changes):
    """The example's table."""
    values = {"joint": '"prbt_joint_2"', "torque_nm": "50.0", "cycles": "10"} | changes
    return "[plugins.torque_ceiling]\n" + "".join(f"{key} = {value}\n" for key, value in values.items() if value)


@pytest.mark.usefixtures("installed")
def test_the_example_is_called_in_every_cycle_and_stops_the_arm(robot, held):
    display = Steps()
    held(robot(ceiling(torque_nm="1e4")), display=display)
    assert display.steps[0] == "plug-in plugins.torque_ceiling of torque-ceiling 1.0"
    with pytest.raises(MotionError, match=r"prbt_joint_2 has .* N m, its ceiling is 1e-06 N m") as caught:
        held(robot(ceiling(torque_nm="1e-6")))
    assert cause_of(caught.value.__cause__) is Cause.PLUGIN_REQUEST


@pytest.mark.usefixtures("installed")
@pytest.mark.parametrize(
    ("tables", "said"),
    [
        (
            ceiling(joint='"joint_9"'),
            "plugins.torque_ceiling.joint is 'joint_9': expected one of prbt_joint_1, prbt_joint_2",
        ),
        (ceiling(torque_nm="-1.0"), "plugins.torque_ceiling.torque_nm is -1.0: expected a number greater than 0"),
        (ceiling(torque_nm=None, torque="5.0"), "torque_nm is missing: it is required; torque is an unknown key"),
        (ceiling(cycles=None), "plugins.torque_ceiling.cycles is missing: it is required"),
        (
            ceiling().replace("torque_ceiling", "torque_cieling"),
            "plugins.torque_cieling is refused: no plug-in with this name is installed. Did you mean torque_ceiling? "
            "Installed are: torque_ceiling (torque-ceiling 1.0). Install its package in armload's environment, or "
            "remove the table",
        ),
    ],
)
def test_what_is_wrong_in_the_file_is_refused_before_the_arm_is_opened(robot, held, servos, tables, said):
    with pytest.raises(ConfigurationError) as caught:
        held(robot(tables))
    assert servos.log == []
    assert "mine.toml: " in str(caught.value)
    assert said in str(caught.value)


def test_a_package_that_is_not_installed_stops_motions_and_nothing_else(robot, held):
    mine = robot("[plugins.elsewhere]\nanything = 1\n")
    assert mine.plugins == {"elsewhere": {"anything": 1}}
    with pytest.raises(ConfigurationError, match=r"plugins\.elsewhere is refused: no plug-in .* Installed are: none\."):
        held(mine)


def test_a_plug_in_is_a_table(robot):
    with pytest.raises(ConfigurationError, match=r"plugins\.torque_ceiling is 3: expected a table"):
        robot("[plugins]\ntorque_ceiling = 3\n")


@pytest.mark.parametrize(
    ("source", "said"),
    [
        ("1 / 0", r"brought_\d+:Mine of {package} cannot be loaded: ZeroDivisionError"),
        ("", r"brought_\d+:Mine of {package} cannot be loaded: AttributeError"),
        ("Mine = dict", r"is <class 'dict'>, expected a class derived from armload\.PluginTable"),
        (
            "class Mine(armload.PluginTable):\n    def plugin(self, robot): return robot.nothing",
            r"{package} could not create its plug-in: AttributeError",
        ),
        (
            "class Mine(armload.PluginTable):\n    def plugin(self, robot): return 5",
            r"{package} returned 5, expected an object with on_cycle\(step\)",
        ),
        ("class Mine(armload.PluginTable): pass", r"{package} could not create its plug-in: .*abstract"),
    ],
)
def test_what_is_wrong_in_a_package_is_reported_with_its_name(bring, robot, held, source, said):
    package = bring(source, mine="Mine")
    with pytest.raises(ConfigurationError, match=said.format(package=package)) as caught:
        held(robot("[plugins.mine]\n"))
    assert "mine.toml: plugins.mine is refused: " in str(caught.value)


def test_one_name_of_two_packages_is_refused(bring, robot, held):
    source = "class Mine(armload.PluginTable): pass"
    packages = [bring(source, mine="Mine"), bring(source, mine="Mine")]
    with pytest.raises(
        ConfigurationError, match=f"{packages[0]} and {packages[1]} both provide a plug-in with this name"
    ):
        held(robot("[plugins.mine]\n"))


PLUGIN = """
class Mine(armload.PluginTable):
    def plugin(self, robot): return Plugin()
class Plugin:
    def on_cycle(self, step):
        {act}
    def close(self):
        calls.append("close")
calls = []
"""


@pytest.mark.parametrize(
    ("act", "said"),
    [
        (
            "return step.feedback.position_rad",
            r"returned array.*expected None: a plug-in named in a robot's file cannot add torque",
        ),
        ("raise KeyError('x')", "raised KeyError: 'x'"),
        # an error that the cycle could take for its own stop and then ignore
        (
            "from armload_controller.control_errors import MotionError; raise MotionError('mine', ())",
            "raised MotionError: mine",
        ),
        # what it sees is what leaves: in place, this would send the arm to zero
        ("step.command.position_rad[:] = 0.0", "raised ValueError: assignment destination is read-only"),
        ("step.reference.position_rad[:] = 0.0", "raised ValueError: assignment destination is read-only"),
    ],
)
def test_a_plug_in_that_fails_brings_the_arm_to_rest_along_its_path(bring, robot, servos, held, act, said):
    package = bring(PLUGIN.format(act=act), mine="Mine")
    with pytest.raises(MotionError, match=rf"plug-in 'plugins\.mine' of {package} {said}") as caught:
        held(robot("[plugins.mine]\n"))
    assert cause_of(caught.value.__cause__) is Cause.PLUGIN_FAILED
    assert "disable" in servos.log
    for command in servos.sent:
        np.testing.assert_allclose(command.position_rad, 0.1, atol=1e-6)
        assert not command.torque_offset_nm.any()


def test_a_plug_in_is_closed_when_the_arm_is_off(bring, robot, servos, held):
    package = bring(PLUGIN.format(act="calls.append('cycle')"), mine="Mine")
    held(robot("[plugins.mine]\n"), cycles=3)
    assert servos.log[-1] == "closed"
    calls = sys.modules[f"brought_{package.split()[0].removeprefix('package-')}"].calls
    assert calls == ["cycle"] * (len(calls) - 1) + ["close"]
    assert len(calls) > len(servos.sent)
