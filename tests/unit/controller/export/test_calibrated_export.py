"""The exported C of a calibrated arm: the payload's friction in its gears, and the recursive estimator."""

import ctypes
import re

import numpy as np
import pytest

from armload_controller.export.c99 import export_c
from armload_controller.export.straight_line.precision import Precision
from armload_controller.feedforward.body_torque import LoadFriction
from armload_core import kernels
from armload_identification.model.regressor import payload_torque
from tests.unit.controller.export.compiled_c import FLAGS, GCC, needs_gcc, run

pytestmark = pytest.mark.pure


@needs_gcc
def test_the_payloads_friction_is_pythons_on_an_arm_that_is_not_level(library, calibrated):
    found, name = library(calibrated)
    function = getattr(found, f"{name}_friction")
    function.argtypes = [np.ctypeslib.ndpointer(np.float64, 1, flags="C_CONTIGUOUS")] * 5
    python = LoadFriction(calibrated.chain, calibrated.calibration.body)
    greatest = 0.0
    for state in np.random.default_rng(31).uniform(-1.5, 1.5, (200, 3, 6)):
        payload_nm = payload_torque(calibrated.chain, calibrated.payload.model.theta, *state)
        friction = np.full(6, np.nan)
        function(*state, payload_nm, friction)
        np.testing.assert_allclose(friction, python.torque_nm(*state, payload_nm), rtol=0.0, atol=1e-11)
        greatest = max(greatest, float(np.abs(friction).max()))
    assert greatest > 1.0
    assert found.armload_er50_selftest() == 0


@needs_gcc
def test_in_single_precision_too(library, calibrated):
    found, name = library(calibrated, precision=Precision.SINGLE)
    assert getattr(found, f"{name}_selftest")() == 0


def test_the_header_names_the_calibration_and_has_friction_only_then(calibrated, make_subject):
    header = export_c(calibrated)["armload_er50.h"]
    assert "Calibration of the arm: arm.calibration.toml, sha256 77ab." in header
    assert "#define ARMLOAD_ER50_FRICTION 1" in header
    assert "friction" not in export_c(make_subject("er50"))["armload_er50.h"].lower()


class Exported:
    """The exported estimator, with the methods of the core's."""

    def __init__(self, library, name, n):
        self._library, self._name, self._n = library, name, n
        self._state = (ctypes.c_double * 4096)()
        vector = np.ctypeslib.ndpointer(np.float64, flags="C_CONTIGUOUS")
        self._function("init")(self._state)
        self._update, self._read = self._function("update"), self._function("read")
        self._update.argtypes = [ctypes.c_void_p, ctypes.c_double, vector, vector]
        self._read.argtypes = [ctypes.c_void_p, *[vector] * 5]

    def _function(self, name):
        return getattr(self._library, f"{self._name}_estimator_{name}")

    def update(self, time_s, position, effort):
        self._update(self._state, time_s, position, effort)

    def read_into(self, *arrays):
        self._read(self._state, *arrays)


def read(estimator, n=6):
    found = np.empty(10), np.empty((10, 10)), np.empty((3, n)), np.empty(n), np.empty(kernels.ESTIMATOR_STATUS)
    estimator.read_into(*found)
    return found


@needs_gcc
def test_the_estimator_is_the_cores_sample_by_sample(library, calibrated):
    """A payload is grasped and dropped; irregular time stamps, lost samples, a NaN, and a clock that is set back."""
    subject = calibrated
    exported = Exported(*library(subject), 6)
    core = kernels.PayloadEstimator(subject.chain.packed, *subject.estimator)
    rng = np.random.default_rng(32)
    body, theta = subject.calibration.body, 2.0 * subject.payload.model.theta
    to_effort = np.linalg.inv(subject.estimator.from_effort)
    time_s = np.cumsum(rng.uniform(0.002, 0.012, 2500))
    rates = rng.uniform(0.5, 3.0, 6)
    phase = np.outer(time_s, rates)
    q, dq, ddq = 0.8 * np.sin(phase), 0.8 * rates * np.cos(phase), -0.8 * rates**2 * np.sin(phase)
    payload_nm = payload_torque(subject.chain, theta, q, dq, ddq)
    payload_nm *= ((time_s > 5.0) & (time_s < 12.0))[:, None]
    effort = (body.torque(subject.chain, q, dq, ddq, payload_nm) + rng.normal(0.0, 0.5, q.shape)) @ to_effort
    q[700, 2] = np.nan
    time_s[2000:] -= 5.0
    largest = 0.0
    for k in np.delete(np.arange(len(time_s)), np.arange(900, 930)):
        exported.update(time_s[k], q[k], effort[k])
        core.update(time_s[k], q[k], effort[k])
        if k % 25 == 24:
            found, expected = read(exported), read(core)
            for one, other in zip(found, expected, strict=True):
                np.testing.assert_allclose(one, other, rtol=1e-7, atol=1e-7)
            largest = max(largest, found[0][0])
    assert largest == pytest.approx(theta[0], rel=0.2)
    status = found[-1]
    assert status[kernels.ESTIMATOR_CHANGES] >= 2.0
    assert status[kernels.ESTIMATOR_REFUSED] == 1.0
    assert status[kernels.ESTIMATOR_ROWS] > 100.0


@needs_gcc
def test_only_names_of_this_arm_are_visible_to_the_linker(calibrated, tmp_path):
    for name, text in export_c(calibrated).items():
        (tmp_path / name).write_text(text)
    run(GCC, *FLAGS, "-c", "armload_er50_estimator.c", cwd=tmp_path)
    defined = [
        line.split()[-1]
        for line in run("nm", "-g", "--defined-only", "armload_er50_estimator.o", cwd=tmp_path).splitlines()
    ]
    assert len(defined) == 6
    assert all(name.startswith("armload_er50_estimator_") for name in defined)


def test_its_header_says_what_to_give_it_and_what_it_costs(calibrated):
    header = export_c(calibrated)["armload_er50_estimator.h"]
    assert "Effort is in A of motor current." in header
    flat = " ".join(header.replace("\n *", " ").split())
    cost = r"at two points of its window, the regressor \(\d{3} multiplications and additions\) and the arm.s links"
    assert re.search(cost + r" \(\d{3}\)", flat)
    assert "sha256 77ab" in header
    # no name may collide with another arm's in the same program
    given = re.findall(r"^(?:\} |void )(\w+)", header, re.MULTILINE)
    assert len(given) == 10
    assert all(name.startswith("armload_er50_") for name in given)
    constants = re.findall(r"^ *(?:#define |#ifndef |#undef )?([A-Z][A-Z_0-9]+)\b", header, re.MULTILINE)
    assert {name for name in constants if not name.startswith("ARMLOAD_ER50_")} == {"ROW"}
