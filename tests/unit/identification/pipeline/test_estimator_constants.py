"""Constants of the recursive estimator, row by row, for a calibration of chosen numbers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from armload_core import kernels
from armload_identification.estimation.empty_arm.known_arm_rows import MOVING
from armload_identification.pipeline.estimator_constants import ROW_S, estimator_constants
from armload_identification.recording.reading_options import Effort
from armload_identification.signals.signal_constants import RowMean

pytestmark = pytest.mark.pure

N = 6


@pytest.fixture
def chosen(calibration):
    return replace(
        calibration,
        correlation_s=np.array([0.01, 0.05, 0.1, 0.3, 1.0, 5.0]),
        body=replace(calibration.body, torque_delay_s=0.003, coulomb_nm=np.arange(1.0, N + 1.0)),
    )


@pytest.fixture
def constants(chosen, pinocchio_arm):
    return estimator_constants(chosen, pinocchio_arm.chain, pinocchio_arm.transmission, memory_s=30.0)


def test_friction_and_its_spread_are_the_calibrations(constants, chosen, pinocchio_arm):
    body, known = chosen.body, chosen.known_arm
    expected = {
        kernels.ESTIMATOR_COULOMB: body.coulomb_nm,
        kernels.ESTIMATOR_VISCOUS: body.viscous_nm_s_rad,
        kernels.ESTIMATOR_ROOT: body.root_nm,
        kernels.ESTIMATOR_LOAD: body.load_friction,
        kernels.ESTIMATOR_REVERSAL: body.reversal_speed_rad_s,
        kernels.ESTIMATOR_GATE: MOVING * body.reversal_speed_rad_s,
        kernels.ESTIMATOR_COULOMB_SPREAD: known.friction_spread[0],
        kernels.ESTIMATOR_VISCOUS_SPREAD: known.friction_spread[1],
        kernels.ESTIMATOR_OFFSET_SPREAD: known.friction_spread[2],
    }
    for row, values in expected.items():
        np.testing.assert_array_equal(constants.parameter[row], values)
    assert (constants.memory_s, constants.delay_s) == (30.0, 0.003)
    np.testing.assert_array_equal(constants.rotors, body.rotor_mass_kg_m2)


def test_noise_that_is_correlated_for_many_rows_counts_as_fewer(constants, chosen, pinocchio_arm):
    known = chosen.known_arm
    rows = np.maximum(known.correlation_s / ROW_S, 1.0)
    np.testing.assert_allclose(constants.parameter[kernels.ESTIMATOR_NOISE], known.noise_nm * np.sqrt(rows))
    colour = constants.parameter[kernels.ESTIMATOR_COLOUR]
    assert (colour >= 1.0).all()
    assert (colour <= rows).all()
    slow = known.correlation_s > 20.0 * RowMean.half_s
    assert slow.any()
    np.testing.assert_allclose(colour[slow], rows[slow], rtol=0.15)


def test_one_ampere_is_the_torque_that_the_calibrated_gain_makes_of_it(chosen, constants, pinocchio_arm):
    used = chosen.transmission(pinocchio_arm.transmission)
    current = np.array([1.0, -2.0, 0.5, 3.0, -1.0, 2.0])
    np.testing.assert_allclose(current @ constants.from_effort, used.joint_torque(current[None])[0])
    torque = replace(chosen, effort=Effort.TORQUE, gain_nm_a=np.full(N, 1.1), nominal=np.ones(N))
    found = estimator_constants(torque, pinocchio_arm.chain, pinocchio_arm.transmission)
    joint_nm = np.linspace(1.0, 2.0, N)
    expected = torque.transmission(pinocchio_arm.transmission).reported_torque(joint_nm[None])[0]
    np.testing.assert_allclose(joint_nm @ found.from_effort, expected)
    assert found.memory_s == 60.0
