"""Constants of the recursive estimator for a calibrated arm, for the kernel and for exported C."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from armload_core import kernels
from armload_identification.calibration.calibration_result import ArmCalibration
from armload_identification.estimation.empty_arm.known_arm_rows import MOVING, payload_scale
from armload_identification.float_array import FloatArray
from armload_identification.model.chain import Chain
from armload_identification.model.dynamics import ArmDynamics
from armload_identification.recording.reading_options import Effort
from armload_identification.signals.joint_torque import Transmission
from armload_identification.signals.signal_constants import RowMean

FLOOR_KG: Final = 0.010
FLOOR_SHARE: Final = 0.001
"""Least standard deviation of a mass on a calibrated arm, absolute and relative: servo sag, encoder errors."""
ROW_S: Final = 0.05
"""Time between rows of the estimator."""
_WINDOW_S: Final = 0.24
"""Window of a row, as in the kernel."""
_WHITE_S: Final = 1.4 * RowMean.half_s
"""Integrated autocorrelation of white noise in the calibration's rows."""


class EstimatorConstants(NamedTuple):
    """Constants of an arm of n joints, in the order of the kernel's arguments after the chain.

    Attributes:
        links: (n, 10) in the turned joint frames.
        from_effort: (n, n) joint torque of one unit of effort of each drive, by rows.
        rotors: (n, n) the rotors' part of the mass matrix, kg m2.
        parameter: (ESTIMATOR_PARAMETERS, n) friction, gate, noise of a row as if rows were independent, its
            correlation in rows, and drift.
        scale: (10,) prior standard deviations of the payload's parameters.
        memory_s: Time after which the weight of data has decreased to 37 %.
        delay_s: Delay of the reported torque relative to the position.
    """

    links: FloatArray
    from_effort: FloatArray
    rotors: FloatArray
    parameter: FloatArray
    scale: FloatArray
    memory_s: float
    delay_s: float


def estimator_constants(
    calibration: ArmCalibration, chain: Chain, transmission: Transmission, memory_s: float = 60.0
) -> EstimatorConstants:
    """The constants of a calibrated arm.

    Args:
        chain: The configured arm.
        transmission: Nominal gains, and coupling.
        memory_s: Time after which the weight of data has decreased to 37 %.

    Raises:
        ModelError: the calibration belongs to another arm.
    """
    calibration.require_arm(chain, transmission.coupling)
    arm, n, body = calibration.known_arm, chain.n, calibration.body
    used = calibration.transmission(transmission)
    from_effort = used.of_effort(np.eye(n), from_torque=calibration.effort is Effort.TORQUE)
    colour = np.maximum(arm.correlation_s / ROW_S, 1.0)
    # The part of the residual that is white noise is larger in a shorter window than in the calibration's rows.
    white = _WHITE_S / np.maximum(arm.correlation_s, _WHITE_S)
    larger = 1.0 + (2.0 * RowMean.half_s / _WINDOW_S - 1.0) * white
    rows = {
        kernels.ESTIMATOR_COULOMB: body.coulomb_nm,
        kernels.ESTIMATOR_VISCOUS: body.viscous_nm_s_rad,
        kernels.ESTIMATOR_ROOT: body.root_nm,
        kernels.ESTIMATOR_LOAD: body.load_friction,
        kernels.ESTIMATOR_REVERSAL: body.reversal_speed_rad_s,
        kernels.ESTIMATOR_GATE: MOVING * body.reversal_speed_rad_s,
        kernels.ESTIMATOR_NOISE: arm.noise_nm * np.sqrt(colour),
        kernels.ESTIMATOR_COLOUR: np.maximum(colour / larger, 1.0),
        kernels.ESTIMATOR_COULOMB_SPREAD: arm.friction_spread[0],
        kernels.ESTIMATOR_VISCOUS_SPREAD: arm.friction_spread[1],
        kernels.ESTIMATOR_OFFSET_SPREAD: arm.friction_spread[2],
    }
    return EstimatorConstants(
        links=ArmDynamics(calibration.level(chain), body).turned_links,
        from_effort=np.ascontiguousarray(from_effort),
        rotors=np.ascontiguousarray(body.rotor_mass_kg_m2),
        parameter=np.stack([rows[row] for row in range(kernels.ESTIMATOR_PARAMETERS)]),
        scale=payload_scale(calibration.level_nm),
        memory_s=memory_s,
        delay_s=body.torque_delay_s,
    )
