"""Derivatives of a run's torque by the unknowns of a calibration, each in the place that `Unknowns` gives it."""

from dataclasses import replace

import numpy as np
import pytest

from armload_identification.estimation.arm_terms import TILT, places_of
from armload_identification.model.joint_states import JointStates

pytestmark = pytest.mark.pure

STEP = 1e-6
INTERVAL_S = 2e-4
PARTS = {
    "rotors": "rotor_inertia_kg_m2",
    "load": "load_friction",
    "coulomb": "coulomb_nm",
    "viscous": "viscous_nm_s_rad",
    "root": "root_nm",
}


def states_at(time_s):
    """A motion of all six joints."""
    rate = np.array([1.1, 1.7, 2.3, 2.9, 3.1, 3.7])
    angle = np.outer(time_s, rate) + np.arange(6.0)
    return JointStates(0.4 * np.sin(angle), 0.4 * rate * np.cos(angle), -0.4 * rate**2 * np.sin(angle))


@pytest.fixture(scope="module")
def derivatives(calibration, pinocchio_arm):
    """The layout, the derivatives along a motion, its torque as a function of calibration and time, and its times."""
    time_s = 0.3 + INTERVAL_S * np.arange(500)
    measured = np.cos(np.outer(time_s, np.arange(1.0, 7.0)))

    def torque(arm=calibration, shift_s=0.0):
        return arm.body.torque(arm.level(pinocchio_arm.chain), *states_at(time_s + shift_s))

    found = calibration.torque_changes(calibration.level(pinocchio_arm.chain), states_at(time_s), INTERVAL_S, measured)
    of = places_of(calibration.body.base)
    assert found.shape == (of[TILT].stop, 500, 6)
    return of, found, torque, measured


@pytest.mark.parametrize("name", PARTS)
def test_rotors_and_friction(calibration, derivatives, name):
    of, found, torque, _ = derivatives
    for joint in range(6):
        value = getattr(calibration.body, PARTS[name]) + STEP * (np.arange(6) == joint)
        changed = replace(calibration, body=replace(calibration.body, **{PARTS[name]: value}))
        expected = -(torque(changed) - torque()) / STEP
        np.testing.assert_allclose(found[of[name]][joint], expected, atol=1e-6)


def test_links(calibration, derivatives):
    of, found, torque, _ = derivatives
    for number, place in enumerate(np.flatnonzero(calibration.body.base)):
        links = calibration.body.links.copy()
        links.ravel()[place] += STEP
        changed = replace(calibration, body=replace(calibration.body, links=links))
        np.testing.assert_allclose(found[of["links"]][number], -(torque(changed) - torque()) / STEP, atol=1e-6)


def test_gains_delay_and_tilt(calibration, derivatives):
    of, found, torque, measured = derivatives
    coupling = calibration.body.coupling
    for joint in range(6):
        one = (measured @ coupling) * (np.arange(6) == joint)
        np.testing.assert_allclose(found[of["log_h"]][joint], one @ np.linalg.inv(coupling), atol=1e-12)
    later = (torque(shift_s=STEP) - torque(shift_s=-STEP)) / (2.0 * STEP)
    rate = found[of["delay"]][0]
    assert np.sqrt(np.mean((rate - later)[1:-1] ** 2)) < 0.01 * np.sqrt(np.mean(later**2))
    for side in range(2):
        tilted = replace(calibration, tilt_rad=calibration.tilt_rad + STEP * (np.arange(2) == side))
        expected = -(torque(tilted) - torque()) / STEP
        assert np.abs(found[of["tilt"]][side] - expected).max() < 0.02 * np.abs(expected).max()
