"""`--float`: within the error that its header states, and without an implicit conversion."""

import ctypes
import re
import shutil
import subprocess

import numpy as np
import pytest

from armload_controller.export.c99 import export_c
from armload_controller.export.c_code.rounding import single_precision_error
from armload_controller.export.c_code.self_test import states_within
from armload_controller.export.straight_line.precision import Precision
from armload_identification.model.payload import InertialParameters
from armload_identification.model.regressor import payload_torque
from tests.unit.controller.export.compiled_c import FLAGS, GCC, needs_gcc, run

CORTEX_GCC = shutil.which("arm-none-eabi-gcc")
CORTEX_M4 = ("-Os", "-mcpu=cortex-m4", "-mfpu=fpv4-sp-d16", "-mfloat-abi=hard")
CPPCHECK = shutil.which("cppcheck")
VECTOR = np.ctypeslib.ndpointer(np.float32, 1, flags="C_CONTIGUOUS")


@needs_gcc
@pytest.mark.parametrize("robot", ["er50", "prbt"])
def test_torque_is_within_the_stated_error_of_the_cores(library, make_subject, robot):
    subject = make_subject(robot)
    found, name = library(subject, precision=Precision.SINGLE)
    states = states_within(subject, 500, seed=40).astype(np.float32)
    expected = payload_torque(subject.chain, subject.payload.model.theta, *np.swapaxes(states.astype(float), 0, 1))
    state = (ctypes.c_char * 256)()
    getattr(found, f"{name}_init")(state)
    functions = {"torque": (), "compute": (state,)}
    stated = single_precision_error(subject)
    for function, first in functions.items():
        call = getattr(found, f"{name}_{function}")
        call.argtypes = [*[ctypes.c_void_p] * len(first), *[VECTOR] * 4]
        torque = np.full(6, np.nan, np.float32)
        worst = 0.0
        for given, wanted in zip(states, expected, strict=True):
            call(*first, *given, torque)
            worst = max(worst, float(np.abs(torque - wanted).max()))
        assert 0.1 * stated.bound_nm < worst <= stated.bound_nm
    assert getattr(found, f"{name}_selftest")() == 0
    assert stated.greatest_nm == pytest.approx(np.abs(expected).max(), rel=0.3)


@needs_gcc
def test_a_payload_is_set_and_an_impossible_one_refused(library, make_subject):
    found, name = library(make_subject("er50"), precision=Precision.SINGLE)
    state = (ctypes.c_char * 256)()
    getattr(found, f"{name}_init")(state)
    call = getattr(found, f"{name}_set_payload")
    call.argtypes = [ctypes.c_void_p, VECTOR, ctypes.c_float, ctypes.c_float]
    rng = np.random.default_rng(41)
    for count in np.tile([1, 2, 3, 8], 50):  # point masses: a needle and a plate are bodies too
        points = np.column_stack([0.2 * rng.normal(size=(count, 3)), np.ones(count)])
        points *= np.sqrt(rng.uniform(0.1, 2.0, (count, 1)))
        theta = InertialParameters.from_pseudo_inertia(points.T @ points).theta.astype(np.float32)
        assert call(state, theta, 0.1, 0.001) == 0
        for index, factor in ((0, -1.0), (4, -0.5), (5, 3.0)):
            wrong = theta.copy()
            wrong[index] = factor * (theta[4] + theta[5] + theta[6]) if index else -theta[0]
            assert call(state, wrong, 0.1, 0.001) == -1


@needs_gcc
def test_nothing_of_it_is_double(make_subject, tmp_path):
    texts = export_c(make_subject("prbt"), Precision.SINGLE)
    for name, text in texts.items():
        (tmp_path / name).write_text(text)
    run(GCC, *FLAGS, "-DARMLOAD_SELFTEST", "-c", "armload_prbt.c", cwd=tmp_path)
    symbols = {line.split()[-1] for line in run("nm", "-u", "armload_prbt.o", cwd=tmp_path).splitlines()}
    assert symbols == {"cosf", "sinf", "floorf"}
    code = re.sub(r"/\*.*?\*/", "", texts["armload_prbt.c"] + texts["armload_prbt.h"], flags=re.DOTALL)
    assert not re.search(r"\bdouble\b|\d\.\d+(e[-+]\d+)?(?!f|\d|e)", code)


@needs_gcc
@pytest.mark.skipif(CORTEX_GCC is None, reason="no gcc-arm-none-eabi on this machine")
def test_a_cortex_m4_computes_it_in_its_own_unit(make_subject, tmp_path):
    texts = export_c(make_subject("er50"), Precision.SINGLE)
    for name, text in texts.items():
        (tmp_path / name).write_text(text)
    run(CORTEX_GCC, *FLAGS, *CORTEX_M4, "-DARMLOAD_SELFTEST", "-c", "armload_er50.c", cwd=tmp_path)
    tool = CORTEX_GCC.removesuffix("gcc") + "nm"
    symbols = {line.split()[-1] for line in run(tool, "-u", "armload_er50.o", cwd=tmp_path).splitlines()}
    assert symbols == {"cosf", "sinf", "floorf"}  # no __aeabi_dadd, the addition of doubles


@pytest.mark.long
@pytest.mark.skipif(CPPCHECK is None, reason="no cppcheck on this machine")
def test_of_misras_rules_only_advice_is_not_followed(calibrated, tmp_path):
    for name, text in export_c(calibrated, Precision.SINGLE).items():
        (tmp_path / name).write_text(text)
    command = [CPPCHECK, "--addon=misra", "--std=c99", "--enable=style,warning", "-DARMLOAD_SELFTEST", "armload_er50.c"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True)
    broken = set(re.findall(r"misra-c2012-([\d.]+)", done.stderr))
    # macros for the caller, functions and constants of file scope, more than one return
    assert {"2.5"} <= broken <= {"2.5", "8.7", "8.9", "15.5"}


def test_the_error_is_in_the_header(make_subject):
    subject = make_subject("er50")
    header = " ".join(re.sub(r"\n \* ", " ", export_c(subject, Precision.SINGLE)["armload_er50.h"]).split())
    assert single_precision_error(subject).statement in header
