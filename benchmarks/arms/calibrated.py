"""An arm calibrated from recordings, and payloads identified with it, as `armload calibrate` and `identify` do."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from armload_identification.calibration.calibrate_arm import calibrate_arm
from armload_identification.calibration.calibration_result import ArmCalibration
from armload_identification.calibration.mounted_runs import ArmRuns, MountedRun, WeighedPayload
from armload_identification.calibration.session_gains import ConfiguredArm, SessionGains
from armload_identification.model.chain import Chain
from armload_identification.model.payload import Provenance
from armload_identification.pipeline.identification_result import Identification
from armload_identification.pipeline.payload_identification import identify_runs
from armload_identification.recording.recording import Recording
from armload_identification.signals.joint_torque import Transmission


def calibrated(
    runs: Sequence[MountedRun], weighed: Mapping[str, WeighedPayload], chain: Chain, transmission: Transmission
) -> ArmCalibration:
    """The arm from its runs.

    Args:
        runs: All its runs.
        weighed: Known payloads by mounting.
        chain: The arm.
        transmission: Nominal gains, and coupling.
    """
    made = Provenance("benchmark", "0" * 64, {})
    return calibrate_arm(ArmRuns(tuple(runs), weighed), chain, transmission, robot="benchmark", made=made)


def calibrated_from_pair(
    loaded: Recording, unloaded: Recording, payload: WeighedPayload, chain: Chain, transmission: Transmission
) -> ArmCalibration:
    """The arm from two runs of one motion, with and without a weighed payload."""
    runs = [MountedRun(loaded, "weighed"), MountedRun(unloaded, "")]
    return calibrated(runs, {"weighed": payload}, chain, transmission)


def identified_with(
    calibration: ArmCalibration | None,
    loaded: Recording,
    unloaded: Recording | None,
    chain: Chain,
    transmission: Transmission,
    *,
    drifts: bool = False,
) -> Identification:
    """A payload identified with a calibrated arm, or with nominal gains without a calibration.

    Args:
        calibration: The arm; None if it is not calibrated.
        loaded: Run with the payload.
        unloaded: Run without it, if there is one.
        chain: The arm.
        transmission: Nominal gains, and coupling.
        drifts: Whether the gains may have drifted since the calibration.

    Raises:
        IdentificationError: the recordings were refused.
    """
    if calibration is None:
        return identify_runs(loaded, unloaded, chain, transmission)
    level, gains, arm = calibration.level(chain), calibration.transmission(transmission), calibration.known_arm
    if drifts:
        session = SessionGains.assumed(calibration)
        run = loaded if unloaded is None else unloaded
        configured = ConfiguredArm(calibration, chain, transmission)
        arm = session.within(run, configured, loaded=unloaded is None).arm(arm)
    return identify_runs(loaded, unloaded, level, gains, arm=arm)
