"""A run of four samples of one joint, of which everything is known."""

from dataclasses import replace

import numpy as np

from armload_identification.model.joint_states import JointStates
from armload_identification.signals.motion import SCATTER, Motion


def motion(raw=0.0, noise=0.0, states=None, **changes):
    """Four samples of one joint."""
    still = JointStates(*np.zeros((3, 4, 1)))
    base = Motion(
        time_s=0.01 * np.arange(4),
        periodic=True,
        states=states or still,
        raw_nm=np.full((4, 1), raw),
        torque_nm=np.full((4, 1), 0.5 * raw),
        valid=np.ones(4, dtype=bool),
        noise_nm=np.array([noise]),
        averaged_noise_nm=np.array([0.5 * noise]),
        noise_source=SCATTER,
        smoothing_loss=np.array([0.1 * noise]),
        periods=2,
        position_fit_rad=np.zeros(1),
        began_s=0.0,
    )
    return replace(base, **changes)
