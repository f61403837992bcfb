"""Two periods of two seconds: a few rows of each joint, which a fit could follow without a residual."""

from dataclasses import replace

import numpy as np
import pytest

from armload_controller.config.robot import load_robot
from armload_identification.excitation.fourier import FourierTrajectory
from armload_identification.pipeline.payload_identification import identify_runs
from benchmarks.arms.setups import Motion, Twin, setup_of
from benchmarks.arms.steady_state import Streaming
from benchmarks.arms.trials import pair


@pytest.mark.long
def test_no_joint_of_a_short_motion_is_said_to_contradict_the_others():
    robot = load_robot("er50")
    swing = 0.12 * np.random.default_rng(0).choice([-1.0, 1.0], (2, 6, 2)) / np.array([1.0, 2.0])
    trajectory = FourierTrajectory(0.5, np.array([0.0, 0.3, 0.6, 0.0, 0.0, 0.0]), swing[0], swing[1])
    streaming = Streaming(replace(robot.drives.settings, cycle_s=0.02), robot.limits.motion, 1)
    payload = robot.simulation.plant_spec("paper").payload
    setup = setup_of("two periods of 2 s", robot, Twin.NORMATIVE, Motion(trajectory, streaming, 6, 2), payload)
    for seed in range(8):
        loaded, unloaded, _ = pair(setup, seed)
        found = identify_runs(loaded, unloaded, setup.chain, setup.transmission)
        error = abs(found.parameters.mass_kg - payload.mass_kg)
        assert error < 1.5 * found.uncertainty.half_width_95[0] < 0.15 * payload.mass_kg
