"""Exported C, compiled as strictly as gcc can."""

import shutil
import subprocess

import pytest

GCC = shutil.which("gcc")
WARNINGS = "all extra conversion double-promotion shadow cast-qual strict-prototypes missing-prototypes undef error"
FLAGS = ["-std=c99", "-pedantic", *(f"-W{name}" for name in WARNINGS.split())]

needs_gcc = pytest.mark.skipif(GCC is None, reason="no gcc on this machine")


def run(*command, cwd):
    done = subprocess.run(command, cwd=cwd, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout
