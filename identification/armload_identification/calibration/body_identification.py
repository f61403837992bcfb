"""Identify an arm's own body and friction from runs without a payload, and judge it on a run that was not used.

recordings -> motion and torque of each -> base parameters, rotors and friction -> prediction error
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from threadpoolctl import threadpool_limits

from armload_core.arrays import FloatArray
from armload_identification.estimation.body_fit import fit_body
from armload_identification.identification_errors import EstimationError, ModelError
from armload_identification.model.body_model import BodyModel
from armload_identification.model.chain import Chain
from armload_identification.model.payload import Provenance
from armload_identification.recording.recording import Recording, RecordingSource, check_joints, hashes_by_name
from armload_identification.signals.joint_torque import Transmission
from armload_identification.signals.motion import motion_of
from armload_identification.verdict.sanity import check_run


@dataclass(frozen=True, eq=False)
class BodyResult:
    """What an identification says of an arm's body: the content of a body file.

    Attributes:
        model: The body.
        gain_nm_a: (n,) gains that the torques were made with; the body belongs to them. Ones where torque was
            recorded.
        residual_rms_nm: (n,) RMS of averaged torque minus prediction over the runs that were used.
        torque_rms_nm: (n,) RMS of the torque, for scale.
        noise_nm: (n,) noise of that averaged torque.
        provenance: What it was made from.
    """

    model: BodyModel
    gain_nm_a: FloatArray
    residual_rms_nm: FloatArray
    torque_rms_nm: FloatArray
    noise_nm: FloatArray
    provenance: Provenance


@dataclass(frozen=True, eq=False)
class BodyIdentification:
    """A body identified from recordings.

    Attributes:
        model: The body.
        base_parameters: How many parameters of links and rotors are identifiable with the kinematics.
        determined: How many of these the runs determine to a tenth of the prior's standard deviation.
        residual_rms_nm: (n,) RMS of averaged torque minus prediction over the runs that were used.
        torque_rms_nm: (n,) RMS of the torque, for scale.
        noise_nm: (n,) noise of that averaged torque.
        gain_nm_a: (n,) gains that the torques were made with.
        sources: Of the recordings.
    """

    model: BodyModel
    base_parameters: int
    determined: int
    residual_rms_nm: FloatArray
    torque_rms_nm: FloatArray
    noise_nm: FloatArray
    gain_nm_a: FloatArray
    sources: tuple[RecordingSource, ...]

    def result(self, armload_version: str, configuration_sha256: str) -> BodyResult:
        """The content of a body file.

        Args:
            armload_version: Version of the program.
            configuration_sha256: Hash of the robot's configuration.
        """
        hashes = hashes_by_name(self.sources)
        return BodyResult(
            self.model,
            self.gain_nm_a,
            self.residual_rms_nm,
            self.torque_rms_nm,
            self.noise_nm,
            Provenance(armload_version, configuration_sha256, hashes),
        )


@dataclass(frozen=True, eq=False)
class BodyCheck:
    """How well a body predicts a run.

    Attributes:
        error_rms_nm: (n,) RMS of averaged torque minus prediction.
        torque_rms_nm: (n,) RMS of the torque, for scale.
        noise_nm: (n,) noise of that averaged torque.
    """

    error_rms_nm: FloatArray
    torque_rms_nm: FloatArray
    noise_nm: FloatArray


def identify_body(
    recordings: Sequence[Recording], chain: Chain, transmission: Transmission, *, stribeck: bool = False
) -> BodyIdentification:
    """Identify the body of an arm.

    Args:
        recordings: Runs of the empty arm, on one or more trajectories.
        chain: The arm.
        transmission: Gains and coupling.
        stribeck: Whether friction near standstill has a column of its own.

    Returns:
        The body, and how it fits the runs.

    Raises:
        EstimationError: no recording, or one that was made with a payload.
        RecordingError: a recording that does not fit the arm or cannot be right.

    References:
        Chen 2016, eqs. (1), (3).
    """
    if not recordings:
        raise EstimationError("no recording was given. Record the empty arm along an excitation.")
    motions = []
    for run in recordings:
        _require_usable(run, chain, transmission)
        motions.append(motion_of(run, transmission))
    with threadpool_limits(1):  # threads would wait for each other: see `identification.identify`
        fit = fit_body(motions, chain, transmission.coupling, stribeck=stribeck)
    gains = np.ones(chain.n) if recordings[0].torque_nm is not None else transmission.gain_nm_a
    return BodyIdentification(
        model=fit.model,
        base_parameters=fit.base_parameters,
        determined=fit.determined,
        residual_rms_nm=fit.residual_rms_nm,
        torque_rms_nm=fit.torque_rms_nm,
        noise_nm=np.sqrt(np.mean([motion.averaged_noise_nm**2 for motion in motions], axis=0)),
        gain_nm_a=gains,
        sources=tuple(run.source for run in recordings),
    )


def check_body(body: BodyModel, recording: Recording, chain: Chain, transmission: Transmission) -> BodyCheck:
    """Predict a run that was not used.

    Args:
        body: The body.
        recording: A run of the empty arm.
        chain: The arm.
        transmission: Gains and coupling, the same as the body was identified with.

    Returns:
        Prediction error beside torque and noise, per joint.

    Raises:
        EstimationError: a run with a payload.
        RecordingError: a recording that does not fit the arm or cannot be right.
    """
    _require_usable(recording, chain, transmission)
    motion = motion_of(recording, transmission).with_delay(body.torque_delay_s)
    predicted = body.torque(chain, *motion.states)
    error = (motion.torque_nm - predicted)[motion.valid]
    return BodyCheck(
        error_rms_nm=np.sqrt(np.mean(error**2, axis=0)),
        torque_rms_nm=np.sqrt(np.mean(motion.torque_nm[motion.valid] ** 2, axis=0)),
        noise_nm=motion.averaged_noise_nm,
    )


def require_same_gains(body_gain_nm_a: FloatArray, loaded: Recording, transmission: Transmission) -> None:
    """Refuse a body that was identified with other gains than those in use.

    Args:
        body_gain_nm_a: (n,) gains of the body.
        loaded: The run that the body is to be taken from.
        transmission: Gains in use.

    Raises:
        ModelError: naming the joint.
    """
    gains = np.ones(transmission.gain_nm_a.size) if loaded.torque_nm is not None else transmission.gain_nm_a
    if body_gain_nm_a.shape != gains.shape:
        raise ModelError(
            f"the body has {body_gain_nm_a.size} joints, the robot {gains.size}. Give the robot's own body."
        )
    off = np.abs(body_gain_nm_a / gains - 1.0)
    worst = int(np.argmax(off))
    if off[worst] > 1e-9:
        raise ModelError(
            f"the body was identified with a gain of {body_gain_nm_a[worst]:g} N m/A on joint {worst + 1}, in use is "
            f"{gains[worst]:g} N m/A. Identify the body again with the gains in use, or give its gains file."
        )


def _require_usable(run: Recording, chain: Chain, transmission: Transmission) -> None:
    check_joints(run, chain.n)
    if run.source.run().get("load") == "loaded":
        raise EstimationError(
            f"{run.source.path} was recorded with a payload. The body is identified from runs of the empty arm."
        )
    check_run(run, transmission)
