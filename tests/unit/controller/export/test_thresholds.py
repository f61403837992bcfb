"""Thresholds for a collision detection: from noise and friction of the calibration, under the payload."""

import tomllib
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import norm

from armload_controller.control_errors import ExportError
from armload_controller.export.thresholds import _greatest, export_thresholds
from armload_identification.model.payload import InertialParameters
from armload_identification.model.regressor import payload_torque
from armload_identification.signals.signal_constants import RowMean


def thresholds_of(subject):
    (text,) = export_thresholds(subject).values()
    return tomllib.loads(text), text


def test_every_joint_has_the_sum_of_its_noise_and_its_friction(calibrated):
    found, text = thresholds_of(calibrated)
    assert found["joints"] == list(calibrated.joint_names)
    parts = [found[f"{part}_nm"] for part in ("noise", "friction", "abrupt")]
    np.testing.assert_allclose(found["threshold_nm"], np.sum(parts, axis=0), rtol=1e-6)
    body = calibrated.calibration.body
    assert (np.array(found["friction_nm"]) >= 1.5 * body.coulomb_nm - 1e-6).all()
    assert "NO SAFETY FUNCTION" in text


def test_a_heavier_payload_has_higher_thresholds(calibrated):
    payload = calibrated.payload
    heavier = replace(payload, model=InertialParameters(20.0 * payload.model.theta))
    light, heavy = (thresholds_of(replace(calibrated, payload=each))[0] for each in (payload, heavier))
    assert sum(heavy["friction_nm"]) > 1.5 * sum(light["friction_nm"])
    assert heavy["noise_nm"] == light["noise_nm"]


def test_noise_is_that_of_the_calibration(calibrated):
    noisier = replace(calibrated.calibration, noise_nm=2.0 * calibrated.calibration.noise_nm)
    once, twice = (
        thresholds_of(replace(calibrated, calibration=each))[0] for each in (calibrated.calibration, noisier)
    )
    np.testing.assert_allclose(twice["noise_nm"], 2.0 * np.array(once["noise_nm"]), rtol=1e-6)


def test_noise_that_differs_between_runs_is_known_less(calibrated):
    """Of few runs it is not known how much it differs."""
    arm, n = calibrated.calibration, calibrated.chain.n

    def noise(*sizes):
        runs = tuple(SimpleNamespace(residual_rms_nm=np.full(n, size)) for size in sizes)
        return thresholds_of(replace(calibrated, calibration=replace(arm, runs=runs)))[0]["noise_nm"][0]

    alike = noise(1.0, 1.0 + 1e-4, 1.0 - 1e-4)
    assert noise(1.0, 1.15, 0.85) > 1.2 * alike
    assert noise(1.0) > 1.2 * alike
    sigma = arm.known_arm.noise_nm[0] * np.sqrt(2.0 * RowMean.half_s / 0.02)
    assert alike / sigma == pytest.approx(norm.isf(0.5e-4), rel=1e-3)


def test_an_arm_that_is_not_calibrated_has_none(make_subject):
    with pytest.raises(ExportError, match="only a calibration states"):
        export_thresholds(make_subject())


def test_an_abrupt_stop_is_a_fifth_of_the_inertial_torque_at_the_acceleration_limit(calibrated):
    limits = calibrated.limits
    slower = replace(limits, acceleration_max_rad_s2=0.5 * limits.acceleration_max_rad_s2)
    once, half = (thresholds_of(replace(calibrated, limits=each))[0]["abrupt_nm"] for each in (limits, slower))
    np.testing.assert_allclose(half, 0.5 * np.array(once), rtol=1e-6)
    calibration, chain = calibrated.calibration, calibrated.chain
    still = np.zeros((1, chain.n))
    base = np.eye(chain.n)[:1]
    links, payload = calibration.body, calibrated.payload.model.theta
    torque = [
        links.link_torque(chain, still, still, ddq) + payload_torque(chain, payload, still, still, ddq)
        for ddq in (base, still)
    ]
    inertia = (torque[0] - torque[1])[0, 0] + links.rotor_mass_kg_m2[0, 0]
    assert once[0] >= 0.2 * inertia * limits.acceleration_max_rad_s2[0] - 1e-6


def test_inertia_does_not_depend_on_gravity(calibrated):
    weightless = replace(calibrated, chain=calibrated.chain.under(np.zeros(3)))
    holding, inertia = _greatest(calibrated)
    assert (holding[1:] > 0.1).all()
    nothing, same = _greatest(weightless)
    np.testing.assert_allclose(nothing, 0.0, atol=1e-9)
    np.testing.assert_allclose(inertia, same)
