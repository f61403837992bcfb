"""A calibration: for which arm it is, and what is known of the arm with it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from armload_identification.identification_errors import ModelError
from armload_identification.model.chain import Chain
from armload_identification.signals.joint_torque import Transmission

pytestmark = pytest.mark.pure


def test_the_residual_of_a_known_arm_is_that_of_its_joints(result, pinocchio_arm, nominal):
    """A calibration holds that of axes with nominal gains; joints 5 and 6 are a differential wrist here."""
    coupling = np.eye(6)
    coupling[4:, 4:] = [[0.5, 0.5], [0.5, -0.5]]
    nominal = Transmission(nominal.gain_nm_a, coupling)
    found = replace(
        result,
        body=replace(result.body, coupling=coupling),
        noise_nm=np.array([1.0, 2.0, 0.5, 0.2, 0.3, 0.9]),
        gain_nm_a=1.2 * nominal.gain_nm_a,
    )
    known = found.known_arm(pinocchio_arm.chain)
    axes = np.random.default_rng(1).normal(size=(100_000, 6))
    for axis_nm, joint_nm in (
        (found.noise_nm, known.noise_nm),
        (found.level_nm, known.level_nm),
    ):
        torque = found.transmission(nominal).joint_torque(axes * axis_nm / nominal.gain_nm_a)
        np.testing.assert_allclose(joint_nm, np.sqrt(np.mean(torque**2, axis=0)), rtol=0.01)


def test_another_arm_is_refused(result, pinocchio_arm):
    chain = pinocchio_arm.chain
    result.require_arm(chain, pinocchio_arm.transmission.coupling)
    hung = Chain(chain.placement, chain.axis, chain.flange, -chain.gravity_m_s2)
    with pytest.raises(ModelError, match="mounted differently"):
        result.require_arm(hung, pinocchio_arm.transmission.coupling)
    with pytest.raises(ModelError, match="different motor coupling"):
        result.require_arm(chain, np.eye(6))
