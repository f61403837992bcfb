"""A run that adapts: what the operator is asked, and what it needs."""

from __future__ import annotations

import numpy as np
import pytest

from armload_controller.analysis.arm_in_use import ArmInUse
from armload_controller.config.robot import load_robot
from armload_controller.control_errors import CommissioningError
from armload_controller.feedforward.adaptation_rules import DeclaredMass
from armload_controller.session.adapted_run import greatest_body, required_calibration

ROBOT = load_robot("er50")
DECLARED = DeclaredMass(0.0, 3.0, ROBOT.payloads.rated_kg)


def test_without_a_calibration_nothing_is_run():
    with pytest.raises(CommissioningError, match="give that file as --calibration"):
        required_calibration(ArmInUse(ROBOT.chain, ROBOT.transmission))


def test_the_offset_is_tried_for_what_was_declared():
    body = greatest_body(ROBOT, DECLARED)
    assert body.mass_kg == pytest.approx(3.0)
    np.testing.assert_allclose(body.center_of_mass_m, ROBOT.payloads.heaviest.center_of_mass_m)
