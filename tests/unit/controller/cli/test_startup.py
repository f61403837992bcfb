"""Imports at the start of the command line: help, version and completion load no library that they do not use."""

import json
import subprocess
import sys

import numpy as np
import pytest

from armload_controller.config.chain_from_urdf import read_urdf_arm
from armload_identification.recording.run_format import MAGIC
from tests.foreign_tables import ARMS, urdf_of
from tests.urdf_simulation import PinocchioArm

HEAVY = (
    "numpy",
    "scipy",
    "msgspec",
    "pydantic",
    "rich",
    "can",
    "canopen",
    "ruckig",
    "mcap",
    "orjson",
    "matplotlib",
    "jinja2",
    "mujoco",
    "dask",
    "distributed",
    "pyarrow",
    "fsspec",
    "cyclonedds",
    "multiprocessing",
    "asyncio",
)
"""Packages that no help may load; armload's own modules are light unless they import one of these."""
SHOW_EVERYTHING = f"""
import functools, json, sys
from typer import testing
from armload_controller.cli.command_tree import app

def below(command, words):
    yield [*words, "--help"]
    for name, inner in getattr(command, "commands", {{}}).items():
        yield from below(inner, [*words, name])

loaded = {{}}
testing._get_command = functools.cache(testing._get_command)
for words in ([], ["--version"], *below(testing._get_command(app), [])):
    result = testing.CliRunner().invoke(app, words)
    assert result.exit_code == (0 if words else 2), (words, result.output)
    assert result.output.count("\\n") >= 1
    loaded[" ".join(words)] = [name for name in {HEAVY!r} if name in sys.modules]
print(json.dumps(loaded))
"""


def answer(program):
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_no_help_loads_what_it_does_not_use():
    loaded = answer(SHOW_EVERYTHING)
    assert len(loaded) > 15
    assert {words: names for words, names in loaded.items() if names} == {}


@pytest.mark.long
def test_a_pair_is_identified_with_little_of_scipy(tmp_path):
    """Its statistics take a third of an identification's time to load."""
    joints, arrays = ARMS["UR"], [tmp_path / "loaded.npz", tmp_path / "empty.npz"]
    (tmp_path / "arm.urdf").write_text(urdf_of(joints))
    arm = read_urdf_arm(tmp_path / "arm.urdf")
    limits = arm.position_min_rad, arm.position_max_rad, arm.velocity_max_rad_s
    simulated = PinocchioArm(tmp_path / "arm.urdf", joints, arm.base, arm.flange)
    for path, run in zip(arrays, simulated.runs(*limits, 1.5, (0.02, -0.01, 0.06), 0.002 * np.eye(3)), strict=True):
        np.savez(path, time_s=run.time_s, position_rad=run.position_rad, torque_nm=run.torque_nm)
    command = ["identify", str(tmp_path / "arm.urdf"), "--loaded", str(arrays[0]), "--unloaded", str(arrays[1])]
    program = (
        "import json, sys\n"
        "from typer.testing import CliRunner\n"
        "from armload_controller.cli.command_tree import app\n"
        f"result = CliRunner().invoke(app, {command!r})\n"
        "assert result.exit_code == 0, result.output\n"
        "slow = 'scipy.linalg', 'scipy.stats', 'scipy.signal', 'matplotlib'\n"
        "print(json.dumps([name for name in slow if name in sys.modules]))"
    )
    assert answer(program) == ["scipy.linalg"]


@pytest.fixture(scope="module")
def after_commands(tmp_path_factory):
    """A program that reads a recording and runs commands: the heavy packages that it has loaded, and its threads."""
    recording = tmp_path_factory.mktemp("startup") / "x.mcap"
    recording.write_bytes(MAGIC + b"cut short")
    return answer(
        "import json, os, sys\n"
        "from pathlib import Path\n"
        "os.environ['OPENBLAS_NUM_THREADS'] = '2'\n"
        "from typer.testing import CliRunner\n"
        "from armload_controller.cli.command_tree import app\n"
        "assert CliRunner().invoke(app, ['compare', 'nothing', 'nothing']).exit_code == 1\n"
        "assert CliRunner().invoke(app, ['identify', 'nonsense', '--loaded', 'x']).exit_code == 1\n"
        "from armload_identification.recording.reader_registry import reader_of\n"
        "from armload_identification.recording.reading_options import ReadingOptions\n"
        f"reader_of(Path({str(recording)!r}), ReadingOptions())\n"
        f"heavy = [name for name in {HEAVY!r} if name in sys.modules]\n"
        "import numpy, scipy.linalg\n"
        "from threadpoolctl import threadpool_info\n"
        "threads = [library['num_threads'] for library in threadpool_info()]\n"
        "print(json.dumps({'heavy': heavy, 'threads': threads}))"
    )


def test_the_list_of_heavy_modules_is_not_empty_talk(after_commands):
    """A command that runs does load them, under these names, and the reader for armload's own recordings."""
    assert {"numpy", "msgspec", "mcap"} <= set(after_commands["heavy"])


def test_linear_algebra_runs_in_one_thread(after_commands):
    """Set before the libraries are loaded, even if the environment sets more threads."""
    if not after_commands["threads"]:
        pytest.skip("no library of linear algebra that threadpoolctl knows")
    assert set(after_commands["threads"]) == {1}
