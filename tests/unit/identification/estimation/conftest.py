"""Columns of a payload on a simulated motion."""

from __future__ import annotations

import numpy as np
import pytest

from armload_identification.model.regressor import payload_regressor
from tests.payload_rows import SAMPLES, STEP_S


@pytest.fixture(scope="module")
def regressor(pinocchio_arm):
    state = pinocchio_arm.trajectory(period_s=SAMPLES * STEP_S).evaluate(np.arange(SAMPLES) * STEP_S)
    return payload_regressor(pinocchio_arm.chain, state.position_rad, state.velocity_rad_s, state.acceleration_rad_s2)
