"""Thresholds for a robot controller's collision detection: deviations of the torque that are ordinary.

    threshold_j = t sigma_j + 1.5 (Fc_j + mu_j max|tau_j|) + 0.2 max M_jj ddq_max

sigma is the noise of torque averaged over 20 ms: the calibration's residual, a mean over a third of a second, as white
noise. The second part is friction of a joint that stops, starts or reverses, under the greatest torque of links and
payload in any position within the joints' limits. t is exceeded by 0.01 % of a variable of Student with 2 / V degrees
of freedom, V being the relative variance of the runs' residual variances: the noise of the next run is only known as
well as runs are alike. The third part is for abrupt stops, in which acceleration and torque are not simultaneous, and
for vibration in fast motion: the share of the inertial torque that `contact_levels.JERK` states, at the configured
acceleration limit.

A UR10e, empty and with 2.8 kg, calibrated with half of its runs of February: of 15,000 means of the other half and of
another day, 3 at most exceed it on a joint (0.02 %), all in abrupt stops at the end of two runs, by at most 24 %.
Without the third part, 1 to 2 % do on joint 1.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from scipy.stats import t as student

from armload_controller.control_errors import ExportError
from armload_controller.export.exported_payload import ExportSubject
from armload_controller.export.template import written
from armload_controller.export.text_format import ascii_line, bracketed, provenance
from armload_identification.calibration.calibration_result import ArmCalibration
from armload_identification.contact.contact_levels import JERK, STOPPING
from armload_identification.float_array import FloatArray
from armload_identification.model.regressor import payload_torque
from armload_identification.signals.signal_constants import RowMean

_BEYOND: Final = 1e-4
_FEW_RUNS: Final = 0.2
"""V where there are fewer than three runs; 0.11 and 0.13 on the UR10e."""
_SAMPLE_S: Final = 0.02
_POSITIONS: Final = 1000
_SEED: Final = 1


def export_thresholds(subject: ExportSubject) -> dict[str, str]:
    """A TOML file with a threshold per joint.

    Raises:
        ExportError: the arm is not calibrated.
    """
    calibration = subject.calibration
    if calibration is None:
        raise ExportError(
            subject.payload_file,
            "thresholds follow from the noise and friction of the arm, which only a calibration states. Give "
            "--calibration FILE of `armload calibrate`",
        )
    body = calibration.body
    noise_nm = _sigmas(calibration) * calibration.known_arm.noise_nm * np.sqrt(2.0 * RowMean.half_s / _SAMPLE_S)
    holding_nm, inertia_kg_m2 = _greatest(subject)
    friction_nm = STOPPING * (body.coulomb_nm + body.load_friction * holding_nm)
    abrupt_nm = JERK * inertia_kg_m2 * subject.limits.acceleration_max_rad_s2
    fields = {
        "provenance": provenance(subject),
        "joints": ", ".join(f'"{ascii_line(name)}"' for name in subject.joint_names),
        "threshold_nm": bracketed(noise_nm + friction_nm + abrupt_nm),
        "noise_nm": bracketed(noise_nm),
        "friction_nm": bracketed(friction_nm),
        "abrupt_nm": bracketed(abrupt_nm),
    }
    return {f"{subject.identifier}_thresholds.toml": written("thresholds.toml", "#", fields)}


def _sigmas(calibration: ArmCalibration) -> float:
    """The quantile t."""
    power = np.array([run.residual_rms_nm for run in calibration.runs]) ** 2
    scatter = _FEW_RUNS if len(power) < 3 else float(np.mean(power.var(axis=0, ddof=1) / power.mean(axis=0) ** 2))
    return float(student.ppf(1.0 - 0.5 * _BEYOND, 2.0 / scatter))


def _greatest(subject: ExportSubject) -> tuple[FloatArray, FloatArray]:
    """(n,) greatest static torque of links and payload within the joints' limits, and (n,) greatest inertia."""
    calibration, limits = subject.calibration, subject.limits
    rng = np.random.default_rng(_SEED)
    low, high = np.maximum(limits.position_min_rad, -np.pi), np.minimum(limits.position_max_rad, np.pi)
    q = rng.uniform(low, high, (_POSITIONS, low.size))
    still = np.zeros_like(q)

    def torque_nm(ddq: FloatArray) -> FloatArray:
        links = still if calibration is None else calibration.body.link_torque(subject.chain, q, still, ddq)
        return np.asarray(links + payload_torque(subject.chain, subject.payload.model.theta, q, still, ddq))

    holding = torque_nm(still)
    unit = np.eye(low.size)
    inertia = [np.max((torque_nm(np.tile(each, (_POSITIONS, 1))) - holding) @ each) for each in unit]
    rotors = 0.0 if calibration is None else np.diag(calibration.body.rotor_mass_kg_m2)
    return np.abs(holding).max(axis=0), np.array(inertia) + rotors
