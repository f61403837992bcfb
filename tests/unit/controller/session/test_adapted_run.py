"""A run with adaptation: its questions to the operator, and its requirements."""

from __future__ import annotations

import numpy as np
import pytest

from armload_controller.config.robot import load_robot
from armload_controller.feedforward.adaptation_rules import DeclaredMass
from armload_controller.session.adapted_run import greatest_body

ROBOT = load_robot("er50")
DECLARED = DeclaredMass(0.0, 3.0, ROBOT.rated_payload_kg)


def test_the_offset_is_tried_for_what_was_declared():
    body = greatest_body(ROBOT, DECLARED)
    assert body.mass_kg == pytest.approx(3.0)
    np.testing.assert_allclose(body.center_of_mass_m, ROBOT.payloads.heaviest.center_of_mass_m)
