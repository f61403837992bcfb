"""Expected uncertainty of a payload's mass from a planned motion of a calibrated arm.

    P = 2 C + S C_arm S^T + (10 g)^2 + (0.1 %)^2

with C from the calibration's noise, of which rows within its correlation time count as one, and S the sensitivity of
the payload to gains and body: the covariance that `any_motion` computes from a recording if its residual equals the
calibration's and no gain has drifted.
"""

from __future__ import annotations

import numpy as np

from armload_identification.calibration.calibration_result import ArmCalibration
from armload_identification.estimation.empty_arm.known_arm_rows import KnownArmRows
from armload_identification.estimation.payload_intervals import NORMAL_HALF_WIDTH
from armload_identification.excitation.fourier import FourierTrajectory
from armload_identification.float_array import FloatArray
from armload_identification.model.chain import Chain
from armload_identification.model.joint_states import JointStates
from armload_identification.model.payload import InertialParameters
from armload_identification.model.regressor import payload_regressor
from armload_identification.pipeline.estimator_constants import FLOOR_KG, FLOOR_SHARE, ROW_S
from armload_identification.pipeline.recursive_estimator import COLOUR


def half_widths_kg(
    chain: Chain, calibration: ArmCalibration, payload: InertialParameters, path: FourierTrajectory, periods: FloatArray
) -> FloatArray:
    """Half widths of the 95 % interval of a payload's mass on a calibrated arm.

    Args:
        chain: The arm, with the tilt of its calibration.
        payload: The expected payload.
        path: One period.
        periods: (p,) numbers of periods.

    Returns:
        (p,) in kg.
    """
    arm = calibration.known_arm
    count = max(int(path.period_s / ROW_S), 1)
    interval_s = path.period_s / count
    states = JointStates(*path.evaluate(np.arange(count) * interval_s)[:3])
    independent = np.minimum(interval_s / arm.correlation_s, 1.0)
    theta = payload.theta
    rows = KnownArmRows.of(chain, arm, states, theta, arm.noise_nm / np.sqrt(independent))
    torque = arm.body.torque(chain, *states) + payload_regressor(chain, *states) @ theta
    changes = calibration.torque_changes(chain, states, interval_s, torque)
    errors = calibration.independent_errors
    floor = FLOOR_KG**2 + (FLOOR_SHARE * payload.mass_kg) ** 2
    variance = [
        COLOUR * rows.covariance(number)[0, 0] + np.sum((errors @ rows.shifts(changes, number)[:, 0]) ** 2) + floor
        for number in periods
    ]
    return np.asarray(NORMAL_HALF_WIDTH * np.sqrt(variance))
