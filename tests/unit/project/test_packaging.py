"""Pinned requirements and contents of the packages."""

import importlib.util
import re
import subprocess
import sys
from importlib import resources
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]
BUILD = ROOT / "identification" / "armload_core" / "source" / "compilation"
PEERS = ROOT / "benchmarks" / "peers"


def test_the_pins_carry_hashes_and_no_addresses():
    locks = [
        ROOT / "requirements.lock",
        ROOT / "controller" / "commission.lock",
        BUILD / "compiler.lock",
        BUILD / "wheels.lock",
        PEERS / "requirements.lock",
    ]
    if not locks[0].is_file():
        pytest.skip("not a checkout: the pins are not installed")
    text = "\n".join(lock.read_text() for lock in locks)
    pins = [line for line in text.splitlines() if line and not line.lstrip().startswith("#")]
    assert sum(line[0].isalpha() for line in pins) > 30
    for line in pins:
        assert line[0].isalpha() or line.startswith("    --hash=sha256:"), line
        assert "/" not in line, line


def test_the_pins_of_a_commissioning_are_among_all_pins():
    locks = [ROOT / "requirements.lock", ROOT / "controller" / "commission.lock"]
    if not locks[0].is_file():
        pytest.skip("not a checkout: the pins are not installed")
    every, few = ({line for line in lock.read_text().splitlines() if "==" in line} for lock in locks)
    assert {line for line in few if not line.startswith("editables")} < every  # pip needs it to install the checkout
    names = {line.partition("==")[0] for line in few}
    assert {"scipy", "matplotlib", "mujoco", "hatchling"} <= names
    assert not names & {"pin", "dask", "pyarrow", "pytest"}


def build_program():
    """The program that compiles the kernels, as a module."""
    if not BUILD.is_dir():
        pytest.skip("not a checkout: the kernels' sources are not installed")
    spec = importlib.util.spec_from_file_location("build_extension", BUILD / "build_extension.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_missing_headers_of_python_are_named_with_their_package(tmp_path):
    with pytest.raises(SystemExit, match=r"no Python\.h in .*apt install python3-dev"):
        build_program().compile_extension(tmp_path, include=tmp_path)


def test_without_a_compiler_two_are_offered(tmp_path):
    if importlib.util.find_spec("ziglang"):
        pytest.skip("PyPI's compiler is installed")
    build_program()
    command = [sys.executable, str(BUILD / "build_extension.py"), str(tmp_path)]
    done = subprocess.run(command, env={"PATH": str(tmp_path)}, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert "apt install gcc" in done.stderr
    assert "pip install ziglang" in done.stderr


def test_what_does_not_compile_leaves_no_file(tmp_path):
    with pytest.raises(SystemExit, match="were not compiled"):
        build_program().compile_extension(tmp_path, ("-include", "not_there.h"))
    assert not [file for file in tmp_path.iterdir() if file.suffix == ".so"]


@pytest.mark.pure
def test_robots_and_report_template_are_package_data():
    robots = {file.name for file in resources.files("armload_configs").iterdir()}
    assert {"er50.toml", "er50_identification.toml", "er50_validation.toml", "ur10e.toml"} <= robots
    report = {file.name for file in resources.files("armload_identification.report").iterdir()}
    assert {"template.html.j2", "style.css"} <= report
    for package in (
        "armload_core",
        "armload_drivers",
        "armload_controller",
        "armload_identification",
        "armload_configs",
    ):
        assert resources.files(package).joinpath("py.typed").is_file()


def test_pure_tests_import_nothing_that_is_not_in_the_wheel():
    """They run with the sources away, where there are no benchmarks."""
    tests = Path(__file__).parents[2]
    pure = [file for file in tests.rglob("test_*.py") if "mark.pure" in file.read_text("utf-8")]
    importing = [file.name for file in pure if re.search(r"^(from|import) benchmarks", file.read_text("utf-8"), re.M)]
    assert len(pure) > 50
    assert not importing
