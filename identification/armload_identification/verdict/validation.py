"""Judging a payload on a second trajectory that was not used for the estimate.

Conventions, so that like is compared with like. Both figures belong to the difference of two RAW torque samples,
one of a loaded and one of an unloaded run at the same place, neither averaged nor smoothed:

- noise: its standard deviation, sqrt(sigma_loaded^2 + sigma_unloaded^2), from the scatter of single samples
  between periods; with one period, from third differences, that is from the signal above the motion's band.
- residual: the RMS of that difference minus the predicted payload torque. With periods it is put together from
  the residual of the averages and the scatter that averaging took out of them.

The verdict asks for a residual of at most `LIMIT` times the noise on every joint.

References:
    Chen 2016, eq. (12).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from armload_core.arrays import FloatArray
from armload_identification.model.chain import Chain
from armload_identification.model.payload import InertialParameters
from armload_identification.model.regressor import payload_torque
from armload_identification.recording.recording import Recording, check_joints
from armload_identification.signals.joint_torque import Transmission
from armload_identification.signals.load_signal import LoadSignal, load_signal

LIMIT: Final = 2.0


@dataclass(frozen=True, eq=False)
class Validation:
    """How well a payload predicts the torque difference of two runs.

    Attributes:
        residual_rms_nm: (n,) RMS of the raw single-sample difference minus prediction.
        noise_rms_nm: (n,) noise of the raw single-sample difference.
        torque_rms_nm: (n,) RMS of the measured difference, for scale.
        ratio: (n,) residual over noise.
        limit: Greatest ratio that passes.
        passed: Every joint is within the limit.
        predicted_nm: (K, n) payload torque predicted at the samples of `signal`.
        signal: The measured difference.
    """

    residual_rms_nm: FloatArray
    noise_rms_nm: FloatArray
    torque_rms_nm: FloatArray
    ratio: FloatArray
    limit: float
    passed: bool
    predicted_nm: FloatArray
    signal: LoadSignal

    @property
    def failed_joints(self) -> tuple[int, ...]:
        """Numbers of the joints beyond the limit, from 1."""
        return tuple(int(joint) + 1 for joint in np.flatnonzero(self.ratio > self.limit))


def validate(
    loaded: Recording,
    unloaded: Recording,
    chain: Chain,
    transmission: Transmission,
    payload: InertialParameters,
) -> Validation:
    """Predict the torque difference of a pair of runs with a payload, and compare.

    Args:
        loaded: Run with the payload.
        unloaded: Run of the same trajectory without it.
        chain: The arm; the payload is in its flange frame.
        transmission: Gains and coupling.
        payload: What is to be judged.

    Returns:
        Residual beside noise per joint, and the verdict.

    Raises:
        RecordingError: the recordings do not fit the arm or each other.
    """
    for run in (loaded, unloaded):
        check_joints(run, chain.n)
    signal = load_signal(loaded, unloaded, transmission)
    return judge(signal, chain, payload)


def judge(signal: LoadSignal, chain: Chain, payload: InertialParameters) -> Validation:
    """Compare a measured torque difference with a payload's prediction.

    Args:
        signal: The measured difference.
        chain: The arm.
        payload: In the flange frame.

    Returns:
        Residual beside noise per joint, and the verdict.
    """
    predicted = payload_torque(chain, payload.theta, *signal.states)
    residual = raw_residual_rms(signal, predicted)
    noise = signal.noise_nm
    ratio = np.divide(residual, noise, out=np.full_like(residual, np.inf), where=noise > 0.0)
    ratio[(residual == 0.0) & (noise == 0.0)] = 0.0
    return Validation(
        residual_rms_nm=residual,
        noise_rms_nm=noise,
        torque_rms_nm=np.sqrt(np.mean(signal.raw_nm[signal.valid] ** 2, axis=0)),
        ratio=ratio,
        limit=LIMIT,
        passed=bool((ratio <= LIMIT).all()),
        predicted_nm=predicted,
        signal=signal,
    )


def raw_residual_rms(signal: LoadSignal, predicted_nm: FloatArray) -> FloatArray:
    """RMS of single-sample differences minus prediction, from the averages and what averaging took out.

    Args:
        signal: The measured difference.
        predicted_nm: (K, n) predicted difference.

    Returns:
        (n,) in N m.
    """
    averaged = np.mean((signal.raw_nm - predicted_nm)[signal.valid] ** 2, axis=0)
    return np.asarray(np.sqrt(averaged + signal.noise_nm**2 - signal.averaged_noise_nm**2))
