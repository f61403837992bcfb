"""The empty arm's body, from a simulated arm with servos, friction and ripple."""

import numpy as np
import pytest

from armload_controller.config.robot import load_robot
from armload_identification.estimation.empty_arm.unloaded_arm import fit_body
from armload_identification.signals.recorded_run import Run
from benchmarks.arms.setups import Twin, shipped_motion, twin_spec
from benchmarks.arms.simulated_recordings import DriveScales, record
from benchmarks.arms.steady_state import steady_period


@pytest.mark.parametrize("name", ["prbt", pytest.param("er50", marks=pytest.mark.long)])
def test_neither_reversals_nor_ripple_are_taken_for_a_delay_or_for_rotors(name, tmp_path):
    """prbt's servos need 0.1 s to settle after a reversal, er50's motors have ripple; both report torque 1 ms late.

    prbt reports one torque in 10 ms, which makes its rotors seem lighter by a quarter; a period of 5 s leaves half a
    millisecond of the delay and a tenth of the load friction open.
    """
    robot = load_robot(name)
    motion, plant = shipped_motion(robot), twin_spec(robot, Twin.NORMATIVE, None)
    period = steady_period(plant, motion.streaming, motion.trajectory, tmp_path)
    scales = DriveScales.of(motion.streaming.arm, robot.limits.torque_noise_nm, robot.n)
    run = record(period, scales, 1, np.random.default_rng(7), np.zeros(robot.n), noise_scale=0.01)
    transmission = robot.drives.transmission
    fit = fit_body([Run.of(run, transmission).motion], robot.chain, transmission.coupling)
    true = [(joint.reflected_rotor_inertia_kg_m2, joint.load_friction) for joint in plant.joints[1:3]]
    assert fit.model.torque_delay_s == pytest.approx(1e-3, abs=6e-4)
    np.testing.assert_allclose(fit.model.rotor_inertia_kg_m2[1:3], [rotor for rotor, _ in true], rtol=0.3)
    np.testing.assert_allclose(fit.model.load_friction[1:3], [load for _, load in true], rtol=0.1)
