"""Joints that disagree with a payload: the measured torque of each joint as a multiple of the predicted one.

    tau_j = a_j tau_payload,j + F_j s + v_j dq + f_j,        s the direction of motion,

joint by joint, so that no joint's error affects another and changes of friction are not mistaken for a scale. Intervals
come from the residual's local spectrum. A wrong mass gives the same a on every joint, a wrong drive gain a different a
on one joint.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armload_identification.estimation.payload_intervals import NORMAL_HALF_WIDTH, student_half_width
from armload_identification.estimation.residual_spectrum import ResidualSpectrum
from armload_identification.float_array import FloatArray
from armload_identification.model.smooth_sign import smooth_sign
from armload_identification.signals.load_signal import LoadSignal
from armload_identification.signals.reversals import reversal_speed
from armload_identification.verdict.decision_levels import FalseAlarms, JointScaleLevels


@dataclass(frozen=True, eq=False, slots=True)
class JointScales:
    """Ratio of measured to predicted payload torque of n joints.

    Attributes:
        scale: (n,) a; 1 if the joint agrees, nan if the payload does not load it.
        half_width_95: (n,) half width of its 95 % interval; inf if the payload does not load the joint.
    """

    scale: FloatArray
    half_width_95: FloatArray

    @property
    def determined(self) -> NDArray[np.bool_]:
        """(n,) True for joints whose scale is known within 5 %."""
        return np.asarray(self.half_width_95 <= JointScaleLevels.determined_within)

    @property
    def disagree(self) -> NDArray[np.bool_]:
        """(n,) True for joints that deviate by more than 1 % and by more than any of n sound joints does by chance."""
        by_chance = FalseAlarms.deviations(self.scale.size) / NORMAL_HALF_WIDTH * self.half_width_95
        off = np.abs(self.scale - 1.0) > np.maximum(by_chance, JointScaleLevels.matters)
        return np.asarray(self.determined & off)


def joint_scales(signal: LoadSignal, predicted_nm: FloatArray, friction_nm: FloatArray) -> JointScales:
    """The scale of every joint, by the payload's (K, n) torque and the friction that it adds, (K, n), in N m."""
    n = predicted_nm.shape[1]
    weight = signal.loaded.reversal_weight * signal.valid[:, None]
    velocity = signal.loaded.states.velocity_rad_s
    direction = smooth_sign(velocity, reversal_speed(velocity))
    columns = np.stack([predicted_nm, direction, velocity, np.ones_like(velocity)], axis=2) * weight[:, :, None]
    target = (signal.torque_nm - friction_nm) * weight
    scale, half_width = np.full(n, np.nan), np.full(n, np.inf)
    for joint in range(n):
        rows, wanted = columns[:, joint], target[:, joint]
        length = np.linalg.norm(rows, axis=0)
        moved = length > JointScaleLevels.rank * max(length.max(), 1.0)
        if not moved[0]:
            continue
        rows = rows[:, moved] / length[moved]
        left, size, right = np.linalg.svd(rows, full_matrices=False)
        # At rest, the payload's torque cannot be separated from an offset.
        if size[-1] < JointScaleLevels.rank * size[0]:
            continue
        half = right.T / size
        coefficient = half @ (left.T @ wanted)
        residual = wanted - rows @ coefficient
        spectrum = ResidualSpectrum((rows @ half)[:, None, :], residual[:, None], weight[:, joint, None])
        contrast = half[:1] / length[0]
        scale[joint] = coefficient[0] / length[0]
        deviation = np.sqrt(spectrum.variance(contrast)[0])
        half_width[joint] = student_half_width(spectrum.freedom(contrast))[0] * deviation
    return JointScales(scale, half_width)
