"""The exported C of a calibrated arm: the payload's friction in its gears."""

from dataclasses import replace

import numpy as np

from armload_controller.export.c99 import export_c
from armload_controller.export.straight_line.precision import Precision
from armload_controller.feedforward.body_torque import LoadFriction
from armload_identification.model.regressor import payload_torque
from tests.unit.controller.export.compiled_c import needs_gcc


def calibrated(make_subject, any_calibration, robot="er50"):
    subject = make_subject(robot)
    calibration = any_calibration(subject.chain)
    chain = calibration.level(subject.chain)
    return replace(subject, chain=chain, calibration=calibration, calibration_sha256={"arm.calibration.toml": "77ab"})


@needs_gcc
def test_the_payloads_friction_is_pythons_on_an_arm_that_is_not_level(library, make_subject, any_calibration):
    subject = calibrated(make_subject, any_calibration)
    found, name = library(subject)
    function = getattr(found, f"{name}_friction")
    function.argtypes = [np.ctypeslib.ndpointer(np.float64, 1, flags="C_CONTIGUOUS")] * 5
    python = LoadFriction(subject.chain, subject.calibration.body)
    greatest = 0.0
    for state in np.random.default_rng(31).uniform(-1.5, 1.5, (200, 3, 6)):
        payload_nm = payload_torque(subject.chain, subject.payload.model.theta, *state)
        friction = np.full(6, np.nan)
        function(*state, payload_nm, friction)
        np.testing.assert_allclose(friction, python.torque_nm(*state, payload_nm), rtol=0.0, atol=1e-11)
        greatest = max(greatest, float(np.abs(friction).max()))
    assert greatest > 1.0
    assert found.armload_er50_selftest() == 0


@needs_gcc
def test_in_single_precision_too(library, make_subject, any_calibration):
    found, name = library(calibrated(make_subject, any_calibration), precision=Precision.SINGLE)
    assert getattr(found, f"{name}_selftest")() == 0


def test_the_header_names_the_calibration_and_has_friction_only_then(make_subject, any_calibration):
    header = export_c(calibrated(make_subject, any_calibration))["armload_er50.h"]
    assert "Calibration of the arm: arm.calibration.toml, sha256 77ab." in header
    assert "#define ARMLOAD_ER50_FRICTION 1" in header
    assert "friction" not in export_c(make_subject("er50"))["armload_er50.h"].lower()
