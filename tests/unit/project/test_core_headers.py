"""The core's C: each header is a unit of its own, and what Python repeats of its numbers agrees."""

import re
import subprocess
import sysconfig
from pathlib import Path

import pytest

from armload_core.c_compiler import INSTALL_ONE, c_compiler
from armload_identification.pipeline import estimator_constants

SOURCE = Path(__file__).resolve().parents[3] / "identification" / "armload_core" / "source"
PYTHON_HEADERS = Path(sysconfig.get_path("include"))
HEADERS = sorted(str(file.relative_to(SOURCE)) for file in SOURCE.rglob("*.h"))
FLAGS = ("-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-fsyntax-only", f"-I{SOURCE}", f"-I{PYTHON_HEADERS}")


@pytest.mark.parametrize("header", HEADERS)
def test_a_header_compiles_alone_and_may_be_included_twice(header):
    compiler = c_compiler()
    if compiler is None:
        pytest.skip(f"no C compiler on this machine. {INSTALL_ONE}")
    if header.startswith("python/") and not (PYTHON_HEADERS / "Python.h").is_file():
        pytest.skip(f"no Python.h in {PYTHON_HEADERS} (Debian, Ubuntu: apt install python3-dev)")
    done = subprocess.run(
        [*compiler, *FLAGS, "-xc", "-"], input=2 * f'#include "{header}"\n', capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr


def test_python_repeats_the_estimators_numbers_as_they_are():
    text = (SOURCE / "estimator" / "estimator_numbers.h").read_text()
    numbers = dict(re.findall(r"^static const double (\w+) = (.+);$", text, re.MULTILINE))
    assert float(numbers["ROW_S"]) == estimator_constants.ROW_S
    assert float(numbers["WINDOW_S"]) == estimator_constants._WINDOW_S


def test_every_number_of_the_estimator_says_where_it_is_from_and_what_it_costs():
    text = (SOURCE / "estimator" / "estimator_numbers.h").read_text()
    explained = re.findall(r"/\*((?:(?!\*/).)*)\*/\n(?:static const double|enum \{) (\w+) =", text, re.DOTALL)
    assert len(explained) == len(re.findall(r"^(?:static|enum)", text, re.MULTILINE)) > 40
    for comment, name in explained:
        assert "Origin: " in comment, name
        assert re.search(r"Cost: |Twice: |Six: |0\.90: ", comment), name
